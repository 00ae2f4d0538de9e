import subprocess
import sys

import gymnasium
import numpy as np
import pytest

from sarl_core.agents.agent import shipped_experts
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.trial import make_agent


def states(env_id: str, count: int) -> np.ndarray:
    d = len(describe_environment(env_id).feature_names)
    return np.random.default_rng(1).normal(size=(count, d)).astype(np.float32)


@pytest.mark.parametrize("name", ["novice", "untrained"])
def test_acts_in_every_kind_of_space(name: str, toy_id: str) -> None:
    episodes = rollout(toy_id, name, episodes=5, seed=3)
    assert (episodes.lengths >= 1).all()
    assert episodes.steps is not None
    # The toy sums up the action it gets, and spoils it afterwards.
    sums = episodes.steps.executed.sum(axis=1, dtype=np.float64)
    assert episodes.steps.reward == pytest.approx(sums, abs=1e-5)


def test_the_novice_is_uniform_over_the_labels() -> None:
    agent = make_agent("novice", "toy/Offset-v0")
    uniforms = np.random.default_rng(0).random((30_000, 1))
    actions = agent.act(states("toy/Offset-v0", 30_000), uniforms)
    values, counts = np.unique(actions, return_counts=True)
    assert values.tolist() == [-1, 0, 1]
    assert np.abs(counts / 30_000 - 1 / 3).max() < 0.02


def test_the_novice_is_uniform_over_an_interval() -> None:
    agent = make_agent("novice", "Pendulum-v1")
    uniforms = np.linspace(0, 1, 101)[:, None]
    actions = agent.act(states("Pendulum-v1", 101), uniforms)
    assert actions[:, 0] == pytest.approx(np.linspace(-2, 2, 101), abs=1e-6)


def test_the_novice_draws_whole_amounts_alike_the_highest_among_them() -> None:
    agent = make_agent("novice", "toy/Whole-v0")
    uniforms = np.random.default_rng(0).random((40_000, 2))
    actions = agent.act(states("toy/Whole-v0", 40_000), uniforms)
    values, counts = np.unique(actions, return_counts=True)
    assert values.tolist() == [-1, 0, 1, 2]
    assert np.abs(counts / 80_000 - 1 / 4).max() < 0.01
    episodes = rollout("toy/Whole-v0", "novice", episodes=20)
    assert episodes.steps is not None
    assert np.unique(episodes.steps.executed).tolist() == [-1, 0, 1, 2]


def test_the_novice_respects_one_sided_bounds() -> None:
    agent = make_agent("novice", "toy/Open-v0")
    uniforms = np.random.default_rng(0).random((1_000, 3))
    uniforms[0] = 0.0
    actions = agent.act(states("toy/Open-v0", 1_000), uniforms)
    assert np.isfinite(actions).all()
    assert actions[:, 1].min() >= 1
    assert actions[:, 2].max() <= 2
    assert actions[:, 0].min() < -1 < 1 < actions[:, 0].max()


def test_untrained_depends_on_its_seed_only() -> None:
    import torch

    before = torch.random.get_rng_state()
    observations = states("LunarLander-v3", 20)
    first, again, other = (
        make_agent("untrained", "LunarLander-v3", seed=seed).policy.outputs(observations)  # type: ignore[attr-defined]
        for seed in (5, 5, 6)
    )
    assert (first == again).all()
    assert (first != other).any()
    assert torch.equal(before, torch.random.get_rng_state())


def test_untrained_has_the_weights_ppo_starts_from() -> None:
    from stable_baselines3 import PPO

    from sarl_core.learning.experts import export_policy

    agent = make_agent("untrained", "CartPole-v1", seed=7)
    ppo = export_policy(PPO("MlpPolicy", "CartPole-v1", seed=7, device="cpu"))
    for mine, theirs in zip(agent.policy.weights, ppo.weights, strict=True):  # type: ignore[attr-defined]
        assert mine.shape == theirs.shape
        assert mine.std() == pytest.approx(theirs.std(), rel=0.3)


def test_untrained_samples_and_trained_agents_do_not_unless_asked() -> None:
    assert make_agent("untrained", "CartPole-v1").n_uniforms == 1
    assert make_agent("expert", "CartPole-v1").n_uniforms == 0
    assert make_agent("expert", "CartPole-v1", stochastic=True).n_uniforms == 1


