"""Rules: every rule in plain language, with the evidence behind it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import _compact
import _edits
import _state as state
import streamlit as st
from _rule_table import column_config, frame, table_height
from _tree_picture import tree_picture, tree_place
from _words import escaped

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.evidence import feature_evidence, path_steps
from sarl_core.explaining.evidence_words import evidence_bar, evidence_text, intervals_text
from sarl_core.explaining.exports import rules_to_csv, rules_to_text
from sarl_core.explaining.language import (
    action_text,
    conditions_text,
    counted,
    sentence,
    share_text,
)
from sarl_core.explaining.path_table import path_table
from sarl_core.explaining.rule_examples import examples_html
from sarl_core.explaining.rule_features import features_html
from sarl_core.mining.holding_out import lower_bound, verdict, with_lower_bound
from sarl_core.mining.rule_files import rules_to_json
from sarl_core.mining.rules import Rule, RuleSet, node_of
from sarl_core.mining.tree import PolicyTree

TABLE_ROWS = 8
MEASURES = """
**Support**: share of all states to which the rule applies.

**Confidence**: share of those in which the expert did what the rule says.

**Lift**: confidence over the action's share of all states; above 1, the conditions make the action
more frequent than it is overall.

**Joint support**: share of all states to which the rule applies and in which it is right.
"""
WHOLE_TREE, AROUND = "Whole tree", "Around this rule"

st.title("Rules")
_edits.notice()
demonstrations = state.require_demonstrations()
compact = _compact.chosen_compact(demonstrations)
thresholds = state.chosen_thresholds()
grown = state.trees(demonstrations, state.chosen_divider()) if compact is None else compact.trees


@st.cache_resource(max_entries=12, show_spinner="Writing the rules in plain language …")
def table_of(key: tuple[object, ...], _rule_set: RuleSet) -> tuple[tuple[Rule, ...], Any]:
    """All rules, the most support first, and the same as a data frame."""
    rules = tuple(sorted(_rule_set.rules, key=lambda rule: -rule.samples))
    return rules, frame(rules, _rule_set)


def key_of(rule: Rule) -> tuple[object, ...]:
    """What tells a rule from all others, those of other data included."""
    tree = grown[rule.dimension]
    return tree.source.digest, tree.divider, compact.digest if compact else "", rule.id


@st.cache_resource(max_entries=96, show_spinner=False)
def features_of(
    key: tuple[object, ...], _tree: PolicyTree, _rule: Rule, _demonstrations: Demonstrations
) -> str:
    """A rule's intervals in HTML."""
    found = feature_evidence(_demonstrations, _tree, _rule)
    return features_html(found, _demonstrations.features, label_colour(_rule.action))


@st.cache_resource(max_entries=96, show_spinner=False)
def examples_of(
    key: tuple[object, ...], _tree: PolicyTree, _rule: Rule, _demonstrations: Demonstrations
) -> str:
    """Some states of a rule, under a heading."""
    heading = "Example states" if _rule.samples > 1 else "The one state it applies to"
    return f"<h3>{heading}</h3>{examples_html(_demonstrations, _tree, _rule)}"


def downloads(rule_set: RuleSet) -> None:
    """The whole rule set as files, made when asked for."""
    name = f"rules-{demonstrations.env_id.replace('/', '-') or 'unnamed'}"
    for kind, mime, make in (
        ("JSON", "application/json", rules_to_json),
        ("CSV", "text/csv", rules_to_csv),
        ("Text", "text/plain", rules_to_text),
    ):
        suffix = "txt" if kind == "Text" else kind.lower()
        st.download_button(
            kind,
            data=partial(make, rule_set),
            mime=mime,
            file_name=f"{name}.{suffix}",
            on_click="ignore",
            icon=":material/download:",
            key=f"download_{suffix}",
            help=f"All {len(rule_set):,} rules" if len(rule_set) != 1 else "The one rule",
        )


def nothing_in_force() -> None:
    """What to do where no rule is in force."""
    st.info(
        f"No part of the tree has a support of at least {thresholds.support:g} and a confidence "
        f"of at least {thresholds.confidence:g}, so there is no rule. Lower one of them on the "
        "Thresholds page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")


def pick(shown: list[int], rules: tuple[Rule, ...]) -> None:
    """Choose the rule whose row was selected."""
    rows = st.session_state["rule_table"]["selection"]["rows"]
    if rows and rows[0] < len(shown):
        state.set_url_choice("rule", rules[shown[rows[0]]].id)


