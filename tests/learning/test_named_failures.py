"""A learner's episodes fail by what its caller calls a failure."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sarl_core import Environment, WorkError, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS
from sarl_core.learning.run import learn
from sarl_core.learning.study import LearningPlan, run_study
from sarl_core.learning.study_files import load_study
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


LATE = """
import gymnasium

class Late(gymnasium.Wrapper):
    limit = 12

    def reset(self, **options):
        self.count = 0
        return self.env.reset(**options)

    def step(self, action):
        self.count += 1
        if self.count > self.limit:
            raise RuntimeError("the load is gone")
        return self.env.step(action)
"""


def test_an_environment_that_fails_while_learning_is_told_and_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "late_task.py").write_text(LATE)
    monkeypatch.syspath_prepend(tmp_path)
    environment = Environment("CartPole-v1", wrappers=("late_task:Late",))
    plan = LearningPlan(environment, None, (ARMS["none"],), 200, (0,), episodes=1)
    with pytest.raises(WorkError) as raised:
        run_study(plan, tmp_path / "study")
    sentence = str(raised.value)
    assert re.search(r"CartPole-v1 failed in episode \d+ while learning, at step 12", sentence)
    assert "(RuntimeError: the load is gone)" in sentence
    (run,) = load_study(tmp_path / "study").runs
    assert run.done > 0
    assert f"in episode {len(run.curve)} while" in sentence
    monkeypatch.setattr("late_task.Late.limit", 1_000)  # it is mended
    (run,) = run_study(plan, tmp_path / "study").runs
    assert run.sittings == 2


def test_a_trial_tells_what_the_rules_left_free() -> None:
    rules = mine_rules(load_demonstrations(CARTPOLE), supp_min=0.005, conf_min=0.9)
    result = learn("CartPole-v1", rules, ARMS["none"], steps=600, episodes=4)
    assert result.alone.freedom is None
    assert result.shielded is not None
    # A rule of one action leaves nothing, and no rule leaves everything.
    assert result.shielded.freedom == pytest.approx(1 - result.shielded.coverage)
    assert 0 < result.shielded.freedom < 1
