"""A cluster of two processes, and steps in files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarl_core import Demonstrations, save_demonstrations
from sarl_core.clusters import cluster
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.distributed.mining import ClusterPlan, mine_on_cluster
from sarl_core.mining.distributed.pieces import Reading, parquet_paths

Mine = Callable[..., MinedData]


@pytest.fixture(scope="module")  # its idle processes would take their share of all other tests
def client() -> Iterator[Any]:
    with cluster("local:2") as client:
        yield client


@pytest.fixture(scope="session")
def fleet() -> Demonstrations:
    """Six thousand steps in sixty episodes; of one feature there are a few values only."""
    rng = np.random.default_rng(11)
    states = rng.normal(size=(6_000, 4)).astype(np.float32)
    states[:, 3] = rng.integers(0, 3, 6_000)
    labels = (states[:, 0] > 0.3).astype(int) + (states[:, 1] * states[:, 3] > 0.5)
    labels = np.where(rng.random(6_000) < 0.1, rng.integers(0, 3, 6_000), labels)
    return Demonstrations(
        states, labels, np.repeat(np.arange(60), 100), label_names=(("left", "right", "brake"),)
    )


def cut(demonstrations: Demonstrations, folder: Path, files: int) -> Path:
    """Steps in files, cut anywhere, with row groups of a thousand."""
    import pyarrow.parquet as pq

    folder.mkdir()
    whole = folder / "whole.parquet"
    save_demonstrations(demonstrations, whole)
    table = pq.read_table(whole)
    whole.unlink()
    for number in range(files):
        start = len(table) * number // files
        rows = len(table) * (number + 1) // files - start
        path = folder / f"part-{number}.parquet"
        pq.write_table(table.slice(start, rows), path, row_group_size=1_000)
    return folder


@pytest.fixture
def mine(client: Any) -> Mine:
    """Mines files on the cluster, by the options of a plan."""

    def mined(folder: Path, missing: Missing = "refuse", **plan: Any) -> MinedData:
        reading = Reading(missing=missing)
        return mine_on_cluster(client, parquet_paths([folder]), reading, ClusterPlan(**plan))

    return mined
