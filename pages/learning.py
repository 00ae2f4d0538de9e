"""Learning: agents learn under the shield, and show what they are worth without it.

The study that is shipped stands first. Studies of a visitor's own learn in a process beside the
page, which goes on while other pages are looked at, and ends when the visitor has gone.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import cast

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.learning.arms import ARMS
from sarl_core.learning.study import LearningPlan
from sarl_core.learning.study_files import LearningStudy, load_study, policy_path
from sarl_core.mining.language import counted, threshold_text
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.jobs import learning
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.data import SHIPPED_SETS, chosen_demonstrations
from sarl_dashboard.state.environments import environment_of, registered
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, RULES_FOLDER, compact_file
from sarl_dashboard.text import escaped, in_full
from sarl_dashboard.views.learning.study import archive, show_curves, show_study

SHIPPED, OWN = "The study", "Your own"
MOST_STEPS, MOST_SEEDS = 500_000, 5


# --- the shipped study -------------------------------------------------------------------------


@st.cache_resource(show_spinner="Reading the study …")
def shipped(folder: Path, stamp: int) -> LearningStudy:
    """A study that is shipped."""
    return load_study(folder)


def shipped_studies() -> dict[str, LearningStudy]:
    """Those that can be read, by the names of their folders."""
    found = {}
    for plan in sorted(learning.STUDIES.glob("*/plan.json")):
        try:
            found[plan.parent.name] = shipped(plan.parent, plan.stat().st_mtime_ns)
        except (SarlError, OSError) as error:
            st.error(in_full(str(error)), icon=":material/error:")
    return found


def title_of(study: LearningStudy) -> str:
    """Environment and rules of a study, in a few words."""
    names = {env_id: label for label, env_id in SHIPPED_SETS.values()}
    rules = study.settings.get("rules")
    by = f", {counted(int(rules['count']), 'rule')}" if isinstance(rules, dict) else ""
    return f"{names.get(study.env_id, study.env_id)}{by}"


def show_shipped() -> None:
    """The study that was made for this page."""
    studies = shipped_studies()
    if not studies:
        st.info(
            "No study is shipped. Under “Your own” you can let agents learn here.",
            icon=":material/school:",
        )
        return
    demonstrations = chosen_demonstrations()
    env_id = demonstrations.env_id if demonstrations is not None else ""
    fitting = [name for name, study in studies.items() if study.env_id == env_id]
    name = st.segmented_control(
        "Study",
        list(studies),
        default=(fitting or list(studies))[0],
        format_func=lambda each: title_of(studies[each]),
        key=f"study_{fitting[0] if fitting else 'any'}",
        required=True,
        label_visibility="collapsed",
    )
    if not fitting:
        st.caption(
            f"For {escaped(env_id or 'these demonstrations')} no study is shipped; under “Your "
            "own” you can make one."
        )
    study = studies[name]
    show_study(study, "shipped")
    with st.expander("Make it again", icon=":material/terminal:"):
        for command in commands(study):
            st.code(command, language="sh", wrap_lines=True)
        st.caption("The same versions on the same kind of machine give the same numbers.")


def commands(study: LearningStudy) -> list[str]:
    """The command lines that make a study again."""
    rules = study.settings.get("rules")
    first, file = [], ""
    if isinstance(rules, dict):
        shipped_file = shipped_rules().get(str(rules["digest"]))
        file = f" --rules {shipped_file or 'rules.json'}"
        data = {env_id: data for data, (_, env_id) in SHIPPED_SETS.items()}.get(study.env_id, "")
        if shipped_file is None:
            first = [
                f"python -m sarl_core mine data/demonstrations/{data}.parquet --support "
                f"{threshold_text(rules['support'])} --confidence "
                f"{threshold_text(rules['confidence'])} --out rules.json"
            ]
    names = ["all"] if len(study.arms) == len(ARMS) else [arm.name for arm in study.arms]
    arms = " ".join(f"--arm {name}" for name in names)
    return [
        *first,
        f"python -m sarl_core learn --env {study.env_id}{file} {arms} --steps {study.steps} "
        f"--seeds {len(study.seeds)} --figures --out learned",
    ]


@st.cache_data(show_spinner=False)
def shipped_rules() -> dict[str, str]:
    """The shipped rule files, by what tells their rules from others."""
    found = {}
    for path in sorted(RULES_FOLDER.glob("*_compact.json")):
        with suppress(SarlError):
            found[rules_digest(RuleSet.load(path))] = f"data/rules/{path.name}"
    return found


# --- a study of one's own ----------------------------------------------------------------------


def settings() -> learning.Order | None:
    """The widgets; None where what they say cannot be learned, which is then said."""
    with st.container(border=True):
        discrete = is_discrete()
        with st.grid(3 if discrete else 4, min_column_width=150, gap="small"):
            rules = st.selectbox(
                "Rules",
                [
                    name
                    for name in ("unfiltered", "filtered", CHOSEN, COMPACT, OWN_FILE)
                    if name != COMPACT or compact_file().is_file()
                ],
                key="learn_rules",
                bind="query-params",
                persist_state="session",
                help="In force while learning. Unfiltered: support 0, confidence 1. Filtered: "
                "support 0.005, confidence 0.95. At the thresholds: those in the sidebar. "
                "Compact: a small set that is shipped. Own file: rules you saved.",
            )
            steps = st.number_input(
                "Steps",
                1_000,
                MOST_STEPS,
                20_000,
                1_000,
                key="learn_steps",
                bind="query-params",
                persist_state="session",
                help="Of each learner. Lunar Lander needs 100,000 and more to show what a way to "
                "learn is worth, Cart Pole 30,000.",
            )
            seeds = st.number_input(
                "Learners of each kind",
                1,
                MOST_SEEDS,
                1,
                key="learn_seeds",
                bind="query-params",
                persist_state="session",
                help="One may have been lucky; three say more.",
            )
            projection = PROJECTIONS[0]
            if not discrete:
                projection = st.selectbox(
                    "Replace by",
                    PROJECTIONS,
                    key="projection",
                    bind="query-params",
                    help="What a continuous action that breaks a rule becomes. Centre: the middle "
                    "of the rule's interval. Clip: the nearest value in it. Expert: what the "
                    "expert typically did there.",
                )
        names = st.pills(
            "Ways to learn",
            list(ARMS),
            selection_mode="multi",
            default=["none", "override", "handover"],
            format_func=lambda name: ARMS[name].title,
            key="learn_arms",
            bind="query-params",
            persist_state="session",
        )
        with st.popover("What they do", icon=":material/help:", type="tertiary"):
            for arm in ARMS.values():
                st.markdown(f"**{arm.title}.** {arm.what}")
            st.caption(
                "PPO, DQN and SAC are the usual learners. PPO learns from what it has just done. "
                "DQN, and SAC where actions are continuous, learn from a memory of all they did."
            )
        file = (
            st.file_uploader("Rule file (.json)", key="learn_rule_file")
            if rules == OWN_FILE
            else None
        )
    try:
        env_id = registered(environment_of(None))
        rule_set, digest = rules_for(rules, file)
        chosen = tuple(arm for arm in ARMS.values() if arm.name in names)
        if not chosen:
            raise InputError("no way to learn is chosen; choose at least one above")
        plan = LearningPlan(
            env_id, rule_set, chosen, int(steps), tuple(range(int(seeds))), projection
        )
        notes_notice(plan.notes)
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        return None
    return learning.Order(env_id, rule_set, digest, chosen, int(steps), int(seeds), projection)


def is_discrete() -> bool:
    """Whether the environment takes labels; True where it cannot be used."""
    try:
        return describe_environment(environment_of(None)).is_discrete
    except SarlError:
        return True


def job() -> learning.Learning | None:
    """What this visitor asked for last."""
    return cast("learning.Learning | None", st.session_state.get("_learning"))


def start(order: learning.Order) -> None:
    """Begin, or go on; for a button."""
    st.session_state["_learning"] = learning.Learning(order)


def bar(order: learning.Order, study: LearningStudy | None) -> None:
    """The button that starts or goes on; or how far it is, and the one that stops."""
    asked = job()
    if asked is not None and asked.running:
        done = learning.steps_made(asked.order)
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(
                min(done / asked.order.steps_in_all, 1.0), progress_text(asked, done, study)
            )
            st.button("Stop", icon=":material/stop:", on_click=asked.cancel, key="learn_stop")
        if asked.order.folder != order.folder:
            st.caption("The settings have changed since; what is learning goes on as it began.")
        return
    begun = study is not None and bool(study.runs)
    complete = study is not None and study.complete
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Go on" if begun and not complete else "Start",
            type="primary",
            icon=":material/play_arrow:",
            key="learn_start",
            on_click=start,
            args=(order,),
            disabled=complete,
        )
        runs = order.seeds * len(order.arms)
        finished = len(study.finished) if study is not None else 0
        after = ", all finished." if complete else f", {finished} finished." if finished else "."
        st.caption(
            f"{counted(runs, 'run')} of {order.steps:,} steps in {escaped(order.env_id)}{after}",
            width="content",
        )
    if asked is not None and asked.order.folder == order.folder:
        if asked.error is not None:
            st.error(in_full(str(asked.error)), icon=":material/error:")
        elif asked.cancelled:
            st.info(
                "Stopped. What was learned is kept, and Go on takes it up from there, with new "
                "episodes: the numbers will be as good, but not the same as without the pause.",
                icon=":material/pause_circle:",
            )


def progress_text(asked: learning.Learning, done: int, study: LearningStudy | None) -> str:
    """How far learning is, and how long it may still take."""
    at_work = next((run for run in study.runs if not run.finished), None) if study else None
    seconds = time.monotonic() - asked.began
    made = done - asked.already
    left = ""
    if made > 0 and seconds > 10:
        minutes = seconds / made * (asked.order.steps_in_all - done) / 60
        left = (
            f", about {counted(round(minutes), 'minute')} left"
            if minutes >= 1.5
            else (", about a minute left")
        )
    who = (
        f"{at_work.arm.title}, learner {at_work.seed + 1}: {at_work.done:,} of "
        f"{asked.order.steps:,} steps"
        if at_work is not None
        else "Starting …"
        if done <= asked.already
        else "Next one …"
    )
    return who + left


def downloads(order: learning.Order, study: LearningStudy) -> None:
    """What was learned, to take away."""
    with st.container(horizontal=True, vertical_alignment="bottom"):
        run = st.selectbox(
            "What was learned",
            study.finished,
            format_func=lambda run: f"{run.arm.title}, learner {run.seed + 1}",
            key="learn_policy",
            width=320,
        )
        st.download_button(
            "Download policy (.npz)",
            lambda: policy_path(order.folder, run.arm, run.seed).read_bytes(),
            f"{order.env_id.rsplit('/', 1)[-1]}-{run.name}.npz",
            "application/octet-stream",
            key="learn_npz",
            on_click="ignore",
            icon=":material/download:",
        )
        st.download_button(
            "Download everything (.zip)",
            lambda: archive(study, order.folder),
            "learned.zip",
            "application/zip",
            key="learn_zip",
            on_click="ignore",
            icon=":material/download:",
        )
    st.caption(
        "A policy is an agent everywhere: on Replay and Shield as “own file”, on the command line "
        "as `--agent`. It is the network alone, without the rules."
    )


def show_own() -> None:
    """Settings, progress, and all that is known so far."""
    order = settings()
    if order is None:
        asked = job()
        if asked is None or not asked.running:
            return
        order = asked.order
    asked = job()
    at_work = asked is not None and asked.running

    @st.fragment(run_every=2.0 if at_work else None)
    def outcome() -> None:
        asked = job()
        if at_work != (asked is not None and asked.running):
            st.rerun()  # as a whole: from now on every two seconds, or no longer
        shown = asked.order if asked is not None and at_work else order
        try:
            study = learning.study_of(shown)
        except SarlError as error:
            st.error(in_full(str(error)), icon=":material/error:")
            study = None
        bar(order, study)
        if study is None or not study.runs:
            if not at_work:
                st.info(
                    "Choose how the agents learn, then press Start. Their curves appear here "
                    "while they learn; you can look at other pages meanwhile, and stop at any "
                    "time: what was learned is kept.",
                    icon=":material/school:",
                )
            return
        if at_work:
            show_curves(study, "own")
        elif study.finished:
            show_study(study, "own")
            downloads(shown, study)
        else:
            show_curves(study, "own")

    outcome()


# --- the page ----------------------------------------------------------------------------------

st.title("Learning")
st.caption(
    "Agents learn by trial and error while the rules shield them. Two questions: how often do they "
    "crash meanwhile, and what are they worth when the shield is taken off?"
)
view = st.segmented_control(
    "View",
    [SHIPPED, OWN],
    default=SHIPPED,
    key="learn_view",
    bind="query-params",
    persist_state="session",
    required=True,
    label_visibility="collapsed",
)
if view == SHIPPED:
    show_shipped()
else:
    show_own()
