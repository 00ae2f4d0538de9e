"""The way of one state through the rules as a table, in HTML."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.state_path import PathFinder, StatePath
from sarl_core.explaining.templates import render
from sarl_core.mining.action_words import says_text
from sarl_core.mining.digits import value_text
from sarl_core.mining.language import bounds_of, number_text, query_text
from sarl_core.mining.rule_set import RuleSet


def lit_path_table(path: StatePath, rule_set: RuleSet, dimension: int) -> Markup:
    """The way of a state as a table; the query it came nearest to is in bold.

    Args:
        path: Of the state.
        rule_set: Knows the names.
        dimension: Index of the action dimension.

    Returns:
        HTML. Where the path ends is said outside the table, so that it is seen however long the
        way is.
    """
    features = rule_set.source.features
    nearest = min(
        (
            query.distance
            for query in path.queries
            if features[query.condition.feature].indicator is None
        ),
        default=None,
    )
    queries = []
    for query in path.queries:
        feature = features[query.condition.feature]
        number = value_text(query.value, feature, [bounds_of(query.condition)])
        if feature.indicator is not None:
            number = feature.statement(query.value > query.condition.threshold)
        queries.append(
            (
                query_text(query.condition, features, beside=(query.value,)),
                f"{number} {feature.unit}" if feature.unit else number,
                number_text(query.distance) if feature.indicator is None else "–",
                query.distance == nearest and feature.indicator is None,
            )
        )
    rule = None if path.rule is None else rule_set.rules[path.rule]
    return render(
        "rules/lit_path",
        queries=queries,
        rule=rule and rule_set.name_of(rule),
        action=rule and says_text(rule, rule_set.actions[dimension]),
        colour=rule and label_colour(rule.label),
    )


def lit_paths_html(
    finder: PathFinder, state: NDArray[np.float32], rules: Sequence[int]
) -> tuple[Markup, ...]:
    """The way of a state in every action dimension.

    Args:
        finder: Of the rule set.
        state: Shape (d,).
        rules: Index of the rule in force in each dimension, -1 for none, (m,).

    Returns:
        A table each, as `lit_path_table`.
    """
    return tuple(
        lit_path_table(finder.path(dimension, state, int(rule)), finder.rule_set, dimension)
        for dimension, rule in enumerate(rules)
    )
