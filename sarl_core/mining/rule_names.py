"""Rules under other names, so that rules from a file speak as the demonstrations do."""

from __future__ import annotations

from dataclasses import replace

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.names import Names
from sarl_core.mining.rules import RuleSet


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
    if len(names.features) == len(source.features):
        features = tuple(
            Feature(name, unit) for name, unit in zip(names.features, names.units, strict=True)
        )
        source = replace(source, features=features)
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
