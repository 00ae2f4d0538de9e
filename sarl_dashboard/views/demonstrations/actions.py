"""Which actions were taken, and how the episodes went."""

from __future__ import annotations

import plotly.graph_objects as go
import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.demonstrations import action_figure, episode_figure
from sarl_core.explaining.figures.distributions import (
    episode_series,
    histogram_by_label,
    interval_histogram,
    label_histogram,
)
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.labels import label_dimensions
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.text import escaped

MOST_FIGURES = 12
RETURN_COLOUR, LENGTH_COLOUR = "#0b6e99", "#7A8AA0"


@cached()
def action_figures(demonstrations: Demonstrations, divider: int) -> tuple[go.Figure, ...]:
    """A figure for each action dimension."""
    figures = []
    for index, dimension in enumerate(label_dimensions(demonstrations, divider)):
        values = demonstrations.action_columns[:, index]
        if dimension.is_interval:
            histogram = interval_histogram(values, dimension)
        else:
            labels = dimension.labels_of(values)
            histogram = histogram_by_label(labels, labels, dimension.n_labels)
        figures.append(action_figure(histogram, dimension))
    return tuple(figures)


@cached()
def counted_action_figures(mined: MinedData) -> tuple[go.Figure, ...]:
    """The same of what was counted of all steps."""
    return tuple(
        action_figure(label_histogram(tree.counts[0], tree.dimension), tree.dimension)
        for tree in mined.trees
    )


@cached()
def episode_figures(
    demonstrations: Demonstrations,
) -> tuple[go.Figure | None, go.Figure]:
    """Returns (if there are rewards) and lengths of the episodes."""
    finished, returns = demonstrations.episode_finished, demonstrations.episode_returns
    return (
        None
        if returns is None
        else episode_figure(episode_series(returns, finished), "return", RETURN_COLOUR),
        episode_figure(
            episode_series(demonstrations.episode_lengths, finished), "length", LENGTH_COLOUR
        ),
    )


def show_actions(
    demonstrations: Demonstrations, divider: int, mined: MinedData | None = None
) -> None:
    """How often each action was taken; return and length of every episode, where they are here."""
    returns, lengths = (None, None) if mined else episode_figures(demonstrations)
    figures = counted_action_figures(mined) if mined else action_figures(demonstrations, divider)
    dimensions = demonstrations.action_dimensions
    with st.grid(3, min_column_width=300, gap="medium") as grid:
        for index, figure in enumerate(figures[:MOST_FIGURES]):
            name = dimensions[index].name
            with grid.cell():
                st.markdown(f"**Actions: {escaped(name)}**")
                chart(figure, f"action_{index}", f"How often each action of {name} was taken")
        if returns is not None:
            with grid.cell():
                st.markdown("**Return of each episode**")
                chart(returns, "returns", "Return of each episode, in order")
        if lengths is not None:
            with grid.cell():
                st.markdown("**Length of each episode**")
                chart(lengths, "lengths", "Number of steps of each episode, in order")
    if say_steps_needed("what became of each episode", demonstrations):
        return
    finished = demonstrations.episode_finished
    if finished is not None and not finished.all():
        st.caption(
            "A hollow point is an episode that had not ended when the recording stopped; "
            "the mean return leaves it out."
        )
