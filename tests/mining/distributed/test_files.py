"""Folders of files as they come: what they have in common, and what is refused."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread
from typing import Any

import dask
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from sarl_core import InputError, WorkError, load_demonstrations
from sarl_core.clusters import cluster, saying_losses
from sarl_core.mining.distributed import pieces
from sarl_core.mining.distributed.mining import mine_files
from sarl_core.mining.distributed.pieces import Reading, parquet_paths, read_piece
from tests.mining.distributed.conftest import Mine


def steps(rows: int = 400, first: int = 0, seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng([seed, first])
    table = pd.DataFrame(
        {
            "episode": first + np.arange(rows) // 50,
            "obs_speed": rng.normal(size=rows),
            "obs_gap": rng.normal(size=rows),
        }
    )
    return table.assign(action=(table.obs_speed > 0).astype(int) + (table.obs_gap > 1))


def folder_of(path: Path, *tables: pd.DataFrame) -> Path:
    path.mkdir(exist_ok=True)
    for number, table in enumerate(tables):
        table.to_parquet(path / f"log-{number}.parquet")
    return path


def test_labels_that_one_file_has_and_another_has_not(tmp_path: Path, mine: Mine) -> None:
    few = steps().assign(action=lambda table: table.action.clip(upper=1))
    mined = mine(folder_of(tmp_path / "logs", few, steps(first=10)))
    assert mined.trees[0].dimension.actions == (0, 1, 2)
    assert mined.trees[0].counts[0].sum() == 800


def test_words_for_actions_and_features_differ_between_files(tmp_path: Path, mine: Mine) -> None:
    words = np.array(["go", "brake", "stop"])
    first = steps().assign(action=lambda table: words[table.action.clip(upper=1)], obs_mode="light")
    second = steps(first=10).assign(
        action=lambda table: words[table.action],
        obs_mode=lambda table: np.where(table.obs_gap > 0, "heavy", "light"),
    )
    mined = mine(folder_of(tmp_path / "logs", first, second))
    (tree,) = mined.trees
    assert tree.dimension.label_names == ("brake", "go", "stop")
    both = pd.concat([first, second])
    assert tree.counts[0].tolist() == [int((both.action == word).sum()) for word in sorted(words)]
    names = [one.name for one in mined.sample.features]
    assert names == ["speed", "gap", "mode is heavy"]
    heavy = mined.histograms[2].counts
    assert heavy.tolist() == [int((both.obs_mode != mode).sum()) for mode in ("heavy", "light")]


def test_numbers_of_episodes_that_begin_again_are_other_episodes(
    tmp_path: Path, mine: Mine
) -> None:
    again = mine(folder_of(tmp_path / "again", steps(), steps(seed=1)))
    goes_on = mine(folder_of(tmp_path / "on", steps(), steps(first=8)))
    assert again.trees[0].source.episodes == goes_on.trees[0].source.episodes == 16
    texts = [f"trip {number}" for number in steps().episode]
    named = mine(folder_of(tmp_path / "named", steps().assign(episode=texts)), hold_out=0.5)
    assert named.trees[0].source.episodes == 4
    assert named.held_out[0].lengths.tolist() == [50] * 4


def test_named_episodes_go_on_in_the_next_file(tmp_path: Path, mine: Mine) -> None:
    table = steps().assign(episode=lambda one: "run-" + one.episode.astype(str))
    whole = mine(folder_of(tmp_path / "whole", table), hold_out=0.5)
    cut = mine(folder_of(tmp_path / "cut", table[:225], table[225:]), hold_out=0.5)
    assert cut.trees[0].source.episodes == 4
    assert cut.trees[0].digest == whole.trees[0].digest


def test_a_row_that_a_piece_would_have_alone_goes_with_those_before(
    tmp_path: Path, mine: Mine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pieces, "ROWS", 100)
    (tmp_path / "logs").mkdir()
    steps(301).to_parquet(tmp_path / "logs" / "log.parquet", row_group_size=100)
    cut = pieces.pieces_of(parquet_paths([tmp_path / "logs"]))
    assert [piece.rows for piece in cut] == [100, 100, 101]
    assert mine(tmp_path / "logs").trees[0].samples[0] == 301


def test_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "logs", steps())
    for options, sentence in (
        ({"seed": -1}, "seed"),
        ({"max_depth": -1}, "maximum depth"),
        ({"min_support": 1.5}, "support is 1.5; give 0 to 1"),
        ({"hold_out": 1.0}, "held-out share is 1.0"),
    ):
        with pytest.raises(InputError, match=sentence):
            mine_files(folder, "local:1", **options)
    mined = mine_files(folder, "local:1", seed=10**16, hold_out=0.3, min_support=1.0)
    assert mined.trees[0].n_nodes <= 3


def test_bounds_of_continuous_actions_are_those_of_all_files(tmp_path: Path, mine: Mine) -> None:
    tables = [
        steps(first=first).assign(action=lambda table, by=by: table.obs_speed * by)
        for first, by in ((0, 1.0), (10, 3.0))
    ]
    mined = mine(folder_of(tmp_path / "logs", *tables), divider=4, min_support=0.05)
    edges = mined.trees[0].dimension.edges
    values = pd.concat(tables).action.astype(np.float32)
    assert (edges[0], edges[-1]) == (float(values.min()), float(values.max()))


FAULTS = {
    "other columns": (
        lambda table: table.rename(columns={"obs_gap": "obs_distance"}),
        "log-1.parquet: it has no column 'obs_gap', and log-0.parquet has; give",
    ),
    "a further column": (
        lambda table: table.assign(obs_rain=1.0),
        "log-1.parquet: it has a column 'obs_rain', and log-0.parquet has none; give",
    ),
    "other types": (
        lambda table: table.assign(obs_gap="far"),
        "log-1.parquet: its column 'obs_gap' holds words, and that of log-0.parquet numbers; write",
    ),
    "a missing value": (
        lambda table: table.assign(obs_gap=table.obs_gap.where(table.index != 7)),
        "log-1.parquet: column 'obs_gap' is empty or not a number .* row 8; mend it",
    ),
    "continuous actions beside labels": (
        lambda table: table.assign(action=table.obs_speed),
        "look like labels in some of these files .* log-0.parquet and log-1.parquet; say",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_file_unlike_the_others_is_named(fault: str, tmp_path: Path, mine: Mine) -> None:
    change, sentence = FAULTS[fault]
    folder = folder_of(tmp_path / "logs", steps(), change(steps(first=10)))
    with pytest.raises(InputError, match=sentence):
        mine(folder)


def test_folders_without_steps(tmp_path: Path, mine: Mine) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no Parquet file; give one that does"):
        mine(tmp_path / "empty")
    with pytest.raises(InputError, match="there are no steps in these files, only columns"):
        mine(folder_of(tmp_path / "bare", steps(0)))
    with pytest.raises(InputError, match="no column says to which episode a row belongs"):
        mine(folder_of(tmp_path / "loose", steps().drop(columns="episode")))
    with pytest.raises(InputError, match="no file has a name of this pattern"):
        parquet_paths([tmp_path / "*.parquet"])
    (tmp_path / "log.csv").write_text("obs_a,action\n1,0\n")
    with pytest.raises(InputError, match="a cluster reads Parquet files; write it as one"):
        parquet_paths([tmp_path / "log.csv"])
    mixed = folder_of(tmp_path / "mixed", steps())
    (mixed / "notes.json").write_text("{}")
    assert [path.suffix for path in parquet_paths([mixed])] == [".parquet"]
    (mixed / "log.csv").write_text("obs_a,action\n1,0\n")
    with pytest.raises(InputError, match=r"mixed: it holds files of several formats, .*log.csv"):
        parquet_paths([mixed])


def test_damaged_and_vanished_files(tmp_path: Path, mine: Mine) -> None:
    folder = folder_of(tmp_path / "logs", steps(), steps(first=10))
    (piece, _) = pieces.pieces_of(parquet_paths([folder]))
    (folder / "log-0.parquet").unlink()
    with pytest.raises(InputError, match=r"log-0.parquet: it is gone since the work began; put"):
        read_piece(piece, Reading())
    other = steps()
    other.assign(action=2 - other.action).to_parquet(folder / "log-0.parquet")
    with pytest.raises(InputError, match=r"log-0.parquet: it has changed since the work began"):
        read_piece(piece, Reading())
    second = folder / "log-1.parquet"
    second.write_bytes(second.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"log-1.parquet: it is damaged or cut off"):
        mine(folder)


def test_one_episode_cannot_be_held_out(tmp_path: Path, mine: Mine) -> None:
    with pytest.raises(InputError, match="there is one episode, and holding it out leaves none"):
        mine(folder_of(tmp_path / "logs", steps(50)), hold_out=0.5)


def test_held_out_episodes_with_nearly_all_steps_are_refused(tmp_path: Path, mine: Mine) -> None:
    folder = folder_of(tmp_path / "logs", steps(51))  # fifty of them in one episode
    refused = []
    for seed in range(8):  # until it is drawn
        try:
            mine(folder, hold_out=0.5, seed=seed)
        except InputError as error:
            refused.append(str(error))
    assert refused
    assert all("have nearly all steps, and leave none to mine from" in one for one in refused)


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("scheduler", "'scheduler' is no cluster; give the address of a scheduler"),
        ("local:0", "'local:0' has no process; give one or more"),
        ("local:two", "is no cluster"),
        (
            "local:1:150MB",
            "the processes of 'local:1:150MB' do not start",
        ),
        ("tcp://127.0.0.1:9", "no scheduler answers at 'tcp://127.0.0.1:9'; check the address"),
        ("tls://127.0.0.1:9", "'tls://127.0.0.1:9' asks for TLS, and no certificate is known here"),
    ],
)
def test_clusters_that_are_none(
    address: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sarl_core.clusters._SECONDS", 1)
    monkeypatch.setattr("sarl_core.clusters._START_SECONDS", 10)
    with pytest.raises(InputError, match=sentence), cluster(address):
        pass


@pytest.mark.parametrize("says", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_a_server_that_is_no_scheduler_is_not_waited_for(
    says: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As that of a scheduler's own pages, at the port after its own."""
    monkeypatch.setattr("sarl_core.clusters._SECONDS", 1)
    monkeypatch.setattr("distributed.Client", None)  # would wait without end
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            other, _ = server.accept()
            with other:
                other.sendall(says)
                while other.recv(4096):  # until the other side has gone
                    pass

        answering = Thread(target=answer, daemon=True)
        answering.start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(InputError, match=f"no scheduler answers at '{address}'"):
            cluster(address).__enter__()
        answering.join()


