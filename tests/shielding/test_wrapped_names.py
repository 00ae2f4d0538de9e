"""A wrapped environment's features are matched with the rules' by their names."""

from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecEnvWrapper,
    VecMonitor,
    VecNormalize,
)

from sarl_core import (
    InputError,
    Shield,
    ShieldedEnv,
    ShieldedVecEnv,
    load_demonstrations,
    mine_rules,
)
from tests.cli.conftest import CART

ORDER = (2, 3, 0, 1)
SHOWN = load_demonstrations(CART)
MOVED = replace(
    SHOWN,
    observations=SHOWN.observations[:, ORDER],
    feature_names=tuple(SHOWN.feature_names[place] for place in ORDER),
    env_id="",
)
RIGHT, OTHER = (Shield(mine_rules(one, supp_min=0.005, conf_min=0.95)) for one in (SHOWN, MOVED))


def executed(env):
    env.reset(seed=3)
    found = []
    for step in range(60):
        *_, terminated, truncated, info = env.step(step % 2)
        found.append((int(info["shield"].executed), info["shield"].observation.tolist()))
        if terminated or truncated:
            break
    return found


def test_every_step_is_what_the_right_order_gives():
    right, other = (ShieldedEnv(gymnasium.make("CartPole-v1"), one) for one in (RIGHT, OTHER))
    assert executed(right) == executed(other)
    assert right.notes == ()
    assert "by their names" in other.notes[0]
    assert right.shield.rule_set is RIGHT.rule_set


def test_side_by_side_as_well():
    made = [
        ShieldedVecEnv(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")] * 2), one)
        for one in (RIGHT, OTHER)
    ]
    taken = []
    for venv in made:
        venv.seed(5)
        venv.reset()
        taken.append([])
        for step in range(30):
            *_, infos = venv.step(np.array([step % 2, 1]))
            taken[-1].append([int(info["shield"].executed) for info in infos])
    assert taken[0] == taken[1]


def test_other_names_are_refused_and_none_are_trusted():
    names = mine_rules(replace(MOVED, feature_names=tuple("abcd")), supp_min=0.1, conf_min=0.9)
    with pytest.raises(InputError, match="a, b, c, d"):
        ShieldedEnv(gymnasium.make("CartPole-v1"), Shield(names))
    bare = mine_rules(replace(MOVED, feature_names=None), supp_min=0.1, conf_min=0.9)
    env = ShieldedEnv(gymnasium.make("CartPole-v1"), Shield(bare))
    assert "no names" in env.notes[0]


def test_observations_that_a_wrapper_changed_have_no_names():
    scaled = gymnasium.wrappers.TransformObservation(
        gymnasium.make("CartPole-v1"), lambda state: state[::-1], None
    )
    env = ShieldedEnv(scaled, OTHER)
    assert env.shield.rule_set is OTHER.rule_set
    assert "no names" in env.notes[0]


class Turned(gymnasium.Wrapper):
    """Shows the features the other way round, and tells nobody."""

    def reset(self, **options):
        state, info = super().reset(**options)
        return state[::-1], info

    def step(self, action):
        state, *rest = super().step(action)
        return state[::-1], *rest


class Swapped(VecEnvWrapper):
    def reset(self):
        return self.venv.reset()[:, ORDER]

    def step_wait(self):
        states, *rest = self.venv.step_wait()
        return states[:, ORDER], *rest


class Bonus(gymnasium.RewardWrapper):
    def reward(self, reward):
        return reward + 1.0


def made(*wrappers):
    env = gymnasium.make("CartPole-v1")
    for wrapper in wrappers:
        env = wrapper(env)
    return env


def alone(*wrappers):
    return ShieldedEnv(made(*wrappers), OTHER)


def side_by_side(*wrappers):
    return ShieldedVecEnv(DummyVecEnv([lambda: made(*wrappers)] * 2), OTHER)


def in_processes(*wrappers):
    venv = SubprocVecEnv([lambda: made(*wrappers)] * 2, start_method="fork")
    try:
        return ShieldedVecEnv(venv, OTHER)
    finally:
        venv.close()


EVERYWHERE = pytest.mark.parametrize("shielded", [alone, side_by_side, in_processes])


def reversed_by_a_function(env):
    return gymnasium.wrappers.TransformObservation(env, lambda state: state[::-1], None)


@EVERYWHERE
@pytest.mark.parametrize(
    ("wrappers", "name"),
    [
        ((Turned,), "Turned"),
        ((reversed_by_a_function,), "TransformObservation"),
        ((gymnasium.wrappers.RecordEpisodeStatistics, Turned, Bonus), "Turned"),
    ],
)
def test_what_a_wrapper_shows_is_trusted_and_told(shielded, wrappers, name):
    env = shielded(*wrappers)
    assert env.shield.rule_set is OTHER.rule_set
    (note,) = env.notes
    assert note == (
        f"the features of CartPole-v1 behind {name} have no names, so they were trusted to be in "
        "the order of the rules"
    )


@EVERYWHERE
@pytest.mark.parametrize(
    "wrappers",
    [
        (),
        (Bonus, Monitor),
        (gymnasium.wrappers.FlattenObservation, gymnasium.wrappers.RecordEpisodeStatistics),
        (partial(gymnasium.wrappers.TimeLimit, max_episode_steps=50), Bonus),
    ],
)
def test_wrappers_that_leave_observations_alone_leave_their_names(shielded, wrappers):
    env = shielded(*wrappers)
    (note,) = env.notes
    assert "into the order of CartPole-v1, by their names" in note
    names = [feature.name for feature in env.shield.rule_set.source.features]
    assert names == [feature.name for feature in RIGHT.rule_set.source.features]


@EVERYWHERE
def test_normalised_observations_are_refused(shielded):
    with pytest.raises(InputError, match="NormalizeObservation normalises the observations"):
        shielded(gymnasium.wrappers.NormalizeObservation)


def test_so_are_those_that_are_normalised_side_by_side():
    venv = VecNormalize(DummyVecEnv([made]))
    for one in (venv, VecMonitor(venv)):
        with pytest.raises(InputError, match="VecNormalize normalises the observations"):
            ShieldedVecEnv(one, RIGHT)
    rewards = VecNormalize(VecMonitor(DummyVecEnv([made])), norm_obs=False)
    assert "by their names" in ShieldedVecEnv(rewards, OTHER).notes[0]


def test_what_is_around_all_of_them_counts_and_what_is_around_one():
    swapped = ShieldedVecEnv(Swapped(DummyVecEnv([made])), OTHER)
    assert "behind Swapped have no names" in swapped.notes[0]
    mixed = ShieldedVecEnv(DummyVecEnv([made, lambda: made(Turned)]), OTHER)
    assert "behind Turned have no names" in mixed.notes[0]
    assert mixed.shield.rule_set is OTHER.rule_set
