"""An agent in its environment, with the rules as a shield and without, on one seed."""

from __future__ import annotations

import hashlib
import html
import tempfile
from collections.abc import Callable
from pathlib import Path

import _state as state
import numpy as np
import streamlit as st
from _replays import (
    ALONE,
    EPISODES,
    WITH,
    WITHOUT,
    Order,
    Replay,
    Request,
    compare,
    kept_comparisons,
    kept_replays,
    movie,
    refuse,
    run,
    with_progress,
)
from _words import escaped
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.demonstrations.environments import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.explaining.colours import INTERVENTION_COLOUR, label_colour
from sarl_core.explaining.language import label_text, share_text
from sarl_core.explaining.replay import (
    StepView,
    margin_text,
    step_texts,
    step_view,
    tracks,
)
from sarl_core.explaining.replay_figures import (
    SHIELDED_COLOUR,
    UNSHIELDED_COLOUR,
    ReturnLine,
    ReturnRow,
    comparison_figure,
    intervention_strip,
    return_figure,
)
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_files import rules_from_json
from sarl_core.mining.rules import FILTERED, UNFILTERED, RuleSet
from sarl_core.rollouts.agents import Agent, make_agent
from sarl_core.rollouts.statistics import summarise
from sarl_core.shielding.shield import Projection

# The words on screen are those in the URL.
AS_DEMONSTRATED = "as demonstrated"
ENVIRONMENTS = (AS_DEMONSTRATED, "CartPole-v1", "LunarLander-v3", "Pendulum-v1")
OWN_FILE = "own file"
AGENTS = ("novice", "untrained", "expert", OWN_FILE)
CHOSEN, NO_RULES = "at the thresholds", "none"
PAPERS = {"filtered": FILTERED, "unfiltered": UNFILTERED}
RULE_SETS = (CHOSEN, *PAPERS, OWN_FILE, NO_RULES)
PROJECTIONS: tuple[Projection, ...] = ("centre", "clip", "expert")
PLAIN = {"displayModeBar": False}

# --- what is asked for -------------------------------------------------------------------------


def settings() -> Callable[[], Order]:
    """The widgets; what they ask for is put together when it is needed, and may be refused."""
    with st.container(border=True):
        in_a_row = 5 if continuous(st.session_state.get("env")) else 4
        with st.grid(in_a_row, min_column_width=150, gap="small"):
            env = st.selectbox(
                "Environment", state.with_own(ENVIRONMENTS, "env"), key="env",
                bind="query-params",
                accept_new_options=True,
                help="That of the demonstrations, or type any id that Gymnasium knows, such as "
                     "CartPole-v1.",
            )
            agent = st.selectbox(
                "Agent", AGENTS, key="agent", bind="query-params",
                help="Novice: random actions. Untrained: a fresh network, its actions sampled. "
                     "Expert: the one that is shipped for this environment. Own file: a policy "
                     "of yours.",
            )
            rules = st.selectbox(
                "Rules", RULE_SETS, key="rules", bind="query-params",
                help="At the thresholds: those in the sidebar. Filtered: support 0.005, "
                     "confidence 0.95. Unfiltered: support 0, confidence 1. Own file: rules you "
                     "saved. None: the agent alone.",
            )
            seed = st.number_input(
                "Seed", 0, 2**31 - 1, 1, key="seed", bind="query-params",
                help="Both runs start in the same state and draw the same random numbers; the "
                     "same seed gives the same replay.",
            )
            projection = PROJECTIONS[0]
            if continuous(env):
                projection = st.selectbox(
                    "Replace by", PROJECTIONS, key="projection", bind="query-params",
                    help="What a continuous action that breaks a rule becomes. Centre: the "
                         "middle of the rule's interval. Clip: the nearest value in it. Expert: "
                         "what the expert typically did there.",
                )
        policy_file = rule_file = None
        if agent == OWN_FILE:
            policy_file = st.file_uploader(
                "Policy: .npz, or a Stable-Baselines3 .zip (PPO, A2C or DQN)", key="policy_file",
            )
        if rules == OWN_FILE:
            rule_file = st.file_uploader("Rule file (.json)", key="rule_file")

    def order() -> Order:
        env_id = environment_of(env)
        rule_set, rules_digest = rules_for(rules, rule_file)
        make, digest = agent_for(agent, policy_file, env_id, int(seed or 0))
        return Order(
            Request(env_id, agent, digest, rules, rules_digest, projection, int(seed or 0)),
            make, rule_set,
        )

    return order


