"""The way of one state through the rules: which queries it was asked, and how near it came."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.figures.colours import MARKER_COLOUR, label_colour
from sarl_core.mining.language import action_text, bounds_of, number_text, query_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, RuleNode, tree_of
from sarl_core.mining.rules import Condition
from sarl_core.mining.written import value_text


class AskedQuery(NamedTuple):
    """One query, as a state answered it.

    Attributes:
        condition: What holds for the state.
        value: Of the feature.
        distance: To the threshold.
    """

    condition: Condition
    value: float
    distance: float


class LitPath(NamedTuple):
    """The way of a state.

    Attributes:
        queries: From the root to where it ends.
        rule: Index of the rule it ends at, None where no rule applies.
    """

    queries: tuple[AskedQuery, ...]
    rule: int | None


class PathFinder:
    """The rules of a set, arranged for following a state through them."""

    def __init__(self, rule_set: RuleSet) -> None:
        """Put the rules of each action dimension together to a tree.

        Args:
            rule_set: The rules; those that are switched off are left out.
        """
        self.rule_set = rule_set
        self._trees: list[list[RuleNode] | None] = [
            tree_of(
                [
                    (index, rule)
                    for index, rule in enumerate(rule_set.rules)
                    if rule.dimension == dimension and rule.enabled and not rule.placed
                ]
            )
            for dimension in range(len(rule_set.actions))
        ]

    def path(self, dimension: int, state: NDArray[np.float32], rule: int) -> LitPath:
        """The way of a state.

        Args:
            dimension: Index of the action dimension.
            state: Shape (d,).
            rule: Index of the rule in force there, -1 for none, as it was recorded.

        Returns:
            The queries it was asked. A rule that a person placed is not in the tree: its own
            conditions are the way to it.
        """
        nodes = self._trees[dimension]
        if rule >= 0 and (nodes is None or self.rule_set.rules[rule].placed):
            conditions = self.rule_set.rules[rule].conditions
            return LitPath(tuple(_asked(one, state) for one in conditions), rule)
        queries: list[AskedQuery] = []
        node = nodes[0] if nodes else None
        while nodes and node is not None and node.feature >= 0:
            below = bool(state[node.feature] <= np.float64(node.threshold))
            condition = Condition(node.feature, "<=" if below else ">", node.threshold)
            queries.append(_asked(condition, state))
            node = nodes[node.left if below else node.right]
        ends = node.rule if node is not None else NO_RULE
        return LitPath(tuple(queries), ends if ends != NO_RULE else None)


def _asked(condition: Condition, state: NDArray[np.float32]) -> AskedQuery:
    value = float(state[condition.feature])
    return AskedQuery(condition, value, abs(value - condition.threshold))


_STYLE = """<style>
.sarl-lit { width: 100%; border-collapse: collapse; font-size: 0.84rem; }
.sarl-lit th { text-align: left; font-weight: 400; opacity: 0.7; padding: 0 0.5rem 0.2rem 0;
  white-space: nowrap; }
.sarl-lit td { padding: 0.16rem 0.5rem 0.16rem 0; border-top: 1px solid rgba(128,140,150,0.25); }
.sarl-lit .n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
.sarl-lit td:first-child { box-shadow: inset 3px 0 0 MARKER; padding-left: 0.6rem; }
.sarl-lit tr.near td { font-weight: 600; }
.sarl-lit-end { font-size: 0.84rem; font-weight: 600; padding: 0.3rem 0 0.3rem 0.6rem;
  box-shadow: inset 3px 0 0 MARKER; border-top: 1px solid rgba(128,140,150,0.25); }
.sarl-lit-end i { display: inline-block; width: 0.75em; height: 0.75em; border-radius: 2px;
  margin-right: 0.4em; }
</style>""".replace("MARKER", MARKER_COLOUR)


def lit_path_table(path: LitPath, rule_set: RuleSet, dimension: int) -> str:
    """The way of a state as a table; the query it came nearest to is in bold.

    Args:
        path: Of the state.
        rule_set: Knows the names.
        dimension: Index of the action dimension.

    Returns:
        HTML without script; every name escaped.
    """
    features = rule_set.source.features
    nearest = min((query.distance for query in path.queries), default=None)
    rows = []
    for query in path.queries:
        feature = features[query.condition.feature]
        number = value_text(query.value, feature, [bounds_of(query.condition)])
        value = f"{number} {feature.unit}" if feature.unit else number
        asked = query_text(query.condition, features, beside=(query.value,))
        css = ' class="near"' if query.distance == nearest else ""
        rows.append(
            f"<tr{css}><td>{escape(asked)}</td>"
            f'<td class="n">{escape(value)}</td>'
            f'<td class="n">{number_text(query.distance)}</td></tr>'
        )
    table = (
        '<div style="overflow:auto;max-height:22rem"><table class="sarl-lit">'
        '<thead><tr><th>Asked on the way</th><th class="n">Here</th><th class="n">Distance</th>'
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )
    return f"{_STYLE}{table if rows else ''}{_end(path, rule_set, dimension)}"


def _end(path: LitPath, rule_set: RuleSet, dimension: int) -> str:
    """Where the path ends; outside the table, so that it is seen however long the way is."""
    text = "No rule ends here"
    if path.rule is not None:
        rule = rule_set.rules[path.rule]
        action = escape(action_text(rule.action, rule_set.actions[dimension]))
        square = f'<i style="background:{label_colour(rule.action)}"></i>'
        text = f"{rule_set.name_of(rule)}: {square}{action}"
    return f'<div class="sarl-lit-end">{text}</div>'


def lit_paths_html(
    finder: PathFinder, state: NDArray[np.float32], rules: Sequence[int]
) -> tuple[str, ...]:
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
