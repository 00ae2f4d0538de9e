"""What the What if page shows of one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import streamlit as st
from _rule_table import table_height
from _tree_picture import tree_picture
from _words import escaped
from numpy.typing import NDArray
from streamlit.delta_generator import DeltaGenerator

from sarl_core.explaining.language import action_text, counted, sentence
from sarl_core.explaining.lit_path import PathFinder, lit_path_table
from sarl_core.explaining.path_table import label_key
from sarl_core.explaining.what_if import (
    change_text,
    condition_views,
    exact_text,
    executed_text,
    near_miss_text,
    node_of_way,
    outside_texts,
    with_unit,
)
from sarl_core.explaining.what_if_figures import lines_figure
from sarl_core.mining.rules import Rule, RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_core.shielding.near import (
    DecisionChange,
    Line,
    NearMiss,
    Neighbourhood,
    decision_changes,
)
from sarl_core.shielding.sampling import Span

PLAIN = {"displayModeBar": False}
MISSES, PAIRS = 8, 4  # near misses that lack one feature, and two
ROWS = 8
WHOLE_TREE, AROUND = "Whole tree", "Around it"
PLACED = "A person gave this rule its place: it is asked before the tree is."


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
    dark: bool,
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
        dark: Whether the theme is.
        key: Tells the rules from all others.
    """
    rule_set = neighbourhood.shield.rule_set
    decision = neighbourhood.shield.decide(state, action)
    lines = neighbourhood.lines(state, action)
    with beside:
        dimension = chosen_dimension(rule_set)
        headline(decision, rule_set, neighbourhood.shield.outside)
        found = decision.rules[dimension]
        rule = None if found is None else rule_set.rules[found]
        show_rule(rule, state, rule_set)
        show_lines(lines, spans, state, order, dimension, rule_set, dark=dark)
    show_changes(lines, state, spreads, spans, rule_set)
    show_misses(neighbourhood, state, spreads, rule_set)
    node = None
    if dimension < len(trees):
        node = node_of_way(rule, state, rule_set, trees[dimension], leaves=leaves)
    if node is None:
        show_way(finder(), dimension, state, -1 if found is None else found)
    else:
        show_tree(rule, node, trees[dimension], rule_set, leaves=leaves, dark=dark, key=key)


def chosen_dimension(rule_set: RuleSet) -> int:
    """The action dimension that is looked at."""
    if len(rule_set.actions) == 1:
        return 0
    names = [f"{index + 1}. {action.name}" for index, action in enumerate(rule_set.actions)]
    chosen = st.selectbox(
        "Action dimension", names, key="dimension", bind="query-params", width=320
    )
    return names.index(chosen)


def headline(decision: Any, rule_set: RuleSet, outside: str) -> None:
    """What is executed."""
    proposed, executed = (
        executed_text(tuple(np.asarray(values, dtype=float).reshape(-1).tolist()), rule_set.actions)
        for values in (decision.proposed, decision.executed)
    )
    abstains = decision.outside and outside == "abstain"
    with st.container(border=True, key="decision"):
        with st.container(horizontal=True, gap="small"):
            if decision.intervened:
                st.badge("Changed by the rules", icon=":material/edit:", color="orange")
            elif abstains:
                st.badge("Rule abstains", icon=":material/do_not_disturb_on:", color="gray")
            elif any(rule is not None for rule in decision.rules):
                st.badge("Allowed by the rules", icon=":material/check:", color="green")
            else:
                st.badge("No rule applies", color="gray")
            if decision.outside:
                st.badge("Outside the data", icon=":material/frame_inspect:", color="red")
        st.markdown(
            f"#### The agent wants {escaped(proposed)}; executed is {escaped(executed)}"
            if decision.intervened
            else f"#### {escaped(executed[:1].upper() + executed[1:])} is executed, as the agent "
            "wants"
        )


