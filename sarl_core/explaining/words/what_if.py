"""What the shield would do in one state, in words: the rule, what is near, what would change it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text, float32_decimal
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import extend
from sarl_core.demonstrations.words import columns_of_words
from sarl_core.mining.action_words import done_text
from sarl_core.mining.algorithm_1 import rules_at
from sarl_core.mining.digits import value_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import (
    is_flag,
    least_conditions,
    neither_text,
    number_text,
    short_condition,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import LAST_REGROWN, Bounds, Rule, node_of
from sarl_core.mining.tree import PolicyTree
from sarl_core.shielding.neighbourhood import FeatureChange

_HALF = 0.5  # of a feature that is 1 or 0
_LONGEST_NUMBER = len(str(LAST_REGROWN))


@dataclass(frozen=True)
class ConditionView:
    """One condition of a rule, and how a state meets it.

    Attributes:
        condition: As "pole angle > 0.02 rad".
        value: The state's value, with its unit.
        room: How far the value can move before the condition fails, with its unit.
    """

    condition: str
    value: str
    room: str


def condition_views(
    rule: Rule, state: tuple[float, ...], rule_set: RuleSet
) -> tuple[ConditionView, ...]:
    """The conditions of a rule beside a state that meets them.

    Args:
        rule: One that applies.
        state: d values.
        rule_set: Knows the names.

    Returns:
        One entry a feature that it asks about.
    """
    features = rule_set.source.features
    views = []
    for entry in least_conditions(rule, features):
        neither = neither_text(entry, features)
        if neither is not None:
            views.append(ConditionView(neither, word_text(entry[0].feature, state, features), "–"))
            continue
        for bounds in entry:
            feature, value = features[bounds.feature], state[bounds.feature]
            flag = is_flag(feature, bounds)
            room = min(value - bounds.low, bounds.high - value)
            views.append(
                ConditionView(
                    short_condition(bounds, feature, beside=(value,)),
                    word_text(bounds.feature, state, features)
                    if flag and feature.indicator is not None
                    else with_unit(value_text(value, feature, [bounds]), feature),
                    "–" if flag else with_unit(number_text(room), feature),
                )
            )
    return tuple(views)


def word_text(at: int, state: Sequence[float], features: Sequence[Feature]) -> str:
    """What a state says of a column of words.

    Args:
        at: One of the column's features.
        state: d values.
        features: The d features.

    Returns:
        As "mode is heavy"; where the state says no word, or several, whether that feature holds.
    """
    own = features[at].indicator
    assert own is not None
    column = columns_of_words([one.indicator for one in features])[own.column]
    holding = [one for one in column if state[one] > _HALF]
    if len(holding) == 1 and len(column) > 1:
        return features[holding[0]].statement(True)
    return features[at].statement(state[at] > _HALF)


def outside_texts(
    rule: Rule, state: tuple[float, ...], features: tuple[Feature, ...]
) -> tuple[str, ...]:
    """Where a state lies outside the data of a rule.

    Args:
        rule: With a data box, or without.
        state: d values.
        features: The d features.

    Returns:
        As "pole angle 0.31 rad is above 0.21 rad, the largest that was seen"; none where the
        state lies inside, or the rule has no box.
    """
    if rule.box is None:
        return ()
    texts = []
    for at, (value, least, most, feature) in enumerate(
        zip(state, rule.box.least, rule.box.most, features, strict=True)
    ):
        if least <= value <= most:
            continue
        if feature.indicator is not None:
            texts.append(f"{word_text(at, state, features)}, which was never seen there")
            continue
        below = value < least
        edge = least if below else most
        texts.append(
            f"{feature.name} {with_unit(number_text(value, apart_from=edge), feature)} is "
            f"{'below' if below else 'above'} "
            f"{with_unit(number_text(edge, apart_from=value), feature)}, the "
            f"{'smallest' if below else 'largest'} that was seen"
        )
    return tuple(dict.fromkeys(texts))  # several features may tell of one word


def feature_change_text(change: FeatureChange, feature: Feature) -> str:
    """A change of one feature, after "if".

    Args:
        change: How far it moves.
        feature: Its name and unit.

    Returns:
        As "pole angle were 0.03 rad less", "there were no left leg contact", or "mode were heavy".
    """
    if _is_contact(change, feature) and feature.indicator is not None:
        return feature.statement(change.by > 0).replace(" is ", " were ", 1)
    if _is_contact(change, feature):
        return f"there were {'no ' if change.by < 0 else ''}{feature.name}"
    way = "less" if change.by < 0 else "more"
    return f"{feature.name} were {with_unit(number_text(abs(change.by)), feature)} {way}"


def near_miss_text(changes: tuple[FeatureChange, ...], features: tuple[Feature, ...]) -> str:
    """What a rule that nearly applies lacks.

    Args:
        changes: What has to move.
        features: The d features.

    Returns:
        As "pole angle were 0.03 rad less and there were left leg contact", after "would apply if".
    """
    return " and ".join(feature_change_text(change, features[change.feature]) for change in changes)


def float32_text(value: float) -> str:
    """A float32 number with every digit it needs to be read back.

    Args:
        value: A float32 number.

    Returns:
        As "0.020938473".
    """
    return decimal_text(float32_decimal(value))


def executed_text(
    values: Sequence[float],
    dimensions: Sequence[LabelledDimension],
    *,
    beside: Sequence[float] | None = None,
) -> str:
    """An action in words.

    Args:
        values: One an action dimension.
        dimensions: The m action dimensions.
        beside: Another action that is shown with it.

    Returns:
        As "fire main engine" or "hip -0.5, knee 0.25".
    """
    parts = []
    for value, other, dimension in zip(values, beside or values, dimensions, strict=True):
        label = dimension.label_of(value)
        if len(dimensions) > 1 and not dimension.is_interval and 0 <= label < dimension.n_labels:
            parts.append(f"{dimension.name}: {dimension.label_names[label]}")
        else:
            parts.append(done_text(value, dimension, beside=(other,)))
    return ", ".join(parts)


def with_unit(text: str, feature: Feature) -> str:
    """A number with the unit of a feature, where it has one."""
    return f"{text} {feature.unit}" if feature.unit else text


def by_use(rule_set: RuleSet) -> tuple[int, ...]:
    """The features in the order in which people want to see them.

    Args:
        rule_set: In force.

    Returns:
        Indexes of all d features; first those that the rules of the most states ask about.
    """
    count = len(rule_set.source.features)
    states, rules = np.zeros(count), np.zeros(count)
    for rule in rule_set.rules:
        if rule.enabled:
            for bounds in rule.bounds:
                states[bounds.feature] += rule.samples
                rules[bounds.feature] += 1
    return tuple(sorted(range(count), key=lambda index: (-states[index], -rules[index], index)))


def _is_contact(change: FeatureChange, feature: Feature) -> bool:
    """Whether the change turns a yes into a no, or back."""
    between = (change.before + change.after) / 2
    crosses = min(change.before, change.after) < 1 and max(change.before, change.after) > 0
    return crosses and is_flag(feature, Bounds(change.feature, between, math.inf))


def node_of_way(
    rule: Rule | None,
    state: NDArray[np.float32],
    rule_set: RuleSet,
    tree: PolicyTree,
    *,
    leaves: bool,
) -> int | None:
    """The node at which the way of a state through a tree ends.

    Args:
        rule: In force there, or None.
        state: Shape (d,).
        rule_set: Of the rule; it may have come from a file, and from another tree.
        tree: Of the rule's action dimension.
        leaves: Whether the rules of the tree are its leaves.

    Returns:
        That of the rule where it was cut from this tree, else a leaf; None where the rule set was
        not cut from this tree, so that no node of it says anything about the rules.
    """
    if not _cut_from(rule_set, tree, leaves=leaves):
        return None
    if rule is None or rule.origin == "manual":
        return int(tree.apply(extend(state[None], tree.source.features))[0])
    return node_in(tree, rule, rule_set, leaves=leaves)


def _cut_from(rule_set: RuleSet, tree: PolicyTree, *, leaves: bool) -> bool:
    divided = tree.dimension.is_interval and rule_set.divider != tree.divider
    return (
        rule_set.source.digest == tree.source.digest
        and not divided
        and (rule_set.cut == "leaves") == leaves
    )


def node_in(tree: PolicyTree, rule: Rule, rule_set: RuleSet, *, leaves: bool) -> int | None:
    """The node of a tree at which a rule was cut.

    Args:
        tree: Of the rule's action dimension.
        rule: Of the rule set.
        rule_set: It may have come from a file, and from another tree.
        leaves: Whether the rules of the tree are its leaves.

    Returns:
        None for a rule added by hand, and for one of another tree.
    """
    if rule.origin == "manual" or not _cut_from(rule_set, tree, leaves=leaves):
        return None
    # A file may have renamed or rounded it: it is the node's if it asks what the way there asks.
    before, _, number = rule.id.rpartition(".")
    beginning = f"{tree.index}n{rule.label}" if rule.forbids else str(tree.index)
    if before != beginning or not (number.isascii() and number.isdigit()):
        return None
    # Longer numbers are no node's, and Python refuses to read the longest.
    node = tree.place_of(node_of(rule)) if len(number) <= _LONGEST_NUMBER else None
    if node is None:
        return None
    (own,) = rules_at(tree, np.array([node]))
    return node if set(own.bounds) == set(rule.bounds) else None
