"""Two rule sets over the same features of which each derives some of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sarl_core.demonstrations.dataset import (
    Feature,
    derived_features,
    derived_over,
    observed_features,
    with_derived,
)
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.environments.feature_order import compared_names
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

_LARGEST = float(np.finfo(np.float32).max)


def deriving_alike(first: RuleSet, second: RuleSet) -> tuple[RuleSet, RuleSet]:
    """Let two rule sets derive what either of them derives, so that they can be compared.

    Args:
        first: A rule set.
        second: Another.

    Returns:
        The same rules; the same objects where both derive the same, or are of other features.
    """
    observed = [observed_features(each.source.features) for each in (first, second)]
    own, other = compared_names(*([one.name for one in each] for each in observed))
    if len(own) != len(other):
        return first, second
    places = list(range(len(own)))  # of the second's features among the first's
    if sorted(own) == sorted(other) and len({*own}) == len(own):
        places = [own.index(name) for name in other]
    back = sorted(range(len(places)), key=places.__getitem__)
    mine = derived_features(first.source.features)
    theirs = derived_over(
        derived_features(second.source.features), places, [one.name for one in observed[0]]
    )
    definitions = [one.definition for one in mine]
    all_of_them = [*mine, *(one for one in theirs if one.definition not in definitions)]
    names = [one.name for one in observed[1]]
    wanted, known = (derived_over(each, back, names) for each in (all_of_them, theirs))
    return _deriving(first, all_of_them, mine), _deriving(second, wanted, known)


def _deriving(
    rule_set: RuleSet, wanted: Sequence[DerivedFeature], own: Sequence[DerivedFeature]
) -> RuleSet:
    """The same rules with what is derived in another order, and more of it."""
    if list(wanted) == list(own):
        return rule_set
    features = rule_set.source.features
    observed = observed_features(features)
    d = len(observed)
    definitions = [one.definition for one in wanted]
    to = [*range(d), *(d + definitions.index(one.definition) for one in own)]
    made: list[Feature] = list(with_derived(observed, wanted))
    for place, feature in zip(to, features, strict=True):
        made[place] = replace(made[place], splits=feature.splits)
    rules = tuple(_moved(rule, to, len(made)) for rule in rule_set.rules)
    return replace(rule_set, rules=rules, source=replace(rule_set.source, features=tuple(made)))


def _moved(rule: Rule, to: Sequence[int], count: int) -> Rule:
    box = rule.box
    if box is not None:
        # Nothing is known of where the others lay: anywhere.
        least, most = [-_LARGEST] * count, [_LARGEST] * count
        sides = [list(least), list(least), list(most), list(most)]
        for side, values in zip(sides, box, strict=True):
            for place, value in zip(to, values, strict=True):
                side[place] = value
        box = DataBox(*map(tuple, sides))
    conditions = tuple(one._replace(feature=to[one.feature]) for one in rule.conditions)
    return replace(rule, conditions=conditions, box=box)
