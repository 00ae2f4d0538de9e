"""Shield: any agents with any shields on the same seeds, in one table and one picture.

What is known of the present choices is shown at once, whoever ran it and whenever; Run adds what is
missing. The work goes on beside the page, in processes of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.agents.agent import Agent
from sarl_core.environments.description import describe_environment
from sarl_core.errors import SarlError
from sarl_core.explaining.figures.comparison import arm_style
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.shield import Outside, Projection, Shield
from sarl_core.studies.comparison import Arm
from sarl_dashboard.components.run_bar import run_bar
from sarl_dashboard.components.settings import (
    environment_choice,
    no_boxes_notice,
    offered_rule_sets,
    outside_choice,
    projection_choice,
)
from sarl_dashboard.jobs.episodes import Row, known, row_key, working
from sarl_dashboard.state.agents import (
    AGENTS,
    FRESH_SEED,
    PROJECTIONS,
    PolicyFile,
    agent_for,
    policy_uploads,
)
from sarl_dashboard.state.environments import continuous, demonstrated, environment_of
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, PAPERS
from sarl_dashboard.text import in_full
from sarl_dashboard.views.shield.table import Line, show

NO_SHIELD = "no shield"
# Their places give them their colours, the paper's where it has them.
AGENT_PLACES = ("novice", "expert", "untrained", OWN_FILE)
RULES_PLACES = ("filtered", "unfiltered", COMPACT, CHOSEN, OWN_FILE, EDITED)
MOST_EPISODES = 1_000
PLACE = "comparison"


@dataclass(frozen=True, eq=False)
class Choices:
    """What the widgets say."""

    env: str | None
    episodes: int
    seed: int
    projection: Projection
    outside: Outside
    agents: list[str]
    shields: list[str]
    policy_files: list[PolicyFile]
    rule_file: UploadedFile | None


@dataclass(frozen=True, eq=False)
class Pilot:
    """An agent: its name, its place among the colours, how to make it, and what tells it."""

    name: str
    place: int
    make: Callable[[], Agent]
    digest: str


@dataclass(frozen=True, eq=False)
class Guard:
    """A shield: its name, its place among the colours, its rules, and what tells them."""

    name: str
    place: int | None
    rules: RuleSet | None
    digest: str


# --- what is asked for -------------------------------------------------------------------------


def settings() -> Choices:
    """The widgets."""
    with st.container(border=True):
        in_a_row = 5 if continuous(st.session_state.get("env")) else 4
        with st.grid(in_a_row, min_column_width=150, gap="small"):
            env = environment_choice()
            episodes = st.number_input(
                "Episodes",
                1,
                MOST_EPISODES,
                20,
                key="episodes",
                bind="query-params",
                help="So many for every agent with every shield, each on a seed of its own. The "
                "paper's figures show 100.",
            )
            seed = st.number_input(
                "First seed",
                0,
                2**31 - 1 - MOST_EPISODES,
                FRESH_SEED,
                key="first_seed",
                bind="query-params",
                help="The episodes start from this seed, the next one, and so on, the same for "
                "all agents. The same seeds give the same result.",
            )
            projection = PROJECTIONS[0]
            if continuous(env):
                projection = projection_choice()
            outside = outside_choice()
        agents = st.pills(
            "Agents",
            AGENTS,
            selection_mode="multi",
            default=["novice", "expert"],
            key="agents",
            bind="query-params",
            help="Novice: random actions. Expert: the one that is shipped for this environment. "
            "Untrained: a fresh network, its actions sampled, which is nearly the same as random. "
            "Own file: policies of yours.",
        )
        policy_files: list[PolicyFile] = []
        if OWN_FILE in agents:
            policy_files = policy_uploads("Policies", "policy_files", env)
        offered = offered_rule_sets([NO_SHIELD, *PAPERS, CHOSEN, COMPACT, EDITED, OWN_FILE])
        shields = st.pills(
            "Shields",
            offered,
            selection_mode="multi",
            default=[NO_SHIELD, *PAPERS],
            key="shields",
            bind="query-params",
            help="Filtered: support 0.005, confidence 0.95. Unfiltered: support 0, confidence 1. "
            "At the thresholds: those in the sidebar. Compact: a small set that is shipped for "
            "this environment. Edited: what you made of them on the Edit page. Own file: rules you "
            "saved.",
        )
        rule_file = None
        if OWN_FILE in shields:
            rule_file = st.file_uploader("Rule file (.json)", key="rule_file")
    return Choices(
        env,
        int(episodes or 1),
        int(seed or 0),
        projection,
        outside,
        [name for name in AGENTS if name in agents],
        [name for name in offered if name in shields],
        policy_files,
        rule_file,
    )


def free_name(name: str, taken: Sequence[str]) -> str:
    """A name that is not taken: the same, or with a number behind it."""
    names = (name, *(f"{name} ({number})" for number in range(2, len(taken) + 2)))
    return next(each for each in names if each not in taken)


def pilots(choices: Choices, env_id: str) -> list[Pilot]:
    """The chosen agents."""
    found: list[Pilot] = []
    for choice in choices.agents:
        place = AGENT_PLACES.index(choice)
        if choice != OWN_FILE:
            make, digest = agent_for(choice, None, env_id, choices.seed)
            found.append(Pilot(choice, place, make, digest))
        for number, file in enumerate(choices.policy_files if choice == OWN_FILE else ()):
            make, digest = agent_for(choice, file, env_id, choices.seed)
            if any(pilot.digest == f"own {digest}" for pilot in found):
                continue  # a file uploaded twice is one
            name = free_name(
                file.name.rsplit(".", 1)[0], (*AGENTS, *(pilot.name for pilot in found))
            )
            found.append(Pilot(name, place + number, make, f"own {digest}"))
    return found


def guards(choices: Choices) -> tuple[list[Guard], list[str]]:
    """The chosen shields that can be had, and why the others cannot."""
    found, problems = [], []
    for choice in choices.shields:
        if choice == NO_SHIELD:
            found.append(Guard(choice, None, None, ""))
        elif choice == OWN_FILE and choices.rule_file is None:
            continue  # an empty place to put a file says enough
        else:
            try:
                rules, digest = rules_for(choice, choices.rule_file)
            except SarlError as error:
                problems.append(str(error))
            else:
                found.append(Guard(choice, RULES_PLACES.index(choice), rules, digest))
    return found, problems


def line(choices: Choices, env_id: str, pilot: Pilot, guard: Guard) -> Line:
    """One agent with one shield."""
    projection = choices.projection if guard.rules is not None else PROJECTIONS[0]
    outside: Outside = choices.outside if guard.rules is not None else "act"
    name = f"{pilot.name}, {guard.name}"
    # Acting everywhere is what other pages ask for, under the same key.
    way = projection if outside == "act" else f"{projection}, {outside}"
    key = row_key(env_id, pilot.digest, guard.digest, way, choices.seed)

    def shield() -> Shield | None:
        if guard.rules is None:
            return None
        return Shield(guard.rules, projection=projection, outside=outside)

    return Line(
        Row(key, name, env_id, choices.seed, pilot.make, shield),
        Arm(name, pilot.name, guard.rules, projection, outside=outside),
        arm_style(pilot.place, guard.place),
        pilot.name,
        guard.name,
    )


# --- the page ----------------------------------------------------------------------------------

st.title("Shield")
st.caption(
    "What a shield is worth: agents with the rules and without, on the same seeds. The rules are "
    "learned from demonstrations; they guarantee nothing."
)
chosen = settings()
try:
    environment = environment_of(chosen.env)
    describe_environment(environment)
    chosen_pilots = pilots(chosen, environment)
except SarlError as error:
    st.error(in_full(str(error)), icon=":material/error:")
    st.stop()
chosen_guards, refused = guards(chosen)
no_boxes_notice([guard.rules for guard in chosen_guards if guard.rules is not None], chosen.outside)
for sentence in refused:
    st.error(in_full(sentence), icon=":material/error:")
wanted = [
    line(chosen, environment, pilot, guard) for pilot in chosen_pilots for guard in chosen_guards
]
if not wanted:
    st.info(
        "Choose at least one agent and one shield; a shield of your own needs its file.",
        icon=":material/checklist:",
    )
    st.stop()
by_rules_mined = any(name not in (NO_SHIELD, OWN_FILE) for name in chosen.shields)
if by_rules_mined and demonstrated(environment, chosen.seed, chosen.episodes):
    st.warning(
        "Some of these seeds are those of the demonstrations, where the rules know the way. A "
        f"first seed such as {FRESH_SEED:,} shows what they bring elsewhere.",
        icon=":material/casino:",
    )
at_work = working(PLACE)


@st.fragment(run_every=1.0 if at_work else None)
def outcome() -> None:
    """The button or the progress, and all that is known so far."""
    if at_work != working(PLACE):
        st.rerun()  # as a whole: from now on every second, or no longer
    rows = [each.row for each in wanted]
    run_bar(PLACE, rows, chosen.episodes)
    found = zip(wanted, known(rows, chosen.episodes), strict=True)
    show(
        [(each, episodes) for each, episodes in found if episodes is not None],
        environment,
        chosen.seed,
        at_work=at_work,
    )


outcome()
