"""The rules in force with the most support."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_dashboard.components.tables import column_config, frame, row_height, table_height
from sarl_dashboard.state.compact_set import Compact
from sarl_dashboard.state.mined import largest_rules
from sarl_dashboard.views.thresholds.display import Display

TABLE_ROWS, SEEN_ROWS = 50, 10


def show_largest(display: Display, thresholds: Thresholds, total: int) -> None:
    """The rules at the thresholds with the most support, or the compact ones.

    Args:
        display: What is looked at.
        thresholds: Those in force.
        total: How many rules there are.
    """
    if display.compact is not None:
        show_compact(display.compact, display.dimension)
        return
    if not total and display.forbids:
        st.info(
            "No part of the tree is as frequent as the minimum support asks and shows that the "
            "expert does some action there as rarely as epsilon asks. Lower the minimum support or "
            "raise epsilon: the maps show where there are rules.",
            icon=":material/filter_alt_off:",
        )
        return
    if not total:
        st.info(
            "No part of the tree is as frequent and as certain as these thresholds ask. Lower "
            "the minimum support or the minimum confidence: the maps show where there are rules.",
            icon=":material/filter_alt_off:",
        )
        return
    part, names = largest_rules(display.trees, thresholds, TABLE_ROWS)
    rows = [
        (rule, name)
        for rule, name in zip(part.rules, names, strict=True)
        if display.dimension in (None, rule.dimension)
    ][:TABLE_ROWS]
    show_rows([rule for rule, _ in rows], [name for _, name in rows], part, "largest_table", "")
    if total > len(rows):
        st.caption(most_support(len(rows), total))


def show_compact(compact: Compact, dimension: int | None) -> None:
    """The compact rules with the most support."""
    rules = [rule for rule in compact.counted.rules if dimension in (None, rule.dimension)]
    rules.sort(key=lambda rule: -rule.samples)
    rows = rules[:TABLE_ROWS]
    names = list(map(compact.counted.name_of, rows))
    show_rows(rows, names, compact.counted, "compact_table", "compact ")
    sentences = []
    if len(rules) > len(rows):
        sentences.append(most_support(len(rows), len(rules)))
    unreached = sum(not rule.samples for rule in rules)
    if unreached:
        are = "is" if unreached == 1 else "are"
        sentences.append(f"{counted(unreached, 'rule')} {are} reached by no demonstrated state.")
    if sentences:
        st.caption(" ".join(sentences))


def show_rows(
    rules: Sequence[Rule], names: Sequence[str], rule_set: RuleSet, key: str, kind: str
) -> None:
    """Some rules as a table."""
    high = row_height(rule_set)
    st.dataframe(
        frame(rules, rule_set, names),
        hide_index=True,
        column_config=column_config(rule_set),
        height=table_height(len(rules), SEEN_ROWS, high),
        row_height=high,
        key=key,
        alt=f"The {kind}rules with the most support",
    )


def most_support(rows: int, total: int) -> str:
    """Which rules the table has, where it has not all."""
    return f"The {rows} rules with the most support, of {total:,}."
