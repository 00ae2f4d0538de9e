"""What a table says is selected in it, and whether somebody chose that."""

from __future__ import annotations

from typing import Any

import pytest

from sarl_dashboard.components import tables
from sarl_dashboard.components.tables import rows_selected_anew, select_row


def selected(*rows: int) -> dict[str, Any]:
    return {"selection": {"rows": list(rows)}}


@pytest.fixture
def state(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    values: dict[str, Any] = {}
    monkeypatch.setattr(tables.st, "session_state", values)
    return values


def test_what_a_table_was_drawn_with_nobody_chose(state: dict[str, Any]) -> None:
    state["table"] = selected(2)
    assert rows_selected_anew("table", 2) is None
    assert rows_selected_anew("table", 0) == [2]
    state["table"] = selected()
    assert rows_selected_anew("table", None) is None
    assert rows_selected_anew("table", 2) == []


def test_what_is_said_late_takes_nothing_back(
    state: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(tables, "monotonic", lambda: now)
    state["table"] = selected(0)
    select_row(1, "table")
    assert state["table"] == selected(1)
    state["table"] = selected(0)  # as the browser had it before it heard of that
    assert rows_selected_anew("table", 1) is None
    select_row(1, "table")
    state["table"] = selected(0)  # said again: it was chosen
    assert rows_selected_anew("table", 1) == [0]
    select_row(1, "table")
    now += 10.0
    state["table"] = selected(0)
    assert rows_selected_anew("table", 1) == [0]
    select_row(1, "table")
    state["table"] = selected(3)
    assert rows_selected_anew("table", 1) == [3]


def test_what_is_chosen_by_name_is_not_taken_back(
    state: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "monotonic", lambda: 100.0)
    state["table"] = selected(0)
    select_row(4, "table")  # by its name, which then asks what was selected
    assert rows_selected_anew("table", 0) == [4]
    state["table"] = selected(0)
    assert rows_selected_anew("table", 4) is None
