"""How much each of many candidates helps a quick tree, in one pass over all of them a node.

A tree sorts every feature at every node. Candidates are the same at every node, so each is put in
bins once; what is then counted at a node, by bin and label, tells the gain of every query.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BINS = 32
_LOOKED_AT = 1_000  # values that the edges of the bins are taken from, about
_TOGETHER = 256  # candidates that are counted together: their counts stay near the processor
_ROUNDING = 1e-12  # of a node's sum of squares: a gain that is less is none

Block = NDArray[np.uint16]


class _BestQuery(NamedTuple):
    """The best query at a node: its gain, what it asks about, and the rows on either side."""

    gain: float
    candidate: int
    left: NDArray[np.int64]
    right: NDArray[np.int64]


def binned(columns: Iterable[NDArray[np.float32]]) -> list[Block]:
    """Put the values of candidates in bins.

    Args:
        columns: The values of each of k candidates in N steps, (N,).

    Returns:
        Blocks of w candidates, (N, w), w the same but for the last: ``bin * w + candidate``.
    """
    rest = iter(columns)
    parts = iter(lambda: list(islice(rest, _TOGETHER)), [])
    return [_cells(np.stack([_bins(values) for values in part], axis=1)) for part in parts]


def gains(
    blocks: Sequence[Block],
    labels: NDArray[np.int64],
    targets: NDArray[np.float64],
    *,
    leaves: int,
) -> NDArray[np.float64]:
    """How much each candidate helps a quick tree, the most helpful query first.

    Args:
        blocks: Of k candidates in N steps, from `binned`.
        labels: Of the steps, (N,), from 0.
        targets: For each of L labels m whole numbers that a leaf shall have alike, (m, L): for
            the identity the gain is of Gini's impurity, for the numbers of intervals of variance.
        leaves: Of the tree, at most.

    Returns:
        The share of each in the gain of all queries, (k,); 0 where it is not asked about.
    """
    worth = np.zeros(sum(block.shape[1] for block in blocks))
    waiting = [_best(blocks, labels, targets, np.arange(len(labels)))]
    for _ in range(leaves - 1):
        query = waiting.pop(int(np.argmax([each.gain for each in waiting])))
        if query.gain <= 0.0:
            break
        worth[query.candidate] += query.gain
        waiting += [_best(blocks, labels, targets, rows) for rows in (query.left, query.right)]
    return worth / (worth.sum() or 1.0)


def _best(
    blocks: Sequence[Block],
    labels: NDArray[np.int64],
    targets: NDArray[np.float64],
    rows: NDArray[np.int64],
) -> _BestQuery:
    """The best query about any candidate at a node, of equals the first candidate's."""
    none = _BestQuery(0.0, 0, rows, rows)
    values = targets[:, labels[rows]]
    values = values[values.any(axis=1)]
    if (values == values[:, :1]).all():
        return none
    best, place, edge = 0.0, 0, 0
    for first, block in enumerate(blocks):
        score = _scores(block[rows], values)
        highest = score.max(axis=0)
        candidate = int(highest.argmax())
        if highest[candidate] > best:
            best = float(highest[candidate])
            place = first * _TOGETHER + candidate
            edge = int(score[:, candidate].argmax())
    before = float(np.square(values.sum(axis=1)).sum()) / len(rows)
    if best - before <= _ROUNDING * before:
        return none
    block = blocks[place // _TOGETHER]
    goes_left = block[rows, place % _TOGETHER] < (edge + 1) * block.shape[1]
    return _BestQuery(best - before, place, rows[goes_left], rows[~goes_left])


def _scores(cells: Block, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each query has of squared sums over numbers of steps, (bins, w): the more the better.

    Args:
        cells: The part of a block that the n steps of a node are, (n, w).
        values: The targets of each step, (m, n).

    Returns:
        Row b for the query that sends bins 0 to b to the left. All but the divisions is in whole
        numbers, which float64 holds: the same on every machine.
    """
    w = cells.shape[1]
    steps = np.bincount(cells.ravel(), minlength=_BINS * w).reshape(_BINS, w).cumsum(axis=0)
    sums = [
        np.bincount(cells[some].ravel(), np.repeat(value[some], w), _BINS * w)
        for value, some in zip(values, values != 0.0, strict=True)
    ]
    left = np.reshape(sums, (-1, _BINS, w)).cumsum(axis=1)
    right = left[:, -1:] - left
    return np.asarray(
        np.square(left).sum(axis=0) / np.maximum(steps, 1)
        + np.square(right).sum(axis=0) / np.maximum(steps[-1] - steps, 1)
    )


def _bins(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The bin of each value, (N,): of about equally many steps each, the least in one alone."""
    some = np.sort(values[:: max(1, len(values) // _LOOKED_AT)])
    edges = np.unique(some[np.arange(_BINS - 1) * len(some) // (_BINS - 1)])
    return np.asarray((values > edges[:, None]).sum(axis=0, dtype=np.uint8))


def _cells(bins: NDArray[np.uint8]) -> Block:
    """Bins of w candidates, (N, w), as one number for each pair of bin and candidate."""
    w = bins.shape[1]
    return np.asarray(bins * np.uint16(w) + np.arange(w, dtype=np.uint16))
