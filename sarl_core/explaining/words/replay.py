"""A recorded episode for people: what the agent wanted, what was done, and which rule said so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature, observed_features
from sarl_core.demonstrations.derived import extend
from sarl_core.demonstrations.names import Names, in_order_of, names_of, renamed_description
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.errors import InputError
from sarl_core.explaining.markup import plain
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.action_words import done_text
from sarl_core.mining.digits import value_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import number_text, sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.rollouts.steps import StepTable


@dataclass(frozen=True)
class ActionView:
    """One action dimension at one step.

    Attributes:
        dimension: Its name.
        proposed: What the agent wanted, in words.
        executed: What was done, in words.
        proposed_label: Its label.
        executed_label: Its label.
        changed: Whether the shield changed it.
        rule: The rule in force as a sentence, "" where none applies.
        rule_id: Its id, "" where none applies.
        rule_name: What it is called, "" where none applies.
        abstains: Whether the action breaks the rule and was left as it is, outside its data.
    """

    dimension: str
    proposed: str
    executed: str
    proposed_label: int
    executed_label: int
    changed: bool
    rule: str
    rule_id: str
    rule_name: str
    abstains: bool = False


@dataclass(frozen=True)
class StepView:
    """One step.

    Attributes:
        step: Its index.
        actions: One entry an action dimension.
        margin: Distance to the nearest threshold, inf where none was looked at, NaN where no
            rule was asked.
        state: Name, value and unit of each feature that is observed or asked about.
        outside: Whether the state lies outside the data of a rule that the agent's action
            breaks.
        invalid: Why no rule was asked, "" where they were.
    """

    step: int
    actions: tuple[ActionView, ...]
    margin: float
    state: tuple[tuple[str, str, str], ...]
    outside: bool = False
    invalid: str = ""

    @property
    def intervened(self) -> bool:
        """Whether the shield changed anything."""
        return any(action.changed for action in self.actions)


def named_description(
    description: EnvironmentDescription,
    rule_set: RuleSet | None,
    demonstrations: Demonstrations | None,
) -> EnvironmentDescription:
    """An environment under the names that its rules have, or its demonstrations.

    Args:
        description: Of the environment.
        rule_set: Of the shield, in the environment's order, or None.
        demonstrations: At hand, perhaps of another environment, or None.

    Returns:
        Names of the rules where they are of this environment and of as many features, actions
        and labels; else those of the demonstrations; else its own.
    """
    candidates = []
    if rule_set is not None and rule_set.source.env_id in ("", description.env_id):
        features, actions = observed_features(rule_set.source.features), rule_set.actions
        candidates.append(
            Names(
                tuple(feature.name for feature in features),
                tuple(feature.unit for feature in features),
                tuple(action.name for action in actions),
                tuple(() if action.is_interval else action.label_names for action in actions),
            )
        )
    if demonstrations is not None and demonstrations.env_id == description.env_id:
        with suppress(InputError):  # of other features: the environment's own names it is
            candidates.append(names_of(in_order_of(demonstrations, description).demonstrations))
    for names in candidates:
        renamed = renamed_description(description, names)
        if renamed is not None:
            return renamed
    return description


def step_view(
    steps: StepTable,
    row: int,
    dimensions: tuple[LabelledDimension, ...],
    features: tuple[Feature, ...],
    rule_set: RuleSet | None,
) -> StepView:
    """One step in words.

    Args:
        steps: Of one episode.
        row: Which of them.
        dimensions: The m action dimensions.
        features: The d features.
        rule_set: The rules of the shield, or None.

    Returns:
        The step; its state with what the rules in force derive from it.
    """
    views = []
    for index, dimension in enumerate(dimensions):
        proposed, executed = steps.proposed[row, index], steps.executed[row, index]
        rule = int(steps.rules[row, index])
        known = rule_set is not None and rule >= 0
        views.append(
            ActionView(
                dimension=dimension.name,
                proposed=done_text(float(proposed), dimension, beside=(float(executed),)),
                executed=done_text(float(executed), dimension, beside=(float(proposed),)),
                proposed_label=dimension.label_of(float(proposed)),
                executed_label=dimension.label_of(float(executed)),
                changed=bool(proposed != executed) and steps.invalid[row] is None,
                rule=sentence(rule_set.rules[rule], rule_set, state=steps.observation[row])
                if known and rule_set
                else "",
                rule_id=rule_set.rules[rule].id if known and rule_set else "",
                rule_name=rule_set.name_of(rule_set.rules[rule]) if known and rule_set else "",
                abstains=known
                and rule_set is not None
                and not rule_set.rules[rule].obeyed_by(dimension.labels_of(executed)).all(),
            )
        )
    in_force = steps.rules[row].tolist() if rule_set is not None else []
    asking = [rule_set.rules[rule] for rule in in_force if rule >= 0] if rule_set else []
    named = rule_set.source.features if rule_set is not None else features
    values = extend(steps.observation[row][None], named)[0]
    state = state_rows(values, (*features, *named[len(features) :]), named, asking)
    return StepView(
        int(steps.step[row]),
        tuple(views),
        float(steps.margin[row]),
        state,
        bool(steps.outside[row]),
        steps.invalid[row] or "",
    )


def state_rows(
    state: NDArray[np.float32],
    features: Sequence[Feature],
    known: Sequence[Feature],
    rules: Sequence[Rule],
) -> tuple[tuple[str, str, str], ...]:
    """A state for a table.

    Args:
        state: Shape (d,).
        features: The d features.
        known: The same as the rules know them, with their demonstrated values.
        rules: Those in force.

    Returns:
        Name, value and unit of each feature, of the derived ones those that the rules ask about;
        the word of each column of words.
    """
    values = state_values(state, known, rules)
    queried = {bounds.feature for rule in rules for bounds in rule.bounds}
    return tuple(
        (
            column.title,
            column.words(state[None])[0] if column.of_words else values[column.places[0]],
            column.unit,
        )
        for column in state_columns(features)
        if column.features[0].derived is None or column.places[0] in queried
    )


def state_values(
    state: NDArray[np.float32], features: Sequence[Feature], rules: Sequence[Rule]
) -> list[str]:
    """The values of a state, with as many digits as keep them on their side of thresholds.

    Args:
        state: Shape (d,).
        features: The d features.
        rules: Those in force.

    Returns:
        d texts.
    """
    bounds_of_rules = [bounds for rule in rules for bounds in rule.bounds]
    return [
        value_text(
            float(value), feature, [bounds for bounds in bounds_of_rules if bounds.feature == index]
        )
        for index, (feature, value) in enumerate(zip(features, state, strict=False))
    ]


def step_texts(
    steps: StepTable, dimensions: tuple[LabelledDimension, ...], rule_set: RuleSet | None
) -> tuple[str, ...]:
    """A tooltip for each step.

    Args:
        steps: Of one episode, T of them.
        dimensions: The m action dimensions.
        rule_set: The rules of the shield, or None.

    Returns:
        T texts, with ``<br>`` between the lines.
    """
    lines: list[list[str]] = [[f"step {step}"] for step in steps.step.tolist()]
    for index, dimension in enumerate(dimensions):
        prefix = f"{plain(dimension.name)}: " if len(dimensions) > 1 else ""
        pairs = zip(
            steps.proposed[:, index].tolist(),
            steps.executed[:, index].tolist(),
            steps.rules[:, index].tolist(),
            steps.invalid.tolist(),
            strict=True,
        )
        for line, (proposed, executed, rule, invalid) in zip(lines, pairs, strict=True):
            done = plain(done_text(executed, dimension, beside=(proposed,)))
            if proposed != executed and invalid is None:
                wanted = plain(done_text(proposed, dimension, beside=(executed,)))
                line.append(f"{prefix}wanted {wanted}, done {done}")
            else:
                line.append(f"{prefix}{done}")
            if rule_set is not None:
                known = rule_set.name_of(rule_set.rules[rule]) if rule >= 0 else ""
                line.append(known or ("no rule applies" if invalid is None else "not checked"))
    for row in np.flatnonzero(steps.outside).tolist():
        lines[row].append("outside the data behind the rule")
    for row in np.flatnonzero(steps.is_invalid).tolist():
        lines[row].append(plain(steps.invalid[row]))
    return tuple("<br>".join(line) for line in lines)


def margin_text(margin: float) -> str:
    """The distance to the nearest threshold, in words.

    Args:
        margin: In the feature's own unit; inf where no threshold was looked at, NaN where no
            rule was asked.

    Returns:
        As "Smallest distance to a threshold on the way: 0.013 (in that feature's unit)".
    """
    if not math.isfinite(margin):
        return "No threshold was looked at"
    return (
        f"Smallest distance to a threshold on the way: {number_text(margin)} "
        "(in that feature's unit)"
    )
