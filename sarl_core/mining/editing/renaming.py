"""Rules and trees under other names, so that they speak as the demonstrations do."""

from __future__ import annotations

from dataclasses import replace

from sarl_core.demonstrations.dataset import (
    Demonstrations,
    derived_features,
    derived_over,
    observed_features,
    with_derived,
)
from sarl_core.demonstrations.names import Names
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree, Source


def renamed_rules(rule_set: RuleSet, names: Names) -> RuleSet:
    """A rule set under the names of demonstrations, as far as both have the same parts.

    Args:
        rule_set: Any number of rules.
        names: Of demonstrations, perhaps of another environment.

    Returns:
        The same rules. Features are renamed if there are as many, an action dimension if there
        are as many, its labels likewise; intervals keep their bounds for names.
    """
    source, actions = rule_set.source, rule_set.actions
    observed = observed_features(source.features)
    if len(names.features) == len(observed):
        observed = tuple(
            replace(feature, name=name, unit=unit)
            for feature, name, unit in zip(observed, names.features, names.units, strict=True)
        )
        places = range(len(observed))
        derived = derived_over(derived_features(source.features), places, names.features)
        source = replace(source, features=with_derived(observed, derived)).with_splits(
            [feature.splits for feature in source.features]
        )
    if len(names.actions) == len(actions):
        actions = tuple(
            replace(
                action,
                name=name,
                label_names=labels if len(labels) == action.n_labels else action.label_names,
            )
            for action, name, labels in zip(actions, names.actions, names.labels, strict=True)
        )
    return replace(rule_set, source=source, actions=actions)


def renamed_trees(
    trees: tuple[PolicyTree, ...], demonstrations: Demonstrations
) -> tuple[PolicyTree, ...]:
    """Trees under the names of demonstrations, without growing them again.

    Args:
        trees: Grown from the same pairs under whatever names, one an action dimension.
        demonstrations: The pairs.

    Returns:
        The same trees; the same objects where the names are the same too.

    Raises:
        ValueError: If there are not as many action dimensions.
    """
    source = Source.of(demonstrations)
    dimensions = label_dimensions(demonstrations, trees[0].divider)
    return tuple(
        tree
        if (tree.source, tree.dimension) == (source, dimension)
        else replace(
            tree,
            source=source.with_splits([feature.splits for feature in tree.source.features]),
            dimension=dimension,
        )
        for tree, dimension in zip(trees, dimensions, strict=True)
    )
