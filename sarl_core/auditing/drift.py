"""Whether a log still looks like what the rules were mined from, or like another log.

Everything compared is a share of steps, and every episode counts once or by its steps; steps of one
episode are alike, so all intervals are over episodes. Each has one pseudo-episode at 0.5 added, as
the evidence of rules has, so that ten episodes of one share leave some doubt about the eleventh.
Many shares are compared at once: the intervals are t intervals, wide enough (Bonferroni) that all
of them together miss no more often than one 95 % interval does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing.overlap import demanded, never_applications
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.rule_set import RuleSet

Floats = NDArray[np.float64]

_TOGETHER = 0.05  # how often one of all intervals may miss
_PSEUDO = 0.5
_QUARTERS = (0.25, 0.5, 0.75)


class Moved(NamedTuple):
    """One share, before and now.

    Attributes:
        name: Of the feature or the rule; "no rule" for the steps that none applies to.
        what: What it is a share of, in words.
        before: The share in what the log is compared with.
        now: The share in the log.
        low: Lower end of the interval of the difference `now - before`; None with too few
            episodes.
        high: Upper end.
    """

    name: str
    what: str
    before: float
    now: float
    low: float | None
    high: float | None

    @property
    def drifted(self) -> bool:
        """Whether the interval leaves no room for no difference."""
        return self.low is not None and self.high is not None and not self.low <= 0 <= self.high


@dataclass(frozen=True)
class Drift:
    """What moved.

    Attributes:
        against: What the log is compared with, in words.
        features: One or more entries a feature.
        rules: One a rule whose share is known, and one for no rule.
        episodes: Of the log, and of what it is compared with.
    """

    against: str
    features: tuple[Moved, ...]
    rules: tuple[Moved, ...]
    episodes: tuple[int, int]

    @property
    def all(self) -> tuple[Moved, ...]:
        """Everything that was compared."""
        return (*self.features, *self.rules)

    @property
    def drifted(self) -> tuple[Moved, ...]:
        """What differs, the largest difference first."""
        moved = [one for one in self.all if one.drifted]
        return tuple(sorted(moved, key=lambda one: -abs(one.now - one.before)))

    @property
    def is_known(self) -> bool:
        """Whether there are enough episodes to say anything."""
        return min(self.episodes) >= FEWEST_EPISODES


class Shares(NamedTuple):
    """K shares in each of E episodes.

    Attributes:
        counts: Steps that count for each share, (E, K).
        steps: Of each episode, (E,).
    """

    counts: Floats
    steps: Floats

    @property
    def each(self) -> Floats:
        """The share in each episode, (E, K)."""
        return np.asarray(self.counts / self.steps[:, None])


def differences(now: Shares, before: Shares) -> tuple[Floats, Floats, Floats, Floats]:
    """Shares of two logs, each episode counted once.

    Args:
        now: Of one.
        before: Of the other, the same K shares.

    Returns:
        The means of both, and the ends of the interval of the difference, (K,) each; NaN where
        there are too few episodes.
    """
    sides = []
    for shares in (now, before):
        each = np.vstack([shares.each, np.full(shares.counts.shape[1], _PSEUDO)])
        variance = each.var(axis=0, ddof=1) / len(each)
        sides.append((shares.each.mean(axis=0), each.mean(axis=0), variance, len(each) - 1))
    (mean, shrunk, variance, freedom), (mean_0, shrunk_0, variance_0, freedom_0) = sides
    squares = variance**2 / freedom + variance_0**2 / freedom_0
    together = (variance + variance_0) ** 2 / np.maximum(squares, 1e-300)
    reach = _quantile(together, len(mean)) * np.sqrt(variance + variance_0)
    if min(freedom, freedom_0) < FEWEST_EPISODES:
        reach = np.full(len(mean), np.nan)
    difference = shrunk - shrunk_0
    return mean_0, mean, difference - reach, difference + reach


def against_expected(
    now: Shares, expected: Floats, episodes: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Shares of a log, each step counted once, and what a rule file says they were.

    What it says has its own uncertainty, of which the file knows the number of episodes alone: they
    are taken to vary as those of the log do, as they would if nothing had moved.

    Args:
        now: Of the log.
        expected: Shares of the demonstrations, (K,).
        episodes: Of the demonstrations.

    Returns:
        As `differences`.
    """
    count, length = len(now.steps), now.steps.mean()
    share = now.counts.sum(axis=0) / now.steps.sum()
    # How an episode pulls the share of all steps; of equally long ones, the shares themselves.
    pulls = share + (now.counts - share * now.steps[:, None]) / length
    pulls = np.vstack([pulls, np.full(len(share), _PSEUDO)])
    variance = pulls.var(axis=0, ddof=1) * (1.0 / (count + 1) + 1.0 / max(episodes, 1))
    reach = _quantile(np.full(len(share), float(count)), len(share)) * np.sqrt(variance)
    if min(count, episodes) < FEWEST_EPISODES:
        reach = np.full(len(share), np.nan)
    difference = pulls.mean(axis=0) - expected
    return expected, share, difference - reach, difference + reach


