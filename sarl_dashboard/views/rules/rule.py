"""One rule and everything behind it: the sentence, the path, the features, example states.

What changes with the rule comes as a few pieces of HTML: each element of Streamlit takes its time,
and the next rule should be there at once.
"""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st
from markupsafe import Markup

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.combination_plots import combination_plots
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.path import path_table
from sarl_core.explaining.html.rule_card import measures_text, rule_card
from sarl_core.explaining.html.rule_combinations import combinations_html
from sarl_core.explaining.html.rule_examples import examples_html
from sarl_core.explaining.html.rule_features import features_html
from sarl_core.explaining.tables.rule_evidence import feature_evidence, path_steps
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, node_of
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.cache import cached
from sarl_dashboard.components import tree_picture
from sarl_dashboard.components.journey.steps_needed import say_of_sample
from sarl_dashboard.state import rule_base
from sarl_dashboard.views.rules.in_force import InForce, TreePlace


def show_rule(rule: Rule, in_force: InForce, buttons: Callable[[], None]) -> None:
    """One rule and everything behind it.

    Args:
        rule: One of those in force.
        in_force: All of them, and what they come from.
        buttons: Draws what leads to other rules.
    """
    place, compact = in_force.place(rule), in_force.compact
    with st.container(border=True, key="sentence"):
        buttons()
        at_thresholds = rule_base.at_thresholds() and rule.origin == "mined"
        demands = at_thresholds and not rule.forbids
        threshold = in_force.thresholds.confidence if demands else None
        st.html(rule_card(rule, in_force.rule_set, threshold=threshold))
        if compact is not None and not in_force.edits:
            show_origin(compact.as_shipped(rule), compact.shipped)
        if not rule.enabled:
            st.markdown(":orange[:material/block: Switched off: a shield does not use this rule.]")
        if not rule.samples and in_force.demonstrations.sample_of is not None:
            st.info(
                "Not counted: only a sample of the steps is here. The page Edit says what the rule "
                "decides of it.",
                icon=":material/data_usage:",
            )
        elif not rule.samples:
            st.info(
                "No demonstrated state reaches this rule. It is for states that the expert never "
                "came into by itself and was asked about.",
                icon=":material/explore:",
            )
        if not rule.conditions and demands:
            st.info(
                "This rule has no conditions: over all states the expert's most frequent action "
                "is already as frequent as the minimum confidence asks, so the tree is cut at "
                "its root. Raise the minimum confidence to see what it depends on.",
                icon=":material/lightbulb:",
            )
    if place is None:
        st.caption(
            "Added by hand: no path of the tree leads to it."
            if rule.origin == "manual"
            else "Not of the trees that the chosen demonstrations grow, so its numbers are those "
            "of its file, and there is no path to show."
        )
        return
    left, right = st.columns([6, 7], gap="medium")
    with left:
        steps = path_steps(place.tree, place.node)
        st.html(
            heading("From the root to the rule")
            + path_table(steps, place.tree.dimension, leaf=compact is not None)
        )
    with right:
        st.html(heading("Its place in the tree"))
        tree_picture.show_tree(path_of(place, in_force), around="Around this rule", widget="tree")
    say_of_sample("The histograms and example states below", in_force.demonstrations)
    st.html(features_of(place.tree, rule, in_force.demonstrations))


def make_ready(rule: Rule, in_force: InForce) -> None:
    """Make what takes longest to make of a rule that may be looked at next."""
    place = in_force.place(rule)
    if place is not None:
        features_of(place.tree, rule, in_force.demonstrations)
        tree_picture.make_ready(path_of(place, in_force))


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


def path_of(place: TreePlace, in_force: InForce) -> tree_picture.PathInTree:
    """The path to a rule."""
    return tree_picture.PathInTree(
        tree=place.tree,
        cut_at=in_force.thresholds if in_force.compact is None else None,
        node=place.node,
        note=note_of(place.tree, in_force),
    )


def note_of(tree: PolicyTree, in_force: InForce) -> str:
    """What the boxes of a tree are."""
    if in_force.rule_set.forbids:
        return (
            f"{counted(tree.n_nodes, 'node')}; each box is as wide as its share of the states, in "
            "the colour of what the expert did most often. The lit path ends at the rule."
        )
    return f"{counted(tree.n_nodes, 'node')}; each box is as wide as its share of the states. " + (
        "Rules are full in colour, what is cut off below them is grey."
        if in_force.compact is None
        else "Every leaf is a rule, full in colour."
    )


@cached()
def features_of(tree: PolicyTree, rule: Rule, demonstrations: Demonstrations) -> Markup:
    """The interval on each feature against its distribution, and some states of the rule."""
    parts = []
    if rule.conditions:
        evidence = feature_evidence(demonstrations, tree, rule)
        figures = features_html(evidence, tree.source.features, label_colour(rule.label))
        parts.append(heading("What it asks, feature by feature") + figures)
        features = tree.source.features
        planes = combination_plots(demonstrations, rule, tree.dimension, features)
        if planes:
            drawn = combinations_html(planes, features, tree.dimension)
            parts.append(heading("What it asks of two features together") + drawn)
    node = tree.place_of(node_of(rule))
    if node is not None and rule.samples and not len(tree.rows(node)):
        parts.append(heading("None of its states is in the sample"))
    elif rule.samples:
        title = "Example states" if rule.samples > 1 else "The one state it applies to"
        parts.append(heading(title) + examples_html(demonstrations, tree, rule))
    return Markup().join(parts)
