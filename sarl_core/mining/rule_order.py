"""Rules whose features and action dimensions are put into the order of what they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from sarl_core.demonstrations.dataset import (
    Demonstrations,
    derived_features,
    derived_over,
    observed_features,
    with_derived,
)
from sarl_core.demonstrations.derived import definitions_of
from sarl_core.demonstrations.recoding import recoded
from sarl_core.environments.feature_order import FeatureOrder, NamedFeatures, line_up
from sarl_core.errors import InputError
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule


class Fitted(NamedTuple):
    """A rule set in the order of what it meets.

    Attributes:
        rule_set: The same rules under the same numbers.
        notes: How it was found out which feature is which, where that has to be said.
    """

    rule_set: RuleSet
    notes: tuple[str, ...]


def fitted_rules(
    rule_set: RuleSet, features: NamedFeatures, actions: Sequence[str], *, rules: str = "the rules"
) -> Fitted:
    """Put rules into the order of an environment's or of demonstrations' features and actions.

    Args:
        rule_set: The rules.
        features: Of what they meet, d names; no derived ones, which follow from those.
        actions: Names of its m action dimensions.
        rules: What the rules are called in a message.

    Returns:
        The same object where the order is the same.

    Raises:
        InputError: If there are more or fewer, or their names are of other things.
    """
    env_id = rule_set.source.env_id
    names = tuple(feature.name for feature in observed_features(rule_set.source.features))
    orders = [line_up(NamedFeatures(rules, names, env_id), features)]
    if len(actions) > 1 or len(rule_set.actions) > 1:  # a single one needs no name
        orders.append(
            line_up(
                NamedFeatures(rules, tuple(action.name for action in rule_set.actions), env_id),
                features._replace(names=tuple(actions)),
                what="action dimensions",
            )
        )
    notes = tuple(order.note for order in orders if order.note)
    if all(order.how != "permuted" for order in orders):
        return Fitted(rule_set, notes)
    return Fitted(_reordered(rule_set, orders[0], orders[1] if len(orders) > 1 else None), notes)


def rules_for(
    rule_set: RuleSet, demonstrations: Demonstrations, *, called: str = "the demonstrations"
) -> Fitted:
    """Put rules into the order of demonstrations.

    Args:
        rule_set: The rules.
        demonstrations: N pairs.
        called: What they are called in a message.

    Returns:
        The same object where the order is the same.

    Raises:
        InputError: If features or actions are others.
    """
    recoded(demonstrations, rule_set.source.features, called=called)  # names an unknown word
    fitted = fitted_rules(
        rule_set,
        NamedFeatures(
            called,
            tuple(feature.name for feature in demonstrations.observed),
            demonstrations.env_id,
        ),
        tuple(dimension.name for dimension in demonstrations.action_dimensions),
    )
    derived = definitions_of(fitted.rule_set.source.features)
    if derived != definitions_of(demonstrations.features):
        raise InputError(
            f"the rules ask about features that {called} do not derive alike; bring them to the "
            "rules' features: recoded(demonstrations, rules.source.features, called='the log')"
        )
    _check_actions(fitted.rule_set.actions, demonstrations)
    if fitted.rule_set is rule_set and rule_set.source.digest == demonstrations.whole.digest:
        return Fitted(rule_set, ())  # mined from these very pairs
    return fitted


def fitting(rule_set: RuleSet, demonstrations: Demonstrations) -> Demonstrations | None:
    """Demonstrations with what rules derive, where they are of the same features and actions.

    Args:
        rule_set: The rules.
        demonstrations: Any.

    Returns:
        Such as `rules_for` takes; None where they are of others.
    """
    try:
        features = rule_set.source.features
        demonstrations = recoded(demonstrations, features, called="the demonstrations")
        rules_for(rule_set, demonstrations)
    except InputError:
        return None
    return demonstrations


def without_idle(rule_set: RuleSet) -> RuleSet:
    """The same rules without derived features that none of them asks about.

    Args:
        rule_set: The rules.

    Returns:
        For whoever works out what is derived at every step; the same object where all are asked
        about. Derived features have other numbers; rules keep theirs.
    """
    features = rule_set.source.features
    queried = {one.feature for rule in rule_set.rules for one in rule.conditions}
    left = [place for place, one in enumerate(features) if one.derived is None or place in queried]
    if len(left) == len(features):
        return rule_set
    to = {place: now for now, place in enumerate(left)}
    rules = tuple(
        replace(
            rule,
            conditions=tuple(one._replace(feature=to[one.feature]) for one in rule.conditions),
            box=rule.box and DataBox(*(tuple(side[place] for place in left) for side in rule.box)),
        )
        for rule in rule_set.rules
    )
    source = replace(rule_set.source, features=tuple(features[place] for place in left))
    return replace(rule_set, rules=rules, source=source)


def _check_actions(actions: tuple[LabelledDimension, ...], demonstrations: Demonstrations) -> None:
    advice = "choose demonstrations of the rules' environment"
    for rules, demonstrated in zip(actions, demonstrations.action_dimensions, strict=True):
        if rules.is_interval != (demonstrated.kind == "interval"):
            kinds = ("continuous", "discrete") if rules.is_interval else ("discrete", "continuous")
            raise InputError(
                f"the action {rules.name!r} is {kinds[0]} in the rules and {kinds[1]} in the "
                f"demonstrations; {advice}"
            )


def _reordered(rule_set: RuleSet, features: FeatureOrder, actions: FeatureOrder | None) -> RuleSet:
    """The rules with every number of a feature and of an action dimension exchanged."""
    known = rule_set.source.features
    observed = features.put(observed_features(known))
    derived = derived_over(
        derived_features(known), features.inverse, tuple(one.name for one in observed)
    )
    # What is derived stays behind all others, in its order.
    further = tuple(range(len(observed), len(known)))
    features = features._replace(places=features.places + further)
    feature_to = {mine: theirs for theirs, mine in enumerate(features.places)}
    dimensions = tuple(range(len(rule_set.actions))) if actions is None else actions.places
    dimension_to = {mine: theirs for theirs, mine in enumerate(dimensions)}
    rules = tuple(_moved(rule, feature_to, features, dimension_to) for rule in rule_set.rules)
    return replace(
        rule_set,
        rules=rules,
        actions=rule_set.actions if actions is None else actions.put(rule_set.actions),
        source=replace(rule_set.source, features=with_derived(observed, derived)).with_splits(
            [one.splits for one in features.put(known)]
        ),
    )


def _moved(
    rule: Rule, feature_to: dict[int, int], features: FeatureOrder, dimension_to: dict[int, int]
) -> Rule:
    box = rule.box
    return replace(
        rule,
        dimension=dimension_to[rule.dimension],
        conditions=tuple(
            Condition(feature_to[feature], op, threshold)
            for feature, op, threshold in rule.conditions
        ),
        box=None if box is None else DataBox(*(features.put(bound) for bound in box)),
    )
