"""A learner's episodes fail by what its caller calls a failure."""

from __future__ import annotations

import pytest

from sarl_core import Environment, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS
from sarl_core.learning.run import learn
from sarl_core.shipped import DATA

CARTPOLE = DATA / "demonstrations" / "cartpole.parquet"


def test_a_learner_fails_by_what_its_caller_calls_a_failure() -> None:
    def learned(failure: str, cost: str = ""):
        environment = Environment("CartPole-v1", failure=failure, cost=cost)
        return learn(environment, None, ARMS["none"], steps=600, episodes=4)

    never, often = learned("cart position > 100"), learned("cart position > -100", "pole angle > 9")
    assert len(never.curve) == len(often.curve) > 0
    assert never.curve.crashes == 0
    assert often.curve.crashed.all()
    assert (never.alone.crashes, often.alone.crashes) == (0, 4)
    assert often.alone.failed == (True,) * 4
    assert often.alone.costs == (0.0,) * 4


def test_a_trial_tells_what_the_rules_left_free() -> None:
    rules = mine_rules(load_demonstrations(CARTPOLE), supp_min=0.005, conf_min=0.9)
    result = learn("CartPole-v1", rules, ARMS["none"], steps=600, episodes=4)
    assert result.alone.freedom is None
    assert result.shielded is not None
    # A rule of one action leaves nothing, and no rule leaves everything.
    assert result.shielded.freedom == pytest.approx(1 - result.shielded.coverage)
    assert 0 < result.shielded.freedom < 1