def show_rule(rule: Rule | None, state: NDArray[np.float32], rule_set: RuleSet) -> None:
    """The rule that applies, its conditions beside the state's values, and its data."""
    if rule is None:
        st.markdown(
            ":gray[No rule applies to this state: the agent's action is passed on as it is.]"
        )
        return
    st.markdown(f"**Rule {escaped(rule.id)}.** {escaped(sentence(rule, rule_set))}")
    values = tuple(state.astype(np.float64).tolist())
    if rule.conditions:
        views = condition_views(rule, values, rule_set)
        st.dataframe(
            {
                "Condition": [view.condition for view in views],
                "The state has": [view.value for view in views],
                "Room to move": [view.room for view in views],
            },
            hide_index=True,
            height=table_height(len(views), ROWS),
            key="conditions",
            alt="The rule's conditions and the state's values",
        )
    if rule.box is None:
        st.caption("It is not kept where the data of this rule lay.")
        return
    texts = outside_texts(rule, values, rule_set.source.features)
    if not texts:
        st.caption(
            ":material/frame_inspect: The state lies inside this rule's data: every feature is "
            "between the least and the largest value seen where it applies."
        )
        return
    shown = "; ".join(escaped(text) for text in texts[:3])
    more = f"; and {counted(len(texts) - 3, 'feature')} more" if len(texts) > 3 else ""
    st.markdown(f":material/frame_inspect: **Outside this rule's data:** {shown}{more}.")


def show_lines(
    lines: Sequence[Line],
    spans: Sequence[Span],
    state: NDArray[np.float32],
    order: Sequence[int],
    dimension: int,
    rule_set: RuleSet,
    *,
    dark: bool,
) -> None:
    """What would be executed along each feature."""
    st.markdown("**If one feature were different, and all others as they are**")
    st.html(label_key(rule_set.actions[dimension]))
    st.plotly_chart(
        lines_figure(
            [lines[index] for index in order],
            [(spans[index].low, spans[index].high) for index in order],
            [float(state[index]) for index in order],
            [rule_set.source.features[index] for index in order],
            dimension,
            rule_set,
            dark=dark,
        ),
        key="lines",
        config=PLAIN,
        alt="For each feature, what would be executed along its range; the present value is marked",
    )
    st.caption(
        "Each bar is a feature from its least to its largest demonstrated value, the mark is the "
        "state. Full colour: a rule decides. Pale: the agent's action is passed on."
    )


