"""One rule and everything behind it: the sentence, the path, the features, example states.

What changes with the rule comes as a few pieces of HTML: each element of Streamlit takes its time,
and the next rule should be there at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.colours import label_colour
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.path import path_table
from sarl_core.explaining.html.rule_card import measures_text, rule_card
from sarl_core.explaining.html.rule_examples import examples_html
from sarl_core.explaining.html.rule_features import features_html
from sarl_core.explaining.rule_evidence import feature_evidence, path_steps
from sarl_core.mining.language import counted
from sarl_core.mining.rules import Rule, RuleSet, Thresholds, node_of
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.cache import cached
from sarl_dashboard.components import tree_picture
from sarl_dashboard.state.compact_set import Compact


@dataclass(frozen=True, eq=False)
class Behind:
    """What the rules come from.

    Attributes:
        demonstrations: The chosen ones.
        trees: One an action dimension.
        thresholds: At which they are cut.
        compact: The compact set whose rules they are; None for mined ones.
    """

    demonstrations: Demonstrations
    trees: tuple[PolicyTree, ...]
    thresholds: Thresholds
    compact: Compact | None

    @property
    def digest(self) -> str:
        """What tells a compact set from others; "" for mined rules."""
        return self.compact.digest if self.compact is not None else ""

    def tree(self, rule: Rule) -> PolicyTree:
        """The tree of a rule's action dimension."""
        return self.trees[rule.dimension]


def show_rule(rule: Rule, rule_set: RuleSet, behind: Behind, buttons: Callable[[], None]) -> None:
    """One rule and everything behind it.

    Args:
        rule: One of the rule set.
        rule_set: Knows the names.
        behind: What it comes from.
        buttons: Draws what leads to other rules.
    """
    tree, compact = behind.tree(rule), behind.compact
    with st.container(border=True, key="sentence"):
        buttons()
        threshold = behind.thresholds.confidence if compact is None else None
        st.html(rule_card(rule, rule_set, threshold=threshold))
        if compact is not None:
            show_origin(compact.as_shipped(rule), compact.shipped)
        if not rule.samples:
            st.info(
                "No demonstrated state reaches this rule. It is for states that the expert never "
                "came into by itself and was asked about.",
                icon=":material/explore:",
            )
        if not rule.conditions and compact is None:
            st.info(
                "This rule has no conditions: over all states the expert's most frequent action "
                "is already as frequent as the minimum confidence asks, so the tree is cut at "
                "its root. Raise the minimum confidence to see what it depends on.",
                icon=":material/lightbulb:",
            )
    left, right = st.columns([6, 7], gap="medium")
    with left:
        steps = path_steps(tree, node_of(rule))
        st.html(
            heading("From the root to the rule")
            + path_table(steps, tree.dimension, leaf=compact is not None)
        )
    with right:
        place(rule, behind)
    st.html(features_of(key_of(rule, behind), tree, rule, behind.demonstrations))


def make_ready(rule: Rule, behind: Behind) -> None:
    """Make what takes longest to make of a rule that may be looked at next."""
    tree = behind.tree(rule)
    features_of(key_of(rule, behind), tree, rule, behind.demonstrations)
    tree_picture.make_ready(
        behind.digest,
        tree,
        behind.thresholds,
        node_of(rule),
        note=note_of(tree, behind),
        leaves=behind.compact is not None,
    )


def key_of(rule: Rule, behind: Behind) -> tuple[object, ...]:
    """What tells a rule from all others, those of other data included."""
    tree = behind.tree(rule)
    return tree.source.digest, tree.divider, behind.digest, rule.id


def show_origin(rule: Rule, rule_set: RuleSet) -> None:
    """The numbers of a compact rule over the pairs it was built from."""
    built, divided = rule_set.source, ""
    if rule_set.actions[rule.dimension].is_interval:
        divided = f" (divider {rule_set.divider})"
    st.caption(
        f"Over the {built.steps:,} pairs that the compact set was built from{divided}: "
        f"{measures_text(rule)}, {counted(rule.samples, 'state')}. Everything else here is of the "
        "chosen demonstrations."
    )


def place(rule: Rule, behind: Behind) -> None:
    """The path lit in the tree."""
    tree = behind.tree(rule)
    st.html(heading("Its place in the tree"))
    tree_picture.show_tree(
        behind.digest,
        tree,
        behind.thresholds,
        node_of(rule),
        around="Around this rule",
        widget="tree",
        note=note_of(tree, behind),
        leaves=behind.compact is not None,
    )


def note_of(tree: PolicyTree, behind: Behind) -> str:
    """What the boxes of a tree are."""
    return f"{counted(tree.n_nodes, 'node')}; each box is as wide as its share of the states. " + (
        "Rules are full in colour, what is cut off below them is grey."
        if behind.compact is None
        else "Every leaf is a rule, full in colour."
    )


@cached()
def features_of(
    key: tuple[object, ...], _tree: PolicyTree, _rule: Rule, _demonstrations: Demonstrations
) -> str:
    """The interval on each feature against its distribution, and some states of the rule."""
    parts = []
    if _rule.conditions:
        found = feature_evidence(_demonstrations, _tree, _rule)
        figures = features_html(found, _tree.source.features, label_colour(_rule.action))
        parts.append(heading("What it asks, feature by feature") + figures)
    if _rule.samples:
        title = "Example states" if _rule.samples > 1 else "The one state it applies to"
        parts.append(heading(title) + examples_html(_demonstrations, _tree, _rule))
    return "".join(parts)
