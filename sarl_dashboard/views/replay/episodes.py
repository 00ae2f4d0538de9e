"""Several episodes on the page Replay: returns with the rules and without, and how each ended."""

from __future__ import annotations

import numpy as np
import streamlit as st

from sarl_core.explaining.figures.replay import (
    SHIELDED_COLOUR,
    UNSHIELDED_COLOUR,
    ReturnRow,
    comparison_figure,
)
from sarl_core.explaining.words.fork import ending_texts
from sarl_core.mining.language import share_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import summarise
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.flips import flips_rate, flips_title, pace_of_played
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.components.safety import freedom_cell, safety_column_config, safety_columns
from sarl_dashboard.jobs.replays import (
    EPISODE_RUNS,
    EPISODES,
    WITH,
    ReplayOrder,
    Runs,
    compared,
    comparing,
    comparison_cache,
)


def take_up(order: ReplayOrder) -> None:
    """Take up a comparison that has been run: the flight recorder has its steps."""
    first, episodes = _first(order), st.session_state.get("over") or EPISODES[0]
    if (first.key, episodes) in comparison_cache():
        st.session_state["_compared"] = (first, episodes)


def _first(order: ReplayOrder) -> ReplayOrder:
    """The order of the first episode of a comparison, whichever is on screen."""
    ran = compared(order)
    return order if ran is None else ran[0]


def comparison(order: ReplayOrder) -> None:
    """Several episodes instead of one, on request."""
    st.header("Over several episodes")
    ran, order = compared(order), _first(order)
    result = st.container()
    episodes = int(
        st.segmented_control(
            "Episodes",
            EPISODES,
            default=EPISODES[0],
            key="over",
            bind="query-params",
            required=True,
        )
        or EPISODES[0]
    )
    key = (order.key, episodes)
    offer = Offer(
        key=key,
        start=lambda: comparing(order, episodes),
        about="One episode may be luck. Run more of them, each on a seed of its own.",
        complete=False,
        cancelled="Cancelled; nothing was kept.",
        label=f"Run {episodes} episodes",
        icon=":material/stacked_bar_chart:",
        type="secondary",
    )

    def bar(at_work: bool) -> None:
        if at_work or key not in comparison_cache():
            run_bar(EPISODE_RUNS, offer)

    watched(EPISODE_RUNS, bar)
    runs = comparison_cache().get(key)
    if runs is None:
        return
    if ran != (order, episodes):
        st.session_state["_compared"] = (order, episodes)
        st.rerun()  # the recorder above shows their steps
    with result:
        outcome(runs)


def outcome(runs: Runs) -> None:
    """What came of them.

    Args:
        runs: With the rules, where there are some, and without.
    """
    rows, table = [], []
    for (name, run), safety in zip(runs, safety_columns([run for _, run in runs]), strict=True):
        interval = summarise(run.returns)
        rows.append(
            ReturnRow(
                name,
                run.returns,
                interval.iqm,
                interval.low,
                interval.high,
                SHIELDED_COLOUR if name == WITH else UNSHIELDED_COLOUR,
            )
        )
        table.append(
            {
                "Run": name.capitalize(),
                "Mean return": f"{interval.mean:,.1f}",
                "Typical return": f"{interval.iqm:,.1f}",
                "95 % interval": f"{interval.low:,.1f} to {interval.high:,.1f}",
                "Mean length": f"{run.lengths.mean():,.1f}",
                **safety,
                "Changed": share_text(float(run.interventions.sum()) / float(run.lengths.sum()))
                if name == WITH
                else "–",
                "Freedom": freedom_cell(run) if name == WITH else "–",
                flips_title(run.env_id): f"{flips_rate(run):.2f}" if name == WITH else "–",
            }
        )
    chart(
        comparison_figure(rows), "comparison", "Returns of the episodes with the rules and without"
    )
    st.dataframe(table, hide_index=True, column_config=safety_column_config())
    st.caption(
        "A point is an episode. The diamond is the typical return, the mean of the middle "
        "half of the episodes, which a few odd ones do not move, with its 95 % interval. The "
        "steps of all episodes are in the flight recorder above."
    )
    every_episode(runs[0][1], shielded=runs[0][0] == WITH)


def every_episode(episodes: Episodes, *, shielded: bool) -> None:
    """A row an episode."""
    pace = pace_of_played(episodes.env_id)
    columns: dict[str, object] = {
        "Seed": episodes.seeds,
        "Return": episodes.returns,
        "Steps": episodes.lengths,
        "Ended": ending_texts(episodes),
    }
    if not np.isnan(episodes.costs).any():
        columns["Cost"] = episodes.costs
    if shielded and episodes.flips is not None:
        columns["Changed"] = episodes.interventions
        columns[flips_title(episodes.env_id)] = [
            pace.rate(*pair)
            for pair in zip(episodes.flips.tolist(), episodes.lengths.tolist(), strict=True)
        ]
    with st.expander("Every episode"):
        st.dataframe(
            columns,
            hide_index=True,
            height=300,
            column_config={
                "Seed": st.column_config.NumberColumn(format="%d"),
                "Return": st.column_config.NumberColumn(format="%.1f"),
                flips_title(episodes.env_id): st.column_config.NumberColumn(format="%.2f"),
            },
        )
