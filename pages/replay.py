"""An agent in its environment, with the rules as a shield and without, on one seed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import SarlError
from sarl_core.explaining.replay import named_description
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import UNFILTERED
from sarl_core.rollouts.player import shield_for
from sarl_core.shielding.shield import Shield
from sarl_dashboard.components.settings import (
    environment_choice,
    no_boxes_notice,
    notes_notice,
    offered_rule_sets,
    outside_choice,
    projection_choice,
)
from sarl_dashboard.jobs.replays import (
    Order,
    Request,
    compared,
    kept_replays,
    movie,
    refuse,
    run,
    with_progress,
)
from sarl_dashboard.state.agents import AGENTS, FRESH_SEED, PROJECTIONS, agent_for, policy_upload
from sarl_dashboard.state.compact_set import THRESHOLDS
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.environments import continuous, demonstrated, environment_of
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, NO_RULES, OWN_FILE, PAPERS
from sarl_dashboard.text import digest_of, escaped
from sarl_dashboard.views.replay.episodes import comparison
from sarl_dashboard.views.replay.steps import numbers, step_by_step

RULE_SETS = (CHOSEN, *PAPERS, COMPACT, EDITED, OWN_FILE, NO_RULES)


# --- what is asked for -------------------------------------------------------------------------


def settings() -> Callable[[], Order]:
    """The widgets; what they ask for is put together when it is needed, and may be refused."""
    with st.container(border=True):
        in_a_row = 6 if continuous(st.session_state.get("env")) else 5
        with st.grid(in_a_row, min_column_width=150, gap="small"):
            env = environment_choice()
            agent = st.selectbox(
                "Agent",
                AGENTS,
                key="agent",
                bind="query-params",
                help="Novice: random actions. Untrained: a fresh network, its actions sampled. "
                "Expert: the one that is shipped for this environment. Own file: a policy "
                "of yours.",
            )
            rules = st.selectbox(
                "Rules",
                offered_rule_sets(RULE_SETS),
                key="rules",
                bind="query-params",
                help="At the thresholds: those in the sidebar. Filtered: support 0.005, "
                "confidence 0.95. Unfiltered: support 0, confidence 1. Compact: a small set that "
                "is shipped for this environment. Edited: what you made of them on the Edit page. "
                "Own file: rules you saved. None: the agent alone.",
            )
            seed = st.number_input(
                "Seed",
                0,
                2**31 - 1,
                FRESH_SEED,
                key="seed",
                bind="query-params",
                help="Both runs start in the same state and draw the same random numbers; the "
                "same seed gives the same replay.",
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

    def order() -> Order:
        env_id = environment_of(env)
        rule_set, rules_digest = rules_for(rules, rule_file)
        if rule_set is not None:
            rule_set = shield_for(env_id, Shield(rule_set)).rule_set
        make, digest = agent_for(agent, policy_file, env_id, int(seed or 0))
        described = named_description(
            describe_environment(env_id), rule_set, chosen_demonstrations()
        )
        return Order(
            Request(
                env_id,
                agent,
                digest,
                rules,
                rules_digest,
                projection,
                int(seed or 0),
                outside,
                digest_of(repr(described).encode()),
            ),
            make,
            rule_set,
            described,
        )

    return order


def try_unfiltered() -> None:
    """Choose the unfiltered rules and run; for a callback."""
    st.session_state["rules"] = "unfiltered"
    st.session_state["_run"] = True


def unfiltered_differ(request: Request, rule_set: RuleSet | None) -> bool:
    """Whether the rules of a replay were filtered, from demonstrations that are at hand."""
    return (
        request.rules in (CHOSEN, "filtered")
        and rule_set is not None
        and rule_set.thresholds != UNFILTERED
    )


# --- the page ----------------------------------------------------------------------------------

st.title("Replay")
st.caption(
    "An agent in its environment, with the rules as a shield and without. An action that "
    "breaks a rule is replaced before it is executed. The rules are learned from "
    "demonstrations: they guarantee nothing."
)
elsewhere: Order | None = None
if (chosen := st.session_state.pop("_elsewhere", None)) is not None:
    # A step of another episode was chosen in the flight recorder: go there.
    latest = compared(st.session_state["_replay"])
    if latest is not None:
        elsewhere = latest[0].of_seed(chosen[0])
        st.session_state["seed"], st.session_state["step"] = chosen
order_now = settings()
started = st.button("Run", type="primary", icon=":material/play_arrow:", key="run")
if elsewhere is not None or started or st.session_state.pop("_run", False):
    try:
        ordered = elsewhere or order_now()
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
    st.info(
        "Choose an agent and the rules, then press Run. What rules do shows best with the novice, "
        "which acts at random, and the unfiltered rules; those at the paper's filtered thresholds "
        "may apply at few steps.",
        icon=":material/play_circle:",
    )
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
notes_notice(note for episode in replayed.film.episodes for note in episode.remarks)
no_boxes_notice([] if replayed.rule_set is None else [replayed.rule_set], asked.outside)
numbers(
    replayed,
    try_unfiltered if unfiltered_differ(asked, replayed.rule_set) else None,
)
if asked.rules not in (OWN_FILE, NO_RULES) and demonstrated(asked.env_id, asked.seed, 1):
    st.caption(
        ":material/casino: The demonstrations have an episode of this seed, where the rules know "
        f"the way. A seed such as {FRESH_SEED:,} shows what they bring elsewhere."
    )
gif = replayed.film.gif()
st.image(gif, width="content", alt="The episode, with the rules and without")
name = f"replay-{asked.env_id.rsplit('/', 1)[-1].rsplit(':', 1)[-1]}-{asked.agent}-{asked.seed}"
with st.container(horizontal=True):
    st.download_button(
        "Download GIF",
        gif,
        f"{name}.gif",
        "image/gif",
        key="gif",
        on_click="ignore",
        icon=":material/download:",
    )
    st.download_button(
        "Download MP4",
        partial(movie, replayed),
        f"{name}.mp4",
        "video/mp4",
        key="mp4",
        on_click="ignore",
        icon=":material/download:",
    )
# Which set the Rules page has to show, to show a rule of this replay.
SHOWN_AS = {CHOSEN: THRESHOLDS, COMPACT: COMPACT}
step_by_step(replayed, shown, linked=SHOWN_AS.get(asked.rules))
if chosen is not None and shown is elsewhere:
    # The slider of another episode is another widget, and a new one takes its step from the URL:
    # now that it is there, it is told again, and the row of the step with it.
    st.session_state["_step"], st.session_state["_jumped"] = chosen[1], True
    st.rerun()
comparison(shown)
