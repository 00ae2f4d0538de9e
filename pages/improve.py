"""Improve: the expert answers where the rules lead, and few rules are made of all its answers.

Where there is nobody to ask, the page shows which states need a demonstration. The work goes on
beside the page, in processes of its own.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import in_order_of
from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.improving.plan import Plan
from sarl_core.improving.refinement import generation_cost
from sarl_core.mining.budgeted_trees import MIN_RULES
from sarl_core.mining.language import counted
from sarl_core.mining.rules import Thresholds
from sarl_core.rollouts.seeds import FRESH
from sarl_dashboard.components.settings import environment_choice, notes_notice
from sarl_dashboard.jobs.improving import Order, Outcome, Working, kept_outcomes
from sarl_dashboard.state.agents import PolicyFile, agent_for, has_expert, policy_upload
from sarl_dashboard.state.data import SHIPPED_SETS, chosen_dataset, require_demonstrations
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.state.thresholds import MAX_DIVIDER, MIN_DIVIDER, chosen_thresholds
from sarl_dashboard.text import digest_of, in_full
from sarl_dashboard.views.improve.outcome import show_outcome, show_shipped

SHIPPED_EXPERT, NOBODY = "shipped", "nobody"
EVERY_LEAF, AT_THRESHOLDS = "every leaf", "at the thresholds"
MOST = 1_000  # of rules, episodes and steps; what needs more is for the command line
MOST_ROUNDS = 200
GAPS_SEEDS_A_RUN = MOST
JOB = "_job_improve"


@dataclass(frozen=True, eq=False)
class Choices:
    """What the widgets say."""

    env: str | None
    expert: str
    policy_file: PolicyFile | None
    max_rules: int
    cut: str
    rounds: int
    episodes: int
    refinement: int
    validation: int
    seed: int
    divider: int


# --- what is asked for -------------------------------------------------------------------------


def number(label: str, key: str, low: int, high: int, usual: int, hint: str) -> int:
    """A whole number."""
    value = st.number_input(label, low, high, usual, key=key, bind="query-params", help=hint)
    return int(usual if value is None else value)


def settings(demonstrations: Demonstrations) -> Choices:
    """The widgets."""
    expert = st.session_state.get("expert") or st.query_params.get("expert")
    asked = expert != NOBODY
    max_rules, cut, rounds, refinement, validation = MIN_RULES, EVERY_LEAF, 1, 0, 1
    divider, policy_file = MIN_DIVIDER, None
    with st.container(border=True):
        with st.grid(5, min_column_width=150, gap="small"):
            env = environment_choice()
            expert = st.selectbox(
                "Expert",
                (SHIPPED_EXPERT, OWN_FILE, NOBODY),
                key="expert",
                bind="query-params",
                help="Who is asked. Shipped: the expert that comes with this environment. Own "
                "file: a policy of yours. Nobody: the page shows which states need a "
                "demonstration.",
            )
            if asked:
                max_rules = number(
                    "Most rules",
                    "max_rules",
                    MIN_RULES,
                    MOST,
                    24,
                    "Of each action. Few can be read, more achieve more.",
                )
                cut = st.selectbox(
                    "Rules are",
                    (EVERY_LEAF, AT_THRESHOLDS),
                    key="cut",
                    bind="query-params",
                    help="Every leaf: in every state some rule applies. At the thresholds: only "
                    "where support and confidence reach those in the sidebar; elsewhere the agent "
                    "acts alone.",
                )
                rounds = number(
                    "Rounds",
                    "rounds",
                    1,
                    MOST_ROUNDS,
                    10,
                    "How often the rules act and the expert answers. The best round is kept.",
                )
            episodes = number(
                "Episodes a round" if asked else "Episodes",
                "round_episodes",
                1,
                MOST,
                20,
                "In each of them the rules shield a novice, which acts at random.",
            )
            if asked:
                validation = number(
                    "Episodes to choose by",
                    "validation",
                    1,
                    MOST,
                    128,
                    "All rounds are tried on a few episodes, the better half on twice as many, "
                    "and so on; the last one left on this many.",
                )
                refinement = number(
                    "Refinement steps",
                    "refine",
                    0,
                    MOST,
                    0,
                    "Afterwards the rules' numbers and actions are moved to where they achieve "
                    "more, so many times. "
                    f"Each step takes {generation_cost()} episodes. 0: not at all.",
                )
            seed = number("Seed", "improve_seed", 0, MOST, 0, "Another one gives other episodes.")
            if not demonstrations.is_discrete:
                divider = st.slider(
                    "Divider",
                    MIN_DIVIDER,
                    MAX_DIVIDER,
                    key="divider",
                    value=MIN_DIVIDER,
                    bind="query-params",
                    help="Number of equal intervals each continuous action is divided into.",
                )
        if expert == OWN_FILE:
            policy_file = policy_upload("The expert", "expert_file", env)
    return Choices(
        env,
        expert,
        policy_file,
        max_rules,
        cut,
        rounds,
        episodes,
        refinement,
        validation,
        seed,
        divider,
    )


def make_order(choices: Choices, demonstrations: Demonstrations) -> Order:
    """What the choices ask for.

    Raises:
        InputError: If it cannot be had.
    """
    env_id = environment_of(choices.env)
    demonstrations, notes = in_order_of(demonstrations, describe_environment(env_id))
    notes_notice(notes)
    if choices.expert == NOBODY:
        return gaps_order(choices, demonstrations, env_id)
    if choices.expert == OWN_FILE:
        if choices.policy_file is None:
            raise InputError("no policy has been uploaded; upload one, or choose another expert")
        make, digest = agent_for(OWN_FILE, choices.policy_file, env_id, choices.seed)
    else:
        if not has_expert(env_id):
            raise InputError(
                f"no expert is shipped for {env_id}; give a policy of your own, or choose nobody "
                "to see which states need a demonstration"
            )
        make, digest = agent_for("expert", None, env_id, choices.seed)
    thresholds = None
    if choices.cut == AT_THRESHOLDS:
        in_force = chosen_thresholds()
        thresholds = Thresholds(in_force.support, in_force.confidence)
    plan = Plan(
        choices.max_rules,
        rounds=choices.rounds,
        episodes=choices.episodes,
        thresholds=thresholds,
        divider=choices.divider,
        generations=choices.refinement,
        validation=choices.validation,
        seed=choices.seed,
    )
    key = digest_of(repr((demonstrations.digest, env_id, plan, digest)).encode())
    command = command_for(choices, demonstrations, env_id, thresholds)
    return Order(key, demonstrations, env_id, plan, make, None, command)


def gaps_order(choices: Choices, demonstrations: Demonstrations, env_id: str) -> Order:
    """Which states need a demonstration, at the thresholds in force."""
    rules = mined_rules(grown_trees(demonstrations, choices.divider))
    plan = Plan(
        MIN_RULES,
        rounds=1,
        episodes=choices.episodes,
        thresholds=rules.thresholds,
        divider=choices.divider,
        seed=FRESH + choices.seed * GAPS_SEEDS_A_RUN,
    )
    key = digest_of(repr((demonstrations.digest, env_id, plan, NOBODY)).encode())
    return Order(key, demonstrations, env_id, plan, None, rules, "")


def command_for(
    choices: Choices, demonstrations: Demonstrations, env_id: str, thresholds: Thresholds | None
) -> str:
    """The same on the command line, for the card."""
    name = chosen_dataset()
    file = f"data/demonstrations/{name}.parquet" if name in SHIPPED_SETS else upload_name()
    statistics = choices.policy_file.statistics if choices.policy_file else None
    words = ["python", "-m", "sarl_core", "aggregate", file]
    for option, value, usual in (
        ("--max-rules", choices.max_rules, None),
        ("--env", env_id, demonstrations.env_id),
        ("--expert", choices.policy_file.name if choices.policy_file else "expert", "expert"),
        ("--normalise", statistics.name if statistics else None, None),
        ("--rounds", choices.rounds, None),
        ("--episodes", choices.episodes, None),
        ("--support", thresholds and thresholds.support, None),
        ("--confidence", thresholds and thresholds.confidence, None),
        ("--divider", choices.divider, MIN_DIVIDER),
        ("--refine", choices.refinement, 0),
        ("--validation", choices.validation, None),
        ("--seed", choices.seed, 0),
    ):
        if value is not None and value != usual:
            words += [option, str(value)]
    return shlex.join([*words, "--out", "rules.json"])


def upload_name() -> str:
    """Of the file that was uploaded."""
    return str(st.session_state.get("_upload_name") or "demonstrations.parquet")


# --- the page ----------------------------------------------------------------------------------


def job() -> Working | None:
    """The run that this visitor asked for last."""
    found = st.session_state.get(JOB)
    return found if isinstance(found, Working) else None


def at_work() -> bool:
    """Whether it goes on, if only to gather what it has finished."""
    asked = job()
    return asked is not None and (asked.running or asked.stopping)


def start(order: Order) -> None:
    """Begin; for a callback."""
    st.session_state[JOB] = Working(order)


def what_it_does(order: Order) -> str:
    """Beside the button."""
    plan = order.plan
    if order.rules is not None:
        return (
            f"{counted(len(order.rules), 'rule')} at the thresholds in the sidebar, "
            f"{counted(plan.episodes, 'episode')}."
        )
    return (
        f"{counted(plan.rounds, 'round')} of {counted(plan.episodes, 'episode')}; then the best is "
        f"chosen, and reported on {plan.report} fresh episodes."
    )


def run_bar(order: Order | None, known: bool) -> None:
    """Run; or how far it is, and a way to call it off."""
    asked = job()
    if asked is not None and asked.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(asked.share, asked.text)
            st.button(
                "Cancel", icon=":material/close:", on_click=asked.cancel, key="cancel_improve"
            )
        return
    if asked is not None and asked.stopping:
        st.info(
            "Stopping: the episodes that are being played are played to their end.",
            icon=":material/hourglass_top:",
        )
        return
    if order is None:
        return
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Run" if order.rules is None else "Find the gaps",
            type="primary",
            icon=":material/play_arrow:",
            key="run_improve",
            on_click=start,
            args=(order,),
            disabled=known,
        )
        st.caption(what_it_does(order) + (" All done already." if known else ""), width="content")


st.title("Improve")
st.caption(
    "Rules protect only where the expert showed what to do. Here the rules act, the expert says "
    "what it would have done in the states they lead to, and few rules are made of all its "
    "answers. With nobody to ask, the page shows which states need a demonstration."
)
chosen = require_demonstrations()
choices = settings(chosen)
order: Order | None = None
try:
    order = make_order(choices, chosen)
except SarlError as error:
    st.error(in_full(str(error)), icon=":material/error:")
going = at_work()


@st.fragment(run_every=1.0 if going else None)
def progress_and_outcome() -> None:
    """The button or the progress, and what is known so far."""
    if going != at_work():
        st.rerun()  # as a whole: from now on every second, or no longer
    asked = job()
    kept = kept_outcomes().get(order.key) if order is not None and not going else None
    run_bar(order, isinstance(kept, Outcome))
    if not going and asked is not None and order is not None and asked.order.key == order.key:
        if asked.error is not None:
            st.error(in_full(str(asked.error)), icon=":material/error:")
        elif asked.cancelled and not isinstance(kept, Outcome):
            st.info(
                "Cancelled before there was anything to keep."
                if asked.outcome.is_empty
                else "Cancelled. What had been finished is kept below.",
                icon=":material/pause_circle:",
            )
    outcome = kept if isinstance(kept, Outcome) else asked.outcome if asked is not None else None
    if outcome is None or outcome.is_empty:
        if not going:
            show_shipped()
        return
    show_outcome(
        outcome,
        at_work=going,
        changed=not going and (order is None or outcome.order.key != order.key),
    )


progress_and_outcome()