def select_row(place: int | None) -> None:
    """Select a row of the table, or none, before it is drawn; it keeps a choice of its own."""
    kept = st.session_state.get("rule_table")
    rows = [] if place is None else [place]
    if kept is not None and list(kept["selection"]["rows"]) != rows:
        st.session_state["rule_table"] = {"selection": {"rows": rows}}


def walk(shown: list[int], rules: tuple[Rule, ...], place: int | None) -> None:
    """The buttons from rule to rule, in the order of the table."""
    before = None if not place else rules[shown[place - 1]].id
    at = -1 if place is None else place  # a rule that is not in the table stands before it
    after = rules[shown[at + 1]].id if at + 1 < len(shown) else None
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        for name, icon, rule_id in (
            ("Previous rule", ":material/chevron_left:", before),
            ("Next rule", ":material/chevron_right:", after),
        ):
            st.button(
                name,
                icon=icon,
                key=name.split()[0].lower(),
                on_click=state.set_url_choice,
                args=("rule", rule_id),
                disabled=rule_id is None,
                help="In the order of support, the most first",
            )


def matching(rules: tuple[Rule, ...], rule_set: RuleSet) -> list[int]:
    """Places of the rules that the search and the choice of action let through."""
    names = list(
        dict.fromkeys(
            action_text(label, dimension)
            for dimension in rule_set.actions
            for label in range(dimension.n_labels)
        )
    )
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        words = st.text_input(
            "Search",
            key="search",
            bind="query-params",
            icon=":material/search:",
            width=300,
            placeholder="a feature, an action, a number",
            label_visibility="collapsed",
        )
        action = st.selectbox(
            "Action",
            ["every action", *names],
            key="action",
            bind="query-params",
            width=220,
            label_visibility="collapsed",
        )
        least = lower_bound_choice() if compact is None else 0.0
        if compact is not None:
            downloads(compact.shipped)
        else:
            downloads(with_lower_bound(rule_set, least) if least else rule_set)
    wanted = (words or "").lower().split()
    places = []
    for place, rule in enumerate(rules):
        does = action_text(rule.action, rule_set.actions[rule.dimension])
        if action not in ("every action", does):
            continue
        if least and lower_bound(rule) < least:
            continue
        if wanted:
            text = f"{conditions_text(rule, rule_set)} {does} {rule.id}".lower()
            if not all(word in text for word in wanted):
                continue
        places.append(place)
    return places


def lower_bound_choice() -> float:
    """The least lower bound of a rule; 0 for any."""
    least = st.number_input(
        "Lower bound at least",
        0.0,
        1.0,
        0.0,
        0.05,
        key="lower",
        bind="query-params",
        width=150,
        help="Only rules whose 95 % interval of confidence lies at or above this, on the held-out "
        "episodes where there are some. The downloads hold these rules. 0: all.",
    )
    return float(least or 0.0)


@st.fragment
def search_and_rules(rule_set: RuleSet) -> None:
    """What is searched for, and the rules that match."""
    key = (
        (rule_set.source.digest, rule_set.divider, thresholds, state.held_out_digest())
        if compact is None
        else (compact.digest,)
    )
    rules, table = table_of(key, rule_set)
    shown = matching(rules, rule_set)
    if shown:
        table_and_rule(rules, table, shown, rule_set)
    else:
        state.url_choice("rule", [rule.id for rule in rules], rules[0].id)
        st.info(
            "No rule matches the search; clear it, and the lower bound, to see all.",
            icon=":material/search_off:",
        )


@st.fragment
def table_and_rule(
    rules: tuple[Rule, ...], table: Any, shown: list[int], rule_set: RuleSet
) -> None:
    """The table of rules, and the chosen one: another choice runs this part alone."""
    chosen_id = state.url_choice("rule", [rule.id for rule in rules], rules[0].id)
    place = next((row for row, at in enumerate(shown) if rules[at].id == chosen_id), None)
    select_row(place)
    st.dataframe(
        table.iloc[shown],
        hide_index=True,
        column_config=column_config(rule_set),
        height=table_height(len(shown), TABLE_ROWS),
        key="rule_table",
        on_select=lambda: pick(shown, rules),
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if place is None else [place]}},
        alt="All rules in force",
    )
    kind = "" if compact is None else "compact "
    count = f"{len(rules):,} {kind}rules" if len(rules) > 1 else f"One {kind}rule"
    st.caption(
        (f"{len(shown):,} of {count.lower()} match. " if len(shown) < len(rules) else f"{count}. ")
        + "Click a heading to sort, the box at the left of a row to see the rule below."
    )
    show_rule(
        next(rule for rule in rules if rule.id == chosen_id),
        rule_set,
        lambda: walk(shown, rules, place),
    )


