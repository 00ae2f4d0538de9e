"""One and the same wrapper in learning, in evaluation and in rendering."""

from __future__ import annotations

import ast
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env as sb3_check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv

from sarl_core import (
    Demonstrations,
    InputError,
    Shield,
    ShieldedEnv,
    ShieldedVecEnv,
    load_demonstrations,
    mine_rules,
)
from sarl_core.environments.description import describe_environment


class Watched(gymnasium.Wrapper):
    """Innermost: what really reaches the environment, and the state it was chosen in."""

    def __init__(self, env):
        super().__init__(env)
        self.seen = []

    def reset(self, **kwargs):
        observation, info = self.env.reset(**kwargs)
        self.state = np.array(observation)
        return observation, info

    def step(self, action):
        self.seen.append((self.state, np.array(action)))
        result = self.env.step(action)
        self.state = np.array(result[0])
        return result


def shield_for(name, supp=0.005, conf=0.95):
    demonstrations = load_demonstrations(f"data/demonstrations/{name}.parquet")
    return Shield(mine_rules(demonstrations, supp_min=supp, conf_min=conf))


@pytest.fixture(scope="module")
def cartpole():
    return shield_for("cartpole", 0.0, 1.0)


def expect_compliant(watched, shield):
    """Every action that reached the environment is what the rules ask for in its state."""
    assert watched.seen
    ruled = 0
    for state, action in watched.seen:
        decision = shield.decide(state, action)
        assert not decision.intervened
        ruled += decision.rules[0] is not None
    assert ruled > 0.5 * len(watched.seen)


def test_in_learning_evaluation_and_rendering_nothing_gets_past(cartpole):
    watched = Watched(gymnasium.make("CartPole-v1", render_mode="rgb_array"))
    env = ShieldedEnv(watched, cartpole)
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, seed=0, device="cpu")
    model.learn(256)
    expect_compliant(watched, cartpole)
    learned = len(watched.seen)
    with warnings.catch_warnings():
        # evaluate_policy would like a Monitor; what is tested is where the actions go.
        warnings.simplefilter("ignore", UserWarning)
        evaluate_policy(model, env, n_eval_episodes=2)
    assert len(watched.seen) > learned
    expect_compliant(watched, cartpole)
    evaluated = len(watched.seen)
    env.reset(seed=0)
    frames = []
    for _ in range(20):
        _, _, terminated, truncated, info = env.step(0)
        frames.append(env.render())
        assert info["shield"].proposed == 0
        if terminated or truncated:
            break
    assert frames[0].shape[2] == 3
    assert len(watched.seen) == evaluated + len(frames)
    expect_compliant(watched, cartpole)


def test_in_vectorised_learning_nothing_gets_past(cartpole):
    watched = [Watched(gymnasium.make("CartPole-v1")) for _ in range(3)]
    venv = ShieldedVecEnv(DummyVecEnv([lambda env=env: env for env in watched]), cartpole)
    PPO("MlpPolicy", venv, n_steps=32, batch_size=32, n_epochs=1, seed=0, device="cpu").learn(192)
    for env in watched:
        expect_compliant(env, cartpole)


def test_our_own_code_never_steps_around_a_wrapper():
    """No file of ours asks an environment for what lies below its wrappers."""
    for path in [
        *Path("sarl_core").rglob("*.py"),
        *Path("sarl_dashboard").rglob("*.py"),
        *Path("pages").rglob("*.py"),
        Path("app.py"),
    ]:
        for node in ast.walk(ast.parse(path.read_text())):
            below = isinstance(node, ast.Attribute) and node.attr == "unwrapped"
            assert not below, f"{path}:{node.lineno}"


@pytest.mark.parametrize(
    ("env_id", "name"),
    [("CartPole-v1", "cartpole"), ("LunarLander-v3", "lunar_lander"), ("Pendulum-v1", "pendulum")],
)
def test_the_checkers_of_gymnasium_and_stable_baselines_pass(env_id, name):
    env = ShieldedEnv(gymnasium.make(env_id, disable_env_checker=True), shield_for(name))
    with warnings.catch_warnings():
        # Advice on the wrapped environment's own spaces; errors are still raised.
        warnings.simplefilter("ignore", UserWarning)
        check_env(env, skip_render_check=True)
        sb3_check_env(env, skip_render_check=True)


