"""A cluster of two processes, rules about words and numbers, and logs of them in files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sarl_core import RuleSet, mine_rules
from sarl_core.clusters import cluster
from sarl_core.demonstrations.formats import read_demonstrations


@pytest.fixture(scope="module")  # its idle processes would take their share of all other tests
def client() -> Iterator[Any]:
    with cluster("local:2") as client:
        yield client


@pytest.fixture(scope="session")
def fleet() -> pd.DataFrame:
    """Four thousand steps in forty episodes of 20 to 400 steps; some lack a value or a time."""
    rng = np.random.default_rng(5)
    lengths = rng.integers(20, 181, 39)
    lengths = np.append(lengths, 4_000 - lengths.sum())
    table = pd.DataFrame(
        {
            "episode": np.repeat(np.arange(40), lengths),
            "step": np.concatenate([np.arange(length) for length in lengths]),
            "time": np.round(np.cumsum(rng.exponential(0.5, 4_000)), 3),
            "obs_speed [m/s]": rng.normal(size=4_000).astype(np.float32),
            "obs_gap [m]": rng.normal(size=4_000).astype(np.float32),
            "obs_road": np.array(["dry", "wet", "icy"])[rng.choice(3, 4_000, p=[0.9, 0.08, 0.02])],
        }
    )
    fast, near = table["obs_speed [m/s]"] > 0.2, table["obs_gap [m]"] < -0.3
    action = np.where(near, "brake", np.where(fast & (table["obs_road"] == "dry"), "go", "roll"))
    odd = rng.random(4_000) < 0.1
    table["action"] = np.where(odd, rng.choice(["brake", "go", "roll"], 4_000), action)
    table.loc[rng.random(4_000) < 0.02, "obs_gap [m]"] = np.nan
    table.loc[rng.random(4_000) < 0.01, "time"] = np.nan
    return table


@pytest.fixture(scope="session")
def fleet_rules(fleet: pd.DataFrame) -> RuleSet:
    content = fleet.to_csv(index=False).encode()
    read = read_demonstrations(content, "fleet.csv", missing="drop")
    # Of some episodes, so that others go where their data do not reach.
    return mine_rules(read.select(range(12)), supp_min=0.02, conf_min=0.9, max_depth=5)


def in_files(table: pd.DataFrame, folder: Path, cuts: Sequence[int], group: int = 300) -> Path:
    """A table in several files that begin at some rows."""
    folder.mkdir()
    whole = pa.Table.from_pandas(table, preserve_index=False)
    edges = [0, *cuts, len(table)]
    for number, (first, end) in enumerate(pairwise(edges)):
        path = folder / f"log-{number}.parquet"
        pq.write_table(whole.slice(first, end - first), path, row_group_size=group)
    return folder
