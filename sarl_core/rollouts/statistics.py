"""What many episodes say together: mean, interquartile mean, and how sure one can be of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.errors import InputError

_RESAMPLES = 9_999
_NUMBERS_AT_ONCE = 2_000_000  # 16 MB; a bootstrap of many episodes is done in pieces
_MANY = 10_000  # values: of more a bootstrap takes seconds to minutes, and says what a formula says
_WORST = 0.1  # the share of the episodes that are the worst
_CUT = 0.25  # the share of the values left out at either end


@dataclass(frozen=True)
class ReturnStatistics:
    """Statistics of one number per episode.

    Attributes:
        mean: Of all values.
        std: Standard deviation (n - 1); 0 for a single value.
        iqm: Interquartile mean: of the middle half of the values.
        low: Lower end of the 95 % interval of the interquartile mean.
        high: Upper end.
    """

    mean: float
    std: float
    iqm: float
    low: float
    high: float


@dataclass(frozen=True)
class MeanInterval:
    """The mean of a few numbers, and how sure one can be of it.

    Attributes:
        mean: Of the values.
        low: Lower end of the 95 % interval of the mean.
        high: Upper end.
    """

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class Rate:
    """How often something happened, and how sure one can be of it.

    Attributes:
        count: How often, as far as is known.
        of: Among how many.
        rate: The share; where some are unknown, the least that it can be.
        low: Lower end of its exact 95 % interval (Clopper and Pearson's), as if it had happened in
            none of the unknown ones.
        high: Upper end, as if it had in all of them.
        unknown: Of how many it is not known.
    """

    count: int
    of: int
    rate: float
    low: float
    high: float
    unknown: int = 0

    @property
    def at_most(self) -> float:
        """What the rate is at most, with 95 % certainty (one-sided, by the same method)."""
        from scipy.special import betaincinv

        most = self.count + self.unknown
        return 1.0 if most == self.of else float(betaincinv(most + 1, self.of - most, 0.95))


def rate_of(happened: ArrayLike, unknown: ArrayLike = False) -> Rate:
    """A share of independent episodes with its exact interval.

    Args:
        happened: One truth value an episode, shape (E,), E at least 1.
        unknown: Whether it is not known of an episode, (E,) or one for all.

    Returns:
        The share; its interval covers in at least 95 % of all cases, however rare it is.
    """
    from scipy.special import betaincinv

    values = np.asarray(happened, dtype=np.bool_).reshape(-1)
    open_ends = np.broadcast_to(np.asarray(unknown, dtype=np.bool_), values.shape)
    count, of = int((values & ~open_ends).sum()), len(values)
    most = int((values | open_ends).sum())
    low = 0.0 if count == 0 else float(betaincinv(count, of - count + 1, 0.025))
    high = 1.0 if most == of else float(betaincinv(most + 1, of - most, 0.975))
    return Rate(count, of, count / of, low, high, most - count)


def rate_over_groups(counts: Sequence[int], of_each: Sequence[int], unknown: int = 0) -> Rate:
    """A share where episodes are of several learners.

    Episodes of one learner are alike, so the interval is that of the mean of the learners' shares
    (Student's). Where these do not differ, as where nothing ever happened, it is that of all
    episodes together.

    Args:
        counts: How often it happened with each of G learners, (G,).
        of_each: Among how many, (G,).
        unknown: Of how many it is not known, in all; then, too, all count together.

    Returns:
        The share of all episodes.
    """
    count, of = sum(counts), sum(of_each)
    order = np.arange(of)
    together = rate_of(order < count, (order >= count) & (order < count + unknown))
    shares = [part / whole for part, whole in zip(counts, of_each, strict=True)]
    if unknown or len(set(shares)) == 1:
        return together
    over = mean_interval(shares)
    return replace(together, low=max(over.low, 0.0), high=min(over.high, 1.0))


def mean_interval(values: ArrayLike) -> MeanInterval:
    """The mean of a few runs, as learners with seeds of their own, with its 95 % interval.

    Student's interval: with a handful of values, a bootstrap is too sure of itself, and a middle
    half is hardly there. Values that are NaN are left out.

    Args:
        values: One number a run, shape (K,).

    Returns:
        The mean and its interval; with one value, or equal ones, the interval is that value; NaN
        without any.
    """
    array = np.asarray(values, dtype=np.float64).reshape(-1)
    array = array[~np.isnan(array)]
    if len(array) == 0:
        return MeanInterval(float("nan"), float("nan"), float("nan"))
    if (array == array[0]).all():
        return mean_interval_of(float(array[0]), 0.0, len(array))
    return mean_interval_of(float(array.mean()), float(array.std(ddof=1)), len(array))


def mean_interval_of(mean: float, deviation: float, count: int) -> MeanInterval:
    """The same of numbers of which no more is known.

    Args:
        mean: Of the values.
        deviation: Their standard deviation, by one less than their number.
        count: How many they are, at least one.

    Returns:
        The mean and its interval; with one value, or equal ones, the interval is that value.
    """
    from scipy.special import stdtrit

    if count == 1 or deviation == 0.0:
        return MeanInterval(mean, mean, mean)
    half = float(stdtrit(count - 1, 0.975)) * deviation / count**0.5
    return MeanInterval(mean, mean - half, mean + half)


def cost_interval(costs: ArrayLike) -> MeanInterval | None:
    """The mean cost of independent episodes with its 95 % interval.

    Args:
        costs: One number an episode, shape (E,).

    Returns:
        Student's interval, which does not reach below zero where no cost does; NaN for its ends
        where all cost the same, because nothing is seen of how they vary; None where a cost is
        not known.
    """
    array = np.asarray(costs, dtype=np.float64).reshape(-1)
    if not len(array) or np.isnan(array).any():
        return None
    if (array == array[0]).all():
        return MeanInterval(float(array[0]), float("nan"), float("nan"))
    interval = mean_interval(array)
    least = 0.0 if array.min() >= 0.0 else -np.inf
    return replace(interval, low=max(interval.low, float(least)))


def worst_tenth(values: ArrayLike, *, worst: Literal["lowest", "highest"]) -> float:
    """The mean of the worst tenth of the episodes (the conditional value at risk).

    Args:
        values: One number an episode, shape (E,), E at least 1.
        worst: Which are the worst: the lowest returns, the highest costs.

    Returns:
        Where a tenth is no whole number of episodes, the last one counts in part; of fewer than
        ten, the worst.
    """
    array = np.sort(np.asarray(values, dtype=np.float64).reshape(-1))
    if worst == "highest":
        array = array[::-1]
    tenth = max(_WORST * len(array), 1.0)
    weights = np.clip(tenth - np.arange(len(array)), 0.0, 1.0)
    counted = weights > 0.0
    return float((array[counted] * weights[counted]).sum() / tenth)


def interquartile_mean(values: ArrayLike, axis: int = -1) -> NDArray[np.float64]:
    """Mean of the middle half of the values, more robust than the mean, tighter than the median.

    Args:
        values: Any shape.
        axis: Along which to average.

    Returns:
        The shape of `values` without `axis`.
    """
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(np.asarray(values, dtype=np.float64), _CUT, axis=axis))


def summarise(values: ArrayLike, *, seed: int = 0) -> ReturnStatistics:
    """Mean, deviation and interquartile mean with its 95 % interval.

    That is by percentile bootstrap, because it is defined for every sample: the corrected ones
    divide by zero where many episodes have the same return, as at CartPole's limit of 500. Of more
    than 10,000 values it is that of Tukey and McLaughlin, by the deviation of the values with those
    left out moved to the borders.

    Args:
        values: One number an episode, shape (E,).
        seed: Of the resampling; the same seed gives the same interval.

    Returns:
        The statistics; with one value, or equal ones, the interval is that value.

    Raises:
        InputError: If there is no value, or one is NaN or infinite.
    """
    array = np.asarray(values, dtype=np.float64).reshape(-1)
    if len(array) == 0 or not np.isfinite(array).all():
        raise InputError(
            "there is nothing to summarise; run at least one episode"
            if len(array) == 0
            else "an episode's value is NaN or infinite; check the environment's rewards"
        )
    if (array == array[0]).all():
        value = float(array[0])
        return ReturnStatistics(mean=value, std=0.0, iqm=value, low=value, high=value)
    low, high = _formula(array) if len(array) > _MANY else _bootstrap(array, seed)
    return ReturnStatistics(
        mean=float(array.mean()),
        std=float(array.std(ddof=1)),
        iqm=float(interquartile_mean(array)),
        low=low,
        high=high,
    )


def summarise_groups(groups: Sequence[ArrayLike], *, seed: int = 0) -> ReturnStatistics:
    """Mean, deviation and interquartile mean where episodes are of several learners.

    Episodes of one learner are alike. So the interval comes from drawing learners with
    replacement, and then episodes of each.

    Args:
        groups: For each of G learners one number an episode, shape (E,), the same for all.
        seed: Of the resampling; the same seed gives the same interval.

    Returns:
        The statistics of all episodes together, with that interval.

    Raises:
        InputError: If there is no value, or one is NaN or infinite.
    """
    whole = summarise(
        np.concatenate([np.asarray(group).reshape(-1) for group in groups]), seed=seed
    )
    if len(groups) == 1 or whole.std == 0.0:
        return whole
    values = np.array(groups, dtype=np.float64)
    learners, episodes = values.shape
    rng = np.random.default_rng(seed)
    at_once = max(1, _NUMBERS_AT_ONCE // values.size)
    means = []
    for start in range(0, _RESAMPLES, at_once):
        count = min(at_once, _RESAMPLES - start)
        drawn = rng.integers(learners, size=(count, learners, 1))
        of_each = rng.integers(episodes, size=(count, learners, episodes))
        means.append(interquartile_mean(values[drawn, of_each].reshape(count, -1), axis=1))
    low, high = np.quantile(np.concatenate(means), [0.025, 0.975])
    return replace(whole, low=float(low), high=float(high))


def _bootstrap(array: NDArray[np.float64], seed: int) -> tuple[float, float]:
    from scipy.stats import bootstrap

    drawn: Any = bootstrap(
        (array,),
        interquartile_mean,
        n_resamples=_RESAMPLES,
        method="percentile",
        batch=max(1, _NUMBERS_AT_ONCE // len(array)),
        rng=np.random.default_rng(seed),
    )
    return float(drawn.confidence_interval.low), float(drawn.confidence_interval.high)


def _formula(array: NDArray[np.float64]) -> tuple[float, float]:
    from scipy.stats.mstats import trimmed_mean_ci

    low, high = trimmed_mean_ci(array, limits=(_CUT, _CUT), alpha=0.05)
    return float(low), float(high)
