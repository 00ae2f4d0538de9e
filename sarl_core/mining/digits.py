"""Thresholds and the values beside them as they are written for people, everywhere."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.splits import written_threshold, written_value
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Bounds


def limit_text(threshold: float, feature: Feature, *, beside: Sequence[float] = ()) -> str:
    """A threshold on a feature.

    Args:
        threshold: At full precision.
        feature: Knows the demonstrated values around it.
        beside: Values of the feature that are shown with it.

    Returns:
        As "293.42": three significant digits, more where it takes them to part the demonstrated
        states and `beside` as the threshold does; without its unit.
    """
    if feature.splits is not None and not beside:
        return feature.splits.written(threshold)
    return decimal_text(written_threshold(threshold, feature.splits, beside=beside))


def limit_texts(bounds: Bounds, feature: Feature, *, beside: Sequence[float] = ()) -> list[str]:
    """The ends of an interval, each as `limit_text`.

    Args:
        bounds: Any.
        feature: That they bound.
        beside: Values of the feature that are shown with them.

    Returns:
        The ends that there are, the lower first; two that differ do not read the same.
    """
    ends = [end for end in (bounds.low, bounds.high) if math.isfinite(end)]
    texts = [limit_text(end, feature, beside=beside) for end in ends]
    return texts if len(set(texts)) == len(set(ends)) else list(map(decimal_text, ends))


def value_text(value: float, feature: Feature, bounds: Iterable[Bounds]) -> str:
    """A value of a feature where bounds on the feature may be shown, too.

    Args:
        value: Of a state; any number, or none.
        feature: Its own.
        bounds: On the feature, shown with the value `beside` them.

    Returns:
        As "293.4": three significant digits, more where it takes them to stay on its side of
        each bound. As "yes" or "no" where it says which word a column holds.
    """
    if not math.isfinite(value):
        return decimal_text(value)
    if feature.indicator is not None and value in (0.0, 1.0):
        return "yes" if value else "no"
    limits = [
        float(limit) for one in bounds for limit in limit_texts(one, feature, beside=(value,))
    ]
    return decimal_text(written_value(value, limits))


def amount_text(
    amount: float, dimension: LabelledDimension | None = None, *, beside: Sequence[float] = ()
) -> str:
    """A continuous action, proposed or executed.

    Args:
        amount: Any number, or none.
        dimension: Its own, where the interval that it lies in may be shown, too.
        beside: Other amounts that are shown with it.

    Returns:
        As "-0.333": three significant digits, more where it takes them to tell the amount from
        those beside it, or not to leave its interval as that is written.
    """
    if not math.isfinite(amount):
        return decimal_text(amount)
    low, high = (-math.inf, math.inf) if dimension is None else dimension.written_interval(amount)
    others = [other for other in beside if math.isfinite(other) and other != amount]
    return decimal_text(written_value(amount, others, within=(low, high)))
