"""The chosen thresholds and divider, kept in the URL."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import streamlit as st

from sarl_core.mining.growing.growth import LearnerChoice
from sarl_core.mining.rules import FILTERED, Thresholds
from sarl_dashboard.state.url import note_unusable, set_url_choice, url_choice

THRESHOLDS = "thresholds"
"""In an address: the rules are those at the thresholds."""
MIN_DIVIDER, MAX_DIVIDER = 2, 16
LEARNERS: tuple[LearnerChoice, ...] = ("auto", "exact", "histogram")
MAX_LIFT = 20.0
MAX_DEPTH = 64  # 0 is no limit


class Settled(NamedTuple):
    """What cannot be chosen of trees that are not grown here.

    Attributes:
        divider: At which they were grown.
        least_support: Down to which.
    """

    divider: int
    least_support: float


def settle(settled: Settled | None) -> None:
    """Say what is settled, before anything is chosen in a run; None for nothing."""
    st.session_state["_settled"] = settled


def settled() -> Settled | None:
    """What cannot be chosen; None where all can."""
    return cast("Settled | None", st.session_state.get("_settled"))


def least_support() -> float:
    """The least minimum support that there are rules for."""
    known = settled()
    return 0.0 if known is None else known.least_support


def from_least(supports: Sequence[float]) -> tuple[float, ...]:
    """Supports, ascending, without those that there are no rules for."""
    least = least_support()
    return tuple(dict.fromkeys(max(support, least) for support in supports))


def _number(name: str, default: float, low: float, high: float) -> float:
    """A number that a widget of some page holds; else the URL's; else the default."""
    went_back = st.session_state.get("_went_back")  # to an address that says everything
    value: Any = None if went_back else st.session_state.get(name)
    if value is None:
        value = st.query_params.get(name, default)
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = default
        note_unusable(name, str(value))
    if not (math.isfinite(number) and low <= number <= high):
        note_unusable(name, str(value))
        number = default
    return number


def chosen_limits() -> tuple[float, int | None]:
    """Minimum lift and maximum depth in force (URL: lift, depth; depth 0 is no limit)."""
    return _number("lift", 0.0, 0.0, MAX_LIFT), int(_number("depth", 0, 0, MAX_DEPTH)) or None


def chosen_thresholds() -> Thresholds:
    """The thresholds in force (URL: support, confidence, and those of `chosen_limits`)."""
    return Thresholds(
        max(_number("support", FILTERED.support, 0.0, 1.0), least_support()),
        _number("confidence", FILTERED.confidence, 0.0, 1.0),
        *chosen_limits(),
    )


def choose_thresholds(thresholds: Thresholds) -> None:
    """Put thresholds in force; for callbacks, and before the sliders are drawn."""
    for name, value in (
        ("support", thresholds.support),
        ("confidence", thresholds.confidence),
        ("lift", thresholds.lift),
        ("depth", thresholds.max_depth or 0),
    ):
        if st.session_state.get(name) != value:
            st.session_state[name] = value


def chosen_divider() -> int:
    """Number of intervals of continuous actions (URL: divider)."""
    if (known := settled()) is not None:
        return known.divider
    return int(_number("divider", MIN_DIVIDER, MIN_DIVIDER, MAX_DIVIDER))


def choose_divider(divider: int) -> None:
    """Choose a divider; for callbacks, and before its slider is drawn."""
    if st.session_state.get("divider") != divider:
        st.session_state["divider"] = divider


def chosen_learner() -> LearnerChoice:
    """What grows the trees (URL: learner)."""
    chosen = url_choice("learner", LEARNERS, LEARNERS[0])
    return next(one for one in LEARNERS if one == chosen)


def choose_learner(learner: LearnerChoice) -> None:
    """Choose a learner; for callbacks."""
    set_url_choice("learner", learner, LEARNERS[0])
