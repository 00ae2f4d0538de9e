"""Failures against freedom: what was measured on the page, beside what was shipped."""

from __future__ import annotations

import json
from collections.abc import Sequence

import streamlit as st

from sarl_core.explaining.figures.rules.freedom import HERE, FreedomPoint, freedom_figure
from sarl_core.mining.language import share_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.session import is_dark
from sarl_dashboard.views.shield.lines import ShieldLine

_SHIPPED = DATA / "rules" / "freedom.json"
_ENVIRONMENT, _AGENT = "LunarLander-v3", "novice"  # of the shipped measurement


def show_freedom(finished: Sequence[tuple[ShieldLine, Episodes]]) -> None:
    """A figure of what every shield prevents and leaves; nothing where failures are not known.

    Args:
        finished: What has been run of the present choices.
    """
    points = [point for line, episodes in finished if (point := _measured(line, episodes))]
    if not points:
        return
    alike = [line.agent == _AGENT and str(line.row.env_id) == _ENVIRONMENT for line, _ in finished]
    shipped = _shipped() if any(alike) else ()
    drawn = [*shipped, *points]
    with st.expander("Failures against freedom", icon=":material/balance:"):
        chart(
            freedom_figure(drawn, front=bool(shipped), dark=is_dark()),
            "freedom_figure",
            "Freedom to the right, share of the episodes that fail upwards, for every shield",
        )
        st.caption(_about(shipped, all(alike)))
        st.dataframe(
            {
                "Rules": [one.name for one in drawn],
                "Freedom": [share_text(one.freedom) for one in drawn],
                "Failures": [f"{one.failures:,} of {one.episodes:,}" for one in drawn],
            },
            hide_index=True,
            alt="The points of the figure: freedom, and episodes that failed",
        )


def _measured(line: ShieldLine, episodes: Episodes) -> FreedomPoint | None:
    summary = episodes.summary()
    if "failures" not in summary:
        return None
    return FreedomPoint(
        kind=HERE,
        features=None,
        name=line.arm.name,
        freedom=1.0 if line.arm.rules is None else float(summary.get("freedom", float("nan"))),
        failures=int(summary["failures"]),
        episodes=len(episodes),
        low=float(summary["failure_low"]),
        high=float(summary["failure_high"]),
    )


@cached()
def _shipped() -> tuple[FreedomPoint, ...]:
    return tuple(map(FreedomPoint.of, json.loads(_SHIPPED.read_text("utf-8"))))


def _about(shipped: Sequence[FreedomPoint], alike: bool) -> str:
    """What is seen, and where it comes from."""
    text = (
        "The best corner is at the bottom on the right: few failures, much left to choose. The "
        "circles are what was measured here, each with its 95 % interval; without a shield "
        "everything is left."
    )
    if not shipped:
        return text
    text += (
        " All other points are a shipped measurement: sets of rules of every kind, and none, with "
        f"a novice that acts at random in Lunar Lander, {shipped[0].episodes} episodes for each on "
        "seeds of their own."
    )
    return text if alike else f"{text} They say nothing of other agents than the novice."
