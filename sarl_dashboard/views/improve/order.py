"""What a run depends on, and the command that does the same."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import in_order_of
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError
from sarl_core.improving.plan import Plan
from sarl_core.mining.budgeted_trees import MIN_RULES
from sarl_core.mining.combining.candidates import Pair
from sarl_core.mining.rules import Thresholds
from sarl_core.rollouts.choices import check_choice
from sarl_core.rollouts.seeds import FRESH
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.jobs.improving import ImprovementOrder
from sarl_dashboard.state import combining, formulas
from sarl_dashboard.state.agents import agent_for, has_expert, own_agents
from sarl_dashboard.state.data import (
    SHIPPED_SETS,
    chosen_dataset,
    data_parts,
    raw_demonstrations,
    uncombined_demonstrations,
    upload_name,
)
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.state.thresholds import MIN_DIVIDER, chosen_thresholds
from sarl_dashboard.views.improve.settings import AT_THRESHOLDS, MOST, NOBODY, ImproveChoices

GAPS_SEEDS_A_RUN = MOST


def order_of(choices: ImproveChoices, demonstrations: Demonstrations) -> ImprovementOrder:
    """What the choices ask for.

    Args:
        choices: What the widgets say.
        demonstrations: What the expert has shown so far.

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
        expert = agent_for(OWN_FILE, choices.policy_file, env_id, choices.seed)
    elif choices.expert in own_agents():
        expert = agent_for(choices.expert, None, env_id, choices.seed)
    else:
        if not has_expert(env_id):
            raise InputError(
                f"no expert is shipped for {env_id}; choose another one, or a policy of your "
                "own, or nobody, to see which states need a demonstration"
            )
        expert = agent_for("expert", None, env_id, choices.seed)
    thresholds = None
    if choices.cut == AT_THRESHOLDS:
        in_force = chosen_thresholds()
        if in_force.never is not None:
            raise InputError(
                "rounds are cut at thresholds of rules that demand an action, and those in force "
                "forbid one; choose rules that demand on the page Thresholds, or another cut"
            )
        thresholds = Thresholds(in_force.support, in_force.confidence)
    start, combined = uncombined_start(demonstrations, env_id)
    plan = Plan(
        choices.max_rules,
        rounds=choices.rounds,
        episodes=choices.episodes,
        thresholds=thresholds,
        divider=choices.divider,
        turns=choices.refinement,
        validation=choices.validation,
        seed=choices.seed,
        choose=choices.choose,
        combined=combined,
    )
    check_choice(plan.choose, env_id)
    command = command_for(choices, start, env_id, thresholds, combined)
    return ImprovementOrder(start, env_id, plan, expert, None, command)


def uncombined_start(
    demonstrations: Demonstrations, env_id: EnvironmentOrId
) -> tuple[Demonstrations, tuple[Pair, ...]]:
    """What is begun with: every round chooses its combinations anew, from what is known by then.

    Args:
        demonstrations: In the environment's order.
        env_id: Environment.

    Returns:
        The demonstrations without combinations, and the pairs of which there may be some.
    """
    plain = uncombined_demonstrations()
    pairs = () if plain is None else combining.pairs(plain)
    if plain is None or not pairs:
        return demonstrations, ()
    start = in_order_of(plain, describe_environment(env_id)).demonstrations
    places = {feature.name: place for place, feature in enumerate(start.features)}
    moved = [sorted(places[plain.features[place].name] for place in pair) for pair in pairs]
    return start, tuple((first, second) for first, second in sorted(moved))


def gaps_order(
    choices: ImproveChoices, demonstrations: Demonstrations, env_id: EnvironmentOrId
) -> ImprovementOrder:
    """Which states need a demonstration, at the thresholds in force."""
    trees = grown_trees(demonstrations, choices.divider)
    rules = mined_rules(trees, chosen_thresholds(), data_parts())
    if rules.forbids:
        raise InputError(
            "finding gaps understands rules that demand an action, and those at the thresholds "
            "forbid one; choose rules that demand on the page Thresholds"
        )
    plan = Plan(
        MIN_RULES,
        rounds=1,
        episodes=choices.episodes,
        thresholds=rules.thresholds,
        divider=choices.divider,
        seed=FRESH + choices.seed * GAPS_SEEDS_A_RUN,
    )
    return ImprovementOrder(demonstrations, env_id, plan, None, rules, "")


def command_for(
    choices: ImproveChoices,
    demonstrations: Demonstrations,
    env_id: EnvironmentOrId,
    thresholds: Thresholds | None,
    combined: Sequence[Pair] = (),
) -> str:
    """The same on the command line, for the card."""
    name = chosen_dataset()
    file = f"data/demonstrations/{name}.parquet" if name in SHIPPED_SETS else upload_name()
    expert = own_agents().get(choices.expert, "expert")
    if choices.policy_file is not None:
        expert = choices.policy_file.name
    statistics = choices.policy_file.statistics if choices.policy_file else None
    environment = as_environment(env_id)
    own = () if environment.key == demonstrations.env_id else environment.words
    words = ["python", "-m", "sarl_core", "aggregate", file, *own]
    for option, value, usual in (
        ("--max-rules", choices.max_rules, None),
        ("--expert", expert, "expert"),
        ("--normalise", statistics.name if statistics else None, None),
        ("--rounds", choices.rounds, None),
        ("--episodes", choices.episodes, None),
        ("--support", thresholds and thresholds.support, None),
        ("--confidence", thresholds and thresholds.confidence, None),
        ("--divider", choices.divider, MIN_DIVIDER),
        ("--refine", choices.refinement, 0),
        ("--validation", choices.validation, None),
        ("--choose", choices.choose, "return"),
        ("--seed", choices.seed, 0),
    ):
        if value is not None and value != usual:
            words += [option, str(value)]
    raw = raw_demonstrations()
    for formula in () if raw is None else formulas.texts_beside(raw):
        words += ["--feature", formula]
    names = _names_in_file(demonstrations)
    if combined and not combining.chosen().features:
        words.append("--combine")
    else:
        for first, second in combined:
            words += ["--combine", f"{names[first]}, {names[second]}"]
    return shlex.join([*words, "--out", "rules.json"])


def _names_in_file(demonstrations: Demonstrations) -> list[str]:
    """What the file itself calls the features of demonstrations, whatever a visitor does."""
    raw, named = raw_demonstrations(), uncombined_demonstrations()
    given = [] if named is None else [feature.name for feature in named.observed]
    own = [] if raw is None else [feature.name for feature in raw.observed]
    before = dict(zip(given, own, strict=False))
    return [before.get(feature.name, feature.name) for feature in demonstrations.features]
