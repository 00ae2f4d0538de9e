from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import ActionDimension, Demonstrations, Feature
from sarl_core.errors import InputError
from tests.demonstrations.strategies import SPACES, demonstrations


def example(**changes: Any) -> Demonstrations:
    fields: dict[str, Any] = {
        "observations": np.arange(10).reshape(5, 2),
        "actions": np.array([0, 1, 0, 2, 0]),
        "episodes": np.array([4, 4, 7, 7, 7]),
        "rewards": np.array([1.0, 2, 3, 4, 5]),
    }
    return Demonstrations(**fields | changes)


def test_what_is_not_given_is_filled_in() -> None:
    got = example()
    assert got.observations.dtype == np.float32
    assert got.actions.dtype == np.int64
    assert got.steps is not None
    assert got.steps.tolist() == [0, 1, 0, 1, 2]
    assert got.features == (Feature("feature 0"), Feature("feature 1"))
    assert got.action_dimensions == (ActionDimension("action", "discrete", labels=("0", "1", "2")),)
    assert (got.env_id, got.agent, got.seed, got.notes) == ("", "", None, ())
    assert len(got) == 5


def test_continuous_actions_have_bounds() -> None:
    got = example(actions=np.array([0.5, -1, 0, 2, 0]))
    assert got.actions.shape == (5, 1)
    assert got.actions.dtype == np.float32
    assert got.action_dimensions == (
        ActionDimension("action", "interval", low=-1, high=2, bounds_from="demonstrated values"),
    )
    given_bounds = example(actions=np.zeros((5, 2)), action_low=(-1, 0), action_high=(1, 3))
    assert given_bounds.bounds_from == "action space"
    assert [d.high for d in given_bounds.action_dimensions] == [1, 3]


def test_whole_numbers_with_bounds_are_continuous() -> None:
    got = example(action_low=(-1.0,), action_high=(2.0,))
    assert not got.is_discrete
    assert got.actions.tolist() == [[0], [1], [0], [2], [0]]


def test_unbounded_dimensions_take_the_demonstrated_values() -> None:
    got = example(
        actions=np.array([[0.5, 3]] * 4 + [[1, 4]]),
        action_low=(-np.inf, -9),
        action_high=(np.inf, 9),
    )
    assert got.action_low == (0.5, -9)
    assert got.action_high == (1, 9)
    assert got.bounds_from == "demonstrated values"
    with pytest.raises(InputError, match=r"'action 1' is 4\.0 in row 5"):
        example(
            actions=np.array([[0.5, 3]] * 4 + [[1, 4]]),
            action_low=(-np.inf, 0),
            action_high=(np.inf, 3),
        )


def test_nothing_can_be_changed() -> None:
    observations = np.arange(10, dtype=np.float32).reshape(5, 2)
    got = example(observations=observations)
    observations[:] = -1
    assert got.observations[4, 1] == 9
    for array in (got.observations, got.actions, got.episodes, got.steps, got.rewards):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(FrozenInstanceError):
        got.agent = "x"  # type: ignore[misc]