def _quantile(freedom: Floats, comparisons: int) -> Floats:
    from scipy.special import stdtrit  # takes its time; most programs need none

    return np.asarray(stdtrit(freedom, 1.0 - _TOGETHER / (2 * max(comparisons, 1))))


def moved(
    names: list[tuple[str, str]], columns: tuple[Floats, Floats, Floats, Floats]
) -> tuple[Moved, ...]:
    """Give shares their names.

    Args:
        names: Name and what of each of K shares.
        columns: What `differences` gave.

    Returns:
        One entry each.
    """
    return tuple(
        Moved(name, what, before, now, *((None, None) if np.isnan(low) else (low, high)))
        for (name, what), before, now, low, high in zip(
            names, *(column.tolist() for column in columns), strict=True
        )
    )


def by_episode(values: NDArray[np.generic], starts: NDArray[np.int64]) -> Floats:
    """Add up over episodes.

    Args:
        values: One row a step, (N,) or (N, K).
        starts: Row at which each of E episodes starts.

    Returns:
        Shape (E,) or (E, K).
    """
    return np.asarray(np.add.reduceat(values, starts, axis=0, dtype=np.float64))


def rule_counts(
    rule_set: RuleSet,
    observations: NDArray[np.float32],
    in_force: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> Floats:
    """In how many steps of each episode each rule is in force.

    Args:
        rule_set: R rules over d features.
        observations: As the rules see them, (N, d).
        in_force: Index of the rule, -1 for none, (N, m).
        starts: Row at which each of E episodes starts.

    Returns:
        Shape (E, R + m): the rules, of those that forbid all steps of `never_applications`; then
        for each action dimension the steps without one.
    """
    size, m = len(rule_set), len(rule_set.actions)
    lengths = np.diff(np.append(starts, len(in_force)))
    episode = np.repeat(np.arange(len(starts)), lengths)
    counts = np.zeros((len(starts), size + m))
    alone = (in_force < 0) | demanded(rule_set, in_force)
    for dimension, column in enumerate(in_force.T):
        place = np.where(column < 0, size + dimension, column)
        key = (episode * (size + m) + place)[alone[:, dimension]]
        counts += np.bincount(key, minlength=counts.size).reshape(counts.shape)
    for never, rows in never_applications(rule_set, observations, in_force):
        counts[:, never] = np.bincount(episode[rows], minlength=len(starts))
    return counts


def quarters(observations: NDArray[np.float32]) -> NDArray[np.float64]:
    """Where a quarter, a half and three quarters of the values lie at or below.

    Args:
        observations: Of the demonstrations, (N, d).

    Returns:
        Shape (3, d).
    """
    return np.asarray(
        np.quantile(observations.astype(np.float64), _QUARTERS, axis=0, method="lower")
    )
