"""The keys' way to a row of a table, by its name.

Shift and Space tick the box of the row whose cell the arrow keys have reached. But a table that
opens with a row selected, as that of Edit does, has no such cell until one is clicked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import streamlit as st

from sarl_dashboard.components.tables import select_row


def row_choice(
    table: str, names: Sequence[str], row: int | None, pick: Callable[[], None] | None = None
) -> None:
    """A list of what is in the rows, which selects the row of what is chosen.

    Args:
        table: Key of the table, which is drawn in the same run.
        names: What is in its rows, in their order.
        row: That is selected, from 0, or none.
        pick: What else happens when a row is selected.
    """
    key = f"{table}_by_name"
    st.session_state[key] = row

    def take() -> None:
        select_row(st.session_state[key], table)
        if pick is not None:
            pick()

    st.selectbox(
        "Row of the table",
        range(len(names)),
        format_func=names.__getitem__,
        index=None,
        key=key,
        on_change=take,
        placeholder="Choose a row by its name",
        label_visibility="collapsed",
        width=320,
    )


def selected_row(table: str, rows: int) -> int | None:
    """The row of a table that is selected, from 0, before it is drawn.

    Args:
        table: Its key.
        rows: How many it has.
    """
    state = st.session_state.get(table)
    chosen = [] if state is None else state["selection"]["rows"]
    return chosen[0] if chosen and chosen[0] < rows else None
