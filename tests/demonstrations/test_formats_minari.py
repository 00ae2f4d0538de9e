"""What Minari's own library writes is read: spaces, names and environment from its metadata."""

from __future__ import annotations

import io
import json
import shutil
import zipfile
from collections import OrderedDict
from pathlib import Path
from typing import Any

import gymnasium
import minari
import numpy as np
import pytest
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import load_demonstrations, read_files
from sarl_core.errors import InputError

LENGTHS = (5, 3, 4, 2, 3, 2, 2, 2, 2, 2, 2, 3)  # more than ten: episode_2 comes before episode_10

OBSERVATIONS = {
    "box": spaces.Box(-1, 1, (3,)),
    "table": spaces.Box(-1, 1, (2, 2)),
    "whole": spaces.Box(0, 9, (2,), np.int64),
    "discrete": spaces.Discrete(3, start=2),
    "multi-discrete": spaces.MultiDiscrete([3, 2]),
    "multi-binary": spaces.MultiBinary(3),
    "dict": spaces.Dict(
        OrderedDict(
            speed=spaces.Box(0, 9, (1,)), gear=spaces.Discrete(3), gap=spaces.Box(0, 1, (2,))
        )
    ),
    "tuple": spaces.Tuple((spaces.Box(0, 1, (2,)), spaces.Dict(a=spaces.Box(0, 1, (1,))))),
}
ACTIONS = {
    "discrete": spaces.Discrete(2),
    "from one": spaces.Discrete(3, start=1),
    "multi-discrete": spaces.MultiDiscrete([2, 3]),
    "multi-binary": spaces.MultiBinary(2),
    "box": spaces.Box(-2, np.array([1, 2], np.float32), (2,)),
    "dict": spaces.Dict(left=spaces.Box(-1, 1, (1,)), right=spaces.Box(-1, 1, (1,))),
}


def stacked(values: list[Any], space: spaces.Space[Any]) -> Any:
    """Values of several steps as Minari keeps them."""
    if isinstance(space, spaces.Dict):
        return {key: stacked([one[key] for one in values], space[key]) for key in space}
    if isinstance(space, spaces.Tuple):
        return tuple(
            stacked([one[place] for one in values], inner) for place, inner in enumerate(space)
        )
    return np.asarray(values, dtype=space.dtype)


def written(
    folder: Path,
    observed: spaces.Space[Any],
    acted: spaces.Space[Any],
    data_format: str,
    **more: Any,
) -> tuple[Path, list[Any], list[Any]]:
    """A data set, and its observations and actions step by step."""
    observed.seed(0)
    acted.seed(1)
    states: list[Any] = []
    actions: list[Any] = []
    buffers = []
    for length in LENGTHS:
        seen = [observed.sample() for _ in range(length + 1)]
        done = [acted.sample() for _ in range(length)]
        states += seen[:-1]
        actions += done
        ends = np.arange(length) == length - 1
        buffers.append(
            EpisodeBuffer(
                observations=stacked(seen, observed),
                actions=stacked(done, acted),
                rewards=np.arange(length, dtype=np.float64),
                terminations=ends,
                truncations=np.zeros(length, bool),
                infos={"why": np.zeros((length + 1, 1))},
            )
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(folder))
        minari.create_dataset_from_buffers(
            "demo/task-v0",
            buffers,
            observation_space=observed,
            action_space=acted,
            data_format=data_format,
            algorithm_name="a driver",
            **more,
        )
    return folder / "demo" / "task-v0", states, actions


def require_same(read: Demonstrations, states: list[Any], observed: spaces.Space[Any]) -> None:
    flat = np.array([spaces.flatten(observed, state) for state in states], np.float32)
    assert read.observations.tolist() == flat.tolist()
    assert read.episode_lengths.tolist() == list(LENGTHS)
    assert read.episode_finished is not None
    assert read.episode_finished.all()
    assert read.rewards is not None
    assert read.rewards[:5].tolist() == [0, 1, 2, 3, 4]
    assert read.agent == "a driver"


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.parametrize("kind", OBSERVATIONS)
@pytest.mark.filterwarnings("ignore")  # of what Minari finds missing in a description
def test_observations_are_flattened_as_gymnasium_does(
    kind: str, data_format: str, tmp_path: Path
) -> None:
    observed = OBSERVATIONS[kind]
    folder, states, actions = written(tmp_path, observed, spaces.Discrete(2), data_format)
    read = load_demonstrations(folder)
    require_same(read, states, observed)
    assert read.actions.tolist() == [int(action) for action in actions]


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.parametrize("kind", ACTIONS)
@pytest.mark.filterwarnings("ignore")
def test_actions_of_every_space(kind: str, data_format: str, tmp_path: Path) -> None:
    acted = ACTIONS[kind]
    folder, _, actions = written(tmp_path, OBSERVATIONS["box"], acted, data_format)
    read = load_demonstrations(folder)
    flat = [
        np.ravel(spaces.flatten(acted, one) if kind == "dict" else one).tolist() for one in actions
    ]
    assert read.action_columns.tolist() == flat
    dimensions = read.action_dimensions
    if kind == "box":
        assert [(one.low, one.high) for one in dimensions] == [(-2, 1), (-2, 2)]
        assert dimensions[0].bounds_from == "action space"
    elif kind == "dict":
        assert [one.name for one in dimensions] == ["left", "right"]
    else:
        counts = {"discrete": [2], "from one": [3], "multi-discrete": [2, 3]}.get(kind, [2, 2])
        assert [len(one.labels) for one in dimensions] == counts
        assert dimensions[0].first == (1 if kind == "from one" else 0)


