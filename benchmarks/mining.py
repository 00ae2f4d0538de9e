"""The threshold landscape against growing or walking a tree for every cell."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from benchmarks import data
from benchmarks.measure import Row, duration, seconds, side_by_side
from sarl_core import Landscape, grow_policy_trees, load_demonstrations, threshold_landscape
from sarl_core.demonstrations.derived import Extension
from sarl_core.mining.combining.candidates import candidates, pairs_of_like_kind
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS

CELLS = [(float(s), float(c)) for s in PAPER_SUPPORTS for c in PAPER_CONFIDENCES]


class PlainTree:
    """A fitted tree as plain lists, which Python walks faster than arrays."""

    def __init__(self, learner: DecisionTreeClassifier) -> None:
        tree = learner.tree_
        self.left: list[int] = tree.children_left.tolist()
        self.right: list[int] = tree.children_right.tolist()
        self.support: list[float] = (tree.n_node_samples / tree.n_node_samples[0]).tolist()
        # Shares of the labels, which make whole numbers of pairs again.
        counts = np.rint(tree.value[:, 0, :] * tree.n_node_samples[:, None])
        self.confidence: list[float] = (counts.max(axis=1) / tree.n_node_samples).tolist()
        self.samples: list[int] = tree.n_node_samples.tolist()
        self.correct: list[int] = counts.max(axis=1).astype(int).tolist()


Sums = tuple[int, int, int, int]


def walk(tree: PlainTree, supp_min: float, conf_min: float) -> Sums:
    """Algorithm 1, directly: down from the root, cutting at the first node that qualifies.

    Args:
        tree: To walk.
        supp_min: Minimum support.
        conf_min: Minimum confidence.

    Returns:
        Number of rules; and summed over them: queries, pairs covered, pairs correct.
    """
    left, right, support, confidence = tree.left, tree.right, tree.support, tree.confidence
    samples, correct = tree.samples, tree.correct
    rules = length = covered = right_ones = 0
    waiting = [(0, 0)]
    while waiting:
        node, depth = waiting.pop()
        if support[node] >= supp_min and confidence[node] >= conf_min:
            rules += 1
            length += depth
            covered += samples[node]
            right_ones += correct[node]
        elif left[node] >= 0:
            waiting.append((left[node], depth + 1))
            waiting.append((right[node], depth + 1))
    return rules, length, covered, right_ones


def fit() -> DecisionTreeClassifier:
    """A tree as ours is grown."""
    demonstrations = data.demonstrations()
    learner = DecisionTreeClassifier(criterion="gini", random_state=0)
    return learner.fit(demonstrations.observations, demonstrations.actions)


def tree_included(quick: bool) -> Iterable[Row]:
    """The whole landscape, tree included, against a fit and a walk for each cell."""

    def ours() -> Landscape:
        return threshold_landscape(
            grow_policy_trees(data.demonstrations()), PAPER_SUPPORTS, PAPER_CONFIDENCES
        )

    cells = CELLS[::11] if quick else CELLS
    landscape = ours()
    mine, theirs, found = [], [], []
    for number, (support, confidence) in enumerate(cells):
        if number % max(1, len(cells) // 11) == 0:
            mine.append(seconds(ours))
        theirs.append(
            seconds(lambda s=support, c=confidence: found.append(walk(PlainTree(fit()), s, c)))
        )
    _check_equal(landscape, cells, found)
    ours_took, theirs_took = statistics.median(mine), statistics.median(theirs) * len(CELLS)
    yield Row(
        "landscape of 231 cells, tree included",
        "a fit and a walk for each cell",
        "times faster",
        theirs_took / ours_took,
        200,
        f"{duration(ours_took)} against {duration(theirs_took)}",
    )


def tree_given(quick: bool) -> Iterable[Row]:
    """The landscape of a tree that is there, against walking it for each cell."""
    trees, plain = data.trees(), PlainTree(fit())
    found: list[Sums] = []

    def theirs() -> None:
        found[:] = [walk(plain, support, confidence) for support, confidence in CELLS]

    ours_took, theirs_took = side_by_side(
        lambda: threshold_landscape(trees, PAPER_SUPPORTS, PAPER_CONFIDENCES),
        theirs,
        repeats=3 if quick else 15,
        ours_calls=20,
    )
    _check_equal(threshold_landscape(trees, PAPER_SUPPORTS, PAPER_CONFIDENCES), CELLS, found)
    yield Row(
        f"landscape of 231 cells, tree of {trees[0].n_nodes:,} nodes given",
        "walking the tree for each cell",
        "times faster",
        theirs_took / ours_took,
        100,
        f"{duration(ours_took)} against {duration(theirs_took)}",
    )


def plane(quick: bool) -> Iterable[Row]:
    """A million cells of a large tree."""
    trees, axis = data.large_tree(), np.linspace(0.0, 1.0, 1000)
    times = [
        seconds(lambda: threshold_landscape(trees, axis, axis)) for _ in range(4 if quick else 16)
    ][1:]
    yield Row(
        f"landscape of 1000 x 1000 cells, {trees[0].n_nodes:,} nodes",
        "-",
        "seconds",
        statistics.median(times),
        0.1,
        f"slowest of {len(times)}: {duration(max(times))}",
    )


def combinations(quick: bool) -> Iterable[Row]:
    """Choosing combinations of many features, against trees that sort every candidate."""
    walker = load_demonstrations(data.DATA / "demonstrations" / "bipedal_walker.parquet")
    divider = 2 if quick else 15
    possible = candidates(walker, pairs_of_like_kind(walker))
    some = walker.observations[:: len(walker) // 5_000]
    states = Extension(some.shape[1], possible).many(some)
    labels = [
        dimension.labels_of(walker.action_columns[:: len(walker) // 5_000, index])
        for index, dimension in enumerate(label_dimensions(walker, divider))
    ]

    def theirs() -> None:
        for each in labels:
            DecisionTreeClassifier(max_leaf_nodes=64, random_state=0).fit(states, each)

    ours_took = statistics.median(
        seconds(lambda: with_combinations(walker, divider=divider)) for _ in range(3)
    )
    theirs_took = seconds(theirs)
    yield Row(
        f"choosing among {len(possible):,} combinations, {len(labels)} action dimensions",
        "scikit-learn's trees of as many leaves over them, on as many steps",
        "times faster",
        theirs_took / ours_took,
        5,
        f"{duration(ours_took)} against {duration(theirs_took)}",
    )


def _check_equal(
    landscape: Landscape, cells: Sequence[tuple[float, float]], found: Sequence[Sums]
) -> None:
    """Both must have done the same work."""
    steps = len(data.demonstrations())
    for (support, confidence), (rules, length, covered, right) in zip(cells, found, strict=True):
        place = (
            int(np.searchsorted(PAPER_SUPPORTS, support)),
            int(np.searchsorted(PAPER_CONFIDENCES, confidence)),
        )
        ours = [
            float(layer[place])
            for layer in (
                landscape.rule_count,
                landscape.mean_length,
                landscape.coverage,
                landscape.fidelity,
            )
        ]
        walked = [
            rules,
            length / max(rules, 1),
            covered / steps,
            right / covered if covered else np.nan,
        ]
        if not np.allclose(ours, walked, rtol=1e-12, atol=0, equal_nan=True):
            raise AssertionError(f"at {support}, {confidence}: {ours}, and by walking {walked}")
