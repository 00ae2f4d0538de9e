"""What puts thresholds in force: the callbacks of the page Thresholds."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.steps import neat_point
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.thresholds import (
    FORBID,
    choose_mode,
    chosen_limits,
    chosen_mode,
    least_support,
    move_thresholds,
    named_thresholds,
)
from sarl_dashboard.views.thresholds.display import SURFACES, TRADE_OFFS


def follow() -> None:
    """Show what the thresholds of the moment give; for callbacks, and the last thing they do."""
    if st.session_state.get("view") == SURFACES:
        st.rerun()  # the chosen point is part of the surface
    st.rerun(
        ["controls", "front"] if st.session_state.get("details") == TRADE_OFFS else ["controls"]
    )


def move(**thresholds: float) -> None:
    """Put thresholds in force, by their names in the URL."""
    move_thresholds(thresholds)
    if not rule_base.at_thresholds():
        leave_compact()
    follow()


def jump(name: str, value: float) -> None:
    """Move one threshold."""
    move(**{name: value})


def use(setting: Thresholds) -> None:
    """Put a named setting in force."""
    move_thresholds(named_thresholds(setting))
    rule_base.choose()
    st.rerun()  # lift and depth, which it resets, are part of the maps


def use_mode(mode: str) -> None:
    """Put rules at the thresholds in force that demand, that forbid, or both; for callbacks."""
    choose_mode(mode)
    st.session_state.pop("_clicked", None)
    rule_base.choose()


def use_compact(name: str) -> None:
    """Put a compact set in force."""
    rule_base.choose(name)
    st.rerun()  # the maps lose their ring


def leave_compact() -> None:
    """Go back to the thresholds; for callbacks, and the last thing they do."""
    rule_base.choose()
    st.rerun()  # the ring comes back to the maps, and the sidebar says what is in force


def use_point(support: float, confidence: float, trees: tuple[PolicyTree, ...]) -> None:
    """Put a point of the best trade-offs in force, at neat numbers; for callbacks."""
    neat = neat_point(trees, Thresholds(support, confidence, *chosen_limits()))
    there = {"support": max(neat.support, least_support()), "confidence": neat.confidence}
    st.session_state["_clicked"] = there
    move(**there)


def take_click(key: str, trees: tuple[PolicyTree, ...]) -> None:
    """Set both thresholds to those of the clicked cell or point.

    A second click on one cell takes its selection back, and means the cell all the same.
    """
    points = st.session_state[key].selection.points
    if points and "customdata" in points[0]:
        data = points[0]["customdata"]
        # Which of the two arrives depends on how the numbers were packed for the browser.
        values = list(data.values()) if isinstance(data, dict) else list(data)
        support, other = float(values[0]), float(values[1])
        if key == "pareto":
            use_point(support, other, trees)
            return
        name = "epsilon" if chosen_mode() == FORBID else "confidence"
        st.session_state["_clicked"] = {"support": max(support, least_support()), name: other}
    if clicked_cell := st.session_state.get("_clicked"):
        move(**clicked_cell)