def test_a_worker_is_no_scheduler(client: Any) -> None:
    worker = next(iter(client.scheduler_info()["workers"]))
    with pytest.raises(InputError, match=f"no scheduler answers at '{worker}'"):
        cluster(worker).__enter__()


def test_workers_of_another_version(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    address = client.scheduler.address
    with cluster(address) as same:
        assert same.submit(sum, [1, 2]).result() == 3
    monkeypatch.setattr("sarl_core.__version__", "99.0")
    with (
        pytest.raises(InputError, match=r"the worker tcp://\S+ has version \S+ of this package"),
        cluster(address),
    ):
        pass


@pytest.mark.parametrize(
    ("package", "says"),
    [
        ("raise ImportError", "lacks this package; install version"),
        ("", "lacks this package; install version"),
        ('__version__ = "0.0.1"', "has version 0.0.1 of this package, and here is"),
    ],
    ids=["none", "nothing in it", "another"],
)
def test_a_scheduler_without_this_package(tmp_path: Path, package: str, says: str) -> None:
    (tmp_path / "sarl_core").mkdir()
    (tmp_path / "sarl_core" / "__init__.py").write_text(package, encoding="utf-8")
    known_by = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    command += ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(known_by)]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(command, cwd=tmp_path, env=environment) as scheduler:
        try:
            until = time.monotonic() + 60
            while not (known_by.exists() and known_by.read_text(encoding="utf-8")):
                assert scheduler.poll() is None
                assert time.monotonic() < until
                time.sleep(0.05)
            address = json.loads(known_by.read_text(encoding="utf-8"))["address"]
            with (
                pytest.raises(InputError, match=f"the scheduler at '{address}' {says}"),
                cluster(address),
            ):
                pass
        finally:
            scheduler.terminate()


