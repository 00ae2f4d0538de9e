"""The card beside a rule file, as far as a report reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from sarl_core.documents import Count, Number, Share, fitting, read_object
from sarl_core.rollouts.statistics import Rate


class RuleSetCard(Struct):
    """What a card of a rule file may say; all of it may be missing."""

    budget: Count | None = None
    rounds: list[Any] = []
    chosen_round: Count | None = None
    refined: bool | None = None
    chosen_by: str | None = None
    reported: dict[str, Any] = {}
    reported_on: str | None = None
    seed: Count | None = None
    command: str | None = None

    @property
    def reported_episodes(self) -> ReportedEpisodes:
        """What an agent that follows the rules achieved; without a mean where it is not said."""
        return fitting(self.reported, ReportedEpisodes)


class ReportedEpisodes(Struct):
    """What a card may say of the episodes in which its rules were tried."""

    episodes: Count | None = None
    mean: Number | None = None
    std: Number | None = None
    min: Number | None = None
    max: Number | None = None
    failures: Count | None = None
    failure_low: Share | None = None
    failure_high: Share | None = None
    cut: Count | None = None
    undecided: Count | None = None
    worst_tenth: Number | None = None
    cost: Number | None = None
    cost_low: Number | None = None
    cost_high: Number | None = None

    @property
    def rate(self) -> Rate | None:
        """Of failures, where all is there that tells it and no number contradicts another."""
        low, high = self.failure_low, self.failure_high
        if self.failures is None or not self.episodes or low is None or high is None:
            return None
        unknown = self.undecided if self.undecided is not None else self.cut or 0
        share = self.failures / self.episodes
        if self.failures + unknown > self.episodes or not low <= share <= high:
            return None
        return Rate(self.failures, self.episodes, share, low, high, unknown)


def read_card(rules: Path) -> Mapping[str, Any] | None:
    """The card beside a rule file, which says how the rules were made.

    Args:
        rules: As "rules.json"; its card is "rules.card.json".

    Returns:
        None where there is none.

    Raises:
        InputError: If it cannot be read.
    """
    path = rules.with_suffix(".card.json")
    if not path.is_file():
        return None
    return read_object(path, "mend this card or take it away")
