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
from sarl_dashboard.components.journey.steps_needed import say_of_sample
from sarl_dashboard.components.lists.feature_search import searched
from sarl_dashboard.components.lists.pages import follow, number_of_pages, page_choice

PAGE_FIGURES = 12
SEARCH, PAGE = "feature_search", "feature_page"


def show_features(
    demonstrations: Demonstrations, rows: tuple[FeatureRow, ...], divider: int
) -> None:
    """The distribution of features, coloured by the action, and a table of them.

    Of many features those that are searched for are shown, a page of figures at a time.

    Args:
        demonstrations: N pairs with d features.
        rows: Each of the d features in numbers.
        divider: Number of intervals of continuous actions.
    """
    st.header("Features")
    say_of_sample("The bars", demonstrations)
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
    named = searched(names, SEARCH) if len(names) > PAGE_FIGURES else list(range(len(names)))
    show_legend(dimensions[by])
    if not named:
        st.caption("No feature has such a name; clear the search to see all.")
    pages = number_of_pages(len(named), PAGE_FIGURES)
    follow(PAGE, tuple(named), None, page=0, pages=pages)
    figures = st.container()
    # Which page it is has to be known before the figures, which stand above the choice.
    first = page_choice(PAGE, pages) * PAGE_FIGURES
    features = named[first : first + PAGE_FIGURES]
    with figures, st.grid(4, min_column_width=220, gap="small") as grid:
        pictures = distributions(demonstrations, divider, by, tuple(features))
        for index, picture in zip(features, pictures, strict=True):
            with grid.cell():
                show_distribution(picture, f"feature_{index}")
    numbers = [rows[place] for place in named if demonstrations.features[place].indicator is None]
    words = [
        (column, word, share)
        for column, shares in word_shares(demonstrations).items()
        for word, share in shares.items()
    ]
    if words:
        say_of_sample("The words", demonstrations)
        columns, held, often = zip(*words, strict=True)
        st.dataframe(
            {"Words of": columns, "Word": held, "Steps": list(map(share_text, often))},
            hide_index=True,
            height="content" if len(words) <= 24 else 480,
        )
    if not numbers:
        return
    if demonstrations.sample_of is not None:
        st.caption(
            "The table is of all steps; a median is the nearest border of the bins they were "
            "counted in."
        )
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