def show_changes(
    lines: Sequence[Line],
    state: NDArray[np.float32],
    spreads: NDArray[np.float64],
    spans: Sequence[Span],
    rule_set: RuleSet,
) -> None:
    """The least change of each feature that makes the shield execute another action."""
    st.subheader("The least change that changes the decision")
    found = sorted(
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
    if not found:
        st.info("No change of a single feature changes what is executed.", icon=":material/lock:")
        return
    first = found[0]
    feature = rule_set.source.features[first.change.feature]
    st.markdown(
        f"Executed would be **{escaped(does(first, rule_set))}** if "
        f"{escaped(change_text(first.change, feature))}."
    )
    st.dataframe(
        [change_row(change, spans, rule_set) for change in found],
        hide_index=True,
        height=table_height(len(found), ROWS),
        key="changes",
        column_config={
            "In spreads": st.column_config.NumberColumn(
                format="%.3g",
                help="The change in units of the feature's interquartile range, the width of the "
                "middle half of its demonstrated values",
            ),
            "From exactly": st.column_config.TextColumn(
                help="The nearest float32 number at which the decision is another: one step less "
                "changes nothing"
            ),
            "Demonstrated": st.column_config.CheckboxColumn(
                help="Whether values as far as this were demonstrated"
            ),
        },
        alt="The least change of each feature that changes the decision",
    )


def does(change: DecisionChange, rule_set: RuleSet) -> str:
    """The action after a change, in words."""
    return executed_text(tuple(change.executed.astype(float).tolist()), rule_set.actions)


def change_row(
    change: DecisionChange, spans: Sequence[Span], rule_set: RuleSet
) -> dict[str, object]:
    """One row of the table of changes."""
    index = change.change.feature
    feature, span = rule_set.source.features[index], spans[index]
    rules = [rule_set.rules[rule].id for rule in change.rules.tolist() if rule >= 0]
    return {
        "If": change_text(change.change, feature),
        "Executed": does(change, rule_set),
        "Rule": ", ".join(rules) or "none",
        "In spreads": change.distance,
        "From exactly": with_unit(exact_text(change.change.after), feature),
        "Demonstrated": span.low <= change.change.after <= span.high,
    }


def show_misses(
    neighbourhood: Neighbourhood,
    state: NDArray[np.float32],
    spreads: NDArray[np.float64],
    rule_set: RuleSet,
) -> None:
    """The rules that nearly apply."""
    st.subheader("Rules that nearly apply")
    found = [
        *neighbourhood.near_misses(state, spreads, most=MISSES),
        *neighbourhood.near_misses(state, spreads, features=2, most=PAIRS),
    ]
    if not found:
        st.info(
            "No rule would apply if one or two features were different.", icon=":material/block:"
        )
        return
    st.dataframe(
        [miss_row(miss, rule_set) for miss in found],
        hide_index=True,
        height=table_height(len(found), MISSES + PAIRS),
        key="misses",
        column_config={
            "In spreads": st.column_config.NumberColumn(
                format="%.3g",
                help="The change in units of the features' interquartile ranges, summed up",
            ),
            "In force": st.column_config.CheckboxColumn(
                help="Whether it would then decide; else a rule that was given its place before "
                "it does"
            ),
            "Would apply if": st.column_config.TextColumn(width=520),
        },
        alt="Rules that would apply if one or two features were different",
    )
    st.caption(
        "First those that lack one feature, then those that lack two; each with the least change "
        "that lets it apply."
    )


def miss_row(miss: NearMiss, rule_set: RuleSet) -> dict[str, object]:
    """One row of the table of near misses."""
    rule = rule_set.rules[miss.rule]
    features = rule_set.source.features
    return {
        "Rule": rule.id,
        "Says": action_text(rule.action, rule_set.actions[rule.dimension]),
        "Would apply if": near_miss_text(miss.changes, features),
        "In spreads": miss.distance,
        "In force": miss.in_force,
        "From exactly": ", ".join(
            with_unit(exact_text(change.after), features[change.feature]) for change in miss.changes
        ),
    }


def show_way(finder: PathFinder, dimension: int, state: NDArray[np.float32], rule: int) -> None:
    """The way of the state through rules that are not of the tree on screen, in a table."""
    st.subheader("Its way through the rules")
    rules = finder.rule_set.rules
    if rule >= 0 and rules[rule].placed:
        st.caption(PLACED)
    st.html(lit_path_table(finder.path(dimension, state, rule), finder.rule_set, dimension))
    st.caption(
        "These rules were not cut from the tree of the chosen demonstrations, so it is not drawn."
    )


def show_tree(
    rule: Rule | None,
    node: int,
    tree: PolicyTree,
    rule_set: RuleSet,
    *,
    leaves: bool,
    dark: bool,
    key: str,
) -> None:
    """The way of the state through the tree."""
    st.subheader("Its way through the tree")
    if rule is not None and rule.placed:
        st.caption(PLACED)
    view = st.segmented_control(
        "Tree",
        [AROUND, WHOLE_TREE],
        default=AROUND,
        key="whole_tree",
        bind="query-params",
        required=True,
        label_visibility="collapsed",
    )
    mined = rule is not None and rule.origin == "mined"
    around = view == AROUND and int(tree.samples[node]) > 0
    st.plotly_chart(
        tree_picture(key, tree, rule_set.thresholds, node, around=around, leaves=leaves, dark=dark),
        key="tree_figure",
        config={"displaylogo": False, "scrollZoom": True},
        alt="The decision tree with the way of the state",
    )
    st.caption(
        "The lit path is the state's: it ends at the rule that applies."
        if mined
        else "The lit path is the state's: it ends at a leaf, and no part of it is a mined rule "
        "that applies."
    )
