"""Whatever happens to a file, it is read or refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations, save_demonstrations
from sarl_core.demonstrations.warnings import find_warnings
from sarl_core.errors import InputError
from tests.bad_inputs import ROWS, csv_bytes, good_arrays, npz_bytes, parquet_bytes

FILES = {
    "demo.csv": csv_bytes(*ROWS),
    "demo.parquet": parquet_bytes(),
    "demo.npz": npz_bytes(**good_arrays()),
}
SIGNS = b",;\n\"0-.eE \t|'xNa\r\xff\x00"


def read_or_refused(content: bytes, name: str, env_id: str | None = None) -> None:
    try:
        demonstrations = read_demonstrations(content, name, env_id=env_id)
    except InputError as error:
        sentence = str(error)
    else:
        sentence = f"{name}: fine"
        find_warnings(demonstrations)
        demonstrations.summary()
        assert len(demonstrations.digest) == 32
    assert "\n" not in sentence
    assert sentence.startswith(f"{name}: ")


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """A file with a few bytes changed, removed, added or doubled."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        place = int(rng.integers(len(data)))
        match rng.integers(4):
            case 0:
                data[place] = rng.integers(256)
            case 1 if len(data) > 20:
                del data[place : place + int(rng.integers(1, 9))]
            case 2:
                data[place:place] = bytes(rng.choice(list(SIGNS), 2).tolist())
            case _:
                data[place:place] = data[max(0, place - 9) : place]
    return bytes(data)


@pytest.mark.parametrize("name", FILES)
def test_damaged_files(name: str) -> None:
    rng = np.random.default_rng(0)
    for attempt in range(400):
        env_id = (None, "CartPole-v1", "Pendulum-v1")[attempt % 3]
        read_or_refused(damaged(FILES[name], rng), name, env_id)


@pytest.mark.parametrize("extension", ["parquet", "npz"])
def test_damaged_files_of_our_own(extension: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / f"demo.{extension}"
    save_demonstrations(
        Demonstrations(
            rng.normal(size=(6, 3)),
            np.array([0, 1, 2, 0, 1, 2]),
            np.array([0, 0, 0, 1, 1, 1]),
            np.ones(6),
            terminated=np.zeros(6),
            env_id="X-v0",
            notes=("read",),
        ),
        path,
    )
    content = path.read_bytes()
    for _ in range(400):
        read_or_refused(damaged(content, rng), path.name)


_values: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["", "x", "y", "a"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["name", "unit", "x"]), inner, max_size=2)
    ),
    max_leaves=6,
)
_metadata = st.fixed_dictionaries(
    {},
    optional={
        "env_id": st.sampled_from(["", "CartPole-v1", "Pendulum-v1", "x:y", "No-v0"]) | _values,
        "agent": _values,
        "seed": _values,
        "version": st.just(1) | _values,
        "features": st.just([{"name": "x"}, {"name": "y", "unit": "m"}]) | _values,
        "action_names": st.sampled_from([["push"], ["a", "b"], [], ["push", "push"]]) | _values,
        "label_names": st.sampled_from([[["l", "r"]], [[]], [["l"], ["r"]], [["l"]]]) | _values,
        "label_first": st.sampled_from([[0], [1], [0, 0], [10**30]]) | _values,
        "action_low": st.sampled_from([[0], [-1.0, 0], [2], [10**400]]) | _values,
        "action_high": st.sampled_from([[1], [1.0, 3], [0]]) | _values,
        "bounds_from": st.sampled_from(["action space", "demonstrated values"]) | _values,
        "notes": st.just(["read"]) | _values,
    },
)


def test_labels_without_their_first_start_at_zero() -> None:
    content = parquet_bytes(metadata='{"label_names": [["left", "right"]]}')
    demonstrations = read_demonstrations(content, "demo.parquet")
    assert demonstrations.label_names == (("left", "right"),)
    assert demonstrations.label_first == (0,)


def test_labels_beyond_any_number() -> None:
    metadata = {"label_names": [["left", "right"]], "label_first": [10**30]}
    with pytest.raises(InputError, match="too large for a label"):
        read_demonstrations(parquet_bytes(metadata=json.dumps(metadata)), "demo.parquet")


def test_environment_of_a_file_that_is_not_there_any_more(
    capfd: pytest.CaptureFixture[str],
) -> None:
    content = parquet_bytes(metadata='{"env_id": "LunarLander-v2"}')
    assert read_demonstrations(content, "demo.parquet").env_id == "LunarLander-v2"
    assert capfd.readouterr() == ("", "")


@settings(max_examples=300)
@given(metadata=_metadata, env_id=st.sampled_from([None, "CartPole-v1"]))
def test_any_metadata(metadata: dict[str, Any], env_id: str | None) -> None:
    text = json.dumps(metadata)
    read_or_refused(parquet_bytes(metadata=text), "demo.parquet", env_id)
    read_or_refused(npz_bytes(**good_arrays(), sarl=np.array(text)), "demo.npz", env_id)


_field = st.sampled_from(["0", "1", "2.5", "-1", "", "nan", "x", "0,5", "true", '"', "1e39", " 3 "])
_name = st.sampled_from(
    [
        "obs_0",
        "obs_1",
        "obs_2",
        "x",
        "action",
        "action_a",
        "episode",
        "step",
        "done",
        "",
        "0",
        "next_obs",
        "reward",
        "#",
    ]
)


@settings(max_examples=400)
@given(
    names=st.lists(_name, max_size=5),
    rows=st.lists(st.lists(_field, max_size=5), max_size=5),
    sign=st.sampled_from([",", ";", "\t"]),
    name=st.sampled_from(["demo.csv", "obs.csv"]),
)
def test_any_table(names: list[str], rows: list[list[str]], sign: str, name: str) -> None:
    text = "\n".join(sign.join(fields) for fields in [names, *rows])
    read_or_refused(text.encode(), name)
    read_or_refused(text.encode(), name, "CartPole-v1")
