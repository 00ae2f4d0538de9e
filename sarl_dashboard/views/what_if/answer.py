"""What the What if page shows of one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray
from streamlit.delta_generator import DeltaGenerator

from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.lit_path import PathFinder, lit_path_table
from sarl_core.explaining.html.what_if import (
    PLACED,
    changes_html,
    decision_html,
    misses_html,
    way_html,
)
from sarl_core.explaining.html.what_if_bars import lines_html
from sarl_core.explaining.words.what_if import node_of_way
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.tree import PolicyTree
from sarl_core.shielding.near import DecisionChange, Line, Neighbourhood, decision_changes
from sarl_core.shielding.sampling import Span
from sarl_dashboard.components.tree_picture import show_tree

MISSES, PAIRS = 8, 4  # near misses that lack one feature, and two


def show(
    beside: DeltaGenerator,
    neighbourhood: Neighbourhood,
    state: NDArray[np.float32],
    action: Any,
    spans: Sequence[Span],
    spreads: NDArray[np.float64],
    order: Sequence[int],
    *,
    trees: tuple[PolicyTree, ...],
    leaves: bool,
    finder: Callable[[], PathFinder],
    key: str,
) -> None:
    """What the shield does in a state, and what lies near it.

    Args:
        beside: Where the decision is shown, beside the sliders.
        neighbourhood: The shield's.
        state: Shape (d,).
        action: What the agent wants.
        spans: Of each feature.
        spreads: What a change of each feature is measured in.
        order: The features, from top to bottom.
        trees: Of each action dimension, grown from the chosen data.
        leaves: Whether every leaf of them is a rule.
        finder: Follows a state through the rules, which may be of other trees.
        key: Tells the rules from all others.
    """
    rule_set = neighbourhood.shield.rule_set
    decision = neighbourhood.shield.decide(state, action)
    lines = neighbourhood.lines(state, action)
    # Few pieces of HTML, and not a widget for each table: a moved slider draws all of them anew.
    with beside:
        dimension = chosen_dimension(rule_set)
        found = decision.rules[dimension]
        rule = None if found is None else rule_set.rules[found]
        with st.container(border=True, key="decision"):
            st.html(decision_html(decision, rule, state, rule_set, neighbourhood.shield.outside))
        with st.container(key="lines"):
            st.html(
                lines_html(
                    [lines[index] for index in order],
                    [(spans[index].low, spans[index].high) for index in order],
                    [float(state[index]) for index in order],
                    [rule_set.source.features[index] for index in order],
                    dimension,
                    rule_set,
                )
            )
    with st.container(key="changes"):
        st.html(changes_html(least_changes(lines, state, spreads), spans, rule_set))
    with st.container(key="misses"):
        misses = [
            *neighbourhood.near_misses(state, spreads, most=MISSES),
            *neighbourhood.near_misses(state, spreads, features=2, most=PAIRS),
        ]
        st.html(misses_html(misses, rule_set))
    node = None
    if dimension < len(trees):
        node = node_of_way(rule, state, rule_set, trees[dimension], leaves=leaves)
    if node is None:
        way = finder().path(dimension, state, -1 if found is None else found)
        st.html(way_html(lit_path_table(way, rule_set, dimension), rule))
    else:
        way_through(rule, node, trees[dimension], rule_set, leaves=leaves, key=key)


def chosen_dimension(rule_set: RuleSet) -> int:
    """The action dimension that is looked at."""
    if len(rule_set.actions) == 1:
        return 0
    names = [f"{index + 1}. {action.name}" for index, action in enumerate(rule_set.actions)]
    chosen = st.selectbox(
        "Action dimension", names, key="dimension", bind="query-params", width=320
    )
    return names.index(chosen)


def least_changes(
    lines: Sequence[Line], state: NDArray[np.float32], spreads: NDArray[np.float64]
) -> list[DecisionChange]:
    """The least change of each feature, both ways, that changes the decision; the least first."""
    return sorted(
        (
            change
            for line in lines
            for change in decision_changes(
                line, float(state[line.feature]), float(spreads[line.feature])
            )
            if change is not None
        ),
        key=lambda change: change.distance,
    )


def way_through(
    rule: Rule | None, node: int, tree: PolicyTree, rule_set: RuleSet, *, leaves: bool, key: str
) -> None:
    """The way of the state through the tree."""
    placed = f"<p>{PLACED}</p>" if rule is not None and rule.placed else ""
    st.html(heading("Its way through the tree") + placed)
    show_tree(
        key,
        tree,
        rule_set.thresholds,
        node,
        around="Around it",
        widget="whole_tree",
        note="The lit path is the state's: it ends at the rule that applies."
        if rule is not None and rule.origin == "mined"
        else "The lit path is the state's: it ends at a leaf, and no part of it is a mined rule "
        "that applies.",
        leaves=leaves,
    )
