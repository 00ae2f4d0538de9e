"""The landscape as two maps, or as the paper's surfaces."""

from __future__ import annotations

import streamlit as st

from sarl_core.explaining.colours import MARKER_COLOUR
from sarl_core.explaining.figures import thresholds as figures
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_dashboard.session import is_dark
from sarl_dashboard.views.thresholds.display import Display
from sarl_dashboard.views.thresholds.moves import take_click

BARE = {"displayModeBar": False, "scrollZoom": False}
MARK_RADIUS = 9


def show_maps(display: Display, landscape: Landscape) -> None:
    """Two maps side by side, with the mark that `controls` moves, or hides.

    Args:
        display: What is looked at.
        landscape: On its grid.
    """
    margin = figures.MARGIN
    st.html(
        "<style>"
        ".st-key-maps [class*='st-key-box_'] { position: relative; }"
        ".st-key-maps [class*='st-key-box_']::after { content: ''; position: absolute; z-index: 2;"
        f" pointer-events: none; width: {2 * MARK_RADIUS}px; height: {2 * MARK_RADIUS}px;"
        f" left: calc({margin['l'] - MARK_RADIUS}px"
        f" + (100% - {margin['l'] + margin['r']}px) * var(--mark-x));"
        f" top: calc({margin['t'] - MARK_RADIUS}px"
        f" + {figures.HEIGHT - margin['t'] - margin['b']}px * var(--mark-y));"
        # In a layer of its own, so that the map beneath is not painted again when it moves.
        f" will-change: transform; border: 3px solid {MARKER_COLOUR};"
        " box-sizing: border-box; border-radius: 50%;"
        " box-shadow: 0 0 0 1.5px #ffffff; }"
        "</style>"
    )
    with st.container(key="maps"):
        for column, layer in zip(st.columns(2), display.layers, strict=True):
            with column:
                st.markdown(f"**{figures.STYLES[layer].title}**")
                with st.container(key=f"box_{layer}"):
                    st.plotly_chart(
                        figures.heatmap(landscape, layer, dark=is_dark()),
                        key=f"map_{layer}",
                        config=BARE,
                        selection_mode="points",
                        on_select=lambda key=f"map_{layer}": take_click(key, display.trees),
                        alt=f"{figures.STYLES[layer].title}, for every minimum support and "
                        "minimum confidence",
                    )
    st.caption(
        "Click a cell to set both thresholds to it. "
        + (
            "The ring marks the present ones."
            if display.compact is None
            else "The compact rules are not cut at thresholds, so no cell is marked."
        )
    )


def show_surfaces(display: Display, landscape: Landscape, thresholds: Thresholds) -> None:
    """The same two layers as the paper draws them.

    Args:
        display: What is looked at.
        landscape: On its grid.
        thresholds: Those in force.
    """
    marked = display.compact is None
    point = display.point(thresholds)
    for column, layer in zip(st.columns(2), display.layers, strict=True):
        with column:
            st.markdown(f"**{figures.STYLES[layer].title}**")
            figure = figures.surface(
                landscape,
                layer,
                dark=is_dark(),
                chosen=(
                    thresholds.support,
                    thresholds.confidence,
                    float(getattr(point, layer)[0, 0]),
                )
                if marked
                else None,
            )
            st.plotly_chart(
                figure,
                key=f"surface_{layer}",
                config={"displaylogo": False},
                alt=f"{figures.STYLES[layer].title} as a surface",
            )
    st.caption("Drag to turn." + (" The dot marks the present thresholds." if marked else ""))
