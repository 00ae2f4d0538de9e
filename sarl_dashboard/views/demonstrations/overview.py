"""A set of demonstrations in a handful of numbers, what it was read from, and what is left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations, Summary
from sarl_core.demonstrations.derived import formula_texts
from sarl_core.demonstrations.samples import sample_text
from sarl_core.demonstrations.warnings import find_warnings
from sarl_core.explaining.figures.distributions import (
    FeatureRow,
    counted_feature_rows,
    feature_rows,
)
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_dashboard.cache import cached
from sarl_dashboard.components.hold_out import leave_out_choice, parting_lines
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state.data import all_demonstrations
from sarl_dashboard.text import escaped, in_full

MOST_REMARKS = 8


@dataclass(frozen=True, eq=False)
class Contents:
    """What the page says of a set in numbers."""

    summary: Summary
    rows: tuple[FeatureRow, ...]
    warnings: tuple[str, ...]


@cached()
def counted_contents(mined: MinedData) -> Contents:
    """The same of what was counted of all steps where they were mined."""
    whole = mined.sample.whole
    summary = replace(
        mined.sample.summary(),
        steps=whole.steps,
        episodes=whole.episodes,
        length_mean=whole.steps / whole.episodes,
        return_mean=None,
        return_std=None,
    )
    return Contents(summary, counted_feature_rows(mined), mined.notes)


@cached(show_spinner="Counting …")
def contents_of(demonstrations: Demonstrations) -> Contents:
    """Numbers of a set."""
    return Contents(
        demonstrations.summary(), feature_rows(demonstrations), find_warnings(demonstrations)
    )


def show_overview(demonstrations: Demonstrations, contents: Contents) -> None:
    """The set in a handful of numbers, and where it comes from."""
    summary = contents.summary
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
            help=with_words("Pairs of a state and the action the expert took in it."),
        )
        st.metric("Episodes", f"{summary.episodes:,}", border=True)
        st.metric(
            "Features",
            f"{summary.features:,}",
            border=True,
            help=with_words("Numbers that describe a state."),
        )
        st.metric("Actions", actions, border=True, help=with_words(of_actions.capitalize() + "."))
        st.metric(
            "Mean length",
            f"{summary.length_mean:,.1f}",
            border=True,
            help=with_words("Steps an episode."),
        )
        st.metric(
            "Mean return",
            "–" if summary.return_mean is None else f"{summary.return_mean:,.1f}",
            border=True,
            help=with_words(
                "Sum of rewards of an episode, over the episodes that ended."
                if summary.return_mean is not None
                else "There are no rewards in these data."
                if demonstrations.sample_of is None
                else "A mined file holds no rewards."
            ),
        )
    parts = [
        f"Environment **{escaped(demonstrations.env_id or 'not given')}**",
        f"shown by **{escaped(demonstrations.agent)}**" if demonstrations.agent else "",
        f"seed {demonstrations.seed}" if demonstrations.seed is not None else "",
        f"fingerprint `{demonstrations.whole.digest[:12]}`",
    ]
    st.caption(" · ".join(part for part in parts if part))
    if demonstrations.sample_of is not None:
        is_part = len(demonstrations) < summary.steps
        st.caption(
            ":material/data_usage: Mined on a cluster: what is said of rules counts all steps. To "
            f"be looked at, {sample_text(demonstrations)} {'is' if is_part else 'are'} here."
        )
    formulas = formula_texts(demonstrations.derived)
    if formulas:
        with st.container(key="formulas", gap="xsmall"):
            st.caption("Worked out from the features, by formulas (the page Names changes them):")
            st.code("\n".join(formulas), language=None, wrap_lines=True)
    remarks = contents.warnings  # the notes on reading among them
    if remarks:
        with st.container(border=True, gap="xsmall"):
            for remark in remarks[:MOST_REMARKS]:
                st.markdown(f":material/info: :gray[{in_full(remark)}]")
            if len(remarks) > MOST_REMARKS:
                st.caption(f"… and {len(remarks) - MOST_REMARKS} more.")


def show_columns(demonstrations: Demonstrations) -> None:
    """What each column of the file was taken for."""
    columns = demonstrations.columns
    if not columns:
        return
    with st.expander("What each column was taken for", icon=":material/view_column:"):
        st.dataframe(
            {
                "Column": [each.column for each in columns],
                "Taken for": [each.use for each in columns],
                "Why": [each.why for each in columns],
            },
            hide_index=True,
            height="content" if len(columns) <= 24 else 480,
        )
        st.caption("If one is wrong, map the columns yourself, where the file was chosen.")


def leave_episodes_out() -> None:
    """Leave episodes out; what is then shown is what remains."""
    whole = all_demonstrations()
    if whole is None or whole.n_episodes < 2 or whole.sample_of is not None:
        return
    lines = parting_lines(whole)
    with st.expander("Leave episodes out", icon=":material/playlist_remove:"):
        leave_out_choice(whole)
        st.caption(
            "Rules are mined without them, on every page; the file stays as it is. The page "
            "Evidence says which episodes contradict the others."
        )
    if lines:
        st.caption(f"This page shows the episodes that rules are mined from: {', '.join(lines)}.")
