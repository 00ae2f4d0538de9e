"""A figure on a page."""

from __future__ import annotations

import plotly.graph_objects as go
import streamlit as st


def chart(figure: go.Figure, key: str, alt: str) -> None:
    """Show a figure, without Plotly's row of tools.

    Args:
        figure: To look at; nothing follows from a click.
        key: Of the widget.
        alt: What it shows, for who cannot see it.
    """
    st.plotly_chart(figure, config={"displayModeBar": False}, key=key, alt=alt)
