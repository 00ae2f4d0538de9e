"""A part of the tree that is regrown from another query, on the page Edit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.explaining.words.edits import edits_change_text
from sarl_core.mining.editing.edits import Regrow
from sarl_core.mining.editing.regrowing import NextQuery, Way, next_queries, tree_for, way_to
from sarl_core.mining.language import counted, query_text
from sarl_core.mining.rules import Condition, Operator, Rule, node_of
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_core.mining.tree import PolicyTree, splits_of
from sarl_core.shielding.effects import Verdicts, change
from sarl_dashboard.cache import cached
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.lists.rows import row_choice
from sarl_dashboard.components.tables import row_height, rows_selected_anew, table_height
from sarl_dashboard.state import edits, in_force
from sarl_dashboard.state.data import chosen_demonstrations, held_out_demonstrations
from sarl_dashboard.state.mined import Trees, mined_landscape
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.url import leave_to_page, set_url_choice, url_choice
from sarl_dashboard.text import escaped, in_full

TABLE_ROWS = 10
# Up to which every query is tried without being chosen: of the part, and of the demonstrations.
MOST_GROWN, MOST_COUNTED = 30_000, 250_000


@dataclass(frozen=True, eq=False)
class TreePart:
    """What lies below a node, and the rules that it is of.

    Attributes:
        base: Without edits.
        now: What the rules say with the edits so far.
        trees: With the edits so far, one an action dimension.
        dimension: Action dimension of the tree.
        place: Of the node in the tree.
        rules: How many are cut below it.
    """

    base: Base
    now: Verdicts
    trees: Trees
    dimension: int
    place: int
    rules: int

    @property
    def tree(self) -> PolicyTree:
        """The tree that it is a part of."""
        return self.trees[self.dimension]

    @property
    def number(self) -> int:
        """Of the node, by which rules are called."""
        return int(self.tree.number[self.place])

    def edit(self, query: NextQuery) -> Regrow:
        """The edit that lets the node ask a query."""
        return Regrow(self.dimension, self.number, query.feature, query.threshold)


@dataclass(frozen=True, eq=False)
class QueryOutcome:
    """What a query would do.

    Attributes:
        below: Rules of the part.
        whole: Of all rules, mined at the thresholds: one cell.
    """

    below: int
    whole: Landscape


_next_queries = cached(show_spinner="Looking for the next best conditions …")(next_queries)


def part(of: Base, rule: Rule, now: Verdicts) -> None:
    """Choose a node on the way to a rule and another query, and regrow what lies below it."""
    with st.container(border=True, key="regrow"):
        st.markdown("**Regrow a part of the tree**")
        demonstrations = chosen_demonstrations()
        if demonstrations is not None and say_steps_needed(
            "regrowing a part of the tree", demonstrations
        ):
            return
        try:
            trees = edits.trees_with(of, edits.history(of).edits)
        except InputError as problem:
            st.caption(in_full(str(problem)))
            return
        if trees is None:
            st.caption("Only rules at the thresholds have a tree; these came as they are.")
            return
        _say_hidden(of, trees)
        way = _way(trees[rule.dimension], rule, of)
        if not way.places:
            st.caption(
                "Choose a mined rule that lies below a node of the tree: this one was written by "
                "hand, asks nothing, or is no longer where the tree is cut."
            )
            return
        chosen = _chosen_part(way, rule, now, TreePart(of, now, trees, rule.dimension, 0, 0))
        _queries(chosen)


def _way(tree: PolicyTree, rule: Rule, of: Base) -> Way:
    place = tree.place_of(node_of(rule)) if rule.origin == "mined" else None
    if place is None:
        return Way((), ())
    return way_to(tree, place, of.rule_set.thresholds)


def _say_hidden(of: Base, trees: Trees) -> None:
    """Say which parts were regrown and change nothing at these thresholds."""
    hidden = 0
    for edit in edits.history(of).edits:
        if isinstance(edit, Regrow):
            tree = trees[edit.dimension]
            place = tree.place_of(edit.node)
            if place is not None:  # else one that was regrown later took its place
                hidden += place not in way_to(tree, place, of.rule_set.thresholds).places
    if hidden:
        lies = "lies" if hidden == 1 else "lie"
        st.caption(
            f":material/visibility_off: {counted(hidden, 'regrown part')} {lies} below a rule at "
            "these thresholds, where nothing is seen of it: every path ends at the first node that "
            "reaches them. It comes back with the thresholds."
        )


def _chosen_part(way: Way, rule: Rule, now: Verdicts, whole: TreePart) -> TreePart:
    """The widget for the node."""
    tree = whole.tree
    numbers = [str(tree.number[place]) for place in way.places]
    number = url_choice("part", numbers, numbers[-1])
    key = f"regrow_node_{rule.id}"
    st.session_state[key] = numbers.index(number)

    def choose() -> None:
        set_url_choice("part", numbers[st.session_state[key]])
        set_url_choice("regrow", "")

    at = st.selectbox(
        f"Node on the way to {now.rule_set.name_of(rule)}",
        range(len(numbers)),
        format_func=lambda at: _node_text(tree, way, at),
        key=key,
        on_change=choose,
        help=with_words(
            "What lies below this node is grown anew. The last one on the way is the smallest "
            "part; the first is the whole tree."
        ),
    )
    return TreePart(whole.base, now, whole.trees, whole.dimension, way.places[at], way.rules[at])


def _node_text(tree: PolicyTree, way: Way, at: int) -> str:
    """As "after pole angle ≤ 0.02 rad: 412 states, 2 rules below"."""
    place = way.places[at]
    counts = f"{counted(int(tree.samples[place]), 'state')}, {counted(way.rules[at], 'rule')} below"
    if not at:
        return f"The root: all {counts}"
    above = way.places[at - 1]
    op: Operator = "<=" if int(tree.children_left[above]) == place else ">"
    query = Condition(int(tree.feature[above]), op, float(tree.threshold[above]))
    return f"{at}. After {query_text(query, tree.source.features)}: {counts}"


# --- the queries -------------------------------------------------------------------------------


def _queries(chosen: TreePart) -> None:
    """The table, and what the chosen query would do."""
    demonstrations = chosen_demonstrations()
    assert demonstrations is not None
    queries = _next_queries(chosen.tree, chosen.number, demonstrations)
    if all(query.current for query in queries):
        st.caption("No other condition parts the states of this node.")
        return
    texts = [chosen.edit(query).text for query in queries]
    link = st.query_params.get("regrow", "")
    if link not in ("", *texts, st.session_state.get("_regrow")):
        misfit = _misfit(link, chosen)
        if misfit:
            st.warning(in_full(misfit), icon=":material/link_off:")
            leave_to_page("regrow")
    choice = url_choice("regrow", ["", *texts], "")
    row = texts.index(choice) if choice in texts else None
    every = chosen.tree.samples[chosen.place] <= MOST_GROWN and len(demonstrations) <= MOST_COUNTED
    outcomes = [
        _outcome(chosen, query) if every or query.current or at == row else None
        for at, query in enumerate(queries)
    ]
    key = f"regrow_table_{hash((chosen.base.key, tuple(texts)))}"

    def pick() -> None:
        rows = rows_selected_anew(key, row)
        if rows is not None:
            set_url_choice("regrow", texts[rows[0]] if rows and rows[0] < len(texts) else "")

    names = _query_texts(chosen.tree, queries, demonstrations)
    high = row_height(chosen.now.rule_set)
    st.dataframe(
        _rows(names, queries, outcomes),
        hide_index=True,
        column_config=_columns(),
        height=table_height(len(queries), TABLE_ROWS, high),
        row_height=high,
        key=key,
        on_select=pick,
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="The next best conditions at the node, with what each would do",
    )
    row_choice(key, names, row, pick)
    st.caption(
        "Of each feature the threshold that parts the expert's actions best; the first row is as "
        "it is now. The numbers are of the rules mined at the thresholds, without other edits. "
        + (
            ""
            if every
            else "There are many states: what a condition does is seen once it is chosen. "
        )
        + "Click the box at the left of a row to choose its condition."
    )
    if row is not None and not queries[row].current:
        outcome = outcomes[row]
        assert outcome is not None
        _offer(chosen, names[row], chosen.edit(queries[row]), outcome)


def _misfit(link: str, chosen: TreePart) -> str:
    """Why what a link chooses cannot be chosen; "" where it is of another node of the tree."""
    try:
        edit = Regrow.of(link)
        place = tree_for(chosen.trees, edit).place_of(edit.node)
    except InputError as problem:
        return f"the link is not understood: {problem}"
    if place is None:
        return "the link is to a node that is not there; choose one on the way to the rule"
    if (edit.dimension, place) != (chosen.dimension, chosen.place):
        return ""
    return "the condition of the link is none of those offered here; choose one of the table"


@cached()
def _query_texts(
    tree: PolicyTree, queries: tuple[NextQuery, ...], demonstrations: Demonstrations
) -> list[str]:
    """In signs, with as many digits as tell the demonstrated states apart as the queries do."""
    feature = np.array([query.feature for query in queries], dtype=np.int64)
    threshold = np.array([query.threshold for query in queries])
    source = tree.source.with_splits(splits_of(feature, threshold, demonstrations.observations))
    return [
        query_text(Condition(query.feature, "<=", query.threshold), source.features)
        for query in queries
    ]


def _outcome(chosen: TreePart, query: NextQuery) -> QueryOutcome:
    """What comes of a query at the thresholds in force."""
    made = edits.history(chosen.base).edits
    if not query.current:
        made = (*made, chosen.edit(query))
    trees = edits.trees_with(chosen.base, made)
    assert trees is not None
    limits = chosen.base.rule_set.thresholds
    whole = mined_landscape(
        trees,
        (limits.support,),
        (limits.confidence,),
        lift=limits.lift,
        depth=limits.max_depth,
        held_out=held_out_demonstrations(),
    )
    tree = trees[chosen.dimension]
    place = tree.place_of(chosen.number)
    assert place is not None
    return QueryOutcome(way_to(tree, place, limits).rules[-1], whole)


def _rows(
    names: list[str], queries: tuple[NextQuery, ...], outcomes: list[QueryOutcome | None]
) -> Any:
    import pandas as pd

    def each(layer: str, times: float = 1.0) -> list[float]:
        values = []
        for outcome in outcomes:
            numbers = None if outcome is None else getattr(outcome.whole, layer)
            values.append(float("nan") if numbers is None else times * float(numbers[0, 0]))
        return values

    columns: dict[str, Any] = {
        "Condition": [
            f"{name} (now)" if query.current else name
            for name, query in zip(names, queries, strict=True)
        ],
        "Gain": [query.gain for query in queries],
        "Rules below": [None if outcome is None else outcome.below for outcome in outcomes],
        "Rules": each("rule_count"),
        "Mean length": each("mean_length"),
        "Coverage": each("coverage", 100),
        "Fidelity": each("fidelity", 100),
    }
    if any(one is not None and one.whole.held_out_fidelity is not None for one in outcomes):
        columns["Held out"] = each("held_out_fidelity", 100)
    return pd.DataFrame(columns)


def _columns() -> dict[str, Any]:
    column = st.column_config
    return {
        "Condition": column.TextColumn(
            width=270, help="Where it holds, a state goes one way from the node, else the other"
        ),
        "Gain": column.NumberColumn(
            width=75,
            format="%.4f",
            help="By how much it lowers Gini's impurity of the expert's actions at the node: what "
            "the tree itself is grown by",
        ),
        "Rules below": column.NumberColumn(
            width=95, help="Rules of the part below the node, at the thresholds in force"
        ),
        "Rules": column.NumberColumn(width=65, format="%d", help="Rules in all"),
        "Mean length": column.NumberColumn(
            width=100, format="%.2f", help="Conditions of a rule, on average"
        ),
        "Coverage": column.NumberColumn(
            width=85, format="%.2f %%", help="Share of the states in which some rule applies"
        ),
        "Fidelity": column.NumberColumn(
            width=85,
            format="%.2f %%",
            help="Share of the covered states in which the expert did as the rule says",
        ),
        "Held out": column.NumberColumn(
            width=85,
            format="%.2f %%",
            help="The same in the episodes held out, each of them counted once",
        ),
    }


def _offer(chosen: TreePart, name: str, edit: Regrow, outcome: QueryOutcome) -> None:
    """What taking a query would change, and the button."""
    then = edits.verdicts_of(chosen.base, (*edits.history(chosen.base).edits, edit))
    noun = edits.basis_of(chosen.base).noun
    rules = counted(outcome.below, "rule")
    has = f"still has {rules}"
    if outcome.below != chosen.rules:
        has = f"has {rules} instead of {chosen.rules:,}"
    text = edits_change_text(change(chosen.now, then), chosen.now, then, states=noun)
    st.markdown(
        escaped(
            f"If the node asks “{name}”, the part below it {has}. Against the set as it is now: "
            f"{text[:1].lower()}{text[1:]}"
        )
    )
    st.button(
        "Take this condition",
        on_click=_take,
        args=(chosen.base, edit),
        type="primary",
        icon=":material/account_tree:",
        key="take_query",
    )


def _take(of: Base, edit: Regrow) -> None:
    in_force.edit(of, edit)
    set_url_choice("regrow", "")
    trees, rules = edits.trees_with(of, edits.history(of).edits), edits.edited(of).rules
    if trees is None or any(rule.id == st.session_state.get("_rule") for rule in rules):
        return
    # The rule that was looked at is gone: one of those that took its place is the next to see.
    tree = trees[edit.dimension]
    place = tree.place_of(edit.node)
    for rule in rules:
        if rule.dimension == edit.dimension and rule.origin == "mined":
            end = tree.place_of(node_of(rule))
            if end is not None and place in tree.path(end):
                set_url_choice("rule", rule.id)
                return
