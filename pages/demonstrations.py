"""What the expert did: choose or upload demonstrations, and look at what is in them."""

from __future__ import annotations

import html
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import plotly.graph_objects as go
import streamlit as st

from sarl_core.decimals import decimal_on_scale
from sarl_core.demonstrations.checks import find_warnings
from sarl_core.demonstrations.dataset import Demonstrations, Summary
from sarl_core.demonstrations.formats import (
    save_demonstrations,
)
from sarl_core.explaining.figures.colours import label_colour
from sarl_core.explaining.figures.demonstrations import (
    action_figure,
    episode_figure,
    feature_figure,
)
from sarl_core.explaining.figures.distributions import (
    FeatureRow,
    episode_series,
    feature_rows,
    histogram_by_label,
    interval_histogram,
)
from sarl_core.mining.labels import LabelledDimension, label_dimensions
from sarl_core.mining.language import label_text
from sarl_dashboard.cache import cached
from sarl_dashboard.components.hold_out import leave_out_choice, told
from sarl_dashboard.state.data import all_demonstrations, chosen_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider
from sarl_dashboard.text import escaped, in_full
from sarl_dashboard.views.demonstrations.upload import upload_section

FIGURES_AT_FIRST = 12
RETURN_COLOUR, LENGTH_COLOUR = "#0b6e99", "#7A8AA0"
PLAIN = {"displayModeBar": False}


# --- what is in them, cached -------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Contents:
    """What the page says of a set in numbers."""

    summary: Summary
    rows: tuple[FeatureRow, ...]
    warnings: tuple[str, ...]


@cached(show_spinner="Counting …")
def contents(digest: str, _demonstrations: Demonstrations) -> Contents:
    """Numbers of a set, worked out once for each digest."""
    return Contents(
        _demonstrations.summary(), feature_rows(_demonstrations), find_warnings(_demonstrations)
    )


@cached(show_spinner="Counting …")
def feature_figures(
    digest: str,
    divider: int,
    by: int,
    features: tuple[int, ...],
    _demonstrations: Demonstrations,
) -> tuple[go.Figure, ...]:
    """A figure for each of some features, coloured by the labels of one action dimension."""
    dimension = label_dimensions(_demonstrations, divider)[by]
    labels = dimension.labels_of(_demonstrations.action_columns[:, by])
    return tuple(
        feature_figure(
            _demonstrations.features[index],
            histogram_by_label(_demonstrations.observations[:, index], labels, dimension.n_labels),
            dimension,
        )
        for index in features
    )


@cached()
def action_figures(
    digest: str, divider: int, _demonstrations: Demonstrations
) -> tuple[go.Figure, ...]:
    """A figure for each action dimension."""
    figures = []
    for index, dimension in enumerate(label_dimensions(_demonstrations, divider)):
        values = _demonstrations.action_columns[:, index]
        if dimension.is_interval:
            histogram = interval_histogram(values, dimension)
        else:
            labels = dimension.labels_of(values)
            histogram = histogram_by_label(labels, labels, dimension.n_labels)
        figures.append(action_figure(histogram, dimension))
    return tuple(figures)


@cached()
def episode_figures(
    digest: str, _demonstrations: Demonstrations
) -> tuple[go.Figure | None, go.Figure]:
    """Returns (if there are rewards) and lengths of the episodes."""
    finished, returns = _demonstrations.episode_finished, _demonstrations.episode_returns
    return (
        None
        if returns is None
        else episode_figure(episode_series(returns, finished), "return", RETURN_COLOUR),
        episode_figure(
            episode_series(_demonstrations.episode_lengths, finished), "length", LENGTH_COLOUR
        ),
    )


