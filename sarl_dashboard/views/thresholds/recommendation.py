"""The thresholds that are recommended, why, and a button that takes them."""

from __future__ import annotations

import streamlit as st

from sarl_core.explaining.html.headings import note
from sarl_core.explaining.words.cross_fit import no_recommendation_text, recommendation_sentences
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.recommendation import Recommendation, episode_count
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.text import escaped
from sarl_dashboard.views.thresholds.display import Display
from sarl_dashboard.views.thresholds.moves import move


def recommendation_of(display: Display, thresholds: Thresholds) -> Recommendation | None:
    """What is recommended; None where nothing can be, or not yet.

    Args:
        display: What is looked at.
        thresholds: Those in force; only lift and depth count.
    """
    fit = cross_fitting.known()
    if fit is None:
        return None
    return cross_fitting.recommendation(
        display.trees,
        fit,
        dimension=display.dimension,
        lift=thresholds.lift,
        depth=thresholds.max_depth,
    )


def show_recommendation(display: Display, thresholds: Thresholds) -> None:
    """Which thresholds to take, once other episodes can tell; nothing before.

    Args:
        display: What is looked at.
        thresholds: Those in force.
    """
    fit = cross_fitting.known()
    if fit is None:
        return  # that it is on its way, the notice above says
    recommendation = recommendation_of(display, thresholds)
    if recommendation is None:
        st.html(note(no_recommendation_text(episode_count(fit))))
        return
    action = "" if display.dimension is None else display.trees[display.dimension].dimension.name
    at = recommendation.thresholds
    text, button = st.columns([6, 1], vertical_alignment="center")
    text.markdown(escaped(recommendation_sentences(recommendation, action)))
    button.button(
        "In force" if at == thresholds else "Use these",
        key="use_recommended",
        icon=":material/check:" if at == thresholds else ":material/recommend:",
        on_click=move,
        kwargs={"support": at.support, "confidence": at.confidence},
        disabled=at == thresholds,
        help="Every pair of steps of the two sliders was compared, each episode judged by rules "
        "mined without it",
    )
