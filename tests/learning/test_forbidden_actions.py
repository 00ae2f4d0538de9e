"""Learners under rules that forbid: they choose from what is left, and are taught to."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
import torch

from sarl_core import RuleSet, Shield, grow_policy_trees, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS
from sarl_core.learning.recipes import make_learner
from sarl_core.learning.replay_buffers import HandoverVecEnv
from sarl_core.mining.never.never_rules import mine_never_rules, with_never_rules
from sarl_core.shielding.leeway import allowed_actions

DATA = Path(__file__).parents[2] / "data"
LANDER = "LunarLander-v3"
STEPS = 512


@pytest.fixture(scope="module")
def forbidding() -> Shield:
    """Rules that forbid something in many states of a beginner, and never all."""
    return Shield(RuleSet.load(DATA / "rules" / "lunar_lander_never.json"))


@pytest.fixture(scope="module")
def mixed() -> Shield:
    """Rules that demand, and behind them rules that forbid."""
    trees = grow_policy_trees(load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet"))
    demanding = mine_rules(trees, supp_min=0.005, conf_min=0.9)
    return Shield(with_never_rules(demanding, trees, 0.1))


def one_rollout(
    arm: str, shield: Shield, env_id: str = LANDER, left_alone: int = 0
) -> tuple[Any, HandoverVecEnv]:
    """A learner after its first rollout, which has not been learned from."""
    learner, env = make_learner(env_id, shield, ARMS[arm], steps=STEPS, seed=3)
    assert isinstance(env, HandoverVecEnv)
    env.enforced[:left_alone] = False
    with patch.object(learner, "train"):
        learner.learn(STEPS, callback=lambda *_: not env.decision.intervened.any())
    assert learner.num_timesteps == STEPS  # nothing was changed, which would have ended it
    return learner, env


@pytest.mark.parametrize("arm", ["mask", "imitate", "handover"])
def test_it_samples_what_is_allowed_with_the_probability_of_that(
    arm: str, forbidding: Shield
) -> None:
    learner, _ = one_rollout(arm, forbidding)
    buffer = learner.rollout_buffer
    states = buffer.observations.reshape(-1, 8)
    allowed = allowed_actions(forbidding, states, 4)
    assert 0.02 < (~allowed).any(axis=1).mean() < 1
    np.testing.assert_array_equal(buffer.allowed.reshape(-1, 4), allowed)
    rows, chosen = np.arange(len(states)), buffer.actions.reshape(-1).astype(int)
    assert allowed[rows, chosen].all()
    with torch.no_grad():
        chances = learner.policy.get_distribution(torch.tensor(states)).distribution.probs.numpy()
    chances = np.where(allowed, chances, 0.0)
    expected = np.log(chances[rows, chosen] / chances.sum(axis=1))
    np.testing.assert_allclose(buffer.log_probs.reshape(-1), expected, rtol=1e-4, atol=1e-5)


def test_where_a_rule_demands_or_one_action_is_left_there_was_no_choice(mixed: Shield) -> None:
    learner, _ = one_rollout("mask", mixed)
    buffer = learner.rollout_buffer
    states = buffer.observations.reshape(-1, 8)
    left = allowed_actions(mixed, states, 4).sum(axis=1)
    assert {1, 2, 3} <= {*left.tolist()}
    np.testing.assert_array_equal(buffer.forced.reshape(-1), left == 1)
    demanded = mixed.rules_in_force(states)[:, 0]
    demanding = [index for index, rule in enumerate(mixed.rule_set) if not rule.forbids]
    assert (left[np.isin(demanded, demanding)] == 1).all()


def test_an_environment_that_is_left_alone_forbids_nothing_and_still_teaches(mixed: Shield) -> None:
    learner, _ = one_rollout("handover", mixed, left_alone=3)
    buffer = learner.rollout_buffer
    assert buffer.allowed[:, :3].all()
    assert not buffer.allowed[:, 3:].all()
    lessons = buffer.lessons
    states = buffer.observations.reshape(-1, 8)
    assert len(lessons) == (~allowed_actions(mixed, states, 4)).any(axis=1).sum()
    told = lessons.allowed[: len(lessons)]
    np.testing.assert_array_equal(
        told, allowed_actions(mixed, lessons.observations[: len(lessons)], 4)
    )


def forbidden_share(learner: Any, shield: Shield) -> float:
    """What an expert's states make the network propose that is forbidden there."""
    states = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet").observations
    states = states[::10].copy()
    with torch.no_grad():
        distribution = learner.policy.get_distribution(torch.as_tensor(states)).distribution
    chances = distribution.probs.numpy()
    return float(chances[~allowed_actions(shield, states, 4)].sum() / len(states))


def test_imitation_teaches_what_not_to_do_and_a_mask_alone_does_not(forbidding: Shield) -> None:
    taught = {}
    for arm in ("mask", "imitate"):
        learner, _ = make_learner(LANDER, forbidding, ARMS[arm], steps=4096, seed=0)
        before = forbidden_share(learner, forbidding)
        learner.learn(4096)
        taught[arm] = forbidden_share(learner, forbidding) / before
    assert taught["imitate"] < 0.75 < 0.9 < taught["mask"]


@pytest.mark.parametrize("arm", ["override", "executed", "imitate", "handover"])
def test_continuous_actions_are_learned_where_some_are_forbidden(arm: str) -> None:
    shown = load_demonstrations(DATA / "demonstrations" / "pendulum.parquet")
    shield = Shield(mine_never_rules(shown, epsilon=0.1, supp_min=0.01, divider=5))
    learner, env = make_learner("Pendulum-v1", shield, ARMS[arm], steps=STEPS, seed=0)
    before = learner.policy.action_net.weight.detach().clone()
    learner.learn(STEPS)
    assert isinstance(env, HandoverVecEnv)
    assert env.choices is None
    assert not torch.equal(before, learner.policy.action_net.weight)
