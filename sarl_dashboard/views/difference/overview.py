"""What each of some rule sets comes to, and how often two of them decide differently."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pandas as pd
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
    if len(sides) > 2:
        st.caption("Share of the states that two of them decide differently:")
        st.dataframe(
            _differences(sides, different),
            hide_index=True,
            width="content",
            key="different_decisions",
            alt="How often two of the rule sets decide differently",
        )


_WIDTH = 560  # pixels, where there are so many
_COLUMNS = (
    Column("Rule set"),
    Column("Rules", "n", "That are switched on"),
    Column("Mean length", "n", "Of the rules that are switched on"),
    Column("Coverage", "n"),
    Column("Fidelity", "n"),
)


def _line(side: Side) -> tuple[str, ...]:
    verdicts = edits.verdicts_of_set(side.rule_set)
    lengths = [rule.length for rule in side.rule_set.rules if rule.enabled]
    return (
        side.name,
        f"{len(lengths):,}",
        f"{sum(lengths) / max(len(lengths), 1):.1f}",
        share_text(verdicts.coverage),
        share_text(verdicts.fidelity),
    )


def _differences(sides: Sequence[Side], different: Callable[[Side, Side], float]) -> pd.DataFrame:
    columns: dict[str, list[str]] = {"Rule set": [side.name for side in sides]}
    for one in sides:
        columns[one.name] = [
            "–" if one is other else share_text(different(one, other), decimals=1)
            for other in sides
        ]
    return pd.DataFrame(columns)
