"""Many pairs: made, mined on one machine, and compared with scikit-learn's exact CART.

``python -m benchmarks.large FOLDER --rows 10000000 --files 16`` writes a folder of Parquet files,
as a fleet's recorder would.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sklearn.tree import DecisionTreeClassifier

from benchmarks.measure import Row, duration, side_by_side
from sarl_core import (
    Demonstrations,
    PolicyTree,
    RuleSet,
    grow_policy_trees,
    mine_rules,
    save_demonstrations,
)

FEATURES, LABELS, STEPS = 24, 4, 1_000
SMALLEST = 0.001
WORST = 0.005
"""Of accuracy: what a faster learner may lose."""


def pairs(rows: int, seed: int, first: int = 0) -> Demonstrations:
    """Pairs of an expert that weighs a few features against others, and is often undecided.

    Args:
        rows: How many, in episodes of `STEPS`.
        seed: Same seed, same pairs.
        first: Number of the first episode.

    Returns:
        States of 24 features and one of 4 labels each.
    """
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(rows, FEATURES)).astype(np.float32)
    leaning = np.stack(
        [
            1.5 * states[:, label]
            + np.sin(2 * states[:, label + 4])
            + states[:, label + 8] * states[:, label + 12]
            for label in range(LABELS)
        ],
        axis=1,
    )
    leaning += rng.normal(size=leaning.shape)
    return Demonstrations(
        states,
        leaning.argmax(axis=1),
        first + np.arange(rows) // STEPS,
        label_names=(("left", "right", "brake", "go on"),),
    )


def mining(quick: bool) -> Iterable[Row]:
    """Rules of 0.1 % of the pairs or more, against scikit-learn with leaves of that size."""
    fresh = pairs(50_000, seed=1)
    for rows, reach in ((200_000, 8.0), (1_000_000, 12.0))[: 1 if quick else 2]:
        demonstrations = pairs(rows, seed=0)
        exact = DecisionTreeClassifier(min_samples_leaf=int(SMALLEST * rows), random_state=0)
        rules = _mined(demonstrations)
        took, exact_took = side_by_side(
            partial(_mined, demonstrations),
            partial(exact.fit, demonstrations.observations, demonstrations.actions),
            repeats=1 if quick else 3,
        )
        (tree,) = _grown(demonstrations)
        right = tree.label[_pruned(tree)[tree.apply(fresh.observations)]] == fresh.actions
        other = exact.predict(fresh.observations) == fresh.actions
        lost = float(other.mean() - right.mean())
        yield Row(
            f"mining {rows:,} x {FEATURES}, smallest rule 0.1 %",
            "DecisionTreeClassifier with the same smallest leaf",
            "times faster",
            exact_took / took if lost <= WORST else 0.0,
            reach,
            f"{duration(took)} against {duration(exact_took)}; accuracy {right.mean():.3f} "
            f"against {other.mean():.3f}; {len(rules):,} rules",
        )


def _grown(demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(demonstrations, learner="histogram", min_support=SMALLEST)


def _mined(demonstrations: Demonstrations) -> RuleSet:
    return mine_rules(_grown(demonstrations), supp_min=SMALLEST, conf_min=0.9)


def _pruned(tree: PolicyTree) -> NDArray[np.int64]:
    """For each node the lowest one on its path that has the smallest support."""
    stands = np.arange(tree.n_nodes)
    for node in np.argsort(tree.depth, kind="stable"):
        if tree.support[node] < SMALLEST:
            stands[node] = stands[tree.parent[node]]
    return stands


def main() -> None:
    """Write a folder of Parquet files."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--files", type=int, default=16)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for number in range(arguments.files):
        start = arguments.rows * number // arguments.files
        part = arguments.rows * (number + 1) // arguments.files - start
        path = arguments.folder / f"part-{number:03d}.parquet"
        save_demonstrations(pairs(part, seed=1_000 + number, first=start // STEPS), path)
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
