"""What learners are told: what was executed, where they had no choice, what the rules said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS
from sarl_core.learning.learners import DecidedPolicy, MaskedPPO
from sarl_core.learning.recipes import make_learner
from sarl_core.learning.replay_buffers import HandoverVecEnv, Lessons, ShieldedRolloutBuffer
from sarl_core.shielding.shield import Shield

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
STEPS = 512


def rules(name: str, support: float, confidence: float, divider: int = 2) -> RuleSet:
    return mine_rules(
        load_demonstrations(DATA / f"{name}.parquet"),
        supp_min=support,
        conf_min=confidence,
        divider=divider,
    )


@pytest.fixture(scope="module")
def everywhere() -> Shield:
    """Rules that speak in every state of CartPole."""
    return Shield(rules("cartpole", 0.005, 0.8))


@pytest.fixture(scope="module")
def here_and_there() -> Shield:
    """Rules that speak in most states of CartPole."""
    return Shield(rules("cartpole", 0.005, 0.9))


class Watching(BaseCallback):
    """Keeps what the environments and the shield made of every step."""

    def __init__(self, env: HandoverVecEnv) -> None:
        super().__init__()
        self.env = env
        self.observations: list[NDArray[Any]] = []
        self.executed: list[NDArray[Any]] = []
        self.proposed: list[NDArray[Any]] = []
        self.covered: list[NDArray[Any]] = []

    def _on_step(self) -> bool:
        records = [info["shield"] for info in self.locals["infos"]]
        self.observations.append(np.array([record.observation for record in records]))
        self.executed.append(np.array([record.executed for record in records]))
        self.proposed.append(np.array([record.proposed for record in records]))
        self.covered.append(np.array([record.rules[0] is not None for record in records]))
        return True


def one_rollout(arm: str, shield: Shield, env_id: str = "CartPole-v1") -> tuple[Any, Watching]:
    """A learner after its first rollout, which has not been learned from."""
    learner, env = make_learner(env_id, shield, ARMS[arm], steps=STEPS, seed=3)
    watching = Watching(env)
    learner.train = lambda *args, **kwargs: None
    learner.learn(STEPS, callback=watching)
    return learner, watching


@pytest.mark.parametrize("arm", ["executed", "mask", "imitate"])
def test_the_rollout_holds_what_was_executed(arm: str, here_and_there: Shield) -> None:
    learner, seen = one_rollout(arm, here_and_there)
    buffer = learner.rollout_buffer
    np.testing.assert_array_equal(buffer.actions[:, :, 0], np.array(seen.executed))
    assert (np.array(seen.proposed) != np.array(seen.executed)).any()


def test_with_plain_override_it_holds_what_was_proposed(here_and_there: Shield) -> None:
    learner, seen = one_rollout("override", here_and_there)
    np.testing.assert_array_equal(learner.rollout_buffer.actions[:, :, 0], np.array(seen.proposed))


def test_the_executed_action_comes_with_its_own_probability(here_and_there: Shield) -> None:
    learner, _ = one_rollout("executed", here_and_there)
    buffer = learner.rollout_buffer
    observations = torch.as_tensor(buffer.observations.reshape(-1, 4))
    with torch.no_grad():
        logits = learner.policy.action_net(learner.policy.mlp_extractor.forward_actor(observations))
        chances = torch.log_softmax(logits, dim=1).numpy()
    rows = np.arange(len(chances))
    expected = chances[rows, buffer.actions.reshape(-1).astype(int)]
    np.testing.assert_allclose(buffer.log_probs.reshape(-1), expected, rtol=1e-4, atol=1e-5)


def test_where_a_rule_speaks_there_was_no_choice(here_and_there: Shield) -> None:
    learner, seen = one_rollout("mask", here_and_there)
    np.testing.assert_array_equal(learner.rollout_buffer.forced, np.array(seen.covered))
    assert 0 < learner.rollout_buffer.forced.mean() < 1


def network(learner: Any) -> dict[str, torch.Tensor]:
    """The part of the weights that chooses actions."""
    return {
        name: value.clone()
        for name, value in learner.policy.state_dict().items()
        if "policy_net" in name or "action_net" in name
    }


def test_masked_everywhere_there_is_nothing_to_learn(everywhere: Shield) -> None:
    learner, _ = make_learner("CartPole-v1", everywhere, ARMS["mask"], steps=STEPS, seed=0)
    before = network(learner)
    values = learner.policy.value_net.weight.detach().clone()
    learner.learn(STEPS)
    assert all(torch.equal(before[name], value) for name, value in network(learner).items())
    assert not torch.equal(values, learner.policy.value_net.weight)


def agreement(learner: Any, shield: Shield) -> float:
    """How often the network's best action is the rule's, in states of the demonstrations."""
    states = load_demonstrations(DATA / "cartpole.parquet").observations[::10]
    chosen, _ = learner.policy.predict(states, deterministic=True)
    return 1.0 - float(shield.decide_batch(states, chosen).intervened.mean())


def test_imitation_teaches_what_the_rules_say(everywhere: Shield) -> None:
    learner, _ = make_learner("CartPole-v1", everywhere, ARMS["imitate"], steps=8192, seed=0)
    if agreement(learner, everywhere) > 0.5:  # fresh weights may agree by luck
        learner.policy.action_net.weight.data.neg_()
    assert agreement(learner, everywhere) < 0.5
    learner.learn(8192)
    assert agreement(learner, everywhere) > 0.9


def test_an_environment_that_is_left_alone_is_left_alone_and_still_teaches(
    everywhere: Shield,
) -> None:
    learner, env = make_learner("CartPole-v1", everywhere, ARMS["handover"], steps=STEPS, seed=1)
    assert isinstance(env, HandoverVecEnv)
    env.enforced[:3] = False
    watching = Watching(env)
    learner.train = lambda: None  # type: ignore[method-assign]
    learner.learn(STEPS, callback=watching)
    proposed, executed = np.array(watching.proposed), np.array(watching.executed)
    np.testing.assert_array_equal(proposed[:, :3], executed[:, :3])
    assert (proposed[:, 3:] != executed[:, 3:]).any()
    assert not np.array(watching.covered)[:, :3].any()
    buffer = learner.rollout_buffer
    assert isinstance(buffer, ShieldedRolloutBuffer)
    assert not buffer.forced[:, :3].any()
    assert buffer.forced[:, 3:].all()
    assert len(buffer.lessons) == buffer.forced.size  # the rules were asked everywhere
    told = everywhere.decide_batch(
        buffer.lessons.observations[: len(buffer.lessons)],
        buffer.lessons.actions[: len(buffer.lessons), 0].astype(np.int64),
    )
    assert not told.intervened.any()


@pytest.mark.parametrize("arm", ["none", "override", "penalty", "executed", "imitate", "handover"])
def test_ppo_learns_continuous_actions_under_a_shield(arm: str) -> None:
    shield = Shield(rules("pendulum", 0.0, 0.9, divider=5))
    learner, _ = make_learner(
        "Pendulum-v1", shield if ARMS[arm].shielded else None, ARMS[arm], steps=STEPS, seed=0
    )
    before = network(learner)
    learner.learn(STEPS)
    assert not all(torch.equal(before[name], value) for name, value in network(learner).items())


def test_a_continuous_action_that_was_replaced_is_a_lesson_and_one_within_is_not() -> None:
    shield = Shield(rules("pendulum", 0.0, 0.9, divider=5))
    learner, seen = one_rollout("imitate", shield, "Pendulum-v1")
    replaced = (np.array(seen.proposed) != np.array(seen.executed))[:, :, 0]
    np.testing.assert_array_equal(learner.rollout_buffer.forced, replaced)
    lessons = learner.rollout_buffer.lessons
    assert len(lessons) == replaced.sum() > 0
    assert lessons.taught[: len(lessons)].all()


def test_dqn_remembers_the_executed_action(everywhere: Shield) -> None:
    learner, seen = one_rollout("replay", everywhere)
    executed = np.array(seen.executed)[:, 0]
    np.testing.assert_array_equal(learner.replay_buffer.actions[:STEPS, 0, 0], executed)
    assert (np.array(seen.proposed)[:, 0] != executed).any()


def test_sac_remembers_the_executed_action_in_its_own_scale() -> None:
    shield = Shield(rules("pendulum", 0.0, 0.9, divider=5))
    learner, seen = one_rollout("replay", shield, "Pendulum-v1")
    executed = np.array(seen.executed)[:, 0, 0]
    np.testing.assert_allclose(  # Pendulum's torque goes from -2 to 2
        learner.replay_buffer.actions[:STEPS, 0, 0], executed / 2.0, atol=1e-6
    )
    assert (np.array(seen.proposed)[:, 0, 0] != executed).any()


def test_sharpness_changes_how_decidedly_it_acts_and_not_what_it_is_taught(
    everywhere: Shield,
) -> None:
    learner, _ = make_learner("CartPole-v1", everywhere, ARMS["handover"], steps=STEPS, seed=0)
    policy = learner.policy
    assert isinstance(policy, DecidedPolicy)
    assert isinstance(learner, MaskedPPO)
    states = torch.randn(50, 4)
    with torch.no_grad():
        acting = policy.get_distribution(states).distribution
        taught = policy.taught(states).distribution
    sharper = torch.softmax(ARMS["handover"].sharpness * taught.logits, dim=1)
    torch.testing.assert_close(acting.probs, sharper)
    with torch.no_grad():
        again = policy.get_distribution(states).distribution
    torch.testing.assert_close(acting.probs, again.probs)


def test_the_oldest_lessons_go_first() -> None:
    lessons = Lessons(1, 1, 1, most=3)
    for value in range(5):
        row = np.full((1, 1), value, dtype=np.float32)
        lessons.add(row, row, *np.ones((2, 1, 1), dtype=np.bool_))
    assert sorted(lessons.observations[:, 0].tolist()) == [2.0, 3.0, 4.0]
    assert len(lessons) == 3
    other = Lessons(1, 1, 1, most=3)
    other.restore(lessons.state())
    row = np.full((1, 1), 9, dtype=np.float32)
    for each in (lessons, other):
        each.add(row, row, *np.ones((2, 1, 1), dtype=np.bool_))
    np.testing.assert_array_equal(lessons.observations, other.observations)


def test_no_two_learners_share_an_episode() -> None:
    firsts = []
    for seed in (0, 1):
        learner, env = make_learner("CartPole-v1", None, ARMS["none"], steps=STEPS, seed=seed)
        firsts.append(env.reset())
        del learner
    assert not any((row == other).all() for row in firsts[0] for other in firsts[1])
