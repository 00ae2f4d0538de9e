"""The landscape as two maps, or as the paper's surfaces."""

from __future__ import annotations

import time
from dataclasses import replace

import streamlit as st

from sarl_core.explaining.figures import thresholds as figures
from sarl_core.mining.never.landscape import NeverLandscape
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_dashboard.components.places import placed
from sarl_dashboard.session import is_dark
from sarl_dashboard.state.thresholds import BOTH, chosen_mode
from sarl_dashboard.views.thresholds.display import Display
from sarl_dashboard.views.thresholds.moves import take_click

BARE = {"displayModeBar": False, "scrollZoom": False}
_UNTIL_DRAWN = 0.4  # seconds; if maps follow sooner, slower machines draw the numbers with them


def let_numbers_be_drawn() -> None:
    """Wait, at the first visit of a session, until a browser has drawn what it was sent.

    What draws maps takes it half a second or two to read, in which it draws nothing else.
    """
    if not st.session_state.setdefault("_numbers_drawn", False):
        time.sleep(_UNTIL_DRAWN)
        st.session_state["_numbers_drawn"] = True


def show_maps(display: Display, landscape: Landscape | NeverLandscape) -> None:
    """Two maps side by side, with the mark that `controls` moves, or hides.

    Args:
        display: What is looked at.
        landscape: On its grid.
    """
    margin, styles = figures.MARGIN, figures.styles_of(landscape)
    other = "epsilon" if display.forbids else "minimum confidence"
    st.html(
        placed(
            "maps",
            left=f"{margin['l']}px",
            right=f"{margin['r']}px",
            top=f"{margin['t']}px",
            height=f"{figures.HEIGHT - margin['t'] - margin['b']}px",
        )
    )
    with st.container(key="maps"):
        for column, layer in zip(st.columns(2), display.layers, strict=True):
            with column:
                st.markdown(f"**{styles[layer].title}**")
                with st.container(key=f"box_{layer}"):
                    st.plotly_chart(
                        figures.heatmap(landscape, layer, dark=is_dark()),
                        key=f"map_{layer}",
                        config=BARE,
                        selection_mode="points",
                        on_select=lambda key=f"map_{layer}": take_click(key, display.trees),
                        alt=f"{styles[layer].title}, for every minimum support and {other}",
                    )
    st.caption(
        "Click a cell to set both thresholds to it; with the keys, move the two sliders. "
        + (
            "The ring marks the present ones."
            if display.compact is None
            else "The compact rules are not cut at thresholds, so no cell is marked."
        )
        + " The maps are of the rules that demand alone." * (chosen_mode() == BOTH)
    )


def _drawn(thresholds: Thresholds) -> Thresholds:
    """Of rules of both kinds, the figures are of those that demand."""
    return replace(thresholds, never=None) if thresholds.demands else thresholds


def show_surfaces(
    display: Display, landscape: Landscape | NeverLandscape, thresholds: Thresholds
) -> None:
    """The same two layers as the paper draws them.

    Args:
        display: What is looked at.
        landscape: On its grid.
        thresholds: Those in force.
    """
    marked, styles = display.compact is None, figures.styles_of(landscape)
    upwards = thresholds.confidence if thresholds.demands else thresholds.never or 0.0
    point = display.point(_drawn(thresholds))
    for column, layer in zip(st.columns(2), display.layers, strict=True):
        with column:
            st.markdown(f"**{styles[layer].title}**")
            figure = figures.surface(
                landscape,
                layer,
                dark=is_dark(),
                chosen=(
                    thresholds.support,
                    upwards,
                    float(getattr(point, layer)[0, 0]),
                )
                if marked
                else None,
            )
            st.plotly_chart(
                figure,
                key=f"surface_{layer}",
                config={"displaylogo": False},
                alt=f"{styles[layer].title} as a surface",
            )
    st.caption(
        "Drag to turn."
        + " The dot marks the present thresholds." * marked
        + " The surfaces are of the rules that demand alone." * (chosen_mode() == BOTH)
    )
