"""One learner, one seed: the record it leaves, how it is tried, and that it stops and goes on."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from sarl_core import InputError, RuleSet, WorkError, load_demonstrations, mine_rules, rollout
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.learning.arms import ARMS
from sarl_core.learning.curves import LearningEpisodes
from sarl_core.learning.run import LearningResult, learn
from sarl_core.progress import CancelledError

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
STEPS = 480
Learn = Callable[..., LearningResult]


@pytest.fixture(scope="module")
def cart_rules() -> RuleSet:
    """One rule only: episodes end early under it too."""
    mined = mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.9)
    return replace(mined, rules=mined.rules[:1])


@pytest.fixture
def cart(cart_rules: RuleSet, monkeypatch: pytest.MonkeyPatch) -> Learn:
    """Learn CartPole for a moment, and look at it very often."""
    monkeypatch.setattr("sarl_core.learning.recorder._REPORTED_EVERY", 0.0)

    def call(arm: str, **settings: object) -> LearningResult:
        given = {"steps": STEPS, "episodes": 2, "seed": 5} | settings
        return learn("CartPole-v1", cart_rules, ARMS[arm], **given)  # type: ignore[arg-type]

    return call


@pytest.mark.parametrize("arm", list(ARMS))
def test_every_arm_leaves_a_record_and_a_policy(cart: Learn, arm: str, tmp_path: Path) -> None:
    result = cart(arm)
    curve = result.curve
    assert len(curve) > 0
    assert curve.ends[-1] <= STEPS
    assert curve.lengths.sum() <= STEPS
    assert (curve.lengths == curve.returns).all()  # a point a step, and no penalty in it
    assert curve.crashed.all()  # within so few steps nobody lasts for 500
    assert (curve.interventions <= curve.covered).all()
    assert (curve.covered <= curve.lengths).all()
    if arm in ("none", "none-replay"):
        assert not curve.shielded.any()
        assert curve.covered.sum() == 0
    else:
        assert curve.shielded.all() == (arm != "handover")
        assert curve.covered[curve.shielded].sum() > 0
    assert result.shielded is not None
    assert len(result.shielded.returns) == len(result.alone.returns) == 2
    path = tmp_path / "learned.npz"
    result.policy.save(path)
    again = rollout("CartPole-v1", path, episodes=2, seed=9_000_000)
    assert tuple(again.returns) == result.alone.returns
    assert MlpPolicy.load(path).env_id == "CartPole-v1"


def test_a_crash_in_lunar_lander_is_not_a_landing() -> None:
    result = learn("LunarLander-v3", None, ARMS["none"], steps=1500, episodes=1)
    crashed = result.curve.crashed
    assert crashed.any()
    assert (result.curve.returns[crashed] < 100).all()


def test_the_same_arguments_give_the_same_result(cart: Learn) -> None:
    one, other = cart("handover"), cart("handover")
    assert one.curve.to_dict() == other.curve.to_dict()
    assert one.alone == other.alone
    assert cart("handover", seed=6).curve.to_dict() != one.curve.to_dict()


def test_a_handed_over_policy_samples_as_decidedly_as_it_learned(cart: Learn) -> None:
    result = cart("handover")
    sharpness = ARMS["handover"].sharpness
    states = np.random.default_rng(0).normal(size=(200, 4)).astype(np.float32)
    drawn = np.full((200, 1), 0.5)
    hidden = states
    for weight, bias in zip(result.policy.weights[:-1], result.policy.biases[:-1], strict=True):
        hidden = np.tanh(hidden @ weight + bias)
    logits = hidden @ result.policy.weights[-1] + result.policy.biases[-1]
    assert np.array_equal(result.policy.act(states, drawn)[:, 0], logits[:, 1] >= logits[:, 0])
    assert sharpness > 1


class StopAfter:
    """Lets a learner go on until it has made some steps."""

    def __init__(self, steps: int) -> None:
        self.steps, self.seen = steps, 0

    def __call__(self, done: int, total: int) -> bool:
        self.seen = done
        return done < self.steps


@pytest.mark.parametrize("arm", ["none", "handover", "replay"])
def test_a_stopped_learner_goes_on(cart: Learn, arm: str, tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.pt"
    with pytest.raises(CancelledError, match="stopped after"):
        cart(arm, checkpoint=checkpoint, progress=StopAfter(200))
    curves: list[LearningEpisodes] = []
    steps: list[int] = []

    def watch(curve: LearningEpisodes, done: int) -> None:
        curves.append(curve)
        steps.append(done)

    result = cart(arm, checkpoint=checkpoint, watch=watch)
    assert 200 <= steps[0] < STEPS
    assert result.sittings == 2
    assert len(curves[0]) > 0
    kept = curves[0].to_dict()
    assert {
        name: column[: len(curves[0])] for name, column in result.curve.to_dict().items()
    } == kept
    assert (np.diff(result.curve.ends) >= 0).all()
    assert STEPS - 100 < result.curve.ends[-1] <= STEPS


def test_a_learner_stopped_in_its_trials_does_not_learn_again(cart: Learn, tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.pt"
    after = iter([True, True, False])  # the last step, the end of learning, the first trial
    with pytest.raises(CancelledError):
        cart(
            "none", checkpoint=checkpoint, progress=lambda done, total: done < total or next(after)
        )
    whole = cart("none")
    assert cart("none", checkpoint=checkpoint).alone == whole.alone


def test_what_an_off_policy_learner_remembers_is_kept(cart: Learn, tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.pt"
    with pytest.raises(CancelledError):
        cart("replay", checkpoint=checkpoint, progress=StopAfter(200))
    kept = torch.load(checkpoint, weights_only=True)["memory"]["replay"]
    assert len(kept["actions"]) == kept["pos"] >= 199
    assert kept["observations"].any()


def test_a_checkpoint_of_another_run_is_refused(cart: Learn, tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.pt"
    with pytest.raises(CancelledError):
        cart("none", checkpoint=checkpoint, progress=StopAfter(100))
    with pytest.raises(InputError, match=r"another run \(its seed"):
        cart("none", checkpoint=checkpoint, seed=6)
    with pytest.raises(InputError, match=r"another run \(its arm and rules"):
        cart("override", checkpoint=checkpoint)


class Payload:
    """What a pickle would run."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return os.mkdir, (str(self.trace),)


