"""Whether paired differences are more than chance, for several things looked at together."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.rollouts.statistics import MeanInterval, mean_interval

_FLIPS = 19_999
_NUMBERS_AT_ONCE = 4_000_000  # 16 MB of signs
_CHANCE = 0.05
_LEAST_PAIRS = 6  # of fewer, no outcome is rarer than that
_HALVINGS = 40
_EQUAL = 1e-9  # relative; sums of the same numbers in another order count as the same


def sign_flip_test(differences: ArrayLike, *, seed: int = 0) -> NDArray[np.float64]:
    """How often chance alone would bring a mean difference as large as the one seen.

    If what is compared made no difference, each pair's difference could as well have had the
    other sign. So the signs are drawn anew, and nothing is assumed about how the differences are
    distributed: returns are skewed, and most differences are exactly zero.

    `scipy.stats.permutation_test` draws alike (tests compare the two). Here one set of signs serves
    all comparisons and `sign_flip_interval`, which so agree with each other, in less than half of
    its time.

    Args:
        differences: E pairs of each of R comparisons, (R, E).
        seed: Of the signs; the same seed gives the same result.

    Returns:
        Two-sided p-values, (R,); 1 where all differences are zero.
    """
    values = np.asarray(differences, dtype=np.float64)
    rows, pairs = values.shape
    if not rows or not pairs:
        return np.ones(rows)
    observed = np.abs(values.sum(axis=1)) * (1.0 - _EQUAL)
    rng = np.random.default_rng(seed)
    at_once = max(1, _NUMBERS_AT_ONCE // pairs)
    reached = np.ones(rows)  # the signs that were seen are one way to draw them
    for start in range(0, _FLIPS, at_once):
        count = min(at_once, _FLIPS - start)
        signs = rng.integers(0, 2, size=(count, pairs), dtype=np.int8) * 2.0 - 1.0
        reached += (np.abs(signs @ values.T) >= observed).sum(axis=0)
    return np.asarray(reached / (1 + _FLIPS))


def sign_flip_interval(differences: ArrayLike, *, seed: int = 0) -> MeanInterval:
    """Where the mean difference probably lies, by the same test.

    The interval holds every difference that, taken off each pair, leaves what chance alone brings
    in at least 5 % of the drawings: so it leaves out zero exactly where `sign_flip_test` is below
    0.05.

    Args:
        differences: Of E pairs, (E,).
        seed: Of the signs; the same seed gives the same result.

    Returns:
        The mean with its 95 % interval; Student's where so few pairs allow for none.
    """
    values = np.asarray(differences, dtype=np.float64).reshape(-1)
    student = mean_interval(values)
    if len(values) < _LEAST_PAIRS or not np.ptp(values):
        return student
    rng = np.random.default_rng(seed)
    signs = rng.integers(0, 2, size=(_FLIPS, len(values)), dtype=np.int8) * 2.0 - 1.0
    flipped, counts = signs @ values, signs.sum(axis=1)
    total, count = values.sum(), len(values)

    def chance(difference: float) -> float:
        observed = abs(total - difference * count) * (1.0 - _EQUAL)
        reached = np.abs(flipped - difference * counts) >= observed
        return float((1 + reached.sum()) / (1 + _FLIPS))

    mean, width = float(values.mean()), float(np.ptp(values))
    ends = []
    for side in (-width, width):
        inside, outside = 0.0, 1.0  # by the width all pairs differ on one side
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            if chance(mean + side * middle) >= _CHANCE:
                inside = middle
            else:
                outside = middle
        ends.append(mean + side * (inside + outside) / 2)
    return MeanInterval(mean, ends[0], ends[1])


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """Allow for several comparisons looked at together (Holm's step-down method).

    Args:
        p_values: One a comparison, (R,).

    Returns:
        Adjusted ones, (R,): who takes those below 0.05 for real is wrong about any of them with a
        chance of at most 5 %.
    """
    values = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    steps = values[order] * (len(values) - np.arange(len(values)))
    adjusted = np.empty(len(values))
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0) if len(values) else steps
    return adjusted