def as_file(demonstrations: Demonstrations, extension: str) -> bytes:
    """The set as a file's bytes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"demonstrations{extension}"
        save_demonstrations(demonstrations, path)
        return path.read_bytes()


# --- the page ----------------------------------------------------------------------------------


def legend(dimension: LabelledDimension) -> None:
    """The colours of the labels."""
    entries = "".join(
        f'<span style="display:inline-block;margin-right:1.1em;white-space:nowrap">'
        f'<span style="display:inline-block;width:.75em;height:.75em;border-radius:2px;'
        f'background:{label_colour(label)};margin-right:.4em"></span>'
        f"{html.escape(label_text(label, dimension))}</span>"
        for label in range(min(dimension.n_labels, 24))
    )
    st.html(f'<div style="font-size:.9rem">{html.escape(dimension.name)}: {entries}</div>')


def overview(demonstrations: Demonstrations, found: Contents) -> None:
    """The set in a handful of numbers, and where it comes from."""
    summary = found.summary
    dimensions = demonstrations.action_dimensions
    if demonstrations.is_discrete and len(dimensions) == 1:
        actions, of_actions = f"{len(dimensions[0].labels)}", "to choose from at every step"
    else:
        kind = "discrete" if demonstrations.is_discrete else "continuous"
        actions, of_actions = f"{len(dimensions)}", f"{kind} action dimensions"
    with st.grid(6, min_column_width=130):
        st.metric(
            "Steps",
            f"{summary.steps:,}",
            border=True,
            help="Pairs of a state and the action the expert took in it.",
        )
        st.metric("Episodes", f"{summary.episodes:,}", border=True)
        st.metric(
            "Features", f"{summary.features:,}", border=True, help="Numbers that describe a state."
        )
        st.metric("Actions", actions, border=True, help=of_actions.capitalize() + ".")
        st.metric(
            "Mean length", f"{summary.length_mean:,.1f}", border=True, help="Steps an episode."
        )
        st.metric(
            "Mean return",
            "–" if summary.return_mean is None else f"{summary.return_mean:,.1f}",
            border=True,
            help="Sum of rewards of an episode, over the episodes that ended."
            if summary.return_mean is not None
            else "There are no rewards in these data.",
        )
    parts = [
        f"Environment **{escaped(demonstrations.env_id or 'not given')}**",
        f"shown by **{escaped(demonstrations.agent)}**" if demonstrations.agent else "",
        f"seed {demonstrations.seed}" if demonstrations.seed is not None else "",
        f"fingerprint `{demonstrations.digest[:12]}`",
    ]
    st.caption(" · ".join(part for part in parts if part))
    remarks = found.warnings  # the notes on reading among them
    if remarks:
        with st.container(border=True, gap="xsmall"):
            for remark in remarks[:8]:
                st.markdown(f":material/info: :gray[{in_full(remark)}]")
            if len(remarks) > 8:
                st.caption(f"… and {len(remarks) - 8} more.")


def columns_section(demonstrations: Demonstrations) -> None:
    """What each column of the file was taken for."""
    if not demonstrations.columns:
        return
    with st.expander("What each column was taken for", icon=":material/view_column:"):
        st.dataframe(
            {
                "Column": [one.column for one in demonstrations.columns],
                "Taken for": [one.use for one in demonstrations.columns],
                "Why": [one.why for one in demonstrations.columns],
            },
            hide_index=True,
            height="content" if len(demonstrations.columns) <= 24 else 480,
        )
        st.caption("If one is wrong, map the columns yourself, where the file was chosen.")


def actions_section(demonstrations: Demonstrations, divider: int) -> None:
    """Which actions were taken, and how the episodes went."""
    returns, lengths = episode_figures(demonstrations.digest, demonstrations)
    figures = action_figures(demonstrations.digest, divider, demonstrations)
    dimensions = demonstrations.action_dimensions
    with st.grid(3, min_column_width=300, gap="medium") as grid:
        for index, figure in enumerate(figures[:FIGURES_AT_FIRST]):
            with grid.cell():
                st.markdown(f"**Actions: {escaped(dimensions[index].name)}**")
                st.plotly_chart(
                    figure,
                    config=PLAIN,
                    key=f"action_{index}",
                    alt=f"How often each action of {dimensions[index].name} was taken",
                )
        if returns is not None:
            with grid.cell():
                st.markdown("**Return of each episode**")
                st.plotly_chart(
                    returns, config=PLAIN, key="returns", alt="Return of each episode, in order"
                )
        with grid.cell():
            st.markdown("**Length of each episode**")
            st.plotly_chart(
                lengths,
                config=PLAIN,
                key="lengths",
                alt="Number of steps of each episode, in order",
            )
    finished = demonstrations.episode_finished
    if finished is not None and not finished.all():
        st.caption(
            "A hollow point is an episode that had not ended when the recording stopped; "
            "the mean return leaves it out."
        )


def features_section(demonstrations: Demonstrations, found: Contents, divider: int) -> None:
    """How every feature is distributed, coloured by the action, and a table of all."""
    st.subheader("Features")
    names = [feature.name for feature in demonstrations.features]
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
    shown: list[int] = list(range(len(names)))
    if len(names) > FIGURES_AT_FIRST:
        shown = st.multiselect(
            "Features to show",
            range(len(names)),
            default=list(range(FIGURES_AT_FIRST)),
            format_func=lambda index: names[index],
            key="features",
            bind="query-params",
            max_selections=48,
        )
    legend(dimensions[by])
    if not shown:
        st.caption("Choose a feature above to see how it is distributed.")
    figures = feature_figures(demonstrations.digest, divider, by, tuple(shown), demonstrations)
    with st.grid(4, min_column_width=220, gap="small") as grid:
        for index, figure in zip(shown, figures, strict=True):
            with grid.cell():
                unit = found.rows[index].unit
                st.markdown(
                    f"**{escaped(names[index])}**" + (f" :gray[{escaped(unit)}]" if unit else "")
                )
                st.plotly_chart(
                    figure,
                    config=PLAIN,
                    key=f"feature_{index}",
                    alt=f"Distribution of {names[index]}, by action",
                )
    st.dataframe(
        {
            "Feature": names,
            "Unit": [row.unit or "–" for row in found.rows],
            "Least": [decimal_on_scale(row.low, row.low, row.high) for row in found.rows],
            "Median": [decimal_on_scale(row.median, row.low, row.high) for row in found.rows],
            "Largest": [decimal_on_scale(row.high, row.low, row.high) for row in found.rows],
        },
        hide_index=True,
        height="content" if len(names) <= 24 else 480,
        column_config={
            column: st.column_config.NumberColumn(format="%.12g")
            for column in ("Least", "Median", "Largest")
        },
    )


def downloads(demonstrations: Demonstrations) -> None:
    """The set as a file."""
    name = demonstrations.env_id.rsplit("/", 1)[-1].rsplit(":", 1)[-1] or "demonstrations"
    with st.container(horizontal=True):
        for label, extension, mime in (
            ("Download as Parquet", ".parquet", "application/vnd.apache.parquet"),
            ("Download as CSV", ".csv", "text/csv"),
        ):
            st.download_button(
                label,
                partial(as_file, demonstrations, extension),
                file_name=f"{name}{extension}",
                mime=mime,
                on_click="ignore",
                icon=":material/download:",
                key=f"download_{extension[1:]}",
            )


def episodes_section() -> None:
    """Leave episodes out; what is then shown is what remains."""
    whole = all_demonstrations()
    if whole is None or whole.n_episodes < 2:
        return
    lines = told(whole)
    with st.expander("Leave episodes out", icon=":material/playlist_remove:"):
        leave_out_choice(whole)
        st.caption(
            "Rules are mined without them, on every page; the file stays as it is. The page "
            "Evidence says which episodes contradict the others."
        )
    if lines:
        st.caption(f"This page shows the episodes that rules are mined from: {', '.join(lines)}.")


st.title("Demonstrations")
st.caption(
    "What the expert did: at every step a state, and the action taken in it. Rules are "
    "mined from these pairs."
)
chosen = chosen_demonstrations()
upload_section(expanded=chosen is None)
if chosen is None:
    st.info(
        "Nothing has been uploaded in this session. Upload a file above, or choose a shipped "
        "set in the sidebar.",
        icon=":material/upload_file:",
    )
    st.stop()
numbers = contents(chosen.digest, chosen)
intervals = chosen_divider()
overview(chosen, numbers)
columns_section(chosen)
episodes_section()
actions_section(chosen, intervals)
features_section(chosen, numbers, intervals)
downloads(chosen)
