"""Demonstrations that meet an environment are put into its order."""

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import InputError, load_demonstrations
from sarl_core.demonstrations.names import in_order_of
from sarl_core.environments.description import describe_environment
from sarl_core.improving.questions import Answers
from sarl_core.rollouts.trial import make_agent
from tests.cli.conftest import CART, ROOT

WALKER = ROOT / "data" / "demonstrations" / "bipedal_walker.parquet"
ORDER = (2, 3, 0, 1)


def test_continuous_actions_move_with_their_bounds():
    shown = load_demonstrations(WALKER)
    moved = replace(
        shown,
        observations=shown.observations[:, ::-1],
        feature_names=shown.feature_names[::-1],
        feature_units=shown.feature_units[::-1],
        actions=shown.actions[:, ::-1],
        action_names=shown.action_names[::-1],
    )
    found = in_order_of(moved, describe_environment("BipedalWalker-v3"))
    assert found.demonstrations.digest == shown.digest
    assert len(found.notes) == 2
    assert in_order_of(shown, describe_environment("BipedalWalker-v3")) == (shown, ())


def test_an_expert_is_asked_about_the_right_states():
    shown = load_demonstrations(CART)
    moved = replace(
        shown,
        observations=shown.observations[:, ORDER],
        feature_names=tuple(shown.feature_names[place] for place in ORDER),
        env_id="",
    )
    expert = make_agent("expert", "CartPole-v1")
    answers = [Answers("CartPole-v1", expert, one).pairs(0) for one in (shown, moved)]
    np.testing.assert_array_equal(answers[0].observations, answers[1].observations)
    np.testing.assert_array_equal(answers[0].actions, answers[1].actions)
    with pytest.raises(InputError, match="a, b, c, d"):
        Answers("CartPole-v1", expert, replace(moved, feature_names=tuple("abcd")))
