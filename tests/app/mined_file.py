"""A mined file of Cart Pole, of which a sample is here, for tests of what the dashboard does."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, save_demonstrations
from sarl_core.clusters import cluster
from sarl_core.mining.distributed import mining
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.distributed.mined_files import load_mined_data, save_mined_data
from sarl_core.mining.distributed.mining import ClusterPlan, mine_on_cluster
from sarl_core.mining.distributed.pieces import Reading, parquet_paths
from tests.app.screens import errors, open_page

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
STEPS, EPISODES, HELD_OUT, SAMPLE, LEAST = 9_000, 18, 6, 2_000, 0.002
"""What the first file is mined from, what is held out beside it, and what is here of it."""


class MinedFiles(NamedTuple):
    """Files as they are uploaded, and what is in the first.

    Attributes:
        cartpole: Content of one, with episodes held out.
        finer: Of the same steps, down to less support.
        pendulum: Of continuous actions at divider 4, with nothing held out; all steps are here.
        data: What the first holds.
    """

    cartpole: bytes
    finer: bytes
    pendulum: bytes
    data: MinedData


def mined_files(folder: Path) -> MinedFiles:
    """Mine them, on a cluster of one process."""
    cartpole = load_demonstrations(DATA / "cartpole.parquet")
    save_demonstrations(cartpole.select(range(EPISODES + HELD_OUT)), folder / "cartpole.parquet")
    pendulum = load_demonstrations(DATA / "pendulum.parquet")
    save_demonstrations(pendulum.select(range(10)), folder / "pendulum.parquet")
    plans = {
        "cartpole": ("cartpole", ClusterPlan(hold_out=0.25, min_support=LEAST)),
        "finer": ("cartpole", ClusterPlan(hold_out=0.25, min_support=LEAST / 2)),
        "pendulum": ("pendulum", ClusterPlan(divider=4)),
    }
    with pytest.MonkeyPatch.context() as patch, cluster("local:1") as client:
        patch.setattr(mining, "HELD_ROWS", SAMPLE)
        for name, (file, plan) in plans.items():
            paths = parquet_paths([folder / f"{file}.parquet"])
            mined = mine_on_cluster(client, paths, Reading(), plan)
            save_mined_data(mined, folder / f"{name}.mined")
    contents = [(folder / f"{name}.mined").read_bytes() for name in plans]
    return MinedFiles(*contents, load_mined_data(folder / "cartpole.mined"))


def upload_mined(app: AppTest, content: bytes, name: str = "fleet.mined") -> str:
    """Upload one; what the address calls it then."""
    app.file_uploader(key="upload_files").set_value([(name, content, "application/zip")]).run()
    assert not app.exception
    assert not errors(app)
    return str(app.query_params["data"])


def opened_mined(content: bytes) -> str:
    """Upload one in a visit that ends; what the address calls it."""
    return upload_mined(open_page("demonstrations"), content)