def test_a_read_only_view_of_a_changing_array_is_copied() -> None:
    observations = np.arange(10, dtype=np.float32).reshape(5, 2)
    view = observations.view()
    view.flags.writeable = False
    got = example(observations=view)
    observations[:] = -1
    assert got.observations[4, 1] == 9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observations": np.zeros((0, 2))}, "no steps"),
        ({"observations": np.zeros((5, 0))}, "no features"),
        ({"observations": np.zeros((1, 2))}, "one observation only"),
        ({"observations": np.zeros(5)}, "a table"),
        ({"observations": np.zeros((5, 4, 4))}, "4x4 look like images"),
        ({"observations": np.zeros((5, 5000))}, "5,000 features"),
        ({"observations": np.array([["a", "b"]] * 5)}, "observations must be numbers"),
        ({"observations": [[1, 2], [3]]}, "observations must have the same length"),
        ({"observations": np.diag([1, 1, np.nan, 1, 1])}, "'feature 2' is not a number .* row 3"),
        ({"observations": np.diag([1, 1, 1, 1e300, 1])}, "'feature 3' is infinite in row 4"),
        ({"actions": np.zeros(0)}, "0 actions for 5 observations"),
        ({"actions": np.zeros(4, int)}, "4 actions for 5 observations"),
        ({"actions": np.zeros((5, 0))}, "no action columns"),
        ({"actions": np.zeros((5, 1, 1))}, "one number or one vector"),
        ({"actions": np.zeros(5, complex)}, "actions must be numbers"),
        ({"actions": np.array(["a", None, "a", "a", "b"], object)}, "1 of 5 actions .* row 2"),
        (
            {"actions": np.array(["a"] * 5), "label_names": (("b", "c"),)},
            "'a', which is none of the actions of the action space, 'b', 'c'",
        ),
        ({"actions": np.array([0, 1, -(2**32), 0, 0])}, "'action' is -4294967296 in row 3"),
        (
            {"actions": np.array([0, 1, 9, 0, 0]), "label_names": (("a", "b"),)},
            "'action' is 9 in row 3",
        ),
        (
            {
                "actions": np.array([4, 9, 5, 4, 4]),
                "label_names": (("a", "b"),),
                "label_codes": ((4, 9),),
            },
            "'action' is 5 in row 3, which is none of its 2 labels",
        ),
        ({"actions": np.full(5, 2**64 - 1, np.uint64)}, "too large for a label"),
        ({"actions": np.array([0, np.nan, 0, 0, 0])}, "'action' is not a number .* row 2"),
        ({"actions": np.zeros(5), "label_names": (("a",),)}, "whole numbers of an integer type"),
        ({"label_names": (("a", "b"),)}, "'action' is 2 in row 4, .* 0 to 1"),
        ({"label_names": (("a", "b", "c"),) * 2}, "2 lists of label names for 1 action"),
        ({"label_first": (0, 0)}, "2 first labels for 1 action"),
        ({"actions": np.ones(5), "action_low": (0,)}, "one bound"),
        ({"actions": np.ones(5), "action_low": (3,), "action_high": (2,)}, "no interval"),
        ({"actions": np.ones(5), "action_low": (0, 0), "action_high": (2, 2)}, "2 lower bounds"),
        (
            {"actions": np.ones(5), "action_low": (2,), "action_high": (3,)},
            "'action' is 1.0 in row 1",
        ),
        ({"episodes": np.zeros(4, int)}, "4 values in column 'episode' for 5"),
        ({"episodes": np.array([0, 0, 1, 1, 0])}, "'episode' comes back to 0 in row 5"),
        ({"episodes": np.array([0, 0, 1, 1, -1])}, "'episode' is -1 in row 5"),
        ({"episodes": np.array([0, 0.5, 1, 1, 2])}, "'episode' is 0.5 in row 2"),
        (
            {"episodes": np.array([0, 0, 1, 1, 2**63], np.uint64)},
            "'episode' is 9223372036854775808",
        ),
        ({"episodes": np.zeros((5, 1))}, "'episode' must hold one number"),
        ({"steps": np.array([0, 1, 0, 0, 1])}, "'step' goes from 0 to 0 in row 4 within episode 7"),
        ({"rewards": np.array([0, 1, np.inf, 0, 0])}, "'reward' is infinite in row 3"),
        ({"rewards": np.zeros(2)}, "2 values in column 'reward'"),
        ({"terminated": np.array([0, 1, 2, 0, 0])}, "'terminated' is 2 in row 3"),
        ({"truncated": np.array([0, 1, np.nan, 0, 0])}, "'truncated' is not a number .* row 3"),
        ({"feature_names": ("x",)}, "1 feature names for 2 features"),
        ({"feature_names": ("x", "x")}, "'x' stands twice"),
        ({"feature_names": ("x", "")}, "feature 1 has an empty name"),
        ({"feature_units": ("m",)}, "1 feature units for 2 features"),
        ({"action_names": ("a", "b")}, "2 action names for 1 actions"),
    ],
)
def test_what_is_inconsistent_is_refused_in_one_sentence(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as error:
        example(**changes)
    assert "\n" not in str(error.value)


def test_episodes_and_returns() -> None:
    got = example()
    assert got.n_episodes == 2
    assert got.episode_starts.tolist() == [0, 2]
    assert got.episode_lengths.tolist() == [2, 3]
    assert got.episode_returns is not None
    assert got.episode_returns.tolist() == [3, 12]
    assert example(rewards=None).episode_returns is None
    assert got.episode_finished is None
    ended = example(terminated=np.array([0, 1, 0, 0, 0]), truncated=np.array([0, 0, 1, 0, 0]))
    assert ended.episode_finished is not None
    assert ended.episode_finished.tolist() == [True, False]


def test_summary() -> None:
    summary = example().summary()
    assert (summary.steps, summary.episodes, summary.features) == (5, 2, 2)
    assert summary.action_dimensions == 1
    assert summary.length_mean == 2.5
    assert summary.return_mean == 7.5
    assert summary.return_std == pytest.approx(np.std([3, 12], ddof=1))
    assert summary.label_shares == ((0.6, 0.2, 0.2),)
    unfinished = example(terminated=np.array([0, 1, 0, 0, 0])).summary()
    assert (unfinished.return_mean, unfinished.return_std) == (3, None)
    continuous = example(actions=np.ones(5), rewards=None).summary()
    assert continuous.label_shares == ((),)
    assert continuous.return_mean is None


def test_select_keeps_whole_episodes_and_the_spaces() -> None:
    got = example(terminated=np.zeros(5, bool)).select([7])
    assert got.observations.tolist() == [[4, 5], [6, 7], [8, 9]]
    assert got.actions.tolist() == [0, 2, 0]
    assert got.steps is not None
    assert got.steps.tolist() == [0, 1, 2]
    assert example().select([4]).label_names == (("0", "1", "2"),)
    continuous = example(actions=np.arange(5.0))
    assert continuous.select([4]).action_high == continuous.action_high
    assert example().select([4, 7]).digest == example().digest


@pytest.mark.parametrize(("wanted", "message"), [([5], "no episode 5"), ([], "no episode is")])
def test_select_what_there_is(wanted: list[int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        example().select(wanted)


@pytest.mark.parametrize(
    "changes",
    [
        {"observations": np.arange(1, 11).reshape(5, 2)},
        {"actions": np.array([0, 1, 0, 2, 1])},
        {"episodes": np.array([4, 4, 4, 7, 7])},
        {"steps": np.array([0, 1, 0, 1, 3])},
        {"rewards": None},
        {"rewards": np.zeros(5)},
        {"terminated": np.zeros(5)},
        {"feature_names": ("a", "b")},
        {"feature_units": ("m", "")},
        {"action_names": ("a",)},
        {"label_names": (("a", "b", "c"),)},
        {"env_id": "X-v0"},
        {"agent": "x"},
        {"seed": 1},
        {"notes": ("read",)},
        {"actions": np.array([[0], [1], [0], [2], [0]])},
    ],
)
def test_digest_tells_everything_apart(changes: dict[str, Any]) -> None:
    assert example().digest == example().digest
    assert example(**changes).digest != example().digest
    assert len(example().digest) == 32


def test_flags_of_two_kinds_are_told_apart() -> None:
    flags = np.array([0, 1, 0, 0, 1])
    assert example(terminated=flags).digest != example(truncated=flags).digest


def test_repr_shows_shapes() -> None:
    text = repr(example(env_id="CartPole-v1"))
    for part in (
        "CartPole-v1",
        "observations=float32[5, 2]",
        "actions=int64[5]",
        "n_episodes=2",
        example(env_id="CartPole-v1").digest[:12],
    ):
        assert part in text
    assert "truncated" not in text


@pytest.mark.parametrize("space", SPACES)
@settings(max_examples=10)
@given(data=st.data())
def test_rebuilding_changes_nothing(space: str, data: st.DataObject) -> None:
    got = data.draw(demonstrations(space))
    assert replace(got).digest == got.digest


def test_far_too_many_labels_are_refused_whoever_names_them() -> None:
    named = {"label_names": [[str(i) for i in range(200_000)]]}
    with pytest.raises(InputError, match=r"200,000 labels"):
        Demonstrations(np.zeros((2, 1)), np.zeros((2, 1), int), np.zeros(2, int), **named)
    n = 20_000
    with pytest.raises(InputError, match=r"20,000 different whole numbers, more than the 10,000"):
        Demonstrations(np.zeros((n, 1)), np.arange(n), np.zeros(n, int))
