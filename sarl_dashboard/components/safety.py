"""Failures, cost, the worst tenth and freedom: the same on every page that plays episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import streamlit as st

from sarl_core.environments.failures import no_failures_text
from sarl_core.mining.language import share_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.failures import rate_text, safety_cells, safety_facts
from sarl_dashboard.components.journey.words import with_words, word_help

_ALWAYS = "Failures"  # a typical return hides them


@dataclass(frozen=True)
class Tile:
    """One number of some episodes.

    Attributes:
        label: What it is.
        value: As text.
        hint: Said when the pointer rests on it.
        interval: Where it probably lies; "" where that is not known.
    """

    label: str
    value: str
    hint: str
    interval: str = ""

    def show(self, label: str = "") -> None:
        """Draw it.

        Args:
            label: In the place of its own.
        """
        st.metric(
            label or self.label,
            self.value,
            delta=self.interval or None,
            delta_color="off",
            delta_arrow="off",
            border=True,
            height="stretch",
            help=with_words(self.hint),
        )


def safety_columns(runs: Sequence[Episodes]) -> list[dict[str, str]]:
    """What the rows of a table say of the safety of some episodes.

    Args:
        runs: One entry a row.

    Returns:
        The cells of each row; without a column of which no row knows anything, but for failures.
    """
    rows = [safety_cells(run.summary(), len(run)) for run in runs]
    known = {name for row in rows for name, text in row.items() if text != "–"} | {_ALWAYS}
    return [{name: text for name, text in row.items() if name in known} for row in rows]


def safety_column_config() -> dict[str, Any]:
    """What these columns look like, and what they mean."""
    texts = {
        "Failures": "Share of the episodes that failed: a fall, a crash, or whatever the task must "
        "not let happen. A landing or an arrival is none. A dash where it is not known which "
        "episodes are failures, or none is",
        "Failures, 95 %": "Where the share of failures probably lies (95 % interval by Clopper and "
        "Pearson)",
        "Cost": "What an episode costs on average, by what the environment or the server's owner "
        "says, with the 95 % interval",
        "Worst tenth": "Mean return of the worst tenth of the episodes",
        "Freedom": word_help("freedom"),
    }
    return {
        name: st.column_config.TextColumn(alignment="right", help=text)
        for name, text in texts.items()
    }


def freedom_cell(episodes: Episodes) -> str:
    """What the rules left in these episodes, in a table; "–" where it is not known."""
    return share_text(episodes.summary().get("freedom", float("nan")))


def safety_tiles(episodes: Episodes, *, shielded: bool) -> list[Tile]:
    """What tiles say of the safety of some episodes.

    Args:
        episodes: At least one.
        shielded: Whether rules were in force.

    Returns:
        Of failures always, of cost, the worst tenth and freedom where it is known.
    """
    summary, failures = episodes.summary(), episodes.failures
    cells = safety_cells(summary, len(episodes))
    why = no_failures_text(episodes.env_id)
    facts = dict(safety_facts(summary, len(episodes), episodes.env_id, shielded=shielded))
    between = "" if failures is None else cells["Failures, 95 %"]
    tiles = [
        Tile(
            "Failures",
            cells["Failures"],
            f"{why[0].upper()}{why[1:]}" if failures is None else rate_text(failures),
            between if between != "–" else "",
        )
    ]
    if "cost" in facts:
        value, _, interval = cells["Cost"].partition(" ")
        tiles.append(Tile("Cost", value, facts["cost"], interval.strip("()")))
    if len(episodes) > 1:
        tiles.append(Tile("Worst tenth", cells["Worst tenth"], "Mean return of the worst tenth"))
    if "freedom" in facts:
        tiles.append(Tile("Freedom", freedom_cell(episodes), word_help("freedom")))
    return tiles
