"""HDF5: the layout of D4RL, episodes in groups, and files that mean harm."""

from __future__ import annotations

import io
import tracemalloc
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


WORDS = [("brake", "accelerate", "coast\u00e4")[index % 3] for index in range(N)]


@pytest.mark.parametrize("kind", [h5py.string_dtype(), h5py.string_dtype(length=12), "S12"])
@pytest.mark.parametrize("shape", [(N,), (N, 1)])
def test_actions_that_are_texts_are_labels_by_those_names(kind: Any, shape: tuple[int]) -> None:
    def fill(file: Any) -> None:
        d4rl(file)
        del file["actions"]
        words = np.array([word.encode() for word in WORDS], dtype="S12").astype(kind)
        file.create_dataset("actions", data=words.reshape(shape), chunks=True, compression="gzip")

    read = read_demonstrations(hdf5(fill), "demo.hdf5")
    (dimension,) = read.action_dimensions
    assert dimension.labels == ("accelerate", "brake", "coast\u00e4")
    assert [dimension.labels[action] for action in read.actions] == WORDS
    assert read.n_episodes == 4


def test_texts_are_read_in_parts_where_little_is_to_be_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fill(file: Any) -> None:
        file["observations"] = STATES
        file["actions"] = WORDS

    content = hdf5(fill)
    monkeypatch.setattr("sarl_core.demonstrations.formats.hdf5.content.read_limit", lambda: 1)
    read = read_demonstrations(content, "demo.hdf5")
    assert read.actions.tolist() == [(1, 0, 2)[index % 3] for index in range(N)]


def test_one_long_text_in_many_places_is_held_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(READ_LIMIT, "0.0625")
    content = hdf5(long_text_everywhere)
    tracemalloc.start()
    try:
        read = read_demonstrations(content, "demo.hdf5")
        assert tracemalloc.get_traced_memory()[1] < N * len(content) / 2
    finally:
        tracemalloc.stop()
    assert [len(label) for label in read.action_dimensions[0].labels] == [2**22]


@pytest.mark.parametrize("home", ["", "rollouts/"])
@pytest.mark.parametrize(("states", "actions"), [("states", "controls"), ("Obs", "Act")])
def test_episodes_under_other_names_are_read_in_the_order_of_their_numbers(
    home: str, states: str, actions: str
) -> None:
    def fill(file: Any) -> None:
        for index in range(12):
            file[f"{home}traj_{index}/{states}"] = np.full((3, 2), index)
            file[f"{home}traj_{index}/{actions}"] = ["left", "right", "left"]

    read = read_demonstrations(hdf5(fill), "demo.hdf5")
    assert read.observations[::3, 0].tolist() == [*range(12)]
    assert read.episode_lengths.tolist() == [3] * 12
    assert read.action_dimensions[0].labels == ("left", "right")


def test_a_group_that_holds_all_episodes_is_cut_at_their_ends() -> None:
    def fill(file: Any) -> None:
        d4rl(file.create_group("dataset"))

    read = read_demonstrations(hdf5(fill), "walker.hdf5")
    assert read.episode_lengths.tolist() == [10, 10, 10, 10]


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
    del file["rewards"]
    file["rewards"] = ["high"] * N


def other_texts(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file["actions"] = np.array([b"\xe4"] * N)


def no_text(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    file["actions"] = [*["left"] * (N - 1), " "]


def long_text_everywhere(file: Any) -> None:
    """Every text of a column starts in the same place: N times what the file holds."""
    d4rl(file)
    del file["actions"]
    made = file.create_dataset("actions", (N,), h5py.string_dtype(), chunks=(1,))
    made[0] = "x" * 2**22
    chunk = made.id.read_direct_chunk((0,))[1]
    for row in range(N):
        made.id.write_direct_chunk((row,), chunk)


def long_texts_side_by_side(file: Any) -> None:
    d4rl(file)
    del file["actions"]
    made = file.create_dataset("actions", (N, 200), h5py.string_dtype())
    made[0, 0] = "x" * 2**20


def words_and_numbers(file: Any) -> None:
    episodes(file)
    del file["data/demo_2/actions"]
    file["data/demo_2/actions"] = [["left", "up"]] * 3


def two_homes(file: Any) -> None:
    for home in ("valid", "train"):
        file[f"{home}/demo_0/obs"] = STATES
        file[f"{home}/demo_0/actions"] = ACTIONS


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
    for index in (10, 9):
        file[f"runs/traj_{index}/sensor"] = STATES


HOSTILE: dict[str, tuple[Callable[[Any], None], str]] = {
    "an external link": (external_link, "'actions' is a link to another place"),
    "a soft link": (soft_link, "'actions' is a link to another place"),
    "external storage": (external_storage, "'actions' lies in another file"),
    "a virtual data set": (virtual, "'actions' lies in another file"),
    "a huge shape": (huge, "it unpacks to"),
    "a huge chunk": (huge_chunk, "it unpacks to"),
    "texts": (texts, "'rewards' holds texts or Python objects"),
    "texts in Latin-1": (other_texts, "'actions' holds texts that are not UTF-8"),
    "an empty text": (no_text, "the action in row 40 is an empty text"),
    "words and numbers": (words_and_numbers, "'demo_2' holds other things than 'demo_0'"),
    "long texts side by side": (long_texts_side_by_side, "it unpacks to"),
    "two groups of episodes": (two_homes, "in each of its groups 'train', 'valid'"),
    "a filter that is not there": (other_filter, r"a filter that is not read \(number 32015\)"),
    "a bomb": (bomb, "unpacks to more than it says"),
    "nothing": (
        nothing,
        "it holds 'runs', 'runs' holds 'traj_9', 'traj_10', 'runs/traj_9' holds 'sensor', and "
        r"nowhere in it are observations \(which may be called .*'obs'.* beside .*'controls'",
    ),
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
        with pytest.raises(InputError, match=r"damaged|nowhere in it"):
            read_demonstrations(content[:end], "demo.hdf5")
