"""What the agent wants to do, on the page What if."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st

from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.shielding.sampling import Span
from sarl_dashboard.text import labelled
from sarl_dashboard.views.what_if.slider import span_slider


def proposal(actions: tuple[LabelledDimension, ...]) -> Any:
    """What the agent wants to do, in the environment's own form."""
    several = len(actions) > 1
    values: list[float] = []
    for index, dimension in enumerate(actions):
        title = f"The agent wants: {dimension.name}" if several else "The agent wants"
        if dimension.is_interval:
            low, high = dimension.edges[0], dimension.edges[-1]
            if low == high:  # the rules know a single value; the agent may want another
                low, high = low - 1.0, high + 1.0
            values.append(span_slider(title, Span(low, (low + high) / 2, high), f"a{index}"))
            continue
        names = [label_text(label, dimension) for label in range(dimension.n_labels)]
        with labelled(title) as label_visibility:
            chosen = st.selectbox(
                title,
                names,
                key=f"a{index}",
                bind="query-params",
                label_visibility=label_visibility,
            )
        values.append(dimension.actions[names.index(chosen)])
    if actions[0].is_interval:
        return np.array(values, dtype=np.float32)
    return np.array(values, dtype=np.int64) if several else int(values[0])
