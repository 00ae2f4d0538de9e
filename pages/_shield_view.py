"""What the Shield page shows of a comparison: two figures and a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import streamlit as st
from _comparisons import Row

from sarl_core.explaining.comparison_figures import ArmStyle, returns_figure, typical_figure
from sarl_core.explaining.language import share_text
from sarl_core.rollouts.comparison import Arm, Comparison, crash_rate
from sarl_core.rollouts.episodes import Episodes

PLAIN = {"displayModeBar": False}
HEIGHT = 400


@dataclass(frozen=True, eq=False)
class Line:
    """One agent with one shield.

    Attributes:
        row: What is run.
        arm: What it is in a comparison.
        style: How it is drawn.
        agent: Name on screen.
        shield: Name on screen.
    """

    row: Row
    arm: Arm
    style: ArmStyle
    agent: str
    shield: str


def show(
    found: Sequence[tuple[Line, Episodes]],
    env_id: str,
    seed: int,
    episodes: int,
    *,
    at_work: bool,
) -> None:
    """The comparison, or what to do where there is none.

    Args:
        found: What has been run of the present choices.
        env_id: Environment.
        seed: Of the first episode.
        episodes: How many were asked for.
        at_work: Whether more is on its way.
    """
    if not found:
        if not at_work:
            st.info(
                "Choose agents and shields, then press Run. The work goes on while you look at "
                "other pages, and what is finished stays when you cancel.",
                icon=":material/play_circle:",
            )
        return
    lines = [line for line, _ in found]
    comparison = Comparison(
        env_id, seed, tuple(line.arm for line in lines), tuple(episodes for _, episodes in found)
    )
    styles = [line.style for line in lines]
    left, right = st.columns([2, 3], gap="medium")
    with left:
        st.markdown("**Typical return**")
        st.plotly_chart(
            typical_figure(comparison, styles=styles),
            config=PLAIN,
            key="typical",
            alt="Interquartile mean of the returns with its 95 % interval, for every agent and "
            "shield",
        )
    with right:
        st.markdown("**Every episode**")
        st.plotly_chart(
            returns_figure(comparison, styles=styles, height=HEIGHT),
            config=PLAIN,
            key="returns",
            alt="Return of every episode, for every agent and shield",
        )
    table(found, env_id)
    st.caption(
        "The typical return is the mean of the middle half of the episodes, which a few odd ones "
        "do not move, with its 95 % interval."
    )


def table(found: Sequence[tuple[Line, Episodes]], env_id: str) -> None:
    """One row a line."""
    rows = [table_row(line, episodes, env_id) for line, episodes in found]
    st.dataframe(rows, hide_index=True, height="content", key="table")


def table_row(line: Line, episodes: Episodes, env_id: str) -> dict[str, Any]:
    """What the table says of a line."""
    numbers, summary = episodes.statistics, episodes.summary()
    shielded = line.arm.rules is not None
    return {
        "Agent": line.agent,
        "Shield": line.shield,
        "Rules": f"{len(line.arm.rules):,}" if line.arm.rules is not None else "–",
        "Episodes": len(episodes),
        "Typical return": round(numbers.iqm, 1),
        "95 % interval": f"{numbers.low:,.1f} to {numbers.high:,.1f}",
        "Mean return": round(numbers.mean, 1),
        "Changed": share_text(summary["intervention_rate"]) if shielded else "–",
        "Covered": share_text(summary["coverage"]) if shielded else "–",
        "Crashes": share_text(crash_rate(episodes, env_id)),
    }
