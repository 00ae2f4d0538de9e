"""CART over bins: where there are many states, borders of a thousand bins are as good as all.

A feature's values become the numbers of bins that hold about as many states each. At a node, states
are counted by feature, label and bin, which says at once what every border between two bins would
part; of the two nodes below, the larger one has what the smaller one has not. Few states have no
use for a thousand bins, so neighbouring ones are taken together, several such nodes choose their
queries in one go, and where very few states are left, sorting them is faster than counting. With
fewer values than bins every border between two of them is one. What is between two bins is a
threshold of the states, so the tree asks about those.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.mining.growing.exact import fitted
from sarl_core.mining.growing.structure import TreeStructure, tree_levels
from sarl_core.mining.tree import LEAF

BINS = 1_024
"""Of a feature, at most; a power of two."""
_FEWEST_BINS = 32
_STATES_A_BIN = 4  # of a node, at least, before neighbouring bins are taken together
_SORTED = 500  # states that are sorted rather than counted, where many nodes are to come of them
_MANY_NODES = 8
_WAITING = 64  # parts at most that are sorted, or wait for it, or to be taken
_BINS_IN_ONE_GO = 512  # of a feature, of all nodes that choose their queries together, at most
_COUNTS_IN_ONE_GO = 200_000  # of all features and labels, likewise: more fill the cache
_AT_ONCE = 6_000  # states whose features are counted in one go: of more, they fill the cache


@dataclass(eq=False)
class BinnedStates:
    """States as numbers of bins, which serve the trees of all action dimensions.

    Attributes:
        numbers: The bin of each value, (d, N) uint16; those of no state once they were taken.
        borders: For each feature what lies between two bins, ascending, float64: a value is in
            bin 0 where it is at most the first.
    """

    numbers: NDArray[np.uint16]
    borders: tuple[NDArray[np.float64], ...]

    @classmethod
    def of(cls, observations: NDArray[np.float32]) -> BinnedStates:
        """Find bins.

        Args:
            observations: Shape (N, d), float32.

        Returns:
            At most `BINS` a feature.
        """
        from loky import cpu_count

        numbers = np.empty(observations.shape[::-1], dtype=np.uint16)

        def bin_feature(index: int) -> NDArray[np.float64]:
            values = observations[:, index].copy()  # side by side: the rest is faster
            # A formula may be infinite, and thresholds lie below the limit; NaN is at most none.
            np.fmax(np.fmin(values, LARGEST, out=values), -LARGEST, out=values)
            # Much faster than to search the bin of each value.
            order = _ascending_order(values)
            ascending = values[order]
            ends = _bin_ends(ascending)
            sizes = np.diff(ends, prepend=0, append=len(values))
            numbers[index, order] = np.repeat(np.arange(len(sizes), dtype=np.uint16), sizes)
            # Exact, and strictly between the two: float64 has more than twice the digits.
            return (ascending[ends - 1].astype(np.float64) + ascending[ends]) / 2

        with ThreadPoolExecutor(cpu_count()) as threads:  # sorting and searching let others run
            borders = tuple(threads.map(bin_feature, range(observations.shape[1])))
        return cls(numbers, borders)

    def taken(self) -> NDArray[np.uint16]:
        """The numbers, which are here no longer: a tree that grows needs their room."""
        numbers, self.numbers = self.numbers, self.numbers[:, :0].copy()
        return numbers


class Query(NamedTuple):
    """What a node asks.

    Attributes:
        feature: Of which.
        border: A state goes left whose bin is at most this.
        left: States of each label that go left, (labels,).
    """

    feature: int
    border: int
    left: NDArray[np.int64]


def best_queries(counts: NDArray[np.int64]) -> list[Query | None]:
    """Choose queries, as CART does by Gini's impurity; of equals the first feature and border.

    Equal are purities that round to one number; up to ninety million states nothing but their
    quotients is rounded.

    Args:
        counts: States of k nodes by feature, label and bin, (k, d, labels, bins).

    Returns:
        k entries; None where no border parts a node's states.
    """
    k, _, _, bins = counts.shape
    if bins < 2:
        return [None] * k
    total = counts[:, 0].sum(axis=2).astype(np.float64)
    # Whole numbers are added up faster.
    below = counts[..., :-1].cumsum(axis=3).astype(np.float64)
    n_below = below.sum(axis=2)
    n_above = total.sum(axis=1)[:, None, None] - n_below
    # The impurity that is left is the number of states less this. The squares of what is above
    # are those of all and of what is below, less twice their product.
    squares = np.einsum("kdlb,kdlb->kdb", below, below)
    purity = np.einsum("kl,kdlb->kdb", -2.0 * total, below)
    purity += squares
    purity += np.square(total).sum(axis=1)[:, None, None]
    purity /= np.maximum(n_above, 1.0)
    squares /= np.maximum(n_below, 1.0)
    purity += squares
    nodes = np.arange(k)

    def chosen() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return np.divmod(purity.reshape(k, -1).argmax(axis=1), bins - 1)

    feature, first = chosen()
    # A border with nothing on one side is as good as no query, and so is the best where no query
    # gains: then the others alone are looked at, which takes longer.
    if not (n_below[nodes, feature, first] * n_above[nodes, feature, first]).all():
        purity[(n_below == 0) | (n_above == 0)] = -1.0
        feature, first = chosen()
    # Between two bins that hold states there may be empty ones: the border is in their middle.
    n_left = n_below[nodes, feature, first]
    last = (n_below[nodes, feature] <= n_left[:, None]).sum(axis=1) - 1
    left = below[nodes, feature, :, first].astype(np.int64)
    queries = map(Query, feature.tolist(), ((first + last) // 2).tolist(), left)
    is_query = purity[nodes, feature, first] >= 0.0
    return [query if is_one else None for query, is_one in zip(queries, is_query, strict=True)]


def histogram_structure(
    bins: BinnedStates,
    labels: NDArray[np.int64],
    *,
    least: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
    last: bool = False,
) -> tuple[TreeStructure, NDArray[np.int64]]:
    """Grow a tree of which each query asks about a border between two bins.

    Args:
        bins: Of N states.
        labels: Shape (N,).
        least: States that a node needs to be split.
        max_depth: Of the tree; None grows it fully: a leaf is pure, or no border between bins
            parts its states.
        seed: For choosing among equally good queries of few states.
        last: Whether the bins serve no other tree, so that their numbers may be taken.

    Returns:
        Its queries, each left part before the right one; and the leaf of each state, (N,).
    """
    counts = [len(borders) + 1 for borders in bins.borders]
    # Handed over without a name, so that whoever is given them alone holds them.
    structure, leaves = binned_structure(
        bins.taken() if last else bins.numbers,
        counts,
        labels,
        least=least,
        max_depth=max_depth,
        seed=seed,
    )
    threshold = np.zeros(len(structure.feature))
    for index, borders in enumerate(bins.borders):
        here = structure.feature == index
        threshold[here] = borders[structure.threshold[here].astype(np.int64)]
    return replace(structure, threshold=threshold), leaves


def binned_structure(
    numbers: NDArray[np.uint16],
    counts: Sequence[int],
    labels: NDArray[np.int64],
    *,
    least: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
) -> tuple[TreeStructure, NDArray[np.int64]]:
    """The same of bins alone, whose borders are whole numbers.

    Args:
        numbers: The bin of each value, (d, N).
        counts: How many bins each feature has, d numbers, at most `BINS`.
        labels: Shape (N,).
        least: As of `histogram_structure`.
        max_depth: Likewise.
        seed: Likewise.

    Returns:
        As `histogram_structure`; a state goes left whose bin is at most the threshold.
    """
    from loky import cpu_count

    # scikit-learn, which sorts, lets other threads run.
    with ThreadPoolExecutor(cpu_count()) as threads:
        growth = _Growth(threads, max(2, least), max_depth, seed)
        waiting = growth.root(numbers, counts, labels)
        del numbers
        return growth.grow(waiting, len(labels))


class _Part(NamedTuple):
    """The states of a node that may be split.

    Attributes:
        node: Its number.
        depth: Queries above it.
        of_labels: How many of its states have each label, (labels,).
        rows: The states, (n,).
        keys: Of each feature, label * `BINS` + bin, (d, n).
        counts: By feature, label and bin; None where they were not counted yet.
    """

    node: int
    depth: int
    of_labels: NDArray[np.int64]
    rows: NDArray[np.signedinteger]
    keys: NDArray[np.unsignedinteger]
    counts: NDArray[np.int64] | None = None


@dataclass
class _Growth:
    """A tree while it grows; nodes have numbers in the order in which they were made.

    Of a million nodes a list of numbers would take as much as the states do.
    """

    threads: ThreadPoolExecutor
    least: int
    max_depth: int | None
    seed: int
    labels: int = 1
    spread: NDArray[np.uint16] = field(default_factory=lambda: np.zeros(0, dtype=np.uint16))
    feature: array[int] = field(default_factory=lambda: array("q", [LEAF]))
    border: array[float] = field(default_factory=lambda: array("d", [0.0]))
    left: array[int] = field(default_factory=lambda: array("q", [LEAF]))
    right: array[int] = field(default_factory=lambda: array("q", [LEAF]))

    def root(
        self, numbers: NDArray[np.uint16], counts: Sequence[int], labels: NDArray[np.int64]
    ) -> list[_Part]:
        """What to begin with: states, (d, N), with so many bins, d, and these labels, (N,)."""
        of_labels = np.bincount(labels)
        present = np.flatnonzero(of_labels)
        self.labels = len(present)
        # Bins of a feature with few values lie far apart, so that they stay apart when others are
        # taken together.
        self.spread = np.log2(BINS // np.array(counts)).astype(np.uint16)
        kind = np.uint16 if self.labels * BINS <= 2**16 else np.uint32
        keys = np.left_shift(numbers, self.spread[:, None], dtype=kind)
        first_keys = np.zeros(len(of_labels), dtype=kind)
        first_keys[present] = BINS * np.arange(self.labels)
        keys += first_keys[labels]
        # One number a state is held of each, and there are fewer nodes than twice the states.
        place = np.int32 if 2 * len(labels) < 2**31 else np.int64
        rows: NDArray[np.signedinteger] = np.arange(len(labels), dtype=place)
        return [_Part(0, 0, of_labels[present], rows, keys)] if len(labels) else []

    def grow(self, waiting: list[_Part], n: int) -> tuple[TreeStructure, NDArray[np.int64]]:
        """Grow it over n states; of the parts that wait nobody else should hold any."""
        leaves = np.zeros(n, dtype=waiting[0].rows.dtype if waiting else np.int64)
        sorted_parts: deque[
            tuple[int, NDArray[np.signedinteger], Future[tuple[TreeStructure, NDArray[np.int64]]]]
        ] = deque()
        counted_parts: dict[int, list[_Part]] = {}  # by the number of bins

        def take() -> None:
            node, rows, future = sorted_parts.popleft()
            self._take(node, rows, *future.result(), leaves)

        while waiting or counted_parts:
            while waiting:
                part = waiting.pop()
                if not self._is_split(part):
                    leaves[part.rows] = part.node
                elif self.least * _MANY_NODES <= len(part.rows) <= _SORTED:
                    future = self.threads.submit(self._sorted, part._replace(counts=None))
                    sorted_parts.append((part.node, part.rows, future))
                    if len(sorted_parts) > _WAITING:
                        take()
                else:
                    counted_parts.setdefault(_bins_for(len(part.rows)), []).append(part)
                del part  # its states may be most of what there is
            if counted_parts:
                bins, parts = self._next_parts(counted_parts)
                waiting, whole = self._split(parts, bins)
                del parts
                while whole:
                    part = whole.pop()
                    if bins < BINS:  # it may be that neighbouring bins are what is to be parted
                        counted_parts.setdefault(BINS, []).append(part)
                    else:
                        leaves[part.rows] = part.node
                    del part
        while sorted_parts:
            take()
        return self._in_order(leaves)

    def _next_parts(self, counted_parts: dict[int, list[_Part]]) -> tuple[int, list[_Part]]:
        """Take parts of one number of bins, and that number.

        As few bins as there are enough parts of, so that what waits stays small; where there are
        enough of none the most, since what comes of those joins the others.
        """

        def most(bins: int) -> int:
            size = len(self.spread) * self.labels * bins
            return max(1, min(_BINS_IN_ONE_GO // bins, _COUNTS_IN_ONE_GO // size))

        enough = [bins for bins, parts in counted_parts.items() if len(parts) >= most(bins)]
        bins = min(enough, default=max(counted_parts))
        parts = counted_parts[bins]
        taken = parts[-most(bins) :]
        del parts[-len(taken) :]
        if not parts:
            del counted_parts[bins]
        return bins, taken

    def _is_split(self, part: _Part) -> bool:
        n = len(part.rows)
        pure = n in part.of_labels.tolist()
        return n >= self.least and part.depth != self.max_depth and not pure

    def _split(self, parts: list[_Part], bins: int) -> tuple[list[_Part], list[_Part]]:
        """Choose queries and make two nodes of each part; and the parts that no border parts."""
        counts = self._counted(parts, bins)
        below, whole = [], []
        for part, of_part, query in zip(parts, counts, best_queries(counts), strict=True):
            if query is None:
                whole.append(part._replace(counts=None))
                continue
            two = self._parted(part, query, BINS // bins)
            # Of fewer, counting is as fast; and what waits should not take more than its states.
            if max(len(one.rows) for one in two) > max(_AT_ONCE, self.labels * BINS):
                smaller, larger = sorted(two, key=lambda one: len(one.rows))
                few = self._counted([smaller], bins)[0]
                if _bins_for(len(smaller.rows)) == BINS:
                    smaller = smaller._replace(counts=few)
                two = [smaller, larger._replace(counts=of_part - few)]
            below += two
        return below, whole

    def _parted(self, part: _Part, query: Query, together: int) -> list[_Part]:
        """Two nodes of one, of whose bins so many were taken together."""
        # The last of the bins that were taken together, and of those that were spread.
        border = (query.border + 1) * together - 1
        goes_left = part.keys[query.feature] & (BINS - 1) <= border
        self.feature[part.node] = query.feature
        self.border[part.node] = border >> int(self.spread[query.feature])
        two = []
        for side, inside, of_labels in (
            (self.left, goes_left, query.left),
            (self.right, ~goes_left, part.of_labels - query.left),
        ):
            side[part.node] = len(self.feature)
            self.feature.append(LEAF)
            self.border.append(0.0)
            self.left.append(LEAF)
            self.right.append(LEAF)
            (some,) = inside.nonzero()
            rows, keys = part.rows[some], part.keys.take(some, axis=1)
            two.append(_Part(side[part.node], part.depth + 1, of_labels, rows, keys))
        return two

    def _counted(self, parts: list[_Part], bins: int) -> NDArray[np.int64]:
        """The states of k nodes by feature, label and bin, (k, d, labels, bins)."""
        k, d = len(parts), len(self.spread)
        shape = (k, d, self.labels, bins)
        known = parts[0].counts
        if k == 1 and known is not None:
            same = known.shape[2] == bins
            return known[None] if same else np.asarray(known.reshape(*shape, -1).sum(axis=4))
        size = self.labels * bins
        keys = np.concatenate([part.keys for part in parts], axis=1) if k > 1 else parts[0].keys
        if bins < BINS:
            keys = keys >> (BINS // bins).bit_length() - 1
        if k == 1 and keys.shape[1] > _AT_ONCE:
            counts = np.stack([np.bincount(column, minlength=size) for column in keys])
        else:
            places = keys.astype(np.int64)
            places += (np.arange(d) * size)[:, None]
            places += np.repeat(d * size * np.arange(k), [len(part.rows) for part in parts])
            counts = np.bincount(places.reshape(-1), minlength=k * d * size)
        return np.asarray(counts.reshape(shape))

    def _sorted(self, part: _Part) -> tuple[TreeStructure, NDArray[np.int64]]:
        """What stands below a node of few states, and the leaf of each."""
        from sklearn.tree import DecisionTreeClassifier

        bins = (part.keys % BINS >> self.spread[:, None]).T.astype(np.float32)
        learner = DecisionTreeClassifier(
            max_depth=None if self.max_depth is None else self.max_depth - part.depth,
            min_samples_split=self.least,
            random_state=self.seed % 2**32,
        )
        below = fitted(learner, bins, part.keys[0] // BINS)
        below = replace(below, threshold=np.floor(below.threshold))
        return below, below.apply(bins)

    def _take(
        self,
        node: int,
        rows: NDArray[np.signedinteger],
        below: TreeStructure,
        reached: NDArray[np.int64],
        leaves: NDArray[np.signedinteger],
    ) -> None:
        """Put a part that was sorted where its node is."""
        n = len(below.feature)
        # Its root is that node; the others stand at the end.
        place = np.concatenate([[node], len(self.feature) + np.arange(n - 1)])
        leaves[rows] = place[reached]

        def children(own: NDArray[np.int64]) -> list[int]:
            return [LEAF if one == LEAF else int(place[one]) for one in own.tolist()]

        for column, values in (
            (self.feature, below.feature.tolist()),
            (self.left, children(below.children_left)),
            (self.right, children(below.children_right)),
        ):
            column[node] = values[0]
            column.extend(values[1:])
        self.border[node] = float(below.threshold[0])
        self.border.extend(below.threshold[1:].tolist())

    def _in_order(
        self, leaves: NDArray[np.signedinteger]
    ) -> tuple[TreeStructure, NDArray[np.int64]]:
        """Nodes with the numbers of one who goes down the left side first."""
        left, right = np.array(self.left), np.array(self.right)
        levels = tree_levels(left, right)
        size = np.ones(len(left), dtype=np.int64)
        place = np.zeros(len(left), dtype=np.int64)
        for level in reversed(levels):
            inner = level[left[level] != LEAF]
            size[inner] += size[left[inner]] + size[right[inner]]
        for level in levels:
            inner = level[left[level] != LEAF]
            place[left[inner]] = place[inner] + 1
            place[right[inner]] = place[inner] + 1 + size[left[inner]]
        order = np.argsort(place)

        def children(side: NDArray[np.int64]) -> NDArray[np.int64]:
            own = side[order]
            return np.where(own == LEAF, LEAF, place[own])

        structure = TreeStructure(
            np.array(self.feature, dtype=np.int64)[order],
            np.array(self.border, dtype=np.float64)[order],
            children(left),
            children(right),
        )
        return structure, place[leaves]


def _bins_for(n: int) -> int:
    """How many bins of a feature are told apart at a node of n states."""
    bins = BINS
    while bins > _FEWEST_BINS and bins * _STATES_A_BIN > n:
        bins //= 2
    return bins


def _ascending_order(values: NDArray[np.float32]) -> NDArray[np.int64]:
    """What sorts N values, of which equal ones may stand in any order, and none is NaN.

    As `argsort`, at half its time: a number that holds a value above its place is sorted as such.
    """
    bits = (values + np.float32(0)).view(np.int32)  # of two zeros one
    bits ^= (bits >> 31) & 0x7FFFFFFF  # as whole numbers, those below zero would run backwards
    both = np.left_shift(bits, 32, dtype=np.int64)
    both |= np.arange(len(values))
    both.sort()
    both &= 0xFFFFFFFF
    return both


def _bin_ends(ascending: NDArray[np.float32]) -> NDArray[np.int64]:
    """Behind which of the ascending values a bin ends: after about as many each, of equals all."""
    ends = np.flatnonzero(ascending[1:] != ascending[:-1]) + 1
    if len(ends) >= BINS:
        wanted = np.arange(1, BINS) * len(ascending) // BINS
        ends = np.unique(ends[np.minimum(np.searchsorted(ends, wanted), len(ends) - 1)])
    return ends
