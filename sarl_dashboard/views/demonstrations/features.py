"""How every feature is distributed."""

from __future__ import annotations

import streamlit as st

from sarl_core.decimals import decimal_on_scale
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.distributions import FeatureRow
from sarl_core.explaining.words.states import word_shares
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.language import share_text
from sarl_dashboard.components.distributions import (
    distributions,
    show_distribution,
    show_legend,
)

AT_FIRST, MOST = 12, 48  # figures


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
    pictures = distributions(demonstrations, divider, by, tuple(features))
    with st.grid(4, min_column_width=220, gap="small") as grid:
        for index, picture in zip(features, pictures, strict=True):
            with grid.cell():
                show_distribution(picture, f"feature_{index}")
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