def test_work_that_ends_every_worker() -> None:
    with (
        # One that ends is enough: of several, the next may be called off while it starts.
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        cluster("local:1") as other,
        pytest.raises(WorkError, match="several workers ended over the same piece of work"),
        saying_losses(),
    ):
        other.submit(os._exit, 1).result()


def test_files_of_one_step_or_of_none_that_is_whole_make_no_difference(
    tmp_path: Path, mine: Mine
) -> None:
    table = steps().assign(step=np.arange(400) % 50)
    table.loc[200:249, "obs_gap"] = np.nan
    table.loc[300:309, "obs_speed"] = np.nan
    cuts = [(0, 1), (1, 180), (180, 200), (200, 230), (230, 251), (251, 300), (300, 311)]
    cuts += [(311, 399), (399, 400)]
    cut = folder_of(tmp_path / "cut", *(table[first:end] for first, end in cuts))
    whole = folder_of(tmp_path / "whole", table)
    one = mine(whole, missing="drop", hold_out=0.4, seed=1)
    other = mine(cut, missing="drop", hold_out=0.4, seed=1)
    assert one.trees[0].counts[0].sum() + one.held_out[0].lengths.sum() == 340
    assert other.trees[0].source.steps == one.trees[0].source.steps
    assert other.sample.whole.digest == one.sample.whole.digest
    assert other.trees[0].counts.tolist() == one.trees[0].counts.tolist()
    assert other.held_out[0].lengths.tolist() == one.held_out[0].lengths.tolist()
    assert other.held_out[0].numbers.tolist() == one.held_out[0].numbers.tolist()


