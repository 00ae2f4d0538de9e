"""The rule sets that no other one beats."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from sarl_core.explaining.figures.pareto_front import front_figure, thin_front
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.thresholds.pareto import ParetoPoint
from sarl_core.mining.validation.recommendation import Recommendation
from sarl_dashboard.session import is_dark
from sarl_dashboard.state.mined import best_trade_offs
from sarl_dashboard.state.thresholds import chosen_thresholds
from sarl_dashboard.views.thresholds.display import Display
from sarl_dashboard.views.thresholds.maps import BARE
from sarl_dashboard.views.thresholds.moves import take_click, use_point
from sarl_dashboard.views.thresholds.recommendation import recommendation_of


def place_of(display: Display, recommendation: Recommendation) -> tuple[int, float]:
    """Rules and coverage of what is recommended, as the figure has them."""
    point = display.point(recommendation.thresholds)
    return int(point.rule_count[0, 0]), float(point.coverage[0, 0])


def _point_choice(points: Sequence[ParetoPoint], display: Display) -> None:
    """The keys' way to a point: all of them by their numbers."""
    key = "_front_point"
    st.session_state[key] = None

    def take() -> None:
        place = st.session_state[key]
        if place is not None:
            use_point(points[place].support, points[place].confidence, display.trees)

    st.selectbox(
        "Point of the figure",
        range(len(points)),
        format_func=lambda place: _point_text(points[place]),
        index=None,
        key=key,
        on_change=take,
        placeholder="Choose a point by its numbers",
        label_visibility="collapsed",
        width=520,
    )


def _point_text(point: ParetoPoint) -> str:
    return (
        f"{counted(point.rules, 'rule')}, coverage {share_text(point.coverage, decimals=1)}, "
        f"fidelity {share_text(point.fidelity, decimals=2)}, at support {point.support:.4g}, "
        f"confidence {point.confidence:.4g}"
    )


@st.fragment(key="front")
def show_trade_offs(display: Display) -> None:
    """The rule sets that no other one beats, and where the one in force is among them.

    Args:
        display: What is looked at.
    """
    thresholds, dimension = chosen_thresholds(), display.dimension
    point = display.point(thresholds)
    trees = display.trees if dimension is None else (display.trees[dimension],)
    with st.spinner("Looking for the best trade-offs …"):
        front = best_trade_offs(trees, lift=thresholds.lift, depth=thresholds.max_depth)
    if not front:
        st.info(
            "There is no rule at any thresholds; lower the minimum lift under More.",
            icon=":material/filter_alt_off:",
        )
        return
    recommendation = recommendation_of(display, thresholds)
    st.caption(
        "No other thresholds give fewer rules, more coverage and more fidelity than these. "
        "Click a point, or choose it below, to use its thresholds. The ring is the rule set in "
        "force" + ("." if recommendation is None else ", the diamond the one recommended above.")
    )
    points = thin_front(front)
    figure = front_figure(
        points,
        dark=is_dark(),
        chosen=(
            int(point.rule_count[0, 0]),
            float(point.coverage[0, 0]),
            float(point.fidelity[0, 0]),
        ),
        recommended=None if recommendation is None else place_of(display, recommendation),
    )
    st.plotly_chart(
        figure,
        key="pareto",
        config=BARE,
        selection_mode="points",
        on_select=lambda: take_click("pareto", display.trees),
        alt="Number of rules against coverage, coloured by fidelity",
    )
    _point_choice(points, display)
    if len(points) < len(front):
        st.caption(f"{len(points):,} of {len(front):,} such rule sets are drawn.")