def environment_of(choice: str | None) -> str:
    """The environment's id.

    Raises:
        InputError: If the demonstrations do not say theirs.
    """
    if choice and choice != AS_DEMONSTRATED:
        return choice.strip()
    demonstrations = state.chosen_demonstrations()
    if demonstrations is None or not demonstrations.env_id:
        raise InputError("the demonstrations do not say which environment they are from; choose "
                         "one, or type its id")
    return demonstrations.env_id


def continuous(choice: str | None) -> bool:
    """Whether the environment takes continuous actions; False where it cannot be used."""
    try:
        return not describe_environment(environment_of(choice)).is_discrete
    except SarlError:
        return False


def rules_for(choice: str, uploaded: UploadedFile | None) -> tuple[RuleSet | None, str]:
    """The rule set that was chosen, None for none, and what tells it from others.

    Raises:
        InputError: If it cannot be had.
    """
    if choice == NO_RULES:
        return None, ""
    if choice == OWN_FILE:
        if uploaded is None:
            raise InputError("no rule file has been uploaded; upload one, or choose other rules")
        content = uploaded.getvalue()
        return rules_from_json(content, name=uploaded.name), digest_of(content)
    demonstrations = state.chosen_demonstrations()
    if demonstrations is None:
        raise InputError("there are no demonstrations to mine rules from; upload some on the "
                         "Demonstrations page, or choose a shipped set in the sidebar")
    grown = state.trees(demonstrations, state.chosen_divider())
    rule_set = state.rule_set(grown, PAPERS.get(choice))
    return rule_set, repr((rule_set.source.digest, rule_set.thresholds, rule_set.divider))


