"""How every feature is distributed."""

from __future__ import annotations

import plotly.graph_objects as go
import streamlit as st

from sarl_core.decimals import decimal_on_scale
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.demonstrations import feature_figure
from sarl_core.explaining.figures.distributions import FeatureRow, histogram_by_label
from sarl_core.explaining.html.step_card import legend
from sarl_core.explaining.words.states import word_shares
from sarl_core.mining.labels import LabelledDimension, label_dimensions
from sarl_core.mining.language import label_text, share_text
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.text import escaped

AT_FIRST, MOST = 12, 48  # figures


@cached(show_spinner="Counting …")
def feature_figures(
    demonstrations: Demonstrations, divider: int, by: int, features: tuple[int, ...]
) -> tuple[go.Figure, ...]:
    """A figure for each of some features, coloured by the labels of one action dimension."""
    dimension = label_dimensions(demonstrations, divider)[by]
    labels = dimension.labels_of(demonstrations.action_columns[:, by])
    return tuple(
        feature_figure(
            demonstrations.features[index],
            histogram_by_label(demonstrations.observations[:, index], labels, dimension.n_labels),
            dimension,
        )
        for index in features
    )


def show_legend(dimension: LabelledDimension) -> None:
    """The colours of the labels."""
    entries = [
        (label_text(label, dimension), label_colour(label))
        for label in range(min(dimension.n_labels, 24))
    ]
    st.html(legend(entries, before=f"{dimension.name}:"))


def show_features(
    demonstrations: Demonstrations, rows: tuple[FeatureRow, ...], divider: int
) -> None:
    """The distribution of features, coloured by the action, and a table of all.

    Args:
        demonstrations: N pairs with d features.
        rows: Each of the d features in numbers.
        divider: Number of intervals of continuous actions.
    """
    st.subheader("Features")
    names = [row.name for row in rows]
    dimensions = label_dimensions(demonstrations, divider)
    by = 0
    if len(dimensions) > 1:
        by = st.selectbox(
            "Colour by",
            range(len(dimensions)),
            key="colour",
            format_func=lambda index: dimensions[index].name,
            bind="query-params",
        )
    features = list(range(len(names)))
    if len(names) > AT_FIRST:
        features = st.multiselect(
            "Features to show",
            range(len(names)),
            default=list(range(AT_FIRST)),
            format_func=lambda index: names[index],
            key="features",
            bind="query-params",
            max_selections=MOST,
        )
    show_legend(dimensions[by])
    if not features:
        st.caption("Choose a feature above to see how it is distributed.")
    figures = feature_figures(demonstrations, divider, by, tuple(features))
    with st.grid(4, min_column_width=220, gap="small") as grid:
        for index, figure in zip(features, figures, strict=True):
            with grid.cell():
                unit = rows[index].unit
                st.markdown(
                    f"**{escaped(names[index])}**" + (f" :gray[{escaped(unit)}]" if unit else "")
                )
                chart(figure, f"feature_{index}", f"Distribution of {names[index]}, by action")
    numbers = [
        row
        for row, feature in zip(rows, demonstrations.features, strict=True)
        if feature.indicator is None
    ]
    words = [
        (column, word, share)
        for column, shares in word_shares(demonstrations).items()
        for word, share in shares.items()
    ]
    if words:
        columns, held, often = zip(*words, strict=True)
        st.dataframe(
            {"Words of": columns, "Word": held, "Steps": list(map(share_text, often))},
            hide_index=True,
            height="content" if len(words) <= 24 else 480,
        )
    if not numbers:
        return
    st.dataframe(
        {
            "Feature": [row.name for row in numbers],
            "Unit": [row.unit or "–" for row in numbers],
            "Least": [decimal_on_scale(row.low, row.low, row.high) for row in numbers],
            "Median": [decimal_on_scale(row.median, row.low, row.high) for row in numbers],
            "Largest": [decimal_on_scale(row.high, row.low, row.high) for row in numbers],
        },
        hide_index=True,
        height="content" if len(numbers) <= 24 else 480,
        column_config={
            column: st.column_config.NumberColumn(format="%.12g")
            for column in ("Least", "Median", "Largest")
        },
    )
