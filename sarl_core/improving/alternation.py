"""Every query of a tree made the best one beside all others, in turns.

CART chooses a query by what it separates at once, and never comes back to it. Of a tree that may
have few queries, each is therefore chosen anew, from the leaves up, by what the rest of the tree
makes of it (tree alternating optimization, Carreira-Perpiñán and Tavallali 2018).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.mining.budgeted_trees import without_idle_queries
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.tree import LEAF

_TURNS = 10
_FEWEST = 20  # states of a leaf that a query may be looked for in
_LEAST = 5  # of them on either side
_ROUNDING = 1e-9  # of a gain, for each state


@dataclass(frozen=True)
class ScoredStates:
    """States, and what is wished there.

    Attributes:
        observations: Shape (N, d), float32.
        scores: How good each label is in each state, (N, labels).
    """

    observations: NDArray[np.float32]
    scores: NDArray[np.float64]

    def select(self, rows: NDArray[np.int64]) -> ScoredStates:
        """These states alone."""
        return ScoredStates(self.observations[rows], self.scores[rows])


@dataclass(frozen=True)
class NewQuery:
    """A query in the place of a leaf, or of another query.

    Attributes:
        gain: How much more of what is wished is met, summed over states.
        node: Where it stands.
        feature: Index.
        threshold: Border.
        labels: What a leaf says where the value is at most that, and beyond; of a query in the
            place of another, None: what is below stays.
    """

    gain: float
    node: int
    feature: int
    threshold: float
    labels: tuple[int, int] | None = None

    def put_into(self, structure: TreeStructure) -> TreeStructure:
        """The tree with this query."""
        if self.labels is None:
            feature, threshold = structure.feature.copy(), structure.threshold.copy()
            feature[self.node], threshold[self.node] = self.feature, self.threshold
            return replace(structure, feature=feature, threshold=threshold)
        n = len(structure.feature)
        label = np.asarray(structure.label)

        def grown(
            values: NDArray[np.generic], here: object, ends: tuple[object, ...]
        ) -> np.ndarray:
            after = np.concatenate([values, np.asarray(ends, dtype=values.dtype)])
            after[self.node] = here
            return after

        return TreeStructure(
            feature=grown(structure.feature, self.feature, (LEAF, LEAF)),
            threshold=grown(structure.threshold, self.threshold, (0.0, 0.0)),
            children_left=grown(structure.children_left, n, (LEAF, LEAF)),
            children_right=grown(structure.children_right, n + 1, (LEAF, LEAF)),
            label=grown(label, label[self.node], self.labels),
        )


def label_scores(
    pairs: Demonstrations, dimension: LabelledDimension, index: int
) -> NDArray[np.float64]:
    """How good each label is, by what was shown alone.

    Args:
        pairs: N of them.
        dimension: One of their action dimensions.
        index: Which.

    Returns:
        (N, labels): of intervals, less by the square of how far its centre is from what was shown.
    """
    actions = pairs.action_columns[:, index]
    if not dimension.is_interval:
        return np.eye(dimension.n_labels)[dimension.labels_of(actions)]
    centres = np.array([dimension.centre(label) for label in range(dimension.n_labels)])
    scores: NDArray[np.float64] = -((actions.astype(np.float64)[:, None] - centres) ** 2)
    return scores


def without_query(structure: TreeStructure, node: int, child: int) -> TreeStructure:
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


def alternated(structure: TreeStructure, states: ScoredStates, *, max_rules: int) -> TreeStructure:
    """Choose queries and labels anew, in turns, as long as that brings anything.

    Args:
        structure: With labels.
        states: N of them.
        max_rules: Most leaves.

    Returns:
        A tree whose labels are at least as good in these states, summed over them.
    """
    most = achieved(structure, states)
    for _ in range(_TURNS):
        changed = _without_unmet(_exchanged(structure, states), states)
        changed = _grown(_labelled(changed, states), states, max_rules)
        before, most = most, achieved(changed, states)
        if most <= before:
            break
        structure = changed
    return _without_unmet(structure, states)


def achieved(structure: TreeStructure, states: ScoredStates) -> float:
    """How good the labels are that a tree says, summed over states.

    Args:
        structure: With labels.
        states: N of them.
    """
    labels = _labels(structure, states.observations)
    return float(states.scores[np.arange(len(labels)), labels].sum())


def splits_of(
    leaf: int, rows: NDArray[np.int64], features: NDArray[np.int64], states: ScoredStates
) -> Iterator[NewQuery]:
    """For each feature the best query in the place of a leaf.

    Args:
        leaf: Its node.
        rows: States that reach it, (n,).
        features: That may be asked about.
        states: N of them.

    Yields:
        Queries that leave enough states on either side; none where too few reach the leaf.
    """
    if len(rows) < _FEWEST:
        return
    for feature in features.tolist():
        values = states.observations[rows, feature]
        order = np.argsort(values, kind="stable")
        ordered = _bounded(values[order])
        places = np.flatnonzero(ordered[:-1] < ordered[1:])
        places = places[(places >= _LEAST - 1) & (places < len(order) - _LEAST)]
        if not len(places):
            continue
        sums = np.cumsum(states.scores[rows[order]], axis=0)
        below, above = sums[places], sums[-1] - sums[places]
        labels = np.column_stack([below.argmax(axis=1), above.argmax(axis=1)])
        gains = below.max(axis=1) + above.max(axis=1) - sums[-1].max()
        gains[labels[:, 0] == labels[:, 1]] = -np.inf  # then nothing is asked
        best = int(gains.argmax())
        if np.isfinite(gains[best]):
            border = float(ordered[places[best] : places[best] + 2].mean())
            said = int(labels[best, 0]), int(labels[best, 1])
            yield NewQuery(float(gains[best]), leaf, feature, border, said)


def exchanges_of(
    structure: TreeStructure,
    node: int,
    rows: NDArray[np.int64],
    features: NDArray[np.int64],
    states: ScoredStates,
) -> Iterator[NewQuery]:
    """For each feature the best query in the place of another, below which all stays.

    Args:
        structure: With labels.
        node: Of the query that is there.
        rows: States that reach it, (n,).
        features: That may be asked about.
        states: N of them.

    Yields:
        Queries that send at least one state to either side.
    """
    values, of_labels = states.observations[rows], states.scores[rows]
    every = np.arange(len(rows))
    left, right = (
        of_labels[every, _labels(without_query(structure, 0, int(side[node])), values)]
        for side in (structure.children_left, structure.children_right)
    )
    better = left - right  # on the left
    now = float(better[values[:, structure.feature[node]] <= structure.threshold[node]].sum())
    if not better.any():
        return
    order = np.argsort(values[:, features], axis=0, kind="stable")
    ordered = _bounded(np.take_along_axis(values[:, features], order, axis=0))
    sums = np.cumsum(better[order], axis=0)[:-1]
    sums[ordered[:-1] >= ordered[1:]] = -np.inf  # no border lies between equals
    for place, best in enumerate(sums.argmax(axis=0).tolist() if len(sums) else []):
        gain = float(sums[best, place]) - now
        if np.isfinite(gain):
            border = float(ordered[best : best + 2, place].mean())
            yield NewQuery(gain, node, int(features[place]), border)


def rows_at(
    structure: TreeStructure, observations: NDArray[np.float32]
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """The states that reach each node, parents before their children.

    Args:
        structure: A tree.
        observations: Shape (N, d), float32.

    Yields:
        A node, and the rows that reach it, ascending.
    """
    level = [(0, np.arange(len(observations)))]
    while level:
        yield from level
        below = []
        for node, rows in level:
            feature = int(structure.feature[node])
            if feature != LEAF:
                left = observations[rows, feature] <= structure.threshold[node]
                below.append((int(structure.children_left[node]), rows[left]))
                below.append((int(structure.children_right[node]), rows[~left]))
        level = below


def _bounded(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """A formula may be infinite; thresholds lie below the limit."""
    return np.clip(values, -LARGEST, LARGEST).astype(np.float64)


def _labels(structure: TreeStructure, observations: NDArray[np.float32]) -> NDArray[np.int64]:
    """What a tree says, (B,)."""
    return np.asarray(structure.label)[structure.apply(observations)]


def _exchanged(structure: TreeStructure, states: ScoredStates) -> TreeStructure:
    """Every query the best one, given those below, from the leaves up."""
    features = np.arange(states.observations.shape[1])
    # What is exchanged below changes nothing about who reaches a node.
    for node, rows in reversed(list(rows_at(structure, states.observations))):
        if structure.feature[node] == LEAF:
            continue
        new = exchanges_of(structure, node, rows, features, states)
        best = max(new, key=lambda query: query.gain, default=None)
        if best is not None and best.gain > _ROUNDING * len(rows):
            structure = best.put_into(structure)
    return structure


def _without_unmet(structure: TreeStructure, states: ScoredStates) -> TreeStructure:
    """A child in the place of a query that sends every state to it."""
    nodes = len(structure.feature)
    sizes = np.zeros(nodes, dtype=np.int64)
    for node, rows in rows_at(structure, states.observations):
        sizes[node] = len(rows)
    for node in np.flatnonzero(structure.feature != LEAF).tolist()[::-1]:
        left, right = int(structure.children_left[node]), int(structure.children_right[node])
        if sizes[node] and not (sizes[left] and sizes[right]):
            structure = without_query(structure, node, left if sizes[left] else right)
    return without_idle_queries(structure)


def _labelled(structure: TreeStructure, states: ScoredStates) -> TreeStructure:
    """Every node saying what is best in the states that reach it."""
    labels = np.asarray(structure.label).copy()
    for node, rows in rows_at(structure, states.observations):
        if len(rows):
            labels[node] = states.scores[rows].sum(axis=0).argmax()
    return replace(structure, label=labels)


def _grown(structure: TreeStructure, states: ScoredStates, max_rules: int) -> TreeStructure:
    """The tree with the best further queries, as long as there is room."""
    features = np.arange(states.observations.shape[1])
    known: dict[int, NewQuery | None] = {}
    while (structure.feature == LEAF).sum() < max_rules:
        possible = []
        for node, rows in rows_at(structure, states.observations):
            if structure.feature[node] == LEAF:
                if node not in known:
                    new = splits_of(node, rows, features, states)
                    known[node] = max(new, key=lambda query: query.gain, default=None)
                possible.append(known[node])
        best = max((one for one in possible if one), key=lambda query: query.gain, default=None)
        if best is None or best.gain <= 0:
            break
        structure = best.put_into(structure)
    return structure