def test_row_numbers_that_a_data_frame_wrote_along_are_no_columns(
    tmp_path: Path, mine: Mine
) -> None:
    one, other = steps(200), steps(200, first=10)
    plain = mine(folder_of(tmp_path / "plain", one, other))
    some = other.set_index(np.arange(200) ** 2)
    assert "__index_level_0__" in pa.Table.from_pandas(some).column_names
    assert "__index_level_0__" not in pa.Table.from_pandas(one).column_names
    for tables in ((one, some), (some, one)):
        mixed = mine(folder_of(tmp_path / "mixed", *tables))
        assert load_demonstrations(tmp_path / "mixed").n_episodes == 8
        assert mixed.trees[0].counts.tolist() == plain.trees[0].counts.tolist()


def test_files_without_any_whole_step_are_refused(tmp_path: Path, mine: Mine) -> None:
    table = steps().assign(obs_gap=np.nan, obs_speed=np.nan)
    with pytest.raises(InputError, match="hardly a step of these files has all of its values"):
        mine(folder_of(tmp_path / "logs", table[:200], table[200:]), missing="drop")


@pytest.mark.parametrize("numbered", [False, True])
def test_names_of_episodes_that_begin_again_are_other_episodes(
    tmp_path: Path, mine: Mine, numbered: bool
) -> None:
    named = [
        steps(seed=seed).assign(episode=lambda one: "run " + one.episode.astype(str))
        for seed in range(3)
    ]
    if numbered:
        named = [table.assign(step=np.arange(400) % 50) for table in named]
    folder = folder_of(tmp_path / "logs", *named)
    mined = mine(folder, hold_out=0.5)
    assert mined.trees[0].source.episodes + mined.held_out_episodes == 24
    assert load_demonstrations(folder).n_episodes == 24
    assert mined.held_out[0].lengths.tolist() == [50] * 12


def test_named_episodes_go_on_where_one_does(tmp_path: Path, mine: Mine) -> None:
    """The last of the first file is the first of the second: these are pieces of one table."""
    first = steps().assign(episode=lambda one: "run " + one.episode.astype(str))
    second = steps(seed=1).assign(episode=lambda one: "run " + (one.episode + 7).astype(str))
    folder = folder_of(tmp_path / "logs", first, second)
    assert mine(folder).trees[0].source.episodes == 15
    assert load_demonstrations(folder).n_episodes == 15


def test_an_episode_that_is_refused_is_called_as_in_its_file(
    tmp_path: Path, mine: Mine, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = steps().assign(episode=lambda one: "run " + one.episode.astype(str))
    table = table.assign(step=np.arange(400) % 50)
    with pytest.raises(
        InputError, match=r"log-0.parquet: column 'step' goes from 9 to 3 .* episode 'run 0'; sort"
    ):
        mine(folder_of(tmp_path / "falls", table.assign(step=table.step.replace(10, 3))))
    again = table[350:].assign(step=np.arange(50))
    with pytest.raises(
        InputError,
        match=r"log-1.parquet: column 'step' goes from 49 to 0 within episode 'run 7', which goes "
        r"on from log-0.parquet; sort",
    ):
        mine(folder_of(tmp_path / "again", table, again))
    monkeypatch.setattr(pieces, "ROWS", 100)
    (tmp_path / "back").mkdir()
    back = pd.concat([table, table[:50].assign(step=np.arange(50, 100))])
    back.to_parquet(tmp_path / "back" / "log.parquet", row_group_size=100)
    with pytest.raises(
        InputError, match=r"log.parquet: column 'episode' comes back to 'run 0' after another"
    ):
        mine(tmp_path / "back")
