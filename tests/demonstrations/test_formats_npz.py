from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.errors import InputError
from tests.bad_inputs import good_arrays, npz_bytes


def lengths_and_steps() -> tuple[list[int], np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Three episodes, their observations (one more than actions each) and actions."""
    lengths = [3, 1, 4]
    observations = np.concatenate(
        [100 * episode + np.arange(length + 1) for episode, length in enumerate(lengths)]
    )[:, None].astype(np.float32)
    return lengths, observations, np.array([0, 1, 0, 1, 1, 0, 1, 0])


EXPECTED = [0, 1, 2, 100, 200, 201, 202, 203]


def test_half_precision_is_read_everywhere() -> None:
    arrays = {name: values.astype(np.float16) for name, values in good_arrays().items()}
    read = read_demonstrations(npz_bytes(**arrays, rewards=np.ones(5, np.float16)), "demo.npz")
    assert read.actions.tolist() == [0, 1, 0, 1, 1]
    assert read.episodes.tolist() == [0, 0, 0, 1, 1]
    assert read.rewards is not None
    assert read.rewards.dtype == np.float64


def test_layout_of_imitation() -> None:
    lengths, observations, actions = lengths_and_steps()
    demonstrations = read_demonstrations(
        npz_bytes(
            obs=observations,
            acts=actions,
            indices=np.cumsum(lengths)[:-1],
            terminal=np.array([True, False, True]),
            rews=np.arange(8.0),
            infos=np.array([{}] * 8, dtype=object),
        ),
        "demo.npz",
    )
    assert demonstrations.observations[:, 0].tolist() == EXPECTED
    assert demonstrations.actions.tolist() == actions.tolist()
    assert demonstrations.episode_lengths.tolist() == lengths
    assert demonstrations.terminated is not None
    assert np.flatnonzero(demonstrations.terminated).tolist() == [2, 7]
    assert demonstrations.rewards is not None
    assert demonstrations.rewards.tolist() == list(range(8))
    assert any("dropped" in note for note in demonstrations.notes)


def test_layout_of_stable_baselines() -> None:
    starts = np.array([1, 0, 0, 1, 1, 0, 0, 0], bool)
    demonstrations = read_demonstrations(
        npz_bytes(
            obs=np.array(EXPECTED, float)[:, None],
            actions=np.array([[0, 1, 0, 1, 1, 0, 1, 0]]).T,
            rewards=np.ones((8, 1)),
            episode_returns=np.array([3.0, 1, 4]),
            episode_starts=starts,
        ),
        "demo.npz",
    )
    assert demonstrations.actions.shape == (8,)
    assert demonstrations.episode_lengths.tolist() == [3, 1, 4]
    assert demonstrations.episode_returns is not None
    assert demonstrations.episode_returns.tolist() == [3, 1, 4]


@pytest.mark.parametrize("extra", [False, True])
def test_layout_of_d4rl(extra: bool) -> None:
    _, observations, _ = lengths_and_steps()
    ends = np.array([0, 0, 1, 0, 0, 0, 0, 1])
    timeouts = np.array([0, 0, 0, 1, 0, 0, 0, 0], bool)
    demonstrations = read_demonstrations(
        npz_bytes(
            observations=observations if extra else np.array(EXPECTED, float)[:, None],
            actions=np.linspace(-1, 1, 16).reshape(8, 2),
            terminals=ends,
            timeouts=timeouts,
        ),
        "demo.npz",
    )
    assert demonstrations.observations[:, 0].tolist() == EXPECTED
    assert demonstrations.episode_lengths.tolist() == [3, 1, 4]
    assert demonstrations.actions.dtype == np.float32
    assert demonstrations.actions.shape == (8, 2)
    assert demonstrations.truncated is not None
    assert np.flatnonzero(demonstrations.truncated).tolist() == [3]


def test_one_episode_with_its_last_observation() -> None:
    demonstrations = read_demonstrations(
        npz_bytes(obs=np.arange(6.0)[:, None], acts=np.array([0, 1, 0, 1, 0])), "demo.npz"
    )
    assert demonstrations.observations[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert len(demonstrations.notes) == 2


def test_environment_decides_and_names() -> None:
    demonstrations = read_demonstrations(
        npz_bytes(obs=np.zeros((3, 4)), acts=np.array([[0.0], [1.0], [1.0]])),
        "demo.npz",
        env_id="CartPole-v1",
    )
    assert demonstrations.actions.tolist() == [0, 1, 1]
    assert demonstrations.feature_names is not None
    assert demonstrations.feature_names[0] == "cart position"


def test_floats_are_continuous() -> None:
    demonstrations = read_demonstrations(
        npz_bytes(obs=np.zeros((3, 4)), acts=np.array([0.5, 1.0, 1.0], np.float32)), "demo.npz"
    )
    assert demonstrations.actions.shape == (3, 1)
    assert not demonstrations.is_discrete
    assert demonstrations.bounds_from == "demonstrated values"


@pytest.mark.parametrize(
    ("arrays", "fragment"),
    [
        ({"indices": np.array([2, 2])}, "'indices'"),
        ({"indices": np.array([9])}, "'indices'"),
        ({"indices": np.array([0.5])}, "'indices'"),
        ({"indices": np.array([1], np.uint8)}, ""),
        ({"episode_starts": np.array([1, 0])}, "'episode_starts'"),
        ({"episode_starts": np.full(5, 7)}, "'episode_starts'"),
        ({"terminals": np.zeros(3)}, "'terminals'"),
        ({"rewards": np.zeros((5, 2))}, "'rewards'"),
        ({"rewards": np.array([0, 0, np.inf, 0, 0])}, "'rewards' is infinite in row 3"),
        ({"actions": np.array(3)}, "single number"),
        ({"actions": np.zeros((5, 0))}, "no steps"),
        ({"observations": np.zeros((5, 0))}, "no steps"),
        ({"observations": np.zeros(5, complex)}, "no numbers"),
        ({"observations": np.zeros((5, 4, 2))}, "as images"),
        (
            {"observations": np.zeros((5, 4, 2)), "actions": np.zeros((5, 4))},
            "episodes side by side, of shape 5x4x2",
        ),
    ],
)
def test_bad_layouts(arrays: dict[str, Any], fragment: str) -> None:
    given = {key: value for key, value in good_arrays().items() if key != "episodes"}
    content = npz_bytes(**given | arrays)
    if not fragment:
        assert read_demonstrations(content, "demo.npz").episodes.tolist() == [0, 1, 1, 1, 1]
        return
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "demo.npz")
    assert str(error.value).startswith("demo.npz: ")
    assert fragment in str(error.value)