@pytest.mark.filterwarnings("ignore")
def test_names_are_the_keys_of_spaces_else_those_of_the_environment(tmp_path: Path) -> None:
    keyed, _, _ = written(tmp_path / "keys", OBSERVATIONS["dict"], spaces.Discrete(2), "arrow")
    assert load_demonstrations(keyed).feature_names == (
        *("speed", "gear is 0", "gear is 1", "gear is 2", "gap 0", "gap 1"),
    )
    cart = spaces.Box(-1, 1, (4,))
    folder, _, _ = written(
        tmp_path / "cart", cart, spaces.Discrete(2), "hdf5", env=gymnasium.make("CartPole-v1")
    )
    read = load_demonstrations(folder)
    assert read.env_id == "CartPole-v1"
    assert read.features[0].name == "cart position"
    assert read.features[0].unit == "m"
    assert read.label_names == (("push left", "push right"),)


def zipped(folder: Path) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder.parent))
    return out.getvalue()


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.filterwarnings("ignore")
def test_the_folder_its_archive_and_the_folder_within_are_the_same(
    data_format: str, tmp_path: Path
) -> None:
    folder, _, _ = written(tmp_path, OBSERVATIONS["box"], spaces.Discrete(2), data_format)
    digest = load_demonstrations(folder).digest
    assert load_demonstrations(folder / "data").digest == digest
    assert load_demonstrations(tmp_path).digest == digest
    assert read_files([(zipped(folder), "task.zip")]).digest == digest
    if data_format == "hdf5":
        assert load_demonstrations(folder / "data" / "main_data.hdf5").digest == digest


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.filterwarnings("ignore")
def test_without_its_metadata_it_is_refused(data_format: str, tmp_path: Path) -> None:
    folder, _, _ = written(tmp_path, OBSERVATIONS["box"], spaces.Discrete(2), data_format)
    (folder / "data" / "metadata.json").unlink()
    for place in (folder, folder / "data"):
        with pytest.raises(InputError, match=r"not the 'metadata\.json' that says"):
            load_demonstrations(place)
    if data_format == "hdf5":
        with pytest.raises(InputError, match=r"Minari's, whose spaces and names stand in a file"):
            load_demonstrations(folder / "data" / "main_data.hdf5")


BOX = '{"type": "Box", "dtype": "float32", "shape": [3], "low": [-1, -1, -1], "high": [1, 1, 1]}'
PICTURE = {
    "type": "Box",
    "dtype": "uint8",
    "shape": [8, 8, 3],
    "low": np.zeros((8, 8, 3), int).tolist(),
    "high": np.full((8, 8, 3), 255).tolist(),
}
CHANGES: dict[str, tuple[dict[str, Any], str]] = {
    "no space": ({"observation_space": None}, r"not as it should be .*'observation_space'"),
    "no JSON": ({"observation_space": "{"}, "space of observations is none that is known"),
    "another space": (
        {"observation_space": '{"type": "Graph"}'},
        "space of observations is none that is known",
    ),
    "another width": (
        {"observation_space": BOX.replace("[3]", "[4]").replace("1]", "1, 1]")},
        "3 numbers, and its space 4|no 'observations_3'",
    ),
    "a huge space": (
        {"observation_space": '{"type": "Discrete", "n": 1000000000000}'},
        "more than 4,096 numbers",
    ),
    "a huge shape": (
        {"observation_space": BOX.replace("[3]", "[1000000, 1000000]")},
        r"of shape \(1000000, 1000000\), as images are",
    ),
    "many labels": ({"action_space": '{"type": "Discrete", "n": 1000000000}'}, "labels that rules"),
    "text": (
        {"observation_space": '{"type": "Text", "max_length": 3}'},
        "is text, which rules cannot read",
    ),
    "images": (
        {"observation_space": BOX.replace("[3]", "[64, 64, 3]").replace("float32", "uint8")},
        r"of shape \(64, 64, 3\), as images are",
    ),
    "small images": (
        {"observation_space": json.dumps(PICTURE)},
        r"of shape \(8, 8, 3\), as images are",
    ),
    "bounds of another shape": (
        {"observation_space": BOX.replace("[1, 1, 1]", "[1, 1]")},
        "space of observations is not as it should be",
    ),
    "another format": ({"data_format": "zarr"}, "in the format 'zarr', which is not read"),
    "deep": (
        {"observation_space": '{"type": "Tuple", "subspaces": [' * 400 + BOX + "]}" * 400},
        "nested too deeply|none that is known",
    ),
}


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.filterwarnings("ignore")
def test_metadata_that_do_not_fit_are_one_sentence(
    change: str, data_format: str, tmp_path: Path
) -> None:
    folder, _, _ = written(tmp_path, OBSERVATIONS["box"], spaces.Discrete(2), data_format)
    path = folder / "data" / "metadata.json"
    more, reason = CHANGES[change]
    path.write_text(json.dumps(json.loads(path.read_text()) | more))
    with pytest.raises(InputError, match=reason) as error:
        load_demonstrations(folder)
    assert "\n" not in str(error.value)


@pytest.mark.filterwarnings("ignore")
def test_two_data_sets_in_a_folder_are_not_mixed(tmp_path: Path) -> None:
    folder, _, _ = written(tmp_path, OBSERVATIONS["box"], spaces.Discrete(2), "arrow")
    shutil.copytree(folder, folder.with_name("task-v1"))
    with pytest.raises(InputError, match="there are 2 data sets in it"):
        load_demonstrations(tmp_path)
