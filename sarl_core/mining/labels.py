"""From actions to labels: what the tree predicts, and the divider for continuous actions."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text, float32_decimal, short_decimal
from sarl_core.demonstrations.dataset import ActionDimension, Demonstrations
from sarl_core.demonstrations.fields import labels_of
from sarl_core.errors import InputError

MAX_DIVIDER = 100

_ROUNDING = 1e-12  # of an interval's width
_EDGE_ERROR = 0.005  # of it: an edge is written with no larger an error


@dataclass(frozen=True)
class LabelledDimension:
    """One action dimension and its labels.

    Attributes:
        name: Of the action dimension.
        label_names: One name a label.
        edges: Of a continuous dimension, the k + 1 edges of its k intervals, ascending; () if
            it is discrete. A single value that was always shown is one label between two equal
            edges.
        first: Of a discrete dimension, the action that label 0 stands for.
        codes: Of one whose labels do not count up from the first, the action of each, ascending.
        bounds_from: Of a continuous dimension, where the outer edges come from.
    """

    name: str
    label_names: tuple[str, ...]
    edges: tuple[float, ...] = ()
    first: int = 0
    bounds_from: str = "action space"
    codes: tuple[int, ...] = ()

    @classmethod
    def of_edges(
        cls, name: str, edges: Sequence[float], *, bounds_from: str = "action space"
    ) -> LabelledDimension:
        """A continuous dimension, its intervals named by their edges.

        Args:
            name: Of the action dimension.
            edges: k + 1 numbers, ascending; or two equal ones.
            bounds_from: Where the outer ones come from.

        Returns:
            A dimension with k labels.
        """
        names = tuple(
            low if low == high else f"{low} to {high}" for low, high in pairwise(_edge_texts(edges))
        )
        return cls(name, names, edges=tuple(map(float, edges)), bounds_from=bounds_from)

    @property
    def is_interval(self) -> bool:
        """Whether the labels are intervals of a continuous action."""
        return bool(self.edges)

    @property
    def n_labels(self) -> int:
        """Number of labels."""
        return len(self.label_names)

    @cached_property
    def actions(self) -> tuple[int, ...]:
        """Of a discrete dimension, the action of each label, ascending."""
        return self.codes or tuple(range(self.first, self.first + self.n_labels))

    @cached_property
    def reach(self) -> tuple[int, int]:
        """Of a discrete dimension, the first action and how many there are up to the last."""
        return self.actions[0], self.actions[-1] - self.actions[0] + 1

    @cached_property
    def inner_edges(self) -> tuple[float, ...]:
        """The edges between the intervals."""
        return self.edges[1:-1]

    @cached_property
    def _written_edges(self) -> list[str]:
        """All edges, as the names of labels say them."""
        return _edge_texts(self.edges)

    def centre(self, label: int) -> float:
        """The middle of an interval.

        Args:
            label: Of a continuous dimension.

        Returns:
            Halfway between its edges.
        """
        low, high = self.edges[label], self.edges[label + 1]
        centre = (low + high) / 2
        # The edges around zero are rounded; their centre is zero all the same.
        return 0.0 if abs(centre) < _ROUNDING * (high - low) else centre

    def label_of(self, value: float) -> int:
        """The label of one action.

        Args:
            value: An action of this dimension.

        Returns:
            Its label. On an inner edge: the upper interval; outside the edges: the nearest. A
            number that is no label for a discrete action that has none.
        """
        if self.edges:
            return bisect_right(self.inner_edges, value)
        if self.codes:
            return self._labels.get(int(value), -1)
        return int(value) - self.first

    @cached_property
    def _labels(self) -> dict[int, int]:
        """The label of each action."""
        return {action: label for label, action in enumerate(self.actions)}

    def written_interval(self, value: float) -> tuple[float, float]:
        """The interval of one action as it is written.

        Args:
            value: An action of this continuous dimension.

        Returns:
            Its ends; the infinite ones if there is one label, which nothing lies beside.
        """
        if self.n_labels == 1:
            return -math.inf, math.inf
        label = self.label_of(value)
        low, high = self._written_edges[label : label + 2]
        return float(low), float(high)

    def labels_of(self, values: NDArray[np.generic]) -> NDArray[np.int64]:
        """The labels of many actions, as `label_of`.

        Args:
            values: Shape (N,).

        Returns:
            Shape (N,).
        """
        if self.edges:
            intervals = np.searchsorted(self.inner_edges, values.astype(np.float64), side="right")
            return intervals.astype(np.int64)
        return labels_of(values, self.first, self.codes)


def _edge_texts(edges: Sequence[float]) -> list[str]:
    """Edges with three significant digits, or with more where intervals are narrow for those.

    The outer ones are rounded outwards: what lies between them lies between what is written, too.
    """
    low, high = edges[0], edges[-1]
    if low == high:
        return [decimal_text(float32_decimal(low))] * 2
    width = min(after - before for before, after in pairwise(edges))
    texts = []
    for edge in map(float, edges):
        error = _EDGE_ERROR * width
        least = edge if edge == high else edge - error
        most = edge if edge == low else edge + error
        if abs(edge) < _ROUNDING * width and least <= 0.0 <= most:
            texts.append("0")
            continue
        decimal = short_decimal(edge, least, float(np.nextafter(most, math.inf)), fewest=3)
        texts.append(decimal_text(edge if decimal is None else decimal))
    return texts


def label_dimensions(
    demonstrations: Demonstrations, divider: int = 2
) -> tuple[LabelledDimension, ...]:
    """What the labels of demonstrations are (the paper's divider).

    Args:
        demonstrations: The actions and their bounds.
        divider: Number of equal-width intervals of each continuous dimension, 2 or more.

    Returns:
        One entry an action dimension.

    Raises:
        InputError: If the divider is out of range.
    """
    if not isinstance(divider, (int, np.integer)) or not 2 <= divider <= MAX_DIVIDER:
        raise InputError(f"the divider is {divider}; give a whole number from 2 to {MAX_DIVIDER}")
    return tuple(
        _labelled(dimension, int(divider)) for dimension in demonstrations.action_dimensions
    )


def _labelled(dimension: ActionDimension, divider: int) -> LabelledDimension:
    if dimension.kind == "discrete":
        return LabelledDimension(
            dimension.name, dimension.labels, first=dimension.first, codes=dimension.codes
        )
    low, high = dimension.low, dimension.high
    # One value that was always shown is one label, however finely others are divided.
    edges = np.linspace(low, high, divider + 1).tolist() if low < high else [low, high]
    return LabelledDimension.of_edges(dimension.name, edges, bounds_from=dimension.bounds_from)