def test_the_record_says_what_happened(cartpole):
    env = ShieldedEnv(gymnasium.make("CartPole-v1"), cartpole, penalty=0.25)
    for episode in range(2):
        observation, _ = env.reset(seed=None if episode else 3)
        for step in range(5):
            state = observation.copy()
            observation, reward, _, _, info = env.step(1)
            record = info["shield"]
            assert (record.episode, record.step) == (episode, step)
            assert len(record) == len(record._fields)
            assert np.array_equal(record.observation, state)
            assert record.intervened == (record.executed != record.proposed)
            assert reward == (0.75 if record.intervened else 1.0)


def test_the_vectorised_wrapper_is_the_single_one_side_by_side(cartpole):
    venv = ShieldedVecEnv(
        DummyVecEnv([lambda: gymnasium.make("CartPole-v1") for _ in range(2)]),
        cartpole,
        penalty=0.5,
    )
    venv.seed(5)
    venv.reset()
    singles = [ShieldedEnv(gymnasium.make("CartPole-v1"), cartpole, penalty=0.5) for _ in range(2)]
    for i, env in enumerate(singles):
        env.reset(seed=5 + i)
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(600):
        actions = rng.integers(0, 2, 2)
        observations, rewards, dones, infos = venv.step(actions)
        for i, env in enumerate(singles):
            observation, reward, terminated, truncated, info = env.step(actions[i])
            ours, theirs = info["shield"], infos[i]["shield"]
            assert np.array_equal(ours.observation, theirs.observation)
            assert (ours.episode, ours.step, ours.rules, ours.intervened, ours.margin) == (
                theirs.episode,
                theirs.step,
                theirs.rules,
                theirs.intervened,
                theirs.margin,
            )
            assert ours.executed == theirs.executed
            assert rewards[i] == reward
            assert dones[i] == (terminated or truncated)
            if dones[i]:
                ended += 1
                observation, _ = env.reset()
            assert np.array_equal(observations[i], observation)
    assert ended > 0


def demonstrations_in(env_id, steps=400):
    """Random demonstrations in the spaces of any environment, flattened."""
    about = describe_environment(env_id)
    env = gymnasium.make(env_id)
    env.action_space.seed(0)
    rows, actions, episodes = [], [], []
    observation, _ = env.reset(seed=0)
    episode = 0
    for _ in range(steps):
        action = env.action_space.sample()
        rows.append(gymnasium.spaces.utils.flatten(env.observation_space, observation))
        actions.append(action)
        episodes.append(episode)
        observation, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            observation, _ = env.reset()
            episode += 1
    return Demonstrations(
        np.array(rows, dtype=np.float32),
        np.array(actions),
        np.array(episodes),
        label_names=about.label_names,
        label_first=about.label_first,
        env_id=env_id,
    )


@pytest.mark.parametrize("env_id", ["FrozenLake-v1", "Blackjack-v1"])
def test_discrete_and_tuple_observations_are_flattened(env_id):
    shield = Shield(mine_rules(demonstrations_in(env_id), supp_min=0.0, conf_min=0.5))
    env = ShieldedEnv(gymnasium.make(env_id), shield)
    env.reset(seed=1)
    for _ in range(30):
        _, _, terminated, truncated, info = env.step(0)
        record = info["shield"]
        assert record.executed in env.action_space
        assert record.observation.shape == (len(shield.rule_set.source.features),)
        if terminated or truncated:
            env.reset()


def test_rules_of_another_environment_are_refused(cartpole):
    for env_id, words in (
        ("LunarLander-v3", "4 features"),
        ("Acrobot-v1", "4 features"),
    ):
        with pytest.raises(InputError, match=words):
            ShieldedEnv(gymnasium.make(env_id), cartpole)
    lander = shield_for("lunar_lander")
    with pytest.raises(InputError, match="continuous"):
        ShieldedEnv(gymnasium.make("LunarLander-v3", continuous=True), lander)


def test_labels_that_start_elsewhere_are_refused():
    env = gymnasium.make("CartPole-v1")
    env.action_space = gymnasium.spaces.Discrete(2, start=5)
    with pytest.raises(InputError, match=r"0 to 1 and the environment takes .* 5 to 6"):
        ShieldedEnv(env, shield_for("cartpole"))
