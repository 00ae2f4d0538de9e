"""What a shield did to an agent: the same seeds with it and without, compared pair by pair."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import MeanInterval
from sarl_core.studies.paired_tests import holm, sign_flip_interval, sign_flip_test

ERROR_RATE = 0.05  # of both tests of one comparison together
_TESTS = 2

Effect = Literal["helps", "harms", "no difference seen"]


@dataclass(frozen=True)
class ShieldEffect:
    """What became of E episodes under a shield.

    Attributes:
        episodes: How many pairs, E.
        returns: Return with the shield less the return without it, mean over the pairs, and
            the 95 % interval of that mean by the same test (`sign_flip_interval`).
        failures: The same of failures, as a share of the pairs that were not cut off; None where
            it is not known which ends are some, or all were cut off.
        fell: Episodes that fail with the shield and not without it; None likewise.
        spared: Episodes that fail without it and not with it; None likewise.
        return_p: How often chance alone would bring such a difference in return, both tests
            allowed for.
        failure_p: The same of failures; 1 where they are not known.
        effect: Harms if more episodes fail or the return is lower with it, helps the other way
            round. Where the two point in different directions, failures decide.
    """

    episodes: int
    returns: MeanInterval
    failures: MeanInterval | None
    fell: int | None
    spared: int | None
    return_p: float
    failure_p: float
    effect: Effect

    @property
    def too_few(self) -> bool:
        """Whether no outcome of so few episodes could rule out chance."""
        return self.episodes < 1 + math.ceil(math.log2(_TESTS / ERROR_RATE))


def shield_effect(alone: Episodes, shielded: Episodes) -> ShieldEffect:
    """Compare the episodes of an agent without a shield and with one.

    Both differences are tested by drawing their signs anew (`sign_flip_test`), which for failures
    is McNemar's test, and both tests hold together (`holm`).

    Args:
        alone: E episodes without it.
        shielded: As many, on the same seeds.

    Returns:
        The difference, its interval, and what it means.

    Raises:
        InputError: If the seeds differ.
    """
    if not np.array_equal(alone.seeds, shielded.seeds):
        raise InputError(
            "the episodes with and without the shield are not of the same seeds; run both with "
            "the same --seed and --episodes"
        )
    # Whether an episode that was cut off would have failed later, nobody knows.
    ended = ~(alone.undecided | shielded.undecided)
    known = alone.failures_known and bool(ended.any())
    gained = shielded.returns - alone.returns
    worse = np.where(ended, shielded.failed.astype(np.float64) - alone.failed, 0.0)
    both = np.stack([gained, worse])
    tested = both.any(axis=1)
    adjusted = np.ones(_TESTS)
    adjusted[tested] = holm(sign_flip_test(both[tested]))
    return_p, failure_p = map(float, adjusted)
    harm = 0.0
    if failure_p < ERROR_RATE:
        harm = float(worse.sum())
    elif return_p < ERROR_RATE:
        harm = -float(gained.sum())
    return ShieldEffect(
        episodes=len(alone),
        returns=sign_flip_interval(gained),
        failures=sign_flip_interval(worse[ended]) if known else None,
        fell=int((worse > 0).sum()) if known else None,
        spared=int((worse < 0).sum()) if known else None,
        return_p=return_p,
        failure_p=failure_p,
        effect="harms" if harm > 0 else "helps" if harm < 0 else "no difference seen",
    )
