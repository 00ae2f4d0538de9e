"""A test of a rate that stops as early as it may: after which episode how many failures decide.

It asks whether a rate is at most p. Looks are fixed beforehand: the rate is *certified* at episode
``n_k`` if no more than k failures have been seen by then, and *refused* at the k-th failure if it
comes by episode ``r_k``. Nothing is spent on a look before the first one at which no failure at all
is enough, so that one comes as early as in a test of a fixed size: 299 episodes for 1 % at 95 %.
What that look leaves of the error that is allowed is little, and the later ones share it, a fifth
of the rest each; they need more episodes than a fixed size would, and whoever has seen a failure
has them to go on with. The error of each verdict is worked out exactly, over all the ways that the
failures can fall, and holds whenever the test stops. Wald's test and bets on a mixture of rates
need more episodes where there is no failure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError, require_whole
from sarl_core.rollouts.seeds import MOST_CERTIFIED

MOST_EXPECTED = 1_000
"""Failures that a test may have to count at the rate that it is of: more say nothing new."""
_RESERVE = 0.1  # of p: the share of the error that the first look leaves to the others, at least
_SHARE = 0.2  # of what is left, spent at each further look
_FEWEST_REFUSED = 2  # one failure alone may be bad luck, wherever it comes
_USUAL = 10  # times the episodes that are enough without a failure


@dataclass(frozen=True)
class SequentialTest:
    """Which counts decide, fixed before the first episode.

    Attributes:
        at_most: The rate p.
        certainty: Of a verdict: each is wrong with a probability of at most 1 - certainty.
        episodes: After which it ends undecided.
        certified: The episode ``n_k`` at which k failures or fewer certify, for k = 0, 1, ...,
            ascending; as far as there are episodes.
        refused: The last episode ``r_k`` at which the k-th failure refuses, for k = 1, 2, ...,
            never falling; 0 where it does not refuse, however early it comes.
    """

    at_most: float
    certainty: float
    episodes: int
    certified: tuple[int, ...]
    refused: tuple[int, ...]

    def least_more(self, episodes: int, failures: int) -> int | None:
        """How many more episodes it takes at least to certify.

        Args:
            episodes: Seen so far.
            failures: Among them.

        Returns:
            None where it cannot be certified any more.
        """
        for count, episode in enumerate(self.certified):
            if count >= failures and episode >= episodes:
                return episode - episodes
        return None

    def decided(self, failed: NDArray[np.bool_], unknown: NDArray[np.bool_]) -> Verdict:
        """What episodes decide, read in their order and no further than needed.

        Args:
            failed: Whether each failed, (E,).
            unknown: Of which that is not known, (E,): it counts as a failure against a
                certificate, and as none against a refusal.

        Returns:
            The verdict and where it fell; undecided after E episodes, or after `episodes`.
        """
        end = min(len(failed), self.episodes)
        episode = np.arange(1, end + 1)
        least = np.cumsum(failed[:end] & ~unknown[:end])
        most = np.cumsum(failed[:end] | unknown[:end])
        never = self.episodes + 1
        look = np.array([*self.certified, never])[np.minimum(most, len(self.certified))]
        last = np.array([0, *self.refused, 0])[np.minimum(least, len(self.refused) + 1)]
        ends = np.flatnonzero((episode >= look) | (episode <= last))
        if not end:
            return Verdict(None, 0, 0, 0)
        at = int(ends[0]) if len(ends) else end - 1
        verdict = bool(at + 1 >= look[at]) if len(ends) else None
        return Verdict(verdict, at + 1, int(least[at]), int(most[at] - least[at]))


@dataclass(frozen=True)
class Verdict:
    """What a test has come to.

    Attributes:
        certified: Whether the rate is at most p; False where it is more; None while undecided.
        episodes: Up to which it looked.
        failures: Among them.
        undecided: Those of which it is not known whether they failed.
    """

    certified: bool | None
    episodes: int
    failures: int
    undecided: int


@dataclass(frozen=True)
class Chances:
    """What becomes of a test at one true rate, exactly.

    Attributes:
        certified: Probability of that verdict.
        refused: Likewise.
        episodes: Expected number of episodes.
    """

    certified: float
    refused: float
    episodes: float


def sequential_test(
    at_most: float, certainty: float = 0.95, episodes: int | None = None
) -> SequentialTest:
    """Fix the looks of a test.

    Args:
        at_most: The rate p, between 0 and 1.
        certainty: Of a verdict, at least 0.5 and below 1.
        episodes: After which it ends undecided; ten times as many as are enough without a failure
            where not given.

    Returns:
        The test.

    Raises:
        InputError: If a number is out of range, or the episodes cannot be enough or are more than
            the test can use.
    """
    p, c = _share("at_most", at_most), _share("certainty", certainty)
    if p == 0.0:
        raise InputError(
            "a rate of 0 cannot be certified by any number of episodes; give a small one, as 0.001"
        )
    if not 0.0 < p < 1.0:
        raise InputError(f"at_most is {at_most}; a rate lies between 0 and 1, as 0.01 for 1 %")
    if not 0.5 <= c < 1.0:
        raise InputError(
            f"certainty is {certainty}; give a number from 0.5 to below 1, as 0.95 for 95 %"
        )
    least = _first_look(p, 1.0 - c)
    what = f"a rate of {p:g} at a certainty of {c:g}"
    if least > MOST_CERTIFIED:
        raise InputError(
            f"{what} takes more than {MOST_CERTIFIED:,} episodes without any failure; give a "
            "larger rate"
        )
    usable = min(max(round(MOST_EXPECTED / p), _USUAL * least), MOST_CERTIFIED)
    wanted = min(_USUAL * least, usable) if episodes is None else episodes
    require_whole("episodes", wanted, 1)
    if not least <= wanted <= usable:
        raise InputError(
            f"{wanted:,} episodes do not suit {what}, which takes {least:,} without any failure "
            f"and can use {usable:,}; give a number between them"
        )
    return _looks(p, c, wanted)


@lru_cache(maxsize=32)
def _looks(p: float, certainty: float, episodes: int) -> SequentialTest:
    expected = episodes * p
    most = math.ceil(expected + 8.0 * math.sqrt(expected) + 8.0)  # failures that there may well be
    return SequentialTest(
        p,
        certainty,
        episodes,
        _certifying(p, 1.0 - certainty, episodes, most),
        _refusing(p, 1.0 - certainty, episodes, most),
    )


def chances(test: SequentialTest, rate: float) -> Chances:
    """What becomes of a test at a true rate, over all the ways that failures can fall.

    Args:
        test: Of any rate.
        rate: At which episodes fail, 0 to 1.

    Returns:
        Exact but for rounding. It takes one pass over the episodes.
    """
    counts = len(test.refused) + 1
    alive = np.zeros(counts + 1)
    alive[0] = 1.0
    looks = {episode: count for count, episode in enumerate(test.certified)}
    last = np.array([0, *test.refused, test.episodes])
    certified = refused = expected = 0.0
    for episode in range(1, test.episodes + 1):
        expected += float(alive.sum())
        alive[1:] = alive[1:] * (1.0 - rate) + alive[:-1] * rate
        alive[0] *= 1.0 - rate
        first = int(np.searchsorted(last[1:], episode)) + 1  # failures that refuse by now
        refused += float(alive[first:].sum())
        alive[first:] = 0.0
        if (count := looks.get(episode)) is not None:
            certified += float(alive[: count + 1].sum())
            alive[: count + 1] = 0.0
    return Chances(certified, refused, expected)


def _share(name: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise InputError(f"{name} is no number; give a share, as 0.05")
    return float(value)


def _first_look(p: float, error: float) -> int:
    """After how many episodes no failure at all certifies; of more than can be, one too many."""
    exact = math.log(error * (1.0 - _RESERVE * p)) / math.log1p(-p)
    return math.ceil(min(exact, MOST_CERTIFIED + 1.0))


def _certifying(p: float, error: float, episodes: int, most: int) -> tuple[int, ...]:
    """The episodes at which so many failures certify.

    A test that is still going on after ``n_(k-1)`` has seen k failures or more. It is certified at
    ``n_k`` if there are k still: if none of the episodes between them fails.
    """
    from scipy.special import xlog1py

    look = _first_look(p, error)
    looks, spent = [look], math.exp(xlog1py(look, -p))
    spare = error - spent
    alive = _binomial(most, look, p)
    alive[0] = 0.0
    for count in range(1, most + 1):
        allowed = error - spare * (1.0 - _SHARE) ** count - spent
        if allowed <= 0.0 or alive[count] <= 0.0:
            break
        more = max(1, math.ceil(math.log(allowed / alive[count]) / math.log1p(-p)))
        look += more
        if look > episodes:
            break
        alive = np.convolve(alive, _binomial(most, more, p))[: most + 1]
        spent += float(alive[count])
        alive[count] = 0.0
        looks.append(look)
    return tuple(looks)


def _refusing(p: float, error: float, episodes: int, most: int) -> tuple[int, ...]:
    """The last episode at which the k-th failure refuses.

    A test that is still going on after ``r_(k-1)`` has seen k - 2 failures at most, so what is
    spent on k is the probability that there are k of them by ``r_k``.
    """
    alive = np.zeros(most + 1)
    alive[0] = 1.0
    spent, last, lasts = 0.0, 0, list[int]()
    for count in range(1, most + 1):
        allowed = error * (1.0 - (1.0 - _SHARE) ** (count + 1 - _FEWEST_REFUSED)) - spent
        going = alive[:count]
        low, high = 0, episodes - last  # of the episodes between two of them
        if count < _FEWEST_REFUSED:
            high = 0
        elif _reached(going, high, p) <= allowed:
            low = high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if _reached(going, middle, p) <= allowed else (low, middle)
        spent += _reached(going, low, p)
        last += low
        alive = np.convolve(alive, _binomial(most, low, p))[: most + 1]
        alive[count:] = 0.0
        lasts.append(last)
        if last >= episodes:
            break
    return tuple(lasts)


def _reached(going: NDArray[np.float64], more: int, p: float) -> float:
    """The probability that so many more episodes bring the failures to as many as there are states.

    Args:
        going: Probability of 0, 1, ..., k - 1 failures so far, (k,).
        more: Episodes.
        p: At which they fail.
    """
    from scipy.special import bdtrc

    lacking = len(going) - 1 - np.arange(len(going))
    above = np.where(lacking < more, bdtrc(lacking, max(more, 1), p), 0.0)
    return float((going * above).sum())


def _binomial(most: int, episodes: int, p: float) -> NDArray[np.float64]:
    """The probability of 0, 1, ..., `most` failures in so many episodes."""
    from scipy.special import gammaln, xlog1py, xlogy

    counts = np.arange(most + 1)
    possible = counts <= episodes
    counted = counts[possible]
    ways = gammaln(episodes + 1) - gammaln(counted + 1) - gammaln(episodes - counted + 1)
    chance = np.zeros(most + 1)
    chance[possible] = np.exp(ways + xlogy(counted, p) + xlog1py(episodes - counted, -p))
    return chance
