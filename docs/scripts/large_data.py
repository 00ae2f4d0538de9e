"""Measures what large data takes: ``python -m docs.scripts.large_data``.

It writes docs/results/large_data.json after every single measurement, and at its end the tables of
docs/results/large_data.md and the picture. ``--only`` measures one part, ``--quick`` up to 100,000
rows; what is not measured stays as it was. The other libraries are no dependencies of this project:
``--python PATH`` names an interpreter that has them (``pip install imodels six mlxtend
pysubgroup``); without it, those that are missing are said to be.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.large import FEATURES, LABELS, pairs, write_files
from docs.scripts.large_methods import METHODS, PREDICTING, SECONDS, SMALLEST, peak_memory
from docs.scripts.large_page import JSON, ROOT, draw, write_page
from sarl_core.clusters import cluster
from sarl_core.errors import WorkError
from sarl_core.files import whole_file
from sarl_core.mining.distributed.mining import ClusterPlan, mine_on_cluster
from sarl_core.mining.distributed.pieces import Reading, parquet_paths, pieces_of
from sarl_core.mining.tree import LEAF, PolicyTree

QUICK, IN_MEMORY, ON_A_CLUSTER = 100_000, 1_000_000, 10_000_000
"""Rows at most."""
SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
WORKERS = (1, 2)
MINUTES = 25
"""After which nothing more is begun."""
FRESH = 50_000
HERE = ("histogram", "exact", "tree")
"""Methods that this interpreter has."""
Outcome = dict[str, Any]


class Results:
    """What was measured, kept in a file from one measurement to the next."""

    def __init__(self, path: Path) -> None:
        self.path, self.ends = path, time.monotonic() + 60 * MINUTES
        self.parts: dict[str, Any] = {}
        if path.exists():
            self.parts = json.loads(path.read_text(encoding="utf-8"))
        self.circumstances = {
            "cores": os.cpu_count(),
            "machine_memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
            "python": platform.python_version(),
            "load_before": round(os.getloadavg()[0], 1),
        }

    def add(self, part: str, method: str, rows: int, outcome: Outcome) -> None:
        """Put one measurement in the place of an earlier one of the same."""
        outcome = outcome | self.circumstances
        self.parts.setdefault(part, {}).setdefault(method, {})[str(rows)] = outcome
        with whole_file(self.path) as unfinished:
            unfinished.write_text(json.dumps(self.parts, indent=1) + "\n", encoding="utf-8")
        seen = outcome.get("note") or f"{outcome['seconds']:.2f} s"
        print(f"{part}, {method}, {rows:,} rows: {seen}", flush=True)


@contextmanager
def arrays(rows: int) -> Iterator[Path]:
    """A folder with pairs, and fresh ones, as methods read them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for called, some in (("seen", pairs(rows, seed=0)), ("fresh", pairs(FRESH, seed=1))):
            np.save(folder / f"{called}_states.npy", some.observations)
            np.save(folder / f"{called}_labels.npy", some.actions)
        yield folder


