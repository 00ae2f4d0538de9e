"""The rules as edited, in a table on the page Edit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st

from sarl_core.explaining.words.edits import state_text
from sarl_core.mining.editing.edits import Edit, apply
from sarl_core.mining.language import action_text, conditions_text, counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.effects import Verdicts
from sarl_dashboard.cache import cached
from sarl_dashboard.components.settings import search_box, switch
from sarl_dashboard.components.tables import action_column, row_height, table_height
from sarl_dashboard.state import edits
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.url import set_url_choice, url_choice

TABLE_ROWS = 9
EVERY, TOUCHED = "All rules", "Edited"


@cached(show_spinner="Writing the rules in plain language …")
def _texts(rule_set: RuleSet) -> dict[str, tuple[str, str]]:
    return {rule.id: _text(rule, rule_set) for rule in rule_set.rules}


def _text(rule: Rule, rule_set: RuleSet) -> tuple[str, str]:
    does = action_text(rule.action, rule_set.actions[rule.dimension])
    return does, conditions_text(rule, rule_set)


def in_order(rule_set: RuleSet) -> list[int]:
    """Places of the rules, the placed ones in their order, then the largest first."""
    rules = rule_set.rules
    placed = [at for at, rule in enumerate(rules) if rule.placed]
    samples = np.array([rule.samples for rule in rules])
    samples[placed] = 0
    largest = np.argsort(-samples, kind="stable").tolist()
    first = set(placed)
    return placed + [at for at in largest if at not in first] if placed else largest


def table(of: Base, verdicts: Verdicts) -> Rule | None:
    """The rules as edited; returns the chosen one."""
    rule_set = verdicts.rule_set
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        words = search_box()
        view = switch("Show", "rules_shown", [EVERY, TOUCHED])
    made = edits.history(of).edits
    rows = _rows(edits.grown(of, made), made, view == TOUCHED, words)
    order = rows.order
    if not order:
        st.info(
            "No rule is edited yet; show all rules and choose one."
            if view == TOUCHED and not words
            else "No rule matches; clear the search to see all.",
            icon=":material/search_off:",
        )
        return None
    ids = [rule_set.rules[at].id for at in order]
    chosen = url_choice("rule", [rule.id for rule in rule_set.rules], ids[0])
    row = ids.index(chosen) if chosen in ids else None
    # What is selected is a row: where the rows change places, it is another table.
    key = f"edit_table_{hash(tuple(ids))}"

    def pick() -> None:
        selected = st.session_state[key].selection.rows
        if selected and selected[0] < len(ids):
            set_url_choice("rule", ids[selected[0]])

    high = row_height(rule_set)
    st.dataframe(
        _with_numbers(rows, verdicts),
        hide_index=True,
        column_config=_columns(rule_set),
        height=table_height(len(order), TABLE_ROWS, high),
        row_height=high,
        key=key,
        on_select=pick,
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="The rules with all edits",
    )
    several = counted(len(rule_set), "rule")
    st.caption(
        (f"{len(order):,} of {several}. " if len(order) < len(rule_set) else f"{several}. ")
        + "Placed rules (manual or pinned) come first, in their order: the first that applies "
        "decides. Mined rules never overlap. Click the box at the left of a row to edit its rule."
    )
    return next(rule for rule in rule_set.rules if rule.id == chosen)


def _touched(rule: Rule) -> bool:
    return rule.placed or rule.regrown or not rule.enabled


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of the table.

    Attributes:
        order: Places of their rules.
        texts: What each says and when, as an Arrow table.
    """

    order: list[int]
    texts: Any


@cached()
def _rows(
    rule_set: RuleSet, edits: tuple[Edit, ...], touched: bool, words: tuple[str, ...]
) -> Rows:
    """The rules that are shown, and what no other edit changes of them."""
    import pyarrow as pa

    edited_set, mined = apply(rule_set, edits), _texts(rule_set)
    texts: dict[int, tuple[str, str]] = {}
    for at in in_order(edited_set):
        rule = edited_set.rules[at]
        if touched and not _touched(rule):
            continue
        text = None if rule.origin == "manual" else mined.get(rule.id)
        text = text or _text(rule, edited_set)
        if words:
            searched = f"{' '.join(text)} {edited_set.name_of(rule)}".lower()
            if not all(word in searched for word in words):
                continue
        texts[at] = text
    return Rows(
        list(texts),
        pa.table(
            {
                "Action": [[does] for does, _ in texts.values()],
                "When": [when for _, when in texts.values()],
            }
        ),
    )


def _with_numbers(rows: Rows, verdicts: Verdicts) -> Any:
    """The table with what edits change."""
    import pyarrow as pa

    order = rows.order
    rules = [verdicts.rule_set.rules[at] for at in order]
    decided = verdicts.decided[order]
    kinds = [state_text(rule).split(",")[0] if _touched(rule) else "mined" for rule in rules]
    table = (
        rows.texts.add_column(0, "On", pa.array([rule.enabled for rule in rules]))
        .add_column(1, "Kind", pa.array(kinds))
        .add_column(2, "Rule", pa.array(list(map(verdicts.rule_set.name_of, rules))))
        .append_column("Decides", pa.array(decided))
    )
    if verdicts.right is not None:
        right = verdicts.right[order].astype(float)
        right[decided == 0] = float("nan")
        share = pa.array(100 * right / decided.clip(min=1), from_pandas=True)
        table = table.append_column("Expert agrees", share)
    return table


def _columns(rule_set: RuleSet) -> dict[str, Any]:
    column = st.column_config
    action, action_width = action_column(rule_set.actions, "What the rule says")
    return {
        "On": column.CheckboxColumn(width=40, help="Whether a shield uses the rule"),
        "Kind": column.TextColumn(
            width=70,
            help="Mined; regrown, with a part of the tree; pinned, so that it keeps its place; or "
            "added by hand",
        ),
        "Rule": column.TextColumn(
            width=80, help="Its name: rules are numbered by their place in the set"
        ),
        "Action": action,
        "When": column.TextColumn(
            width=570 - action_width, help="The conditions under which the rule applies"
        ),
        "Decides": column.NumberColumn(
            width=80, format="localized", help="States in which it is the rule in force"
        ),
        "Expert agrees": column.ProgressColumn(
            width=112,
            min_value=0.0,
            max_value=100.0,
            format="%.2f %%",
            color="gray",
            help="Share of those in which the expert did as it says",
        ),
    }
