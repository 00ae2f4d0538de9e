"""The flight recorder as a table that people read: a page of steps at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import extend
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.action_words import done_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.step_filters import StepFilter
from sarl_core.rollouts.steps import StepTable

PAGE = 15  # steps; a page is seen as a whole, and with it the step that is chosen


def recorder_columns(
    steps: StepTable,
    rows: NDArray[np.int64],
    dimensions: Sequence[LabelledDimension],
    features: Sequence[Feature],
    rule_set: RuleSet | None,
    *,
    seeds: Sequence[int] | None = None,
) -> dict[str, list[object]]:
    """Some steps as columns.

    Args:
        steps: T of them.
        rows: Those to show.
        dimensions: The m action dimensions.
        features: The d features; what the rules derive from them follows.
        rule_set: The rules of the shield; None without one, and then without what it says.
        seeds: Of the episodes where there are several, to name them.

    Returns:
        Column name to one value a row: the seed, the step, for each dimension what the agent
        wanted, what was done and the rule's name, then "Changed", "Outside", "Not checked" (why no
        rule was asked), "Distance", "Reward", "Failure" and "Cost" where the steps say so, and the
        features: with their units, and words in words. Where no threshold was looked at, the
        distance is NaN.
    """
    part = steps.take(rows)
    columns: dict[str, list[object]] = {}
    if seeds is not None:
        columns["Seed"] = [int(seeds[episode]) for episode in part.episode.tolist()]
    columns["Step"] = part.step.tolist()
    several = len(dimensions) > 1
    for index, dimension in enumerate(dimensions):
        before = f"{dimension.name}: " if several else ""
        proposed, executed = (one[:, index].tolist() for one in (part.proposed, part.executed))
        done = [
            done_text(value, dimension, beside=(other,))
            for value, other in zip(executed, proposed, strict=True)
        ]
        if rule_set is None:
            columns[_titled(f"{before}done")] = list(done)
            continue
        wanted = [
            done_text(value, dimension, beside=(other,))
            for value, other in zip(proposed, executed, strict=True)
        ]
        columns[_titled(f"{before}wanted")] = list(wanted)
        columns[_titled(f"{before}done")] = list(done)
        columns[_titled(f"{before}rule")] = [
            rule_set.name_of(rule_set.rules[rule]) if rule >= 0 else ""
            for rule in part.rules[:, index].tolist()
        ]
    if rule_set is not None:
        columns["Changed"] = part.intervened.tolist()
        if steps.outside.any():
            columns["Outside"] = part.outside.tolist()
        if steps.is_invalid.any():
            columns["Not checked"] = [why or "" for why in part.invalid.tolist()]
        columns["Distance"] = [
            value if math.isfinite(value) else math.nan for value in part.margin.tolist()
        ]
    columns["Reward"] = part.reward.tolist()
    if steps.failed.any():
        columns["Failure"] = part.failed.tolist()
    if not np.isnan(steps.cost).all():
        columns["Cost"] = part.cost.tolist()
    known = rule_set.source.features if rule_set is not None else features
    states = extend(part.observation, known)
    for column in state_columns((*features, *known[len(features) :])):
        index = column.places[0]
        title = f"{column.title} ({column.unit})" if column.unit else column.title
        if title in columns:
            title = f"{title} [{index}]"  # a column of a table has a name of its own
        columns[title] = (
            list(column.words(states))
            if column.of_words
            else states[:, index].astype(np.float64).tolist()
        )
    return columns


def place_of(rows: NDArray[np.int64], row: int) -> int | None:
    """Where a row stands among those that a filter lets through.

    Args:
        rows: Their numbers, ascending.
        row: One of the table.

    Returns:
        Its place, or None if it is not among them.
    """
    place = int(np.searchsorted(rows, row))
    return place if place < len(rows) and int(rows[place]) == row else None


def page_count(rows: int) -> int:
    """How many pages so many steps take.

    Args:
        rows: Number of steps.

    Returns:
        At least 1.
    """
    return max(-(-rows // PAGE), 1)


def filter_text(chosen: StepFilter, rows: int, total: int, rule: str = "") -> str:
    """What a filter leaves, in words.

    Args:
        chosen: The filter.
        rows: Steps it lets through.
        total: Steps in all.
        rule: What its rule is called.

    Returns:
        As "12 of 300 steps: changed by the rules, under R14"; "300 steps" without a filter.
    """
    filters = [
        words
        for words, on in (
            ("changed by the rules", chosen.intervened),
            ("outside the data", chosen.outside),
            (f"under {rule}", chosen.rule is not None),
            ("of one episode", chosen.episode is not None),
        )
        if on
    ]
    if not filters:
        return counted(total, "step")
    return f"{rows:,} of {counted(total, 'step')}: {', '.join(filters)}"


def _titled(text: str) -> str:
    return text[:1].upper() + text[1:]
