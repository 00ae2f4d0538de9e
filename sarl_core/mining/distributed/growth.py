"""Growing a tree over rows that lie in pieces on many machines.

The upper part grows level by level: every piece counts its rows by node, feature, bin and label,
the counts are added up, and the best query of each node is sent back. A node of few rows is grown
to its end where these are brought together.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.distributed.histograms import (
    NOWHERE,
    Queries,
    added,
    at_root,
    chosen_queries,
    grown_parts,
    histogram,
    joined,
    sent_on,
    taken,
)
from sarl_core.mining.growing.histogram import Query
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF

PART_ROWS = 100_000
"""A node with no more rows is grown to its end in one process."""
COUNTS = 4_000_000
"""Numbers that a piece counts at once: 32 MB."""
_GROUP_ROWS = 400_000  # rows of the nodes that one process grows at once
_WAVE_ROWS = 4_000_000  # rows that are brought together at once
_TOGETHER = 8  # arrays that are added up at once


@dataclass
class _Node:
    """A node of the upper part while it grows."""

    counts: NDArray[np.int64]
    depth: int
    feature: int = LEAF
    border: int = 0
    left: int = LEAF
    right: int = LEAF
    part: TreeStructure | None = None


@dataclass
class DistributedGrowth:
    """A tree that grows over the rows of all pieces.

    Attributes:
        client: A ``distributed.Client``.
        rows: The `BinnedRows` of each piece, as futures.
        counts: Rows of each label in all of them, (labels,).
        bins: How many each feature has.
        dimension: Whose labels the tree is about.
        least: Rows that a node needs to be split.
        max_depth: Of the tree; None for no limit.
        seed: For choosing among equally good queries.
        advance: Called now and then with a share of the work, 0 to 1; may raise to end it.
    """

    client: Any
    rows: Sequence[Any]
    counts: NDArray[np.int64]
    bins: Sequence[int]
    dimension: int = 0
    least: int = 2
    max_depth: int | None = None
    seed: int = 0
    advance: Callable[[float], None] = lambda share: None
    _nodes: list[_Node] = field(default_factory=list)

    def grow(self) -> TreeStructure:
        """Grow it.

        Returns:
            Its queries, the root first and each left part before the right one; the thresholds are
            borders, as whole numbers: a row goes left whose bin is at most that.
        """
        self._nodes = [_Node(self.counts, 0)]
        at = [self.client.submit(at_root, rows) for rows in self.rows]
        level = [0] if self._is_split(0) else []
        small: list[int] = []
        while level:
            small += [one for one in level if self._size(one) <= PART_ROWS]
            large = [one for one in level if self._size(one) > PART_ROWS]
            if not large:
                break
            queries = self._chosen(large, at)
            at = [
                self.client.submit(sent_on, rows, nodes, queries)
                for rows, nodes in zip(self.rows, at, strict=True)
            ]
            level = [
                child
                for one in large
                for child in (self._nodes[one].left, self._nodes[one].right)
                if child != LEAF and self._is_split(child)
            ]
            self._tell(small)
        self._grow_parts(sorted(small), at)
        return self._assembled()

    def _size(self, node: int) -> int:
        return int(self._nodes[node].counts.sum())

    def _is_split(self, node: int) -> bool:
        one = self._nodes[node]
        deep = self.max_depth is not None and one.depth >= self.max_depth
        mixed = np.count_nonzero(one.counts) > 1
        return bool(mixed and not deep and self._size(node) >= max(2, self.least))

    def _tell(self, small: Sequence[int], grown: int = 0) -> None:
        """The upper part is half of the work, and the parts below are the other."""
        total = int(self.counts.sum())
        ready = sum(self._size(one) for one in small)
        self.advance(0.5 * ready / total + 0.5 * grown / total)

    def _chosen(self, nodes: Sequence[int], at: Sequence[Any]) -> Queries:
        """Choose the queries of some nodes, and make their children."""
        labels, bins = len(self.counts), max(self.bins)
        together = max(1, COUNTS // (len(self.bins) * bins * labels))
        chosen: list[Query | None] = []
        for start in range(0, len(nodes), together):
            wanted = np.array(nodes[start : start + together], dtype=np.int64)
            parts = [
                self.client.submit(histogram, rows, where, wanted, (labels, bins), self.dimension)
                for rows, where in zip(self.rows, at, strict=True)
            ]
            total = added_up(self.client, parts)
            chosen += self.client.submit(chosen_queries, total).result()
        split: list[tuple[int, Query]] = []
        for number, query in zip(nodes, chosen, strict=True):
            if query is None:
                continue
            node = self._nodes[number]
            node.feature, node.border = query.feature, query.border
            node.left, node.right = len(self._nodes), len(self._nodes) + 1
            self._nodes += [
                _Node(counts, node.depth + 1) for counts in (query.left, node.counts - query.left)
            ]
            split.append((number, query))

        def children(side: str) -> NDArray[np.int64]:
            below = [getattr(self._nodes[number], side) for number, _ in split]
            ends = [one if self._is_split(one) else NOWHERE for one in below]
            return np.array(ends, dtype=np.int64)

        return Queries(
            np.array([number for number, _ in split], dtype=np.int64),
            np.array([query.feature for _, query in split], dtype=np.int64),
            np.array([query.border for _, query in split], dtype=np.int64),
            children("left"),
            children("right"),
        )

    def _grow_parts(self, small: Sequence[int], at: Sequence[Any]) -> None:
        grown = 0
        for wave in _packed(small, self._size, _WAVE_ROWS):
            groups = [
                np.array(group, dtype=np.int64) for group in _packed(wave, self._size, _GROUP_ROWS)
            ]
            handed = [
                self.client.submit(taken, rows, nodes, groups)
                for rows, nodes in zip(self.rows, at, strict=True)
            ]
            parts = [
                self.client.submit(
                    grown_parts,
                    group,
                    [self._depth_left(node) for node in group.tolist()],
                    self.least,
                    self.seed,
                    self.dimension,
                    self.bins,
                    *(self.client.submit(operator.getitem, one, place) for one in handed),
                )
                for place, group in enumerate(groups)
            ]
            for group, future in zip(groups, parts, strict=True):
                for node, part in zip(group.tolist(), future.result(), strict=True):
                    self._nodes[node].part = part
                grown += sum(map(self._size, group.tolist()))
                self._tell(small, grown)

    def _depth_left(self, node: int) -> int | None:
        return None if self.max_depth is None else self.max_depth - self._nodes[node].depth

    def _assembled(self) -> TreeStructure:
        """The upper part with those below; children have larger numbers than their parents."""
        parts: dict[int, TreeStructure] = {}
        for number, node in reversed(list(enumerate(self._nodes))):
            if node.part is not None:
                parts[number] = node.part
            elif node.left == LEAF:
                leaf = np.full(1, LEAF, dtype=np.int64)
                parts[number] = TreeStructure(leaf, np.zeros(1), leaf, leaf)
            else:
                parts[number] = joined(
                    node.feature, node.border, parts.pop(node.left), parts.pop(node.right)
                )
        return parts[0]


def added_up(client: Any, parts: Sequence[Any], add: Callable[..., Any] = added) -> Any:
    """Add up what pieces have, where it is, some at once.

    Args:
        client: A ``distributed.Client``.
        parts: Futures.
        add: Adds up any number of them; it matters to nobody in which order.

    Returns:
        A future of the sum.
    """
    while len(parts) > 1:
        parts = [
            client.submit(add, *parts[start : start + _TOGETHER])
            for start in range(0, len(parts), _TOGETHER)
        ]
    return parts[0]


def _packed(nodes: Sequence[int], size: Callable[[int], int], most: int) -> list[list[int]]:
    """Nodes one after the other, in packs of so many rows."""
    packs: list[list[int]] = []
    rows = most
    for node in nodes:
        if rows + size(node) > most:
            packs.append([])
            rows = 0
        packs[-1].append(node)
        rows += size(node)
    return packs