def digest_of(content: bytes) -> str:
    """Fingerprint of a file."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def agent_for(
    choice: str, uploaded: UploadedFile | None, env_id: str, seed: int
) -> tuple[Callable[[], Agent], str]:
    """How to make the agent, and what tells it from others of its name.

    Raises:
        InputError: If there is no such agent.
    """
    if choice != OWN_FILE:
        return lambda: make_agent(choice, env_id, seed=seed), ""
    if uploaded is None:
        raise InputError("no policy has been uploaded; upload one, or choose another agent")
    content = uploaded.getvalue()

    def make() -> Agent:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / Path(uploaded.name).name
            path.write_bytes(content)
            try:
                return make_agent(path, env_id, seed=seed)
            except SarlError as error:
                # The folder is ours; the person knows the file by its name.
                raise InputError(str(error).replace(f"{folder}/", "")) from error

    return make, digest_of(content)


# --- what came of it ---------------------------------------------------------------------------


def numbers(replay: Replay) -> None:
    """Returns, lengths and interventions."""
    plain, shielded = replay.plain, replay.shielded
    alone = float(plain.returns[0])
    if shielded is None:
        with st.grid(6, min_column_width=130):
            st.metric("Return", f"{alone:,.1f}", border=True)
            st.metric("Length", f"{int(plain.lengths[0]):,} steps", border=True)
        return
    with_rules, length = float(shielded.returns[0]), int(shielded.lengths[0])
    changed, covered = int(shielded.interventions[0]), int(shielded.covered[0])
    with st.grid(6, min_column_width=140):
        st.metric("Return with rules", f"{with_rules:,.1f}", border=True, height="stretch")
        st.metric("Return without", f"{alone:,.1f}", border=True, height="stretch")
        st.metric("Length with rules", f"{length:,}", border=True, height="stretch")
        st.metric("Length without", f"{int(plain.lengths[0]):,}", border=True, height="stretch")
        st.metric("Changed", share_text(changed / length), border=True, height="stretch",
                  help=f"The rules changed the action at {changed:,} of {length:,} steps.")
        st.metric("Covered", share_text(covered / length), border=True, height="stretch",
                  help=f"Some rule applied at {covered:,} of {length:,} steps.")
    if not changed:
        st.markdown(
            ":material/info: :gray[The rules changed nothing in this episode: "
            + ("no rule applied in any of its states. Lower the minimum support or confidence on "
               "the Thresholds page, or choose the unfiltered rules.]" if not covered else
               "wherever one applied, the agent did what it says.]")
        )


def swatch(name: str, label: int) -> str:
    """A coloured square and a name, as HTML."""
    return (
        f'<span style="white-space:nowrap"><span style="display:inline-block;width:.75em;'
        f'height:.75em;border-radius:2px;margin-right:.4em;background:{label_colour(label)}">'
        f"</span>{html.escape(name)}</span>"
    )


def legend(dimensions: tuple[LabelledDimension, ...], *, marks: bool) -> None:
    """The colours of the strip."""
    many = len(dimensions) > 1
    entries = [
        swatch(f"{dimension.name} {text}" if many else text, label)
        for dimension in dimensions for label in range(min(dimension.n_labels, 24))
        for text in [label_text(label, dimension)]
    ]
    if marks:
        entries.append(
            f'<span style="white-space:nowrap"><span style="display:inline-block;width:.75em;'
            f'height:.75em;border-radius:2px;margin-right:.4em;background:{INTERVENTION_COLOUR}">'
            "</span>changed by the rules</span>"
        )
    gap = "display:flex;flex-wrap:wrap;column-gap:1.2em;font-size:.9rem"
    st.html(f'<div style="{gap}">{"".join(entries)}</div>')


def pick_step() -> None:
    """Go to the step that was clicked in the strip."""
    points = st.session_state["strip"].selection.points
    if points:
        step = points[0]["customdata"]
        st.session_state["step"] = int(step["0"] if isinstance(step, dict) else step[0])


def go_to(step: int) -> None:
    """Go to a step; for buttons."""
    st.session_state["step"] = step


@st.fragment
def step_by_step(replay: Replay, request: Request) -> None:
    """The strip, the slider, and everything about the step it stands at."""
    st.subheader("Step by step")
    steps, shielded = replay.shown.steps, replay.shielded is not None
    last = len(steps) - 1
    kept = st.session_state.get("step")
    if kept is not None and not 0 <= kept <= last:
        st.session_state["step"] = min(max(kept, 0), last)
    legend(replay.dimensions, marks=shielded)
    strip = st.container()
    if last > 0:
        current = int(st.slider(
            "Step", 0, last, key="step", bind="query-params",
            help="Move it, or click a step in the strip above.",
        ))
    else:
        current = 0
    changes = np.flatnonzero(steps.intervened)
    if shielded:
        before, after = changes[changes < current], changes[changes > current]
        with st.container(horizontal=True, vertical_alignment="center"):
            st.button("Previous change", icon=":material/skip_previous:", on_click=go_to,
                      args=(int(before[-1]) if len(before) else current,),
                      disabled=not len(before), key="previous")
            st.button("Next change", icon=":material/skip_next:", on_click=go_to,
                      args=(int(after[0]) if len(after) else current,),
                      disabled=not len(after), key="next")
            st.caption(f"{len(changes):,} of {len(steps):,} steps were changed.")
    strip.plotly_chart(
        intervention_strip(
            tracks(steps, replay.dimensions, shielded=shielded),
            step_texts(steps, replay.dimensions, replay.rule_set), current=current,
        ),
        key="strip", on_select=pick_step, selection_mode="points", config=PLAIN,
        alt="What the agent wanted, what was done, and where the two differ, step by step",
    )
    view = step_view(steps, current, replay.dimensions, replay.features, replay.rule_set)
    pictures, words = st.columns([3, 2], gap="medium")
    with pictures:
        st.image(replay.film.frame(current), width="stretch",
                 alt=f"The environment at step {current}")
        lines = [ReturnLine(WITHOUT if shielded else ALONE,
                            np.cumsum(replay.plain.steps.reward), UNSHIELDED_COLOUR)]
        if shielded:
            lines.insert(0, ReturnLine(WITH, np.cumsum(steps.reward), SHIELDED_COLOUR))
        st.plotly_chart(return_figure(lines, current=current), config=PLAIN, key="return",
                        alt="Return so far, step by step")
    with words:
        describe(view, shielded=shielded, chosen=request.rules == CHOSEN)


def describe(view: StepView, *, shielded: bool, chosen: bool) -> None:
    """One step in words."""
    for action in view.actions:
        if len(view.actions) > 1:
            st.markdown(f"**{escaped(action.dimension)}**")
        done = swatch(action.executed, action.executed_label)
        if action.changed:
            st.badge("Changed by the rules", icon=":material/edit:", color="orange")
            st.html(f"The agent wanted {swatch(action.proposed, action.proposed_label)}, "
                    f"and {done} was done.")
        elif action.rule:
            st.badge("Allowed by the rules", icon=":material/check:", color="green")
            st.html(f"The agent wanted {done}, as the rule says.")
        elif shielded:
            st.badge("No rule applies", color="gray")
            st.html(f"The agent chose {done}.")
        else:
            st.html(f"The agent chose {done}.")
        if action.rule:
            st.markdown(f"**Rule {escaped(action.rule_id)}.** {escaped(action.rule)}")
            if chosen:
                st.page_link("rules.py", label="Open this rule", icon=":material/rule:",
                             query_params={**st.query_params.to_dict(), "rule": action.rule_id})
    if shielded:
        st.caption(f"{margin_text(view.margin).capitalize()}.")
    st.dataframe(
        {"State": [name for name, _, _ in view.state],
         "Value": [value for _, value, _ in view.state],
         "Unit": [unit or "–" for _, _, unit in view.state]},
        hide_index=True, height="content" if len(view.state) <= 12 else 400,
    )


def comparison(order: Order) -> None:
    """Several episodes instead of one, on request."""
    st.subheader(f"Over {EPISODES} episodes")
    key = order.request
    runs = kept_comparisons().get(key)
    if runs is None:
        st.caption("One episode may be luck. Run more of them, each on a seed of its own.")
        if st.button(f"Run {EPISODES} episodes", key="compare",
                     icon=":material/stacked_bar_chart:"):
            runs = with_progress(lambda tell: compare(order, tell))
            if runs is not None:
                kept_comparisons().put(key, runs)
                st.rerun()
        return
    rows, table = [], []
    for name, episodes in runs:
        interval = summarise(episodes.returns)
        rows.append(ReturnRow(name, episodes.returns, interval.iqm, interval.low, interval.high,
                              SHIELDED_COLOUR if name == WITH else UNSHIELDED_COLOUR))
        steps = float(episodes.lengths.sum())
        table.append({
            "Run": name.capitalize(),
            "Mean return": f"{interval.mean:,.1f}",
            "Typical return": f"{interval.iqm:,.1f}",
            "95 % interval": f"{interval.low:,.1f} to {interval.high:,.1f}",
            "Mean length": f"{episodes.lengths.mean():,.1f}",
            "Changed": share_text(float(episodes.interventions.sum()) / steps)
            if name == WITH else "–",
        })
    st.plotly_chart(comparison_figure(rows), config=PLAIN, key="comparison",
                    alt="Returns of the episodes with the rules and without")
    st.dataframe(table, hide_index=True)
    st.caption("A point is an episode. The diamond is the typical return, the mean of the middle "
               "half of the episodes, which a few odd ones do not move, with its 95 % interval.")


# --- the page ----------------------------------------------------------------------------------

st.title("Replay")
st.caption("An agent in its environment, with the rules as a shield and without. An action that "
           "breaks a rule is replaced before it is executed. The rules are learned from "
           "demonstrations: they guarantee nothing.")
order_now = settings()
started = st.button("Run", type="primary", icon=":material/play_arrow:", key="run")
if started:
    try:
        ordered = order_now()
    except SarlError as error:
        refuse(error)
    else:
        result = kept_replays().get(ordered.request)
        if result is None:
            result = with_progress(lambda tell: run(ordered, tell))
            if result is not None:
                kept_replays().put(ordered.request, result)
        if result is not None:
            st.session_state["_replay"] = ordered
shown = st.session_state.get("_replay")
replayed = kept_replays().get(shown.request) if shown is not None else None
if shown is None or replayed is None:
    st.info("Choose an agent and the rules, then press Run. Try the novice first: it acts at "
            "random, so what the rules do is plain to see.", icon=":material/play_circle:")
    st.stop()
try:
    same = order_now().request == shown.request
except SarlError:
    same = False
asked = shown.request
st.markdown(
    f"**{escaped(replayed.plain.agent.capitalize())}** in **{escaped(asked.env_id)}**, seed "
    f"{asked.seed}"
    + (f", {len(replayed.rule_set):,} rules ({asked.rules})" if replayed.rule_set else "")
    + ("" if same else "  \n:orange[:material/info: The settings have changed since: press Run.]")
)
numbers(replayed)
gif = replayed.film.gif()
st.image(gif, width="content", alt="The episode, with the rules and without")
name = f"replay-{asked.env_id.rsplit('/', 1)[-1].rsplit(':', 1)[-1]}-{asked.agent}-{asked.seed}"
with st.container(horizontal=True):
    st.download_button("Download GIF", gif, f"{name}.gif", "image/gif", key="gif",
                       on_click="ignore", icon=":material/download:")
    st.download_button("Download MP4", lambda: movie(replayed), f"{name}.mp4", "video/mp4",
                       key="mp4", on_click="ignore", icon=":material/download:")
step_by_step(replayed, asked)
comparison(shown)