@pytest.mark.parametrize("kind", ["pickle", "torch", "text", "other", "version", "part"])
def test_a_damaged_checkpoint_is_refused_and_never_run(
    cart: Learn, tmp_path: Path, kind: str
) -> None:
    checkpoint, trace = tmp_path / "run.pt", tmp_path / "trace"
    with pytest.raises(CancelledError):
        cart("none", checkpoint=checkpoint, progress=StopAfter(100))
    document = torch.load(checkpoint, weights_only=True)
    if kind == "pickle":
        checkpoint.write_bytes(pickle.dumps(Payload(trace), protocol=2))
    elif kind == "torch":
        torch.save({**document, "memory": Payload(trace)}, checkpoint)
    elif kind == "text":
        checkpoint.write_text("nothing")
    elif kind == "other":
        torch.save({"weights": torch.zeros(3)}, checkpoint)
    elif kind == "version":
        torch.save({**document, "version": 99}, checkpoint)
    else:
        torch.save({name: document[name] for name in document if name != "curve"}, checkpoint)
    with pytest.raises(InputError, match=r"run\.pt") as caught:
        cart("none", checkpoint=checkpoint)
    assert "\n" not in str(caught.value)
    assert not trace.exists()


def test_a_full_disk_is_said(cart: Learn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise RuntimeError("[enforce fail at inline_container.cc:668] . unexpected pos 64 vs 0")

    monkeypatch.setattr("torch.save", full)
    with pytest.raises(WorkError, match="make room"):
        cart("none", checkpoint=tmp_path / "run.pt")
    assert not list(tmp_path.iterdir())


def test_the_last_steps_are_learned_from_too(cart: Learn, monkeypatch: pytest.MonkeyPatch) -> None:
    learned_from: list[int] = []
    monkeypatch.setattr(
        "stable_baselines3.PPO.train", lambda self: learned_from.append(self.num_timesteps)
    )
    cart("none", steps=800)
    assert learned_from == [400, 800]


def test_a_learner_that_diverged_is_said(cart: Learn, monkeypatch: pytest.MonkeyPatch) -> None:
    def diverge(self: PPO) -> None:
        self.policy.action_net.weight.data.fill_(float("nan"))

    monkeypatch.setattr("stable_baselines3.PPO.train", diverge)
    with pytest.raises(WorkError, match="diverged"):
        cart("none")


@pytest.mark.parametrize(("name", "value"), [("steps", 0), ("episodes", 0), ("seed", -1)])
def test_numbers_out_of_range_are_refused(cart: Learn, name: str, value: int) -> None:
    with pytest.raises(InputError, match=f"{name} is {value}"):
        cart("none", **{name: value})
