"""LeRobot's folders, and those of Hugging Face's `datasets`, as imitation saves them."""

from __future__ import annotations

import io
import itertools
import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sarl_core.demonstrations.formats import (
    load_demonstrations,
    read_demonstrations,
    read_files,
    table_columns,
)
from sarl_core.errors import InputError

LENGTHS = (4, 3, 5)
N = sum(LENGTHS)
STATES = np.random.default_rng(0).normal(size=(N, 3)).astype(np.float32)
ACTIONS = np.random.default_rng(1).normal(size=(N, 2)).astype(np.float32)
NAMES = ["speed", "gap", "tilt"]


def fixed(values: Any) -> Any:
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def zipped(folder: Path) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder.parent))
    return out.getvalue()


def lerobot(
    folder: Path, version: str = "v3.0", names: Any = NAMES, files: int = 3, **features: Any
) -> Path:
    """A data set of three episodes, in one file each or in one for all."""
    (folder / "meta").mkdir(parents=True)
    described = {
        "observation.state": {"dtype": "float32", "shape": [3], "names": names},
        "observation.images.top": {"dtype": "video", "shape": [64, 64, 3], "names": None},
        "action": {"dtype": "float32", "shape": [2], "names": {"motors": ["left", "right"]}},
        "frame_index": {"dtype": "int64", "shape": [1], "names": None},
        "episode_index": {"dtype": "int64", "shape": [1], "names": None},
        "task": {"dtype": "string", "shape": [1], "names": None},
        **features,
    }
    info = {"codebase_version": version, "fps": 30, "features": described}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    episodes = np.repeat(np.arange(len(LENGTHS)), LENGTHS)
    table = pa.table(
        {
            "observation.state": fixed(STATES),
            "action": fixed(ACTIONS),
            "timestamp": np.concatenate([np.arange(n) / 30 for n in LENGTHS]),
            "frame_index": np.concatenate([np.arange(n) for n in LENGTHS]),
            "episode_index": episodes,
            "index": np.arange(N),
            "task_index": np.zeros(N, int),
            "task": ["push"] * N,
            "next.reward": np.arange(N, dtype=np.float32),
        }
    )
    ends = [0, *np.cumsum(LENGTHS).tolist()] if files == 3 else [0, N]
    for index, (start, end) in enumerate(itertools.pairwise(ends)):
        # So that "chunk-2" has to stand before "chunk-10".
        chunk = folder / "data" / f"chunk-{(2, 10, 11)[index]}"
        chunk.mkdir(parents=True)
        pq.write_table(table.slice(start, end - start), chunk / f"file-{index:03d}.parquet")
    video = folder / "videos" / "observation.images.top" / "chunk-000" / "file-000.mp4"
    video.parent.mkdir(parents=True)
    video.write_bytes(b"\0" * 100)
    return folder


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
@pytest.mark.parametrize("files", [1, 3])
def test_lerobot_is_read_with_its_names(version: str, files: int, tmp_path: Path) -> None:
    folder = lerobot(tmp_path / "push", version, files=files)
    read = load_demonstrations(folder)
    assert read.feature_names == tuple(NAMES)
    assert read.action_names == ("left", "right")
    assert read.observations.tolist() == STATES.tolist()
    assert read.actions.tolist() == ACTIONS.tolist()
    assert read.episode_lengths.tolist() == list(LENGTHS)
    assert read.rewards is not None
    assert any("'observation.images.top'" in note and "pictures" in note for note in read.notes)
    assert read_files([(zipped(folder), "push.zip")]).digest == read.digest


@pytest.mark.parametrize(
    ("names", "features"),
    [
        (None, ("state 0", "state 1", "state 2")),
        ({"axes": NAMES}, tuple(NAMES)),
        ({"gap": 1, "speed": 0, "tilt": 2}, tuple(NAMES)),
        ([NAMES], tuple(NAMES)),
        (["one", "two"], ("state 0", "state 1", "state 2")),
        (["a", "a", "b"], ("state 0", "state 1", "state 2")),
    ],
)
def test_lerobot_names_in_all_their_forms(names: Any, features: Any, tmp_path: Path) -> None:
    assert load_demonstrations(lerobot(tmp_path, names=names)).feature_names == features


