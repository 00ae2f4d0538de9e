"""What each of some rule sets comes to, and how often two of them decide differently."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pandas as pd
import streamlit as st

from sarl_dashboard.state import edits
from sarl_dashboard.views.difference.sides import Side


def show_overview(sides: Sequence[Side], different: Callable[[Side, Side], float]) -> None:
    """A line a set.

    Args:
        sides: The one that the others are held against first.
        different: Share of the states that two of them decide differently.
    """
    rows: dict[str, list[object]] = {
        name: [] for name in ("Rule set", "Rules", "Mean length", "Coverage", "Fidelity")
    }
    for side in sides:
        verdicts = edits.verdicts_of_set(side.rule_set)
        for name, value in zip(
            rows,
            (
                side.name,
                sum(rule.enabled for rule in side.rule_set.rules),
                side.rule_set.mean_length,
                verdicts.coverage,
                verdicts.fidelity,
            ),
            strict=True,
        ):
            rows[name].append(value)
    against = sides if len(sides) > 2 else sides[:1]
    columns = {f"Otherwise than {one.name}": one for one in against}
    for name, one in columns.items():
        rows[name] = [None if side is one else different(one, side) for side in sides]
    column = st.column_config
    share = column.NumberColumn(format="percent", width="small")
    st.dataframe(
        pd.DataFrame(rows),
        hide_index=True,
        key="compared_sets",
        alt="What each rule set comes to",
        column_config={
            "Rule set": column.TextColumn(width="medium"),
            "Rules": column.NumberColumn(
                format="localized", width="small", help="That are switched on"
            ),
            "Mean length": column.NumberColumn(format="%.1f", width="small"),
            "Coverage": share,
            "Fidelity": share,
            **{
                name: column.NumberColumn(
                    format="percent",
                    width="small",
                    help="Share of the states that the two decide differently",
                )
                for name in columns
            },
        },
    )
