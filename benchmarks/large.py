"""Many pairs: made, mined on one machine, and compared with scikit-learn's exact CART.

``python -m benchmarks.large FOLDER --rows 10000000 --files 16`` writes a folder of Parquet files,
as a fleet's recorder would.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
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
    load_demonstrations,
    mine_rules,
    save_demonstrations,
)
from sarl_core.clusters import cluster
from sarl_core.limits import READ_LIMIT
from sarl_core.mining.distributed.mining import ClusterPlan, mine_on_cluster
from sarl_core.mining.distributed.pieces import Reading, parquet_paths

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
        right = tree.label[pruned(tree)[tree.apply(fresh.observations)]] == fresh.actions
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


def on_a_cluster(quick: bool) -> Iterable[Row]:
    """Parquet files on two Dask workers of 4 GB, against the same rows in memory."""
    rows, limit = (1_000_000 if quick else 10_000_000), 4e9
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder, rows, files=16)
        paths = parquet_paths([folder])
        plan = ClusterPlan(min_support=SMALLEST)
        with cluster("local:2:4GB") as client:
            started = time.perf_counter()
            mined = mine_on_cluster(client, paths, Reading(), plan)
            took = time.perf_counter() - started
            peak = max(client.run(_peak).values())
        os.environ.setdefault(READ_LIMIT, "8")
        whole = load_demonstrations(paths)
    started = time.perf_counter()
    (tree,) = grow_policy_trees(whole, learner="histogram", min_support=SMALLEST)
    in_memory = time.perf_counter() - started
    fresh = pairs(50_000, seed=1)
    right = [
        float((one.label[one.apply(fresh.observations)] == fresh.actions).mean())
        for one in (*mined.trees, tree)
    ]
    rules = [mine_rules([one], supp_min=SMALLEST, conf_min=0.9) for one in (*mined.trees, tree)]
    yield Row(
        f"mining {rows:,} x {FEATURES} from files on two workers of 4 GB",
        "a worker's 4 GB",
        "share",
        peak / limit,
        1.0,
        f"{peak / 1e9:.2f} GB at most; {duration(took)}, and {duration(in_memory)} for the trees "
        f"alone in memory; {len(rules[0]):,} rules against {len(rules[1]):,}, accuracy "
        f"{right[0]:.3f} against {right[1]:.3f}",
        holds=abs(right[0] - right[1]) <= WORST,
    )


def _peak() -> float:
    """The most memory that this process has had, in bytes: its own, not that of its parent."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return 1024.0 * int(status.split("VmHWM:")[1].split()[0])


def _grown(demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(demonstrations, learner="histogram", min_support=SMALLEST)


def _mined(demonstrations: Demonstrations) -> RuleSet:
    return mine_rules(_grown(demonstrations), supp_min=SMALLEST, conf_min=0.9)


def pruned(tree: PolicyTree) -> NDArray[np.int64]:
    """For each node the lowest one on its path that has the smallest support."""
    stands = np.arange(tree.n_nodes)
    for node in np.argsort(tree.depth, kind="stable"):
        if tree.support[node] < SMALLEST:
            stands[node] = stands[tree.parent[node]]
    return stands


def write_files(folder: Path, rows: int, *, files: int) -> None:
    """Write pairs into Parquet files, the episodes of which are numbered through.

    Args:
        folder: Made where it is not there.
        rows: Of all files.
        files: How many.
    """
    folder.mkdir(parents=True, exist_ok=True)
    first = 0
    for number in range(files):
        start = rows * number // files
        part = rows * (number + 1) // files - start
        path = folder / f"part-{number:03d}.parquet"
        save_demonstrations(pairs(part, seed=1_000 + number, first=first), path)
        first += -(-part // STEPS)


def main() -> None:
    """Write a folder of Parquet files."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--files", type=int, default=16)
    arguments = parser.parse_args()
    write_files(arguments.folder, arguments.rows, files=arguments.files)


if __name__ == "__main__":
    main()