def test_lerobot_columns_are_mapped_by_their_names(tmp_path: Path) -> None:
    folder = lerobot(tmp_path)
    assert table_columns(folder)[:4] == (
        *("observation.speed", "observation.gap", "observation.tilt", "action.left"),
    )
    read = load_demonstrations(folder, columns={"observation.tilt": "ignore"})
    assert read.feature_names == ("speed", "gap")
    assert read.action_names == ("left", "right")
    assert read.n_episodes == len(LENGTHS)


def test_lerobot_with_a_label_in_a_column_of_its_own(tmp_path: Path) -> None:
    folder = lerobot(tmp_path, files=1)
    info = folder / "meta" / "info.json"
    said = json.loads(info.read_text())
    said["features"]["action"] = {"dtype": "int64", "shape": [1], "names": ["push"]}
    info.write_text(json.dumps(said))
    (path,) = (folder / "data").rglob("*.parquet")
    table = pq.read_table(path)
    labels = pa.array(np.arange(N) % 3)
    pq.write_table(table.set_column(table.column_names.index("action"), "action", labels), path)
    read = load_demonstrations(folder)
    assert read.actions.tolist() == labels.to_pylist()
    assert read.action_names == ("push",)


def test_lerobot_without_its_data(tmp_path: Path) -> None:
    folder = lerobot(tmp_path)
    shutil.rmtree(folder / "data")
    with pytest.raises(InputError, match="no Parquet files in its folder 'data'"):
        load_demonstrations(folder)


@pytest.mark.parametrize("version", ["v1.6", "v4.0", ""])
def test_a_version_that_is_not_known_is_refused_by_name(version: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"LeRobot's version '{version}', and this program"):
        load_demonstrations(lerobot(tmp_path, version))


def test_lerobot_that_speaks_of_columns_that_are_not_there(tmp_path: Path) -> None:
    more = {"observation.force": {"dtype": "float32", "shape": [2], "names": None}}
    with pytest.raises(InputError, match=r"speaks of 'observation\.force_0'"):
        load_demonstrations(lerobot(tmp_path / "a", **more))
    huge = {"observation.force": {"dtype": "float32", "shape": [10**6, 10**6], "names": None}}
    with pytest.raises(InputError, match="1,000,000,000,000 numbers"):
        load_demonstrations(lerobot(tmp_path / "b", **huge))


@pytest.mark.parametrize(
    "content", [b"{", b"[]", b'{"features": 3}', b'{"codebase_version": "v3.0"}']
)
def test_lerobot_with_a_description_that_is_none(content: bytes, tmp_path: Path) -> None:
    folder = lerobot(tmp_path)
    (folder / "meta" / "info.json").write_bytes(content)
    with pytest.raises(InputError, match=r"meta/info\.json: it is no"):
        load_demonstrations(folder)


