"""HDF5: the layout of D4RL, episodes in groups, and files that mean harm."""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from sarl_core.demonstrations.formats import load_demonstrations, read_demonstrations
from sarl_core.errors import InputError
from sarl_core.limits import READ_LIMIT

N = 40
RNG = np.random.default_rng(0)
STATES = RNG.normal(size=(N, 3)).astype(np.float32)
ACTIONS = RNG.normal(size=(N, 2)).astype(np.float32)


def hdf5(fill: Callable[[Any], object]) -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        fill(file)
    return out.getvalue()


def d4rl(file: Any) -> None:
    file["observations"] = STATES
    file["next_observations"] = STATES
    file["actions"] = ACTIONS
    file["rewards"] = np.ones(N, np.float32)
    file["terminals"] = np.arange(N) == 9
    file["timeouts"] = np.isin(np.arange(N), (19, 29))
    file["infos/action_log_probs"] = np.zeros(N)
    file["metadata/algorithm"] = "SAC"


@pytest.mark.parametrize("extension", ["hdf5", "h5"])
def test_d4rl_is_cut_into_episodes_at_terminals_and_timeouts(extension: str) -> None:
    read = read_demonstrations(hdf5(d4rl), f"walker.{extension}")
    assert read.observations.tolist() == STATES.tolist()
    assert read.actions.tolist() == ACTIONS.tolist()
    assert read.episode_lengths.tolist() == [10, 10, 10, 10]
    assert read.episode_finished is not None
    assert read.episode_finished.tolist() == [True, True, True, False]


def packed(file: Any) -> None:
    for name, values in (("observations", STATES), ("actions", np.arange(N) % 2)):
        file.create_dataset(
            name, data=values, chunks=True, compression="gzip", shuffle=True, fletcher32=True
        )


def test_usual_filters_are_read() -> None:
    assert read_demonstrations(hdf5(packed), "demo.hdf5").observations.tolist() == STATES.tolist()

    def lzf(file: Any) -> None:
        file.create_dataset("observations", data=STATES, compression="lzf")
        file["actions"] = np.arange(N) % 2

    assert read_demonstrations(hdf5(lzf), "demo.hdf5").observations.tolist() == STATES.tolist()


def episodes(file: Any, more: int = 0) -> None:
    """As robomimic keeps them: a group an episode, with a group of observations."""
    for index in (0, 2, 10):
        group = file.create_group(f"data/demo_{index}")
        group["actions"] = np.full((3, 2), index, np.float32)
        group["rewards"] = np.zeros(3)
        group["dones"] = [0, 0, 1]
        group["obs/grip"] = np.full(3 + more, index, np.float32)
        group["obs/arm"] = np.full((3 + more, 2), index, np.float32)
        group["obs/camera"] = np.zeros((3 + more, 8, 8, 3), np.uint8)


@pytest.mark.parametrize("more", [0, 1])
def test_episodes_in_groups_are_read_in_their_natural_order(more: int) -> None:
    read = read_demonstrations(hdf5(lambda file: episodes(file, more)), "demo.hdf5")
    assert read.feature_names == ("arm 0", "arm 1", "grip")
    assert read.actions[:, 0].tolist() == [0, 0, 0, 2, 2, 2, 10, 10, 10]
    assert read.observations[:, 2].tolist() == [0, 0, 0, 2, 2, 2, 10, 10, 10]
    assert read.n_episodes == 3
    assert any("'camera'" in note for note in read.notes)


def other_episode(file: Any) -> None:
    episodes(file)
    del file["data/demo_10/obs/grip"]


def short_episode(file: Any) -> None:
    episodes(file)
    del file["data/demo_2/rewards"]
    file["data/demo_2/rewards"] = np.zeros(2)


def external_link(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file["actions"] = h5py.ExternalLink("other.hdf5", "/actions")


def soft_link(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file["actions"] = h5py.SoftLink("/rewards")


def external_storage(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file.create_dataset("actions", (N,), "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])


def virtual(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    layout = h5py.VirtualLayout((N, 2), np.float32)
    layout[:] = h5py.VirtualSource("other.hdf5", "actions", (N, 2))
    file.create_virtual_dataset("actions", layout)


def huge(file: Any) -> None:
    d4rl(file)
    del file["observations"]
    file.create_dataset("observations", (10**12, 3), "f4", chunks=(1000, 3))


def huge_chunk(file: Any) -> None:
    d4rl(file)
    del file["observations"]
    file.create_dataset("observations", (N, 3), "f4", chunks=(2**28, 3), maxshape=(None, 3))


def texts(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file["actions"] = ["left"] * N


def other_filter(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    filters = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    filters.set_chunk((N, 2))
    filters.set_filter(32015, h5py.h5z.FLAG_OPTIONAL)  # Zstandard, a plug-in
    space = h5py.h5s.create_simple((N, 2))
    h5py.h5d.create(file.id, b"actions", h5py.h5t.IEEE_F32LE, space, dcpl=filters)


def bomb(file: Any) -> None:
    """A part that says that it is 480 bytes and unpacks to half a gigabyte."""
    d4rl(file)
    del file["observations"]
    made = file.create_dataset("observations", (N, 3), "f4", chunks=(N, 3), compression="gzip")
    packer = zlib.compressobj(9)
    content = b"".join(packer.compress(bytes(2**20)) for _ in range(512)) + packer.flush()
    made.id.write_direct_chunk((0, 0), content)


def nothing(file: Any) -> None:
    file["x"] = STATES


HOSTILE: dict[str, tuple[Callable[[Any], None], str]] = {
    "an external link": (external_link, "'actions' is a link to another place"),
    "a soft link": (soft_link, "'actions' is a link to another place"),
    "external storage": (external_storage, "'actions' lies in another file"),
    "a virtual data set": (virtual, "'actions' lies in another file"),
    "a huge shape": (huge, "it unpacks to"),
    "a huge chunk": (huge_chunk, "it unpacks to"),
    "texts": (texts, "'actions' holds texts or Python objects"),
    "a filter that is not there": (other_filter, r"a filter that is not read \(number 32015\)"),
    "a bomb": (bomb, "unpacks to more than it says"),
    "nothing": (nothing, "neither arrays 'observations' and 'actions' nor episodes"),
    "an episode of another task": (other_episode, "'demo_10' holds other things than 'demo_0'"),
    "a short array": (short_episode, "'demo_2' has 2 rewards for 3 actions"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_means_harm_is_one_sentence(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(READ_LIMIT, "0.125")
    fill, reason = HOSTILE[name]
    path = tmp_path / "demo.hdf5"
    path.write_bytes(hdf5(fill))
    with pytest.raises(InputError, match=reason) as error:
        load_demonstrations(path)
    assert "\n" not in str(error.value)


def test_a_file_that_is_cut_off_is_one_sentence() -> None:
    content = hdf5(packed)
    for end in range(8, len(content) - 1, 97):
        with pytest.raises(InputError, match=r"damaged|neither arrays"):
            read_demonstrations(content[:end], "demo.hdf5")