def test_an_agent_is_given_back_as_it_is() -> None:
    agent = make_agent("novice", "CartPole-v1")
    assert make_agent(agent, "CartPole-v1") is agent


def test_the_expert_is_found_by_environment() -> None:
    shipped = [
        "BipedalWalker-v3",
        "CartPole-v1",
        "LunarLander-v3",
        "LunarLanderContinuous-v3",
        "Pendulum-v1",
    ]
    assert list(shipped_experts()) == shipped
    assert make_agent("expert", "gymnasium:CartPole-v1").name == "expert"
    with pytest.raises(InputError, match=", ".join(shipped)):
        make_agent("expert", "Acrobot-v1")


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ("exprt", "there is no agent 'exprt'; give novice"),
        ("missing.npz", "missing.npz does not exist"),
        ("missing.zip", "missing.zip does not exist"),
    ],
)
def test_what_is_no_agent_is_named(spec: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make_agent(spec, "CartPole-v1")


@pytest.mark.parametrize(
    ("env_id", "sentence"),
    [
        ("Acrobot-v1", "takes 4 features and Acrobot-v1 gives 6"),
        ("Pendulum-v1", "takes 4 features and Pendulum-v1 gives 3"),
        ("toy/Wide-v0", "gives discrete actions and toy/Wide-v0 takes continuous ones"),
        ("toy/Three-v0", "chooses among 2 actions and toy/Three-v0 offers 3 actions"),
    ],
)
def test_a_policy_of_another_environment_is_refused(env_id: str, sentence: str) -> None:
    from gymnasium import spaces

    from sarl_core.agents.agent import EXPERT_FOLDER

    for name, actions in (
        ("toy/Wide-v0", spaces.Box(-1, 1, (1,))),
        ("toy/Three-v0", spaces.Discrete(3)),
    ):
        if name not in gymnasium.registry:
            toy = gymnasium.spec("toy/Matrix-v0")
            gymnasium.register(
                name,
                entry_point=toy.entry_point,
                kwargs={"observations": spaces.Box(-1, 1, (4,)), "actions": actions, "steps": 3},
            )
    with pytest.raises(InputError, match=sentence):
        make_agent(EXPERT_FOLDER / "cartpole.npz", env_id)


def test_continuous_policies_must_have_as_many_dimensions(tmp_path: object) -> None:
    from pathlib import Path

    policy = MlpPolicy(
        weights=(np.zeros((3, 2), np.float32),),
        biases=(np.zeros(2, np.float32),),
        activation="tanh",
        head="gaussian",
        log_std=np.zeros(2, np.float32),
        action_low=-np.ones(2, np.float32),
        action_high=np.ones(2, np.float32),
    )
    path = Path(str(tmp_path)) / "two.npz"
    policy.save(path)
    with pytest.raises(InputError, match="gives 2 action dimensions and Pendulum-v1 takes 1"):
        make_agent(path, "Pendulum-v1")


def test_novice_and_expert_load_no_learner() -> None:
    code = (
        "import sys; from sarl_core.rollouts.episodes import rollout\n"
        "rollout('CartPole-v1', 'novice', episodes=1); rollout('CartPole-v1', 'expert', "
        "episodes=1)\n"
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_policy_of_other_features_is_refused_and_one_without_names_is_trusted() -> None:
    """A number of features alone does not say which is which."""
    from dataclasses import replace

    from sarl_core.agents.agent import PolicyAgent, order_notes

    expert = make_agent("expert", "CartPole-v1")
    assert isinstance(expert, PolicyAgent)
    assert order_notes(expert, "CartPole-v1") == ()
    assert rollout("CartPole-v1", expert, episodes=1).notes == ()
    unknown = replace(expert, policy=replace(expert.policy, env_id=""))
    (note,) = rollout("CartPole-v1", unknown, episodes=1).notes
    assert "no names" in note
    assert "CartPole-v1" in note
    walker = make_agent("expert", "BipedalWalker-v3")
    assert order_notes(walker, "BipedalWalkerHardcore-v3") == ()
    pendulum = make_agent("expert", "Pendulum-v1")
    assert isinstance(pendulum, PolicyAgent)
    lander = replace(pendulum, policy=replace(pendulum.policy, env_id="MountainCarContinuous-v0"))
    with pytest.raises(InputError, match="asks about 3 features"):
        order_notes(lander, "MountainCarContinuous-v0")
