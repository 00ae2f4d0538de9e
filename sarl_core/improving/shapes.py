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
from sarl_core.improving.alternation import (
    NewQuery,
    ScoredStates,
    exchanges_of,
    label_scores,
    rows_at,
    splits_of,
    without_query,
)
from sarl_core.improving.candidate import Candidate, structure_of
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.tree import LEAF, PolicyTree

_AT_ONCE = 2  # queries of a place before the other places have their turn
_OFFERED = 0.6  # of the features to each place, so that not the same ones are always first
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
        count: Of neighbours, at most: up to a quarter each with a query less, with another label
            and with a query exchanged, and the rest with a query less and another one elsewhere,
            or one more where there is room.
        generator: Which of them.

    Returns:
        Different from each other and from the trees.
    """
    structures = [structure_of(tree) for tree in trees]
    observed = len(met.pairs.observed)
    known = {Candidate.of(structures, met.pairs.derived, observed=observed).key}
    result = []

    def take(kind: Iterator[tuple[int, TreeStructure]], most: int) -> None:
        for index, changed in kind:
            if most <= 0:
                return
            both = [*structures[:index], changed, *structures[index + 1 :]]
            candidate = Candidate.of(both, met.pairs.derived, observed=observed)
            if candidate.asks and candidate.key not in known:
                known.add(candidate.key)
                result.append(candidate)
                most -= 1

    quarter = count // 4
    take(_with_a_query_less(structures, generator), quarter)
    take(_with_another_label(structures, trees, generator), quarter)
    take(_with_a_query_exchanged(structures, trees, met, generator), quarter)
    other = _with_another_query(structures, trees, met, max_rules, generator)
    take(other, count - len(result))
    return result


def with_a_rule_less(
    trees: Sequence[PolicyTree], pairs: Demonstrations, *, max_rules: int, count: int
) -> list[Candidate]:
    """Trees with a leaf less, where there are too many.

    Args:
        trees: One an action dimension, counted over `pairs`.
        pairs: States that they lead to.
        max_rules: Most leaves of each.
        count: Of the trees given back, at most: of those without a leaf that few states reach.

    Returns:
        Different from each other.
    """
    structures = [structure_of(tree) for tree in trees]
    places = []
    for index, tree in enumerate(trees):
        if (tree.feature == LEAF).sum() <= max_rules:
            continue
        for node, stays in _merges(structures[index]):
            left, right = tree.children_left[node], tree.children_right[node]
            gone = int(right if stays == left else left)
            if tree.feature[gone] == LEAF:
                places.append((int(tree.samples[gone]), index, node, stays))
    less: dict[tuple[object, ...], Candidate] = {}
    for _, index, node, stays in sorted(places):
        changed = without_query(structures[index], node, stays)
        both = [*structures[:index], changed, *structures[index + 1 :]]
        candidate = Candidate.of(both, pairs.derived, observed=len(pairs.observed))
        if candidate.asks and len(less) < count:
            less.setdefault(candidate.key, candidate)
    return list(less.values())


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
        yield index, without_query(structures[index], node, child)


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


def _with_a_query_exchanged(
    structures: Sequence[TreeStructure],
    trees: Sequence[PolicyTree],
    met: MetStates,
    generator: np.random.Generator,
) -> Iterator[tuple[int, TreeStructure]]:
    """Trees with another query in the place of one, below which all stays as it is."""
    ways = []
    for index, structure in enumerate(structures):
        dimension = trees[index].dimension
        queries = _new_queries(structure, dimension, index, met, generator, exchanged=True)
        ways.append([(index, query.put_into(structure)) for query in queries])
    yield from _abreast(ways)


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
        queries = _new_queries(structure, trees[index].dimension, index, met, generator)
        ways.append([(index, query.put_into(structure)) for query in queries])
    yield from _abreast(ways)


def _abreast(
    ways: Sequence[Sequence[tuple[int, TreeStructure]]],
) -> Iterator[tuple[int, TreeStructure]]:
    """The first of each way, then the second of each, and so on."""
    for abreast in zip_longest(*ways):
        yield from (one for one in abreast if one is not None)


def _new_queries(
    structure: TreeStructure,
    dimension: LabelledDimension,
    index: int,
    met: MetStates,
    generator: np.random.Generator,
    *,
    exchanged: bool = False,
) -> list[NewQuery]:
    """The best queries of different features, the very best of each place first.

    Args:
        structure: A tree.
        dimension: What it is about.
        index: Of the dimension.
        met: States that it leads to.
        generator: Which features are offered.
        exchanged: Those in the place of queries, rather than of leaves.
    """
    pairs = met.pairs
    scores = label_scores(pairs, dimension, index) if met.scores is None else met.scores
    states = ScoredStates(pairs.observations, scores)
    kinds = [feature.derived for feature in pairs.features]
    result: list[tuple[int, NewQuery]] = []
    for node, rows in rows_at(structure, pairs.observations):
        if (structure.feature[node] == LEAF) == exchanged:
            continue
        offered = np.flatnonzero(generator.random(len(kinds)) < _OFFERED)
        if exchanged:
            possible = exchanges_of(structure, node, rows, offered, states)
        else:
            possible = splits_of(node, rows, offered, states)
        of_kind: dict[object, NewQuery] = {}
        for query in sorted(possible, key=lambda query: -query.gain):
            derived = kinds[query.feature]
            # Of a pair of features only the best ratio.
            kind = derived.features if isinstance(derived, Combination) else query.feature
            of_kind.setdefault(kind, query)
        result += [(place // _AT_ONCE, query) for place, query in enumerate(of_kind.values())]
    return [query for _, query in sorted(result, key=lambda one: (one[0], -one[1].gain))]
