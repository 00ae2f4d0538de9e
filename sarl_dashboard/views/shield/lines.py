"""The lines of a comparison: every chosen agent with every chosen shield."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import SarlError
from sarl_core.explaining.figures.comparison import ArmStyle, arm_style
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.shield import Outside
from sarl_core.studies.comparison import Arm
from sarl_dashboard.components.settings import no_boxes_notice
from sarl_dashboard.jobs.episodes import Row
from sarl_dashboard.state.agents import (
    PROJECTIONS,
    ChosenAgent,
    agent_for,
    offered_agents,
    own_agents,
)
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMBINED,
    COMPACT,
    EDITED,
    FEWEST,
    IN_FORCE,
    NO_SHIELD,
    OWN_FILE,
    UNEDITED,
)
from sarl_dashboard.text import refuse
from sarl_dashboard.views.shield.settings import ShieldChoices

# Their places give them their colours, the paper's where it has them.
AGENT_PLACES = ("novice", "expert", "untrained", OWN_FILE)
RULES_PLACES = (
    "filtered",
    "unfiltered",
    COMPACT,
    CHOSEN,
    IN_FORCE,
    EDITED,
    COMBINED,
    FEWEST,
    UNEDITED,
)


@dataclass(frozen=True, eq=False)
class ShieldLine:
    """One agent with one shield.

    Attributes:
        row: What is run.
        arm: What it is in a comparison.
        style: How it is drawn.
        agent: Name on screen.
        shield: Name on screen.
        chosen: Makes the agent.
    """

    row: Row
    arm: Arm
    style: ArmStyle
    agent: str
    shield: str
    chosen: ChosenAgent


@dataclass(frozen=True, eq=False)
class Pilot:
    """An agent: its name, and its place among the colours."""

    name: str
    place: int
    agent: ChosenAgent


@dataclass(frozen=True, eq=False)
class Guard:
    """A shield: its name, its place among the colours, and its rules."""

    name: str
    place: int | None
    rules: RuleSet | None


def free_name(name: str, taken: Sequence[str]) -> str:
    """A name that is not taken: the same, or with a number behind it."""
    names = (name, *(f"{name} ({number})" for number in range(2, len(taken) + 2)))
    return next(each for each in names if each not in taken)


def pilots(choices: ShieldChoices, env_id: EnvironmentOrId) -> list[Pilot]:
    """The chosen agents.

    Raises:
        InputError: If one of them cannot be had.
    """
    chosen: list[Pilot] = []
    places = (*AGENT_PLACES[:-1], *own_agents(), AGENT_PLACES[-1])
    for choice in choices.agents:
        place = places.index(choice)
        if choice != OWN_FILE:
            agent = agent_for(choice, None, env_id, choices.seed)
            chosen.append(Pilot(choice, place, agent))
        for number, file in enumerate(choices.policy_files if choice == OWN_FILE else ()):
            agent = agent_for(choice, file, env_id, choices.seed)
            if any(pilot.agent.digest == agent.digest for pilot in chosen):
                continue  # a file uploaded twice is one
            name = free_name(
                file.name.rsplit(".", 1)[0], (*offered_agents(), *(pilot.name for pilot in chosen))
            )
            chosen.append(Pilot(name, place + number, agent))
    return chosen


def guards(choices: ShieldChoices) -> list[Guard]:
    """The chosen shields that can be had; why the others cannot is said."""
    chosen: list[Guard] = []
    problems: list[str] = []
    for choice in choices.shields:
        if choice == NO_SHIELD:
            chosen.append(Guard(choice, None, None))
        else:
            try:
                rules = rules_for(choice)
            except SarlError as error:
                problems.append(str(error))
            else:
                chosen.append(Guard(choice, RULES_PLACES.index(choice), rules))
    no_boxes_notice([guard.rules for guard in chosen if guard.rules is not None], choices.outside)
    for problem in problems:
        refuse(problem)
    return chosen


def line(choices: ShieldChoices, env_id: EnvironmentOrId, pilot: Pilot, guard: Guard) -> ShieldLine:
    """One agent with one shield."""
    projection = choices.projection if guard.rules is not None else PROJECTIONS[0]
    outside: Outside = choices.outside if guard.rules is not None else "act"
    name = f"{pilot.name}, {guard.name}"
    return ShieldLine(
        Row(name, env_id, choices.seed, pilot.agent, guard.rules, projection, outside),
        Arm(name, pilot.name, guard.rules, projection, outside=outside),
        arm_style(pilot.place, guard.place),
        pilot.name,
        guard.name,
        pilot.agent,
    )
