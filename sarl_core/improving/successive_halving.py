"""Choosing the best of many candidates by episodes, most of which go to the few that are good."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.rollouts.choices import mean_score

Score = Callable[[Sequence[int], int, int], Sequence[NDArray[np.float64]]]
"""Called with (candidates, first seed, how many); gives for each candidate the return of each
episode, (E,), or of each what counts, the most important first and the return last, (E, K)."""


@dataclass(frozen=True)
class Selection:
    """How the best candidate was found.

    Attributes:
        ranking: All of them, the best first; who left early stands behind who stayed.
        means: Mean return of each candidate over the episodes it was given, (K,).
        episodes: How many each was given, (K,) int64.
        turns: Mean return after each of T turns, NaN for who had left, (T, K).
    """

    ranking: tuple[int, ...]
    means: NDArray[np.float64]
    episodes: NDArray[np.int64]
    turns: NDArray[np.float64]

    @property
    def best(self) -> int:
        """Index of the best one."""
        return self.ranking[0]

    def places(self) -> NDArray[np.float64]:
        """Whom to follow.

        Returns:
            Shape (K,), more where a candidate is better. Who left early lies behind who stayed;
            where both had achieved the same, it has the mean place of those it is equal to.
        """
        from scipy.stats import rankdata

        places = np.full(len(self.means), np.nan)
        for means in reversed(self.turns):
            stayed = ~np.isnan(places)
            left = ~np.isnan(means) & ~stayed
            if not stayed.any():
                places[left] = rankdata(means[left])
                continue
            alike = left & np.isin(means, means[stayed])
            lowest = places[stayed].min()
            for place in np.flatnonzero(alike):
                places[place] = places[stayed & (means == means[place])].mean()
            behind = left & ~alike
            places[behind] = lowest - 1 - behind.sum() + rankdata(means[behind])
        return places


def planned_episodes(candidates: int, first: int, most: int) -> int:
    """How many episodes `successive_halving` runs in all.

    Args:
        candidates: K, at least 1.
        first: Episodes of the first turn.
        most: Most episodes a candidate is given.

    Returns:
        Their number, over all candidates.
    """
    total, given, left = 0, 0, candidates
    while given < most:
        new = min(max(first, given), most - given)  # every turn doubles what each has
        total, given = total + new * left, given + new
        if left == 1 and given >= most:
            break
        left = max(1, (left + 1) // 2)
    return total


def successive_halving(
    candidates: int,
    score: Score,
    *,
    seed: int,
    first: int = 16,
    most: int = 256,
) -> Selection:
    """Give all a few episodes, the better half twice as many, and so on.

    All candidates are given the same seeds, so that luck is shared, and what was run counts on.

    Args:
        candidates: K, at least 1.
        score: Runs episodes of the candidates that are left.
        seed: Of the first episode.
        first: Episodes of the first turn.
        most: Most episodes a candidate is given; the last one left gets them all.

    Returns:
        The selection. The winner's mean is too good by what luck it was chosen for: report it on
        other episodes.
    """
    scored: list[list[NDArray[np.float64]]] = [[] for _ in range(candidates)]

    def means(candidate: int) -> tuple[float, ...]:
        return mean_score(np.concatenate(scored[candidate]))

    left, behind = list(range(candidates)), list[int]()
    turns: list[NDArray[np.float64]] = []
    given = 0
    while given < most:
        new = min(max(first, given), most - given)
        for candidate, scores in zip(left, score(left, seed + given, new), strict=True):
            scored[candidate].append(scores.reshape(len(scores), -1))
        given += new
        turns.append(np.full(candidates, np.nan))
        turns[-1][left] = [means(candidate)[-1] for candidate in left]
        ranked = sorted(left, key=means, reverse=True)  # of equals, the first stays first
        stay = max(1, (len(ranked) + 1) // 2)
        left, behind = ranked[:stay], ranked[stay:] + behind
    return Selection(
        ranking=(*left, *behind),
        means=np.array([means(candidate)[-1] for candidate in range(candidates)]),
        episodes=np.array([sum(map(len, one)) for one in scored], dtype=np.int64),
        turns=np.array(turns),
    )
