"""How the values of features are distributed, a figure each, coloured by the actions taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.demonstrations import feature_figure
from sarl_core.explaining.figures.distributions import FeatureRow, feature_row, histogram_by_label
from sarl_core.explaining.html.step_card import legend
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension, label_dimensions
from sarl_core.mining.language import share_text
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.text import escaped, together


@dataclass(frozen=True, eq=False)
class Distribution:
    """The values of one feature.

    Attributes:
        row: In numbers.
        figure: In bars.
        infinite: Share of the steps in which it is infinite, as a formula may be.
    """

    row: FeatureRow
    figure: go.Figure
    infinite: float


def distribution_of(
    demonstrations: Demonstrations, index: int, dimension: LabelledDimension, by: int
) -> Distribution:
    """How one feature is distributed.

    Args:
        demonstrations: N pairs.
        index: Of the feature.
        dimension: Whose labels colour it.
        by: Which action dimension that is.

    Returns:
        Its numbers and its figure.
    """
    values, feature = demonstrations.observations[:, index], demonstrations.features[index]
    labels = dimension.labels_of(demonstrations.action_columns[:, by])
    histogram = histogram_by_label(values, labels, dimension.n_labels)
    return Distribution(
        feature_row(feature, values),
        feature_figure(feature, histogram, dimension),
        float(np.isinf(values).mean()),
    )


@cached(show_spinner="Counting …")
def distributions(
    demonstrations: Demonstrations, divider: int, by: int, features: tuple[int, ...]
) -> tuple[Distribution, ...]:
    """How some features are distributed, coloured by the labels of one action dimension."""
    dimension = label_dimensions(demonstrations, divider)[by]
    return tuple(distribution_of(demonstrations, index, dimension, by) for index in features)


def show_legend(dimension: LabelledDimension) -> None:
    """The colours of the labels."""
    entries = [
        (label_text(label, dimension), label_colour(label))
        for label in range(min(dimension.n_labels, 24))
    ]
    st.html(legend(entries, before=f"{dimension.name}:"))


def show_distribution(distribution: Distribution, key: str) -> None:
    """A feature's name, its figure, and where it is infinite.

    Args:
        distribution: Of the feature.
        key: Of the figure.
    """
    name, unit = distribution.row.name, distribution.row.unit
    st.markdown(f"**{escaped(name)}**" + (f" :gray[{escaped(unit)}]" if unit else ""))
    chart(distribution.figure, key, f"Distribution of {name}, by action")
    if distribution.infinite:
        st.caption(together(f"Infinite in {share_text(distribution.infinite)} of the steps"))
