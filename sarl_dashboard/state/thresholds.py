"""The chosen thresholds and divider, kept in the URL."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

import streamlit as st

from sarl_core.mining.growing.growth import LearnerChoice
from sarl_core.mining.never.never_rules import never_thresholds
from sarl_core.mining.never.steps import USUAL_EPSILON
from sarl_core.mining.rules import FILTERED, Thresholds
from sarl_dashboard.state.url import note_unusable, set_url_choice, url_choice

THRESHOLDS = "thresholds"
"""In an address: the rules are those at the thresholds."""
MIN_DIVIDER, MAX_DIVIDER = 2, 16
AUTOMATIC: LearnerChoice = "auto"
LEARNERS: tuple[LearnerChoice, ...] = (AUTOMATIC, "exact", "histogram")
DEMAND, FORBID, BOTH = "demand", "forbid", "both"
MAX_LIFT = 20.0
MAX_DEPTH = 64  # 0 is no limit
_LEAST_EPSILON = 0.0001


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


def chosen_mode() -> str:
    """Whether rules at the thresholds demand an action, forbid one, or both (URL: mode)."""
    return url_choice("mode", (DEMAND, FORBID, BOTH), DEMAND)


def choose_mode(mode: str) -> None:
    """Choose between rules that demand, rules that forbid, and both; for callbacks."""
    set_url_choice("mode", mode, DEMAND)


def chosen_confidence() -> float:
    """The minimum confidence of rules that demand, in force or set aside (URL: confidence)."""
    return _number("confidence", FILTERED.confidence, 0.0, 1.0)


def chosen_epsilon() -> float:
    """The epsilon of rules that forbid, in force or set aside (URL: epsilon)."""
    return _number("epsilon", USUAL_EPSILON, _LEAST_EPSILON, 1.0 - _LEAST_EPSILON)


def chosen_limits() -> tuple[float, int | None]:
    """Minimum lift and maximum depth in force (URL: lift, depth; depth 0 is no limit)."""
    return _number("lift", 0.0, 0.0, MAX_LIFT), int(_number("depth", 0, 0, MAX_DEPTH)) or None


def chosen_thresholds() -> Thresholds:
    """The thresholds in force (URL: support, confidence, and those of `chosen_limits`).

    Of rules that forbid alone those of `never_thresholds`, which know no confidence and no lift.
    """
    support = max(_number("support", FILTERED.support, 0.0, 1.0), least_support())
    lift, depth = chosen_limits()
    if chosen_mode() == FORBID:
        return never_thresholds(chosen_epsilon(), support, depth)
    never = chosen_epsilon() if chosen_mode() == BOTH else None
    return Thresholds(support, chosen_confidence(), lift, depth, never)


def threshold_values() -> dict[str, tuple[float, float]]:
    """Every threshold by its name in the URL, in force or set aside, and its default."""
    thresholds, (lift, depth) = chosen_thresholds(), chosen_limits()
    return {
        "support": (thresholds.support, FILTERED.support),
        "confidence": (chosen_confidence(), FILTERED.confidence),
        "lift": (lift, 0.0),
        "depth": (depth or 0, 0),
        "epsilon": (chosen_epsilon(), USUAL_EPSILON),
    }


def keep_thresholds() -> None:
    """Let every threshold stay what it is, before the sliders are drawn, or where there are none.

    Those that are set aside stay, too.
    """
    _put({name: value for name, (value, _) in threshold_values().items()})


def move_thresholds(values: Mapping[str, float]) -> None:
    """Put thresholds in force, by their names in the URL, in the run that a callback asks for next.

    `take_over_moved` writes them where the sliders find them. What the callback wrote there itself
    would not reach the browser; and where a timer of the page has asked for a run meanwhile, with
    the values that sliders had before, those would take its place.
    """
    st.session_state["_moved"] = dict(values)


def take_over_moved() -> None:
    """Hand moved thresholds to the sliders, before these are drawn."""
    _put(st.session_state.pop("_moved", {}))


def named_thresholds(thresholds: Thresholds) -> dict[str, float]:
    """Thresholds of rules that demand, by their names in the URL."""
    return {
        "support": thresholds.support,
        "confidence": thresholds.confidence,
        "lift": thresholds.lift,
        "depth": thresholds.max_depth or 0,
    }


def _put(values: Mapping[str, float]) -> None:
    for name, value in values.items():
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
    chosen = url_choice("learner", LEARNERS, AUTOMATIC)
    return next(one for one in LEARNERS if one == chosen)


def choose_learner(learner: LearnerChoice) -> None:
    """Choose a learner; for callbacks."""
    set_url_choice("learner", learner, AUTOMATIC)
