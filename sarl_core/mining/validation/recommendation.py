"""Which thresholds to take: few rules that are right elsewhere, too.

Fidelity alone would recommend a single rule that is nearly always right and nearly never applies.
So only rule sets count that have a rule for a fair share of the states. Among those, the best
fidelity in episodes that the rules were not mined from often takes many rules, and most of it is
had with few: the fewest rules are recommended that lose next to nothing against it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.evidence import FEWEST_EPISODES, EpisodeSums
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import (
    EpisodePlane,
    episode_sums,
    threshold_landscape,
)
from sarl_core.mining.thresholds.steps import CONFIDENCE_STEPS, SUPPORT_STEPS
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import CrossFit

COVERAGE = 0.5
"""Least share of the states of other episodes in which a rule must apply, on average."""
NEAR = 0.02
"""So far below the best fidelity is as good as the best."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Recommendation:
    """Thresholds that give few rules which are right elsewhere, too.

    Attributes:
        thresholds: At a step of both sliders.
        rules: How many rules they give.
        coverage: How often a rule applies in an episode that is judged by rules mined without it,
            on average over all; at least `COVERAGE`.
        fidelity: How often the expert does what they say there, likewise; at most `NEAR` below
            `best`.
        best: The best fidelity at any steps of the sliders with so much coverage.
        best_rules: How many rules that takes.
        unseen: The same fidelity where an episode has no say in the choice of thresholds either:
            those of its fold are chosen from the other folds. Having been chosen flatters
            `fidelity`, and not this.
    """

    thresholds: Thresholds
    rules: int
    coverage: float
    fidelity: float
    best: float
    best_rules: int
    unseen: float


def enough_episodes(fit: CrossFit) -> bool:
    """Whether there are enough episodes to compare thresholds by."""
    return fit.whole_episodes and episode_count(fit) >= FEWEST_EPISODES


def episode_count(fit: CrossFit) -> int:
    """How many episodes judge; of stretches of one, that one."""
    return sum(len(fold.leaves[0].numbers) for fold in fit.folds) if fit.whole_episodes else 1


def recommended(
    trees: Sequence[PolicyTree],
    fit: CrossFit,
    *,
    dimension: int | None = None,
    lift_min: float = 0.0,
    max_depth: int | None = None,
) -> Recommendation | None:
    """The fewest rules that are nearly as right elsewhere as any at the steps of the sliders.

    Exact at every pair of steps from `fit.least_support` on: the trees without each fold know
    their rules at all of these.

    Args:
        trees: Grown from all episodes, one an action dimension.
        fit: Of the same demonstrations.
        dimension: The action dimension that alone counts; None for all.
        lift_min: Minimum lift of a rule.
        max_depth: Longest rule.

    Returns:
        Of several with as few rules the one that is right most often. None where there are too few
        episodes (`enough_episodes`), or where no thresholds give rules for enough states.
    """
    if not enough_episodes(fit):
        return None
    place = 0 if dimension is None else 1 + dimension
    supports = tuple(support for support in SUPPORT_STEPS if support >= fit.least_support)
    planes = [
        _added(
            episode_sums(
                fold.trees,
                supports,
                CONFIDENCE_STEPS,
                counts,
                lift_min=lift_min,
                max_depth=max_depth,
            )[place]
            for counts in fold.counts()
        )
        for fold in fit.folds
    ]
    landscape = threshold_landscape(
        trees, supports, CONFIDENCE_STEPS, lift_min=lift_min, max_depth=max_depth
    )
    rules = (landscape if dimension is None else landscape.dimensions[dimension]).rule_count
    episodes = [len(fold.leaves[0].numbers) for fold in fit.folds]
    together = _elsewhere(planes, episodes)
    chosen = _choice(rules, together)
    if chosen is None:
        return None
    best = together.fidelity[together.enough].max()
    return Recommendation(
        thresholds=Thresholds(
            supports[chosen[0]], CONFIDENCE_STEPS[chosen[1]], lift_min, max_depth
        ),
        rules=int(rules[chosen]),
        coverage=float(together.coverage[chosen]),
        fidelity=float(together.fidelity[chosen]),
        best=float(best),
        best_rules=int(rules[together.enough & (together.fidelity == best)].min()),
        unseen=_unseen(rules, planes, episodes),
    )


class _Elsewhere(NamedTuple):
    """What some episodes say of every pair of steps, on average; (S, C) each.

    Attributes:
        fidelity: NaN where no rule applies in any of them.
        coverage: 0 there.
    """

    fidelity: Floats
    coverage: Floats

    @property
    def enough(self) -> NDArray[np.bool_]:
        """Where rules apply often enough to be compared."""
        return self.coverage >= COVERAGE


def _added(planes: Iterable[EpisodePlane]) -> EpisodePlane:
    """What is added up over the episodes of several."""
    fidelity, coverage = zip(*planes, strict=True)
    sums = (np.sum(columns, axis=0) for columns in zip(*fidelity, strict=True))
    return EpisodePlane(EpisodeSums(*sums), np.sum(coverage, axis=0))


def _elsewhere(planes: Sequence[EpisodePlane], episodes: Sequence[int]) -> _Elsewhere:
    """The means over the episodes of some folds."""
    counted = np.sum([plane.fidelity.episodes for plane in planes], axis=0)
    total = np.sum([plane.fidelity.total for plane in planes], axis=0)
    with np.errstate(invalid="ignore"):
        fidelity = total / counted
    return _Elsewhere(
        fidelity, np.sum([plane.coverage for plane in planes], axis=0) / sum(episodes)
    )


def _choice(rules: NDArray[np.int64], elsewhere: _Elsewhere) -> tuple[int, int] | None:
    """The pair with the fewest rules near the best, and of those the one that is right most."""
    enough, fidelity = elsewhere.enough, elsewhere.fidelity
    if not enough.any():
        return None
    near = enough & (fidelity >= fidelity[enough].max() - NEAR)
    fewest = near & (rules == rules[near].min())
    row, column = np.unravel_index(np.argmax(np.where(fewest, fidelity, -np.inf)), rules.shape)
    return int(row), int(column)


def _unseen(
    rules: NDArray[np.int64], planes: Sequence[EpisodePlane], episodes: Sequence[int]
) -> float:
    """Mean over all episodes, each at thresholds that the folds without it would have chosen."""
    total, counted = 0.0, 0
    for number, own in enumerate(planes):
        others = [place for place in range(len(planes)) if place != number]
        chosen = _choice(
            rules,
            _elsewhere([planes[place] for place in others], [episodes[place] for place in others]),
        )
        if chosen is not None:
            total += float(own.fidelity.total[chosen])
            counted += int(own.fidelity.episodes[chosen])
    return total / counted if counted else float("nan")
