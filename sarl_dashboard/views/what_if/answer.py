"""What the What if page shows of one state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray
from streamlit.delta_generator import DeltaGenerator

from sarl_core.explaining.html.headings import heading, note
from sarl_core.explaining.html.lit_path import lit_path_table
from sarl_core.explaining.html.what_if import (
    PLACED,
    changes_html,
    decision_html,
    misses_html,
    way_html,
)
from sarl_core.explaining.html.what_if_bars import lines_html
from sarl_core.explaining.words.leeway import left_text
from sarl_core.explaining.words.what_if import node_of_way
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.leeway import labels_left
from sarl_core.shielding.neighbourhood import DecisionChange, FeatureLine, decision_changes
from sarl_dashboard.components.tree_picture import PathInTree, show_tree
from sarl_dashboard.views.what_if.derived import derived_values
from sarl_dashboard.views.what_if.features import sliders
from sarl_dashboard.views.what_if.proposal import proposal
from sarl_dashboard.views.what_if.rules import RulesOnTrees
from sarl_dashboard.views.what_if.situation import Situation
from sarl_dashboard.views.what_if.state import source_choice

MISSES, PAIRS = 8, 4  # near misses that lack one feature, and two


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked.

    Attributes:
        situation: The rules, and where states lie.
        state: Shape (d,).
        action: What the agent wants.
        drawn: The features that are looked at.
    """

    situation: Situation
    state: NDArray[np.float32]
    action: Any
    drawn: tuple[int, ...]


@st.fragment
def question_and_answer(situation: Situation) -> None:
    """Everything that answers to a slider."""
    source_choice(situation)
    left, right = st.columns([4, 7], gap="large")
    with left:
        action = proposal(situation.rules.rule_set.actions)
        st.markdown("**The state**")
        state, drawn = sliders(situation)
        derived_values(situation, state, action)
    answer(Question(situation, state, action, drawn), right)


def answer(question: Question, beside: DeltaGenerator) -> None:
    """What the shield does in a state, and what lies near it.

    Args:
        question: The state.
        beside: Where the decision is shown, beside the sliders.
    """
    situation, state, action = question.situation, question.state, question.action
    neighbourhood, spans, spreads = situation.neighbourhood, situation.spans, situation.spreads
    rules, order = situation.rules, question.drawn
    rule_set = neighbourhood.shield.rule_set
    decision = neighbourhood.shield.decide(state, action)
    lines = neighbourhood.lines(state, action)
    # Few pieces of HTML, and not a widget for each table: a moved slider draws all of them anew.
    with beside:
        dimension = chosen_dimension(rule_set)
        index = decision.rules[dimension]
        rule = None if index is None else rule_set.rules[index]
        with st.container(border=True, key="decision"):
            shield = neighbourhood.shield
            left = labels_left(shield, state, dimension)
            words = "" if left is None else left_text(left, rule_set, dimension)
            st.html(decision_html(decision, rule, state, rule_set, shield.outside, left=words))
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
    if dimension < len(rules.trees):
        tree = rules.trees[dimension]
        node = node_of_way(rule, state, rule_set, tree, leaves=rules.leaves)
    if node is None:
        way = situation.finder.path(dimension, state, -1 if index is None else index)
        st.html(way_html(lit_path_table(way, rule_set, dimension), rule))
    else:
        way_through(rules, dimension, rule, node)


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
    lines: Sequence[FeatureLine], state: NDArray[np.float32], spreads: NDArray[np.float64]
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


def way_through(rules: RulesOnTrees, dimension: int, rule: Rule | None, node: int) -> None:
    """The way of the state through the tree, to a node."""
    placed = note(PLACED) if rule is not None and rule.placed else ""
    st.html(heading("Its way through the tree") + placed)
    path = PathInTree(
        tree=rules.trees[dimension],
        cut_at=None if rules.leaves else rules.rule_set.thresholds,
        node=node,
        note="The lit path is the state's: it ends at the rule that applies."
        if rule is not None and rule.origin == "mined"
        else "The lit path is the state's: it ends at a leaf, and no part of it is a mined rule "
        "that applies.",
    )
    show_tree(path, around="Around it", widget="whole_tree")
