"""What each of some rule sets comes to, and how often two of them decide differently."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import streamlit as st

from sarl_core.explaining.html.table import Column, table_html
from sarl_core.mining.language import share_text
from sarl_dashboard.state import edits
from sarl_dashboard.views.difference.sides import Side


def show_overview(sides: Sequence[Side], different: Callable[[Side, Side], float]) -> None:
    """A line a set, and of more than two a table of every set against every other.

    Args:
        sides: The one that the others are held against first.
        different: Share of the states that two of them decide differently.
    """
    lines = [_line(side) for side in sides]
    with st.container(width=_WIDTH):
        st.html(table_html(_COLUMNS, lines, "What each rule set comes to"))
    if any(side.rule_set.forbids for side in sides):
        st.caption(_BOTH_KINDS)
    if len(sides) > 2:
        st.caption("Share of the states that two of them decide differently:")
        columns = (Column("Rule set"), *(Column(side.name, "n") for side in sides[:-1]))
        with st.container(width=_WIDTH):
            st.html(
                table_html(
                    columns,
                    _differences(sides, different),
                    "How often two of the rule sets decide differently",
                )
            )


_WIDTH = 640  # pixels, where there are so many
_COLUMNS = (
    Column("Rule set"),
    Column("Rules", "n", "That are switched on"),
    Column("Mean length", "n", "Of the rules that are switched on"),
    Column("Coverage", "n"),
    Column("Fidelity", "n"),
    Column("Freedom", "n"),
)
_BOTH_KINDS = (
    "Fidelity is counted by states, as on Thresholds: of those with a rule, the share in which the "
    "expert did what a rule demands there, or nothing of what rules forbid there. Freedom is what "
    "is left to choose from in the mean of all states. Two sets decide a state alike where both "
    "leave the same actions, whether they demand or forbid."
)


def _line(side: Side) -> tuple[str, ...]:
    leeway = edits.leeway_of_set(side.rule_set)
    lengths = [rule.length for rule in side.rule_set.rules if rule.enabled]
    return (
        side.name,
        f"{len(lengths):,}",
        f"{sum(lengths) / max(len(lengths), 1):.1f}",
        share_text(leeway.coverage),
        share_text(leeway.fidelity),
        share_text(leeway.freedom),
    )


def _differences(
    sides: Sequence[Side], different: Callable[[Side, Side], float]
) -> list[tuple[str, ...]]:
    """A row for each set but the first, against those before it."""
    rows = []
    for place, one in enumerate(sides[1:], start=1):
        shares = [share_text(different(other, one), decimals=1) for other in sides[:place]]
        rows.append((one.name, *shares, *[""] * (len(sides) - 1 - place)))
    return rows
