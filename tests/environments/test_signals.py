"""Failure and cost as a caller names them: by a key of info, a condition, a function."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from sarl_core import Environment, rollout
from sarl_core.environments.failures import failure_text
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import join

TOY = f"{__name__}:Ramp-v0"
CONDITION = "feature 0 > 2.5 and feature 0 < 3.5"


SILENT = object()
COSTS: dict[int, Any] = {}  # of the second step, by the seed


class Ramp(gymnasium.Env[Any, Any]):
    """Its first feature counts the steps; an episode has as many as its seed, and 4 more."""

    observation_space = gymnasium.spaces.Box(-100.0, 100.0, (2,), np.float32)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.steps, self.seed = 0, seed or 0
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.steps += 1
        info: dict[str, Any] = {"hot": self.steps == 3, "heat": 0.5, "word": "high"}
        info |= {"boxed": np.array([[0.5]]), "two": np.ones(2)}
        if self.steps > 5:
            info["late"] = True
        if (cost := COSTS.get(self.seed, SILENT)) is not SILENT:
            info["cost"] = cost if self.steps == 2 else 0.25
        return self._observation(), 1.0, self.steps == 4 + self.seed, False, info

    def _observation(self) -> Any:
        return np.array([self.steps, 0.0], dtype=np.float32)


gymnasium.register("Ramp-v0", Ramp)


def warm(observation: Any, action: Any, reward: float, terminated: bool, info: Any) -> bool:
    """The same as `hot` and the condition."""
    return bool(observation[0] == 3.0 and info["hot"] and reward == 1.0 and not terminated)


def broken(*_: Any) -> bool:
    raise RuntimeError("no lamp")


@pytest.mark.parametrize("failure", ["hot", CONDITION, f"{__name__}:warm"])
def test_a_failure_is_true_at_some_step_and_ends_nothing(failure: str) -> None:
    episodes = rollout(Environment(TOY, failure=failure), "novice", episodes=3)
    assert episodes.lengths.tolist() == [4, 5, 6]
    assert episodes.failed.all()
    assert episodes.steps is not None
    assert episodes.steps.observation[episodes.steps.failed, 0].tolist() == [2.0, 2.0, 2.0]
    assert [one["failed"] for one in episodes.to_dict()["episodes"]] == [True, True, True]
    assert join([episodes.part(0, 1), episodes.part(1, 3)]).failed.all()


@pytest.mark.parametrize(
    ("cost", "sums"),
    [
        ("heat", [2.0, 2.5, 3.0]),
        ("boxed", [2.0, 2.5, 3.0]),
        ("hot", [1.0, 1.0, 1.0]),
        ("feature 0 >= 2", [3.0, 4.0, 5.0]),
        ("feature 0 / 2", [5.0, 7.5, 10.5]),
        (f"{__name__}:warm", [1.0, 1.0, 1.0]),
    ],
)
def test_a_cost_is_summed_over_the_steps(cost: str, sums: list[float]) -> None:
    episodes = rollout(Environment(TOY, cost=cost), "novice", episodes=3)
    assert episodes.cost.tolist() == sums
    assert episodes.failures is None
    summary = episodes.summary()
    assert summary["cost"] == pytest.approx(np.mean(sums))
    assert ("cost_low" in summary) == (len(set(sums)) > 1)
    assert summary["cost_worst_tenth"] == max(sums)


def test_what_is_known_of_an_environment_gives_way_to_what_its_caller_says() -> None:
    cart = rollout(Environment("CartPole-v1", failure="cart position > 100"), "novice", episodes=3)
    assert cart.terminated.all()
    assert cart.failures is not None
    assert cart.failures.count == 0


def test_of_an_episode_cut_off_only_a_failure_that_was_seen_is_known() -> None:
    hot = rollout(Environment(TOY, failure="hot"), "novice", episodes=2, max_steps=3)
    assert hot.failed.all()
    assert not hot.undecided.any()
    later = rollout(Environment(TOY, failure="feature 0 > 3"), "novice", episodes=2, max_steps=3)
    assert later.undecided.all()
    assert [one["failed"] for one in later.to_dict()["episodes"]] == [None, None]


def test_what_cannot_be_said_of_a_step_stays_open() -> None:
    # 0/0 at every step, and true at the third in spite of it.
    open_end = rollout(Environment(TOY, failure="feature 1 / feature 1 > 0"), "novice", episodes=1)
    assert open_end.undecided.all()
    failed = rollout(
        Environment(TOY, failure="feature 1 / feature 1 > 0 or feature 0 >= 3"),
        "novice",
        episodes=1,
    )
    assert failed.failed.all()
    unpriced = rollout(Environment(TOY, cost="feature 1 / feature 1"), "novice", episodes=1)
    assert np.isnan(unpriced.cost).all()


@pytest.mark.parametrize(
    ("failure", "cost", "says"),
    [
        (
            "hott",
            "",
            "no step of the episode with seed 0 has 'hott' in its info, which holds boxed",
        ),
        ("late", "", "no step of the episode with seed 0 has 'late'"),
        ("word", "", r"info\['word'\] is 'high' at step 0 of the episode with seed 0"),
        ("", "two", r"info\['two'\] is .* at step 0 .* a cost is a number"),
        (f"{__name__}:broken", "", "at step 0 of the episode with seed 0 .*no lamp"),
        (f"{__name__}:nothing", "", "has no nothing"),
        (f"{__name__}:TOY", "", "cannot be called"),
        ("feature 7 > 1", "", "is no feature; did you mean"),
        ("", "feature 0", "write it in parentheses"),
        ("", "1 / (3 - feature 0)", "is infinite at step 2 of the episode with seed 0"),
    ],
)
def test_what_tells_nothing_is_one_sentence(failure: str, cost: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        rollout(Environment(TOY, failure=failure, cost=cost), "novice", episodes=3)


@pytest.mark.parametrize(
    ("cost", "what"),
    [
        ("high", "a text"),
        (None, "None"),
        (np.ones(2), "an array"),
        ([1.0, [2.0]], "an array"),
        (np.inf, "no finite number"),
        (np.nan, "no finite number"),
        ({}, "no finite number"),
    ],
)
def test_a_cost_that_cannot_be_read_is_noted_once_and_counts_nothing(
    cost: Any, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.COSTS", {0: 1.0, 1: cost, 2: cost})
    episodes = rollout(TOY, "novice", episodes=3, batch=1)
    assert episodes.cost[0] == 1.75
    assert np.isnan(episodes.cost[1:]).all()
    (note,) = [note for note in episodes.remarks if "cost" in note]
    assert note.startswith(f"the cost that the environment tells (info['cost']) is {what} and")
    assert episodes.to_dict()["notes"] == [note]
    assert join([episodes.part(0, 1), episodes.part(1, 3)]).remarks == (note,)
    monkeypatch.setattr(f"{__name__}.COSTS", {0: 1.0, 1: 1.0})
    first = rollout(TOY, "novice", episodes=2)
    assert not first.remarks
    assert join([first, episodes]).remarks == (note,)


def test_a_key_that_comes_late_is_enough() -> None:
    episodes = rollout(Environment(TOY, failure="late"), "novice", episodes=2, seed=2)
    assert episodes.failed.tolist() == [True, True]


def test_highway_env_says_itself_what_a_crash_is() -> None:
    env = Environment(
        "highway_env:highway-fast-v0",
        '{"config": {"vehicles_count": 8, "duration": 12}}',
        ("gymnasium.wrappers:FlattenObservation",),
    )
    episodes = rollout(env, "novice", episodes=4, seed=1)
    assert episodes.failures is not None
    assert episodes.failed.any()
    by_name = rollout(
        Environment(env.id, env.arguments, env.wrappers, failure="crashed"),
        "novice",
        episodes=4,
        seed=1,
    )
    assert by_name.failed.tolist() == episodes.failed.tolist()


def test_what_a_failure_is_can_be_said() -> None:
    assert failure_text("LunarLander-v3") == "an end with a last reward of -100"
    assert failure_text("CartPole-v1") == "an end that is no time limit"
    assert failure_text("MountainCar-v0") == failure_text("FrozenLake-v1") == ""
    named = Environment("FrozenLake-v1", failure="crashed")
    assert failure_text(named) == "a step at which crashed is true"
