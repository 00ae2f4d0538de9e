"""A wrapped environment's features are matched with the rules' by their names."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from sarl_core import (
    InputError,
    Shield,
    ShieldedEnv,
    ShieldedVecEnv,
    load_demonstrations,
    mine_rules,
)
from tests.commandline.conftest import CART

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
