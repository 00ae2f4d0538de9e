"""Failures, cost and the worst tenth of some episodes: the same on every page that plays them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import streamlit as st

from sarl_core.environments.failures import no_failures_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.failures import rate_text, safety_cells, safety_facts

_ALWAYS = "Failures"  # a typical return hides them


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
    }
    return {
        name: st.column_config.TextColumn(alignment="right", help=text)
        for name, text in texts.items()
    }


def safety_metrics(episodes: Episodes) -> list[tuple[str, str, str]]:
    """What tiles say of the safety of some episodes.

    Args:
        episodes: At least one.

    Returns:
        Label, value and help: of failures always, of cost and the worst tenth where it is known.
    """
    cells, failures = safety_cells(episodes.summary(), len(episodes)), episodes.failures
    why = no_failures_text(episodes.env_id)
    facts = dict(safety_facts(episodes.summary(), len(episodes), episodes.env_id, shielded=False))
    tiles = [
        (
            "Failures",
            cells["Failures"],
            f"{why[0].upper()}{why[1:]}" if failures is None else rate_text(failures),
        )
    ]
    if "cost" in facts:
        tiles.append(("Cost", cells["Cost"].partition(" ")[0], facts["cost"]))
    if len(episodes) > 1:
        tiles.append(("Worst tenth", cells["Worst tenth"], "Mean return of the worst tenth"))
    return tiles