def saved(folder: Path, columns: dict[str, Any], parts: int = 1) -> Path:
    """A data set as `datasets` saves it to a disk."""
    folder.mkdir(parents=True, exist_ok=True)
    table = pa.table(columns)
    names = [f"data-{part:05d}-of-{parts:05d}.arrow" for part in range(parts)]
    size = -(-table.num_rows // parts)
    for part, name in enumerate(names):
        with pa.OSFile(str(folder / name), "wb") as out, pa.ipc.new_stream(out, table.schema) as to:
            to.write_table(table.slice(part * size, size))
    files = [{"filename": name} for name in names]
    (folder / "state.json").write_text(json.dumps({"_data_files": files, "_split": None}))
    (folder / "dataset_info.json").write_text('{"features": {}}')
    return folder


def trajectories(more: int = 1) -> dict[str, Any]:
    """Episodes of imitation, with one observation more than actions in each."""
    starts = np.cumsum((0, *LENGTHS))
    last = np.full((more, 3), 9, np.float32)
    return {
        "obs": pa.array(
            [np.concatenate([STATES[a:b], last]).tolist() for a, b in itertools.pairwise(starts)],
            pa.list_(pa.list_(pa.float32())),
        ),
        "acts": [list(range(n)) for n in LENGTHS],
        "infos": [['{"py/object": "os.system"}'] * n for n in LENGTHS],
        "terminal": [True, False, True],
        "rews": [[0.5] * n for n in LENGTHS],
    }


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("more", [0, 1])
def test_imitation_has_an_episode_in_each_row(parts: int, more: int, tmp_path: Path) -> None:
    folder = saved(tmp_path / "expert", trajectories(more), parts)
    read = load_demonstrations(folder)
    assert read.observations.tolist() == STATES.tolist()
    assert read.actions.tolist() == [step for n in LENGTHS for step in range(n)]
    assert read.episode_lengths.tolist() == list(LENGTHS)
    assert read.terminated is not None
    assert np.flatnonzero(read.terminated).tolist() == [3, 11]
    assert read.rewards is not None
    assert read_files([(zipped(folder), "expert.zip")]).digest == read.digest


def test_continuous_actions_of_imitation(tmp_path: Path) -> None:
    starts = np.cumsum((0, *LENGTHS))
    acts = [ACTIONS[a:b].tolist() for a, b in itertools.pairwise(starts)]
    read = load_demonstrations(saved(tmp_path, trajectories() | {"acts": acts}))
    assert read.actions.tolist() == ACTIONS.tolist()


def test_rows_that_are_episodes_in_other_files() -> None:
    starts = np.cumsum((0, *LENGTHS)).tolist()
    rows = [
        {
            "observations": STATES[a:b].tolist(),
            "actions": ACTIONS[a:b].tolist(),
            "rewards": [1.0] * (b - a),
            "dones": [False] * (b - a),
        }
        for a, b in itertools.pairwise(starts)
    ]
    out = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(rows), out)
    lines = "".join(json.dumps(row) + "\n" for row in rows).encode()
    for name, content in (("hopper.parquet", out.getvalue()), ("hopper.jsonl", lines)):
        read = read_demonstrations(content, name)
        assert read.observations.tolist() == STATES.tolist()
        assert read.actions.tolist() == ACTIONS.tolist()
        assert read.episode_lengths.tolist() == list(LENGTHS)


def test_a_data_set_with_a_row_a_step(tmp_path: Path) -> None:
    columns = {"obs": STATES.tolist(), "action": np.arange(N) % 2, "episode": np.arange(N) // 4}
    read = load_demonstrations(saved(tmp_path, columns))
    assert read.observations.tolist() == STATES.tolist()
    assert read.n_episodes == 3


def test_data_sets_of_hugging_face_that_are_wrong(tmp_path: Path) -> None:
    short = trajectories() | {"acts": [[0], [1], [0]]}
    with pytest.raises(InputError, match=r"row 1 has 5 observations for 1 actions"):
        load_demonstrations(saved(tmp_path / "short", short))
    ragged = trajectories() | {"obs": [[[1.0, 2.0], [3.0]], [[1.0]] * 4, [[1.0]] * 6]}
    with pytest.raises(InputError, match=r"column 'obs': its lists have different lengths"):
        load_demonstrations(saved(tmp_path / "ragged", ragged))
    splits = tmp_path / "splits"
    saved(splits / "train", trajectories())
    saved(splits / "test", trajectories())
    with pytest.raises(InputError, match="there are 2 data sets in it, as 'test' and 'train'"):
        load_demonstrations(splits)
    folder = saved(tmp_path / "cut", trajectories())
    (folder / "data-00000-of-00001.arrow").unlink()
    with pytest.raises(InputError, match=r"there is no 'data-00000-of-00001\.arrow' in it"):
        load_demonstrations(folder)
    (folder / "state.json").write_text('{"_data_files": [{"filename": "../../secret"}]}')
    with pytest.raises(InputError, match=r"there is no '\.\./\.\./secret' in it"):
        load_demonstrations(folder)
