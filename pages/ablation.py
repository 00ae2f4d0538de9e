"""Ablation: what each rule of a shield is worth, found by taking it out.

What is known of the present choices is shown at once, whoever ran it and whenever; Run adds what is
missing. The work goes on beside the page, in processes of its own.
"""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.language import counted
from sarl_core.rollouts.player import check_environment
from sarl_core.shielding.shield import Shield
from sarl_core.studies.ablation import MOST_RULES
from sarl_core.studies.ablation_run import LEAST_EPISODES
from sarl_dashboard.components.settings import (
    environment_choice,
    no_boxes_notice,
    notes_notice,
    offered_rule_sets,
    outside_choice,
    projection_choice,
)
from sarl_dashboard.jobs.ablation import Ablating, Wanted
from sarl_dashboard.jobs.episodes import row_key
from sarl_dashboard.state.agents import AGENTS, FRESH_SEED, PROJECTIONS, agent_for, policy_upload
from sarl_dashboard.state.compact_set import THRESHOLDS
from sarl_dashboard.state.environments import continuous, demonstrated, environment_of
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, PAPERS
from sarl_dashboard.text import in_full
from sarl_dashboard.views.ablation.table import show

MOST_EPISODES = 500
RULE_SETS = (CHOSEN, *PAPERS, COMPACT, EDITED, OWN_FILE)
# Which set the Rules page has to show, to show a rule of this ablation.
SHOWN_AS = {CHOSEN: THRESHOLDS, COMPACT: COMPACT}
JOB = "_job_ablation"


def settings() -> Callable[[], tuple[Wanted, str]]:
    """The widgets; what they ask for is put together when it is needed, and may be refused."""
    with st.container(border=True):
        with st.grid(4, min_column_width=150, gap="small"):
            env = environment_choice()
            agent = st.selectbox(
                "Agent",
                AGENTS,
                key="agent",
                bind="query-params",
                help="Whom the rules hold. With the novice, which acts at random, they have the "
                "most to do.",
            )
            rules = st.selectbox(
                "Rules",
                offered_rule_sets(RULE_SETS),
                key="rules",
                bind="query-params",
                help="At the thresholds: those in the sidebar. Filtered: support 0.005, "
                "confidence 0.95. Unfiltered: support 0, confidence 1. Compact: a small set that "
                "is shipped for this environment. Own file: rules you saved.",
            )
            most = st.number_input(
                "Rules to take out",
                1,
                MOST_RULES,
                25,
                key="most_rules",
                bind="query-params",
                help="At most so many: those that change the most actions.",
            )
            episodes = st.number_input(
                "Episodes",
                LEAST_EPISODES,
                MOST_EPISODES,
                50,
                key="ablation_episodes",
                bind="query-params",
                help="With every rule taken out, and with none. More of them show smaller "
                "differences.",
            )
            seed = st.number_input(
                "First seed",
                0,
                2**31 - 1 - 1_000,
                FRESH_SEED,
                key="first_seed",
                bind="query-params",
                help="The episodes start from this seed, the next one, and so on, the same with "
                "every rule taken out. The same seeds give the same result.",
            )
            projection = PROJECTIONS[0]
            if continuous(env):
                projection = projection_choice()
            outside = outside_choice()
        policy_file = rule_file = None
        if agent == OWN_FILE:
            policy_file = policy_upload("Policy", "policy_file", env)
        if rules == OWN_FILE:
            rule_file = st.file_uploader("Rule file (.json)", key="rule_file")

    def wanted() -> tuple[Wanted, str]:
        env_id, first = environment_of(env), int(seed or 0)
        describe_environment(env_id)
        rule_set, rules_digest = rules_for(rules, rule_file)
        make, agent_digest = agent_for(agent, policy_file, env_id, first)
        if rule_set is None or not any(rule.enabled for rule in rule_set.rules):
            raise InputError(
                "there is no rule that could be taken out; lower the thresholds in the sidebar, or "
                "choose other rules"
            )
        no_boxes_notice([rule_set], outside)
        notes_notice(check_environment(env_id, Shield(rule_set)).notes)
        key = row_key(env_id, agent_digest, f"{rules_digest} {outside}", projection, first)
        return (
            Wanted(
                key,
                env_id,
                first,
                int(episodes or LEAST_EPISODES),
                int(most or 1),
                make,
                lambda: Shield(rule_set, projection=projection, outside=outside),
            ),
            rules,
        )

    return wanted


def working() -> bool:
    """Whether an ablation of this visitor goes on."""
    asked: Ablating | None = st.session_state.get(JOB)
    return asked is not None and asked.running


def start(wanted: Wanted) -> None:
    """Begin the work beside the page; for a callback."""
    st.session_state[JOB] = Ablating(wanted)


def bar(wanted: Wanted) -> None:
    """The button; or how far the work is, and a way to call it off."""
    asked: Ablating | None = st.session_state.get(JOB)
    if asked is not None and asked.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(asked.share, asked.text)
            st.button(
                "Cancel", icon=":material/close:", on_click=asked.cancel, key="cancel_ablation"
            )
        return
    known = wanted.known
    finished = known is not None and len(known.rules) >= min(
        wanted.most, len(known.rules) + len(known.left_out)
    )
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Run",
            type="primary",
            icon=":material/play_arrow:",
            key="run_ablation",
            on_click=start,
            args=(wanted,),
            disabled=finished,
        )
        st.caption(
            f"{counted(wanted.episodes, 'episode')} with all rules, and again without each of the "
            f"{wanted.most} most used{'; all done already' if finished else ''}.",
            width="content",
        )
    if asked is None or asked.key != wanted.key:
        return
    if asked.error is not None:
        st.error(in_full(str(asked.error)), icon=":material/error:")
    if asked.cancelled:
        st.info(
            "Cancelled. What had been finished is kept; Run goes on from there.",
            icon=":material/pause_circle:",
        )


# --- the page ----------------------------------------------------------------------------------

st.title("Ablation")
st.caption(
    "What each rule is worth: the same episodes again, with one rule taken out. A rule without "
    "which an agent does worse carries load; one without which it does better does harm."
)
ask = settings()
try:
    chosen, rules_name = ask()
except SarlError as error:
    st.error(in_full(str(error)), icon=":material/error:")
    st.stop()
if rules_name != OWN_FILE and demonstrated(chosen.env_id, chosen.seed, chosen.episodes):
    st.warning(
        "Some of these seeds are those of the demonstrations, where the rules know the way. A "
        f"first seed such as {FRESH_SEED:,} shows what they bring elsewhere.",
        icon=":material/casino:",
    )
at_work = working()


@st.fragment(run_every=1.0 if at_work else None)
def outcome() -> None:
    """The button or the progress, and all that is known so far."""
    if at_work != working():
        st.rerun()  # as a whole: from now on every second, or no longer
    bar(chosen)
    found = chosen.known
    if found is not None:
        show(found, chosen, at_work=at_work, linked=SHOWN_AS.get(rules_name))
    elif not at_work:
        st.info(
            "Choose an agent and the rules, then press Run. Only episodes in which a rule made a "
            "difference are run without it. The work goes on while you look at other pages, and "
            "what is finished stays when you cancel.",
            icon=":material/play_circle:",
        )


outcome()
