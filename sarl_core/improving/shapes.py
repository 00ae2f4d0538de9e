"""Trees that differ from others in one query or one label.

Which queries imitate best is not which act best. So a tree's neighbours in shape are tried too:
a query less, another label, another query in the place of one. New queries are those after which
the expert's wishes are met best in the states that the present rules lead to.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, zip_longest

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Combination
from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.improving.candidate import Candidate, structure_of
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.tree import LEAF, PolicyTree, TreeStructure

_FEWEST = 20  # states of a leaf that a query may be looked for in
_LEAST = 5  # of them on either side
_THRESHOLDS = 60  # of each feature that are looked at
_AT_ONCE = 2  # queries of a leaf before the other leaves have their turn
_OFFERED = 0.6  # of the features to each leaf, so that not the same ones are always first
_MERGED = 6  # trees with a query less in which new ones are looked for
_FURTHER = 2  # neighbouring intervals that a leaf may say instead


@dataclass(frozen=True)
class MetStates:
    """States that rules led to, and what the expert wishes there.

    Attributes:
        pairs: N states with the expert's answers, and with all that may be asked about.
        scores: Of the only, discrete dimension, how good the expert holds each label to be,
            (N, labels); None where that is not known.
    """

    pairs: Demonstrations
    scores: NDArray[np.float64] | None


@dataclass(frozen=True)
class _NewQuery:
    """A query in the place of a leaf.

    Attributes:
        gain: How much more of the expert's wishes is met.
        leaf: Its node.
        feature: Index.
        threshold: Border.
        below: Label where the value is at most that.
        above: Label beyond.
    """

    gain: float
    leaf: int
    feature: int
    threshold: float
    below: int
    above: int


def neighbours(
    trees: Sequence[PolicyTree],
    met: MetStates,
    *,
    max_rules: int,
    count: int,
    generator: np.random.Generator,
) -> list[Candidate]:
    """Trees that differ in one query or label.

    Args:
        trees: One an action dimension, counted over `met.pairs`.
        met: States that they lead to.
        max_rules: Most leaves of each.
        count: Of neighbours, at most: up to a third with a query less, up to a third with another
            label, and the rest with another query, or one more where there is room.
        generator: Which of them.

    Returns:
        Different from each other and from the trees.
    """
    structures = [structure_of(tree) for tree in trees]
    observed = len(met.pairs.observed)
    known = {_key(structures)}
    result = []

    def take(kind: Iterator[tuple[int, TreeStructure]], most: int) -> None:
        for index, changed in kind:
            if most <= 0:
                return
            both = [*structures[:index], changed, *structures[index + 1 :]]
            candidate = Candidate.of(both, met.pairs.derived, observed=observed)
            asks = any(len(one.feature) > 1 for one in candidate.structures)
            if asks and (key := _key(candidate.structures)) not in known:
                known.add(key)
                result.append(candidate)
                most -= 1

    third = count // 3
    take(_with_a_query_less(structures, generator), third)
    take(_with_another_label(structures, trees, generator), third)
    other = _with_another_query(structures, trees, met, max_rules, generator)
    take(other, count - len(result))
    return result


def _key(structures: Sequence[TreeStructure]) -> tuple[bytes, ...]:
    return tuple(
        np.asarray(values).tobytes()
        for one in structures
        # What is said at queries is never heard.
        for values in (
            one.feature,
            one.threshold,
            np.where(one.feature == LEAF, np.asarray(one.label), LEAF),
        )
    )


def _shuffled(
    places: list[tuple[int, int, int]], generator: np.random.Generator
) -> list[tuple[int, int, int]]:
    return [places[place] for place in generator.permutation(len(places)).tolist()]


def _merges(structure: TreeStructure) -> list[tuple[int, int]]:
    """Every query, and either child that may take its place."""
    return [
        (node, int(child))
        for node in np.flatnonzero(structure.feature != LEAF).tolist()
        for child in (structure.children_left[node], structure.children_right[node])
    ]


def _with_a_query_less(
    structures: Sequence[TreeStructure], generator: np.random.Generator
) -> Iterator[tuple[int, TreeStructure]]:
    places = [
        (index, *merge)
        for index, structure in enumerate(structures)
        for merge in _merges(structure)
    ]
    for index, node, child in _shuffled(places, generator):
        yield index, _merged(structures[index], node, child)


def _with_another_label(
    structures: Sequence[TreeStructure],
    trees: Sequence[PolicyTree],
    generator: np.random.Generator,
) -> Iterator[tuple[int, TreeStructure]]:
    places = [
        (index, leaf, label)
        for index, tree in enumerate(trees)
        for leaf in np.flatnonzero(tree.feature == LEAF).tolist()
        for label in range(tree.dimension.n_labels)
        if label != tree.label[leaf]
        and (not tree.dimension.is_interval or abs(label - tree.label[leaf]) <= _FURTHER)
    ]
    for index, leaf, label in _shuffled(places, generator):
        labels = np.asarray(structures[index].label).copy()
        labels[leaf] = label
        yield index, replace(structures[index], label=labels)


def _with_another_query(
    structures: Sequence[TreeStructure],
    trees: Sequence[PolicyTree],
    met: MetStates,
    max_rules: int,
    generator: np.random.Generator,
) -> Iterator[tuple[int, TreeStructure]]:
    """Trees with a query less, or with room for one more, and the most helpful new ones there."""
    less = list(islice(_with_a_query_less(structures, generator), _MERGED))
    room = [
        (index, structure)
        for index, structure in enumerate(structures)
        if (structure.feature == LEAF).sum() < max_rules
    ]
    ways = []
    for index, structure in room + less:
        queries = _queries(structure, trees[index].dimension, index, met, generator)
        ways.append([(index, _split(structure, query)) for query in queries])
    for abreast in zip_longest(*ways):
        yield from (one for one in abreast if one is not None)


def _merged(structure: TreeStructure, node: int, child: int) -> TreeStructure:
    """The tree with a child in the place of its parent."""
    places = np.arange(len(structure.feature))
    places[node] = child  # what stands there now
    return TreeStructure(
        feature=structure.feature[places],
        threshold=structure.threshold[places],
        children_left=structure.children_left[places],
        children_right=structure.children_right[places],
        label=np.asarray(structure.label)[places],
    )


def _split(structure: TreeStructure, query: _NewQuery) -> TreeStructure:
    """The tree with a query in the place of a leaf."""
    n = len(structure.feature)

    def grown(values: NDArray[np.generic], here: object, ends: Sequence[object]) -> np.ndarray:
        after = np.concatenate([values, np.asarray(ends, dtype=values.dtype)])
        after[query.leaf] = here
        return after

    label = np.asarray(structure.label)
    return TreeStructure(
        feature=grown(structure.feature, query.feature, (LEAF, LEAF)),
        threshold=grown(structure.threshold, query.threshold, (0.0, 0.0)),
        children_left=grown(structure.children_left, n, (LEAF, LEAF)),
        children_right=grown(structure.children_right, n + 1, (LEAF, LEAF)),
        label=grown(label, label[query.leaf], (query.below, query.above)),
    )


def _queries(
    structure: TreeStructure,
    dimension: LabelledDimension,
    index: int,
    met: MetStates,
    generator: np.random.Generator,
) -> list[_NewQuery]:
    """The best queries of different features, the very best of each leaf first."""
    pairs = met.pairs
    wishes = _wishes(met, dimension, index)
    kinds = [feature.derived for feature in pairs.features]
    reached = structure.apply(pairs.observations)
    result: list[tuple[int, _NewQuery]] = []
    for leaf in np.unique(reached).tolist():
        rows = np.flatnonzero(reached == leaf)
        if len(rows) < _FEWEST:
            continue
        values, wanted = pairs.observations[rows], wishes[rows]
        offered = np.flatnonzero(generator.random(len(kinds)) < _OFFERED).tolist()
        possible = [
            query
            for feature in offered
            if (query := _query(leaf, feature, values[:, feature], wanted, dimension))
        ]
        of_kind: dict[object, _NewQuery] = {}
        for query in sorted(possible, key=lambda query: -query.gain):
            derived = kinds[query.feature]
            # Of a pair of features only the best ratio.
            kind = derived.features if isinstance(derived, Combination) else query.feature
            of_kind.setdefault(kind, query)
        result += [(place // _AT_ONCE, query) for place, query in enumerate(of_kind.values())]
    return [query for _, query in sorted(result, key=lambda one: (one[0], -one[1].gain))]


def _wishes(met: MetStates, dimension: LabelledDimension, index: int) -> NDArray[np.float64]:
    """What the expert wants: how good each label is, (N, labels), or an amount, (N, 1)."""
    if met.scores is not None:
        return met.scores
    actions = met.pairs.action_columns[:, index]
    if dimension.is_interval:
        return actions.astype(np.float64)[:, None]
    return np.eye(dimension.n_labels)[dimension.labels_of(actions)]


def _query(
    leaf: int,
    feature: int,
    values: NDArray[np.float32],
    wishes: NDArray[np.float64],
    dimension: LabelledDimension,
) -> _NewQuery | None:
    """The border of one feature at which most wishes are met, if there is any."""
    order = np.argsort(values, kind="stable")
    # A formula may be infinite; thresholds lie below the limit.
    ordered = np.clip(values[order], -LARGEST, LARGEST).astype(np.float64)
    last = len(order) - _LEAST
    places = np.unique(np.linspace(_LEAST - 1, last - 1, min(_THRESHOLDS, last)).astype(np.int64))
    places = places[ordered[places] < ordered[places + 1]]
    if not len(places):
        return None
    sums = np.cumsum(wishes[order], axis=0)
    below, above = sums[places], sums[-1] - sums[places]
    count = places + 1.0
    if dimension.is_interval:  # how much closer its means are
        gains = (below**2)[:, 0] / count + (above**2)[:, 0] / (len(order) - count)
        gains = gains - sums[-1, 0] ** 2 / len(order)
    else:
        gains = below.max(axis=1) + above.max(axis=1) - sums[-1].max()
    best = int(gains.argmax())
    place = int(places[best])
    border = (ordered[place] + ordered[place + 1]) / 2
    if dimension.is_interval:
        means = below[best] / count[best], above[best] / (len(order) - count[best])
        labels = dimension.labels_of(np.concatenate(means))
    else:
        labels = np.array([below[best].argmax(), above[best].argmax()])
    return _NewQuery(float(gains[best]), leaf, feature, border, int(labels[0]), int(labels[1]))
