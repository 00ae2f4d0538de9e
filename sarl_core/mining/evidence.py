"""What a rule carries of the pairs behind it: where they lay, and what others say of it."""

from __future__ import annotations

from typing import NamedTuple


class DataBox(NamedTuple):
    """Where the pairs of a rule lay: its half-spaces reach further than they did.

    Attributes:
        least: Least value of each feature, (d,), exact float32 numbers.
        low: The 1 % quantile of each feature, (d,).
        high: The 99 % quantile of each feature, (d,).
        most: Largest value of each feature, (d,), exact float32 numbers.
    """

    least: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    most: tuple[float, ...]


class HeldOut(NamedTuple):
    """A rule on episodes that it was not mined from.

    Attributes:
        samples: Pairs to which it applies.
        correct: Those of them that carry its label.
    """

    samples: int
    correct: int
