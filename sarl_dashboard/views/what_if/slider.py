"""A slider over the values of a feature or an action."""

from __future__ import annotations

import streamlit as st

from sarl_core.decimals import digits_telling
from sarl_core.shielding.sampling import Span
from sarl_dashboard.text import labelled

STEPS = 400


def span_slider(name: str, span: Span, key: str) -> float:
    """A slider with as many digits as its steps need."""
    step = (span.high - span.low) / STEPS
    digits = digits_telling(step, max(abs(span.low), abs(span.high)))
    with labelled(name) as label_visibility:
        return float(
            st.slider(
                name,
                span.low,
                span.high,
                span.middle,
                step=step,
                key=key,
                bind="query-params",
                format=f"%.{digits}g",
                label_visibility=label_visibility,
            )
        )