def show_rule(rule: Rule, rule_set: RuleSet, buttons: Callable[[], None]) -> None:
    """One rule and everything behind it."""
    tree = grown[rule.dimension]
    node = node_of(rule)
    with st.container(border=True, key="sentence"):
        buttons()
        reached = rule.samples > 0
        st.markdown(f"#### {escaped(sentence(rule, rule_set, evidence=reached))}")
        st.caption(
            f"Rule {rule.id} · "
            + (f"{measures(rule)} · " if reached else "")
            + f"{counted(rule.length, 'condition')} on {counted(rule.merged_length, 'feature')}"
            + (f"  \n{sureness(rule)}" if reached and compact is None else ""),
            help=MEASURES,
        )
        if compact is not None:
            show_origin(compact.as_shipped(rule), compact.shipped)
        elif reached:
            st.html(evidence_bar(rule, thresholds.confidence))
        if not reached:
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
        st.subheader("From the root to the rule")
        st.html(path_table(path_steps(tree, node), tree.dimension, leaf=compact is not None))
    with right:
        show_tree(rule)
    if rule.conditions:
        show_features(rule)
    show_examples(rule)


def measures(rule: Rule) -> str:
    """The numbers of a rule."""
    return (
        f"support {share_text(rule.support)} · confidence {share_text(rule.confidence)} · "
        f"lift {rule.lift:.2f} · joint support {share_text(rule.joint_support)}"
    )


def sureness(rule: Rule) -> str:
    """How sure the rule is, on what it was mined from and on what was held out."""
    words = f"{evidence_text(rule)} · {intervals_text(rule)}"
    below = rule.held_out is not None and verdict(rule, thresholds.confidence) == "below"
    return f":red[{words}; too low]" if below else words


def show_origin(rule: Rule, rule_set: RuleSet) -> None:
    """The numbers of a compact rule over the pairs it was built from."""
    built, divided = rule_set.source, ""
    if rule_set.actions[rule.dimension].is_interval:
        divided = f" (divider {rule_set.divider})"
    st.caption(
        f"Over the {built.steps:,} pairs that the compact set was built from{divided}: "
        f"{measures(rule)}, {counted(rule.samples, 'state')}. Everything else here is of the "
        "chosen demonstrations."
    )


def show_tree(rule: Rule) -> None:
    """The path lit in the tree."""
    tree = grown[rule.dimension]
    st.subheader("Its place in the tree")
    view = WHOLE_TREE
    if rule.samples:
        view = st.segmented_control(
            "Tree",
            [AROUND, WHOLE_TREE],
            default=AROUND,
            key="tree",
            bind="query-params",
            required=True,
            label_visibility="collapsed",
        )
    note = f"{counted(tree.n_nodes, 'node')}; each box is as wide as its share of the states. " + (
        "Rules are full in colour, what is cut off below them is grey. "
        if compact is None
        else "Every leaf is a rule, full in colour. "
    )
    key = compact.digest if compact is not None else ""
    leaves, dark = compact is not None, state.is_dark()
    if view == AROUND:
        with st.container(key="tree_figure"):
            st.html(
                tree_place(
                    key, tree, thresholds, node_of(rule), note=note, leaves=leaves, dark=dark
                )
            )
    else:
        st.plotly_chart(
            tree_picture(
                key, tree, thresholds, node_of(rule), around=False, leaves=leaves, dark=dark
            ),
            key="tree_figure",
            config={"displaylogo": False, "scrollZoom": True},
            alt="The decision tree with the path of the rule",
        )
        st.caption(
            note
            + ("" if rule.samples else "No state reaches this rule, so its box has no width. ")
            + "Drag or scroll to zoom, double-click to go back."
        )


def show_features(rule: Rule) -> None:
    """The interval on each feature against its distribution."""
    st.subheader("What it asks, feature by feature")
    with st.container(key="features"):
        st.html(features_of(key_of(rule), grown[rule.dimension], rule, demonstrations))


def show_examples(rule: Rule) -> None:
    """Some states to which the rule applies."""
    if rule.samples:
        with st.container(key="examples"):
            st.html(examples_of(key_of(rule), grown[rule.dimension], rule, demonstrations))


with st.spinner("Mining the rules …"):
    in_force = state.rule_set(grown, thresholds) if compact is None else compact.counted
if not in_force.rules:
    nothing_in_force()
else:
    search_and_rules(in_force)