def measured(python: str, method: str, folder: Path) -> Outcome:
    """What a method comes to in a process of its own."""
    done = subprocess.run(
        [python, "-m", "docs.scripts.large_methods", method, str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    outcome: Outcome = json.loads(done.stdout.splitlines()[-1]) if done.stdout else {}
    if "seconds" in outcome or "note" in outcome:
        return outcome
    if done.returncode == -signal.SIGALRM:
        return outcome | {"note": f"no answer in {SECONDS} s"}
    why = done.stderr.strip().splitlines()[-1:]
    return outcome | {"note": "failed", "why": (why or [f"signal {-done.returncode}"])[0]}


def measure_methods(
    results: Results, part: str, methods: dict[str, str], sizes: tuple[int, ...]
) -> None:
    """Measure methods, each with its interpreter; one that gives up is tried with no more rows."""
    given_up: dict[str, Outcome] = {}
    for rows in sizes:
        with arrays(rows) as folder:
            for method, python in methods.items():
                if time.monotonic() + SECONDS + PREDICTING > results.ends:
                    print(f"{part}, {method}, {rows:,} rows: no time left, it stays as it was")
                    continue
                outcome = given_up.get(method) or measured(python, method, folder)
                if "note" in outcome:
                    given_up[method] = outcome | {"note": "not tried, for that reason"}
                results.add(part, method, rows, outcome)


def measure_cluster(results: Results, sizes: tuple[int, ...]) -> None:
    """Mine files of each size with each number of workers."""
    for rows in sizes:
        with tempfile.TemporaryDirectory() as name:
            few, many = Path(name) / "few", Path(name) / "many"
            write_files(few, 4_000, files=2)
            write_files(many, rows, files=max(2, min(16, rows // 50_000)))
            for workers in WORKERS:
                try:
                    outcome = on_cluster(few, many, workers)
                except WorkError as error:  # as of a worker that had too little memory
                    outcome = {"note": "failed", "why": str(error)}
                results.add("scaling", f"cluster_{workers}", rows, outcome)


def on_cluster(few: Path, many: Path, workers: int) -> Outcome:
    """What mining some files takes, after a few rows for which workers load what they need."""
    paths, plan = parquet_paths([many]), ClusterPlan(min_support=SMALLEST)
    with cluster(f"local:{workers}:4GB") as client:
        mine_on_cluster(client, parquet_paths([few]), Reading(), plan)
        before = client.run_on_scheduler(work_of)
        sent = sum(client.run(sent_bytes).values())
        started = time.perf_counter()
        mined = mine_on_cluster(client, paths, Reading(), plan)
        seconds = time.perf_counter() - started
        work = client.run_on_scheduler(work_of)
        return {
            "seconds": round(seconds, 4),
            "memory": max(client.run(peak_memory).values()),
            "sent": sum(client.run(sent_bytes).values()) - sent,
            "file_bytes": sum(path.stat().st_size for path in paths),
            "pieces": len(pieces_of(paths)),
            "splits": splits(mined.trees[0]),
            "work": {
                name: {
                    key: round(value - before.get(name, {}).get(key, 0), 4)
                    for key, value in one.items()
                }
                for name, one in work.items()
            },
        }


def work_of(dask_scheduler: Any) -> dict[str, dict[str, float]]:
    """How often a cluster has called each function, and the seconds that they took."""
    return {
        name: {
            "calls": prefix.state_counts["memory"],
            "seconds": prefix.all_durations.get("compute", 0.0),
        }
        for name, prefix in dask_scheduler.task_prefixes.items()
    }


def sent_bytes(dask_worker: Any) -> int:
    """What a worker has sent to others."""
    return int(dask_worker.transfer_outgoing_bytes_total)


def splits(tree: PolicyTree) -> list[int]:
    """How many nodes are split on each level."""
    depths = Counter(tree.depth[tree.children_left != LEAF].tolist())
    return [depths[level] for level in range(max(depths, default=-1) + 1)]


def main() -> None:
    """Measure, and write."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.scripts.large_data",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", choices=("scaling", "peers"))
    parser.add_argument("--quick", action="store_true", help="up to 100,000 rows")
    parser.add_argument("--python", default=sys.executable, help="that has the other libraries")
    arguments = parser.parse_args()
    print(f"{FEATURES} features, {LABELS} labels, support of {SMALLEST} or more", flush=True)

    def sizes(most: int) -> tuple[int, ...]:
        return tuple(
            rows for rows in SIZES if rows <= min(most, QUICK if arguments.quick else most)
        )

    results = Results(JSON)
    if arguments.only != "peers":
        measure_methods(results, "scaling", dict.fromkeys(HERE, sys.executable), sizes(IN_MEMORY))
        measure_cluster(results, sizes(ON_A_CLUSTER))
    if arguments.only != "scaling":
        pythons = {
            one: sys.executable if one in HERE else arguments.python
            for one in METHODS
            if one != "exact"
        }
        measure_methods(results, "peers", pythons, sizes(IN_MEMORY))
    write_page(results.parts)
    draw(results.parts)


if __name__ == "__main__":
    main()
