from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sarl_core.environments.failures import failure_known
from sarl_core.errors import InputError
from sarl_core.explaining.words.comparison import verdict
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import CancelledError
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.recording import record
from sarl_core.shielding.shield import Shield
from sarl_core.studies.comparison import (
    Arm,
    Comparison,
    compare,
    compare_arm,
    comparison_row,
)

CARTPOLE = "CartPole-v1"


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return mine_rules(record(CARTPOLE, "expert", steps=2_000), supp_min=0.0, conf_min=1.0)


@pytest.fixture(scope="module")
def comparison(rules: RuleSet) -> Comparison:
    arms = (Arm("alone", "novice"), Arm("shielded", "novice", rules), Arm("expert", "expert"))
    return compare(CARTPOLE, arms, episodes=12, seed=5)


def ended(terminated: list[bool], last_rewards: list[float], env_id: str = CARTPOLE) -> Episodes:
    """Episodes of which only the end is known."""
    count = len(terminated)
    nothing = np.zeros(count, dtype=np.int64)
    return Episodes(
        env_id=env_id,
        agent="",
        seeds=nothing.copy(),
        returns=np.zeros(count),
        lengths=nothing.copy(),
        interventions=nothing.copy(),
        covered=nothing.copy(),
        terminated=np.array(terminated),
        truncated=~np.array(terminated),
        last_rewards=np.array(last_rewards),
    )


def test_every_arm_is_a_rollout_on_the_same_seeds(comparison: Comparison, rules: RuleSet) -> None:
    alone = rollout(CARTPOLE, "novice", episodes=12, seed=5)
    shielded = rollout(CARTPOLE, "novice", shield=Shield(rules), episodes=12, seed=5)
    for found, wanted in zip(comparison.episodes, (alone, shielded), strict=False):
        assert found.steps is None
        assert found.seeds.tolist() == list(range(5, 17))
        assert found.returns.tolist() == wanted.returns.tolist()
        assert found.interventions.tolist() == wanted.interventions.tolist()
    assert comparison.episodes[1].returns.mean() > 2 * comparison.episodes[0].returns.mean()


def test_the_table_says_of_each_arm_what_its_episodes_say(
    comparison: Comparison, rules: RuleSet
) -> None:
    frame = comparison.to_frame()
    assert frame["arm"].tolist() == ["alone", "shielded", "expert"]
    assert frame["episodes"].tolist() == [12, 12, 12]
    alone, shielded, expert = (frame.iloc[row] for row in range(3))
    assert shielded["rules"] == len(rules)
    assert np.isnan(alone["rules"])
    assert np.isnan(alone["coverage"])
    assert 0 < shielded["intervention_rate"] < shielded["coverage"] <= 1
    assert shielded["iqm_low"] <= shielded["iqm"] <= shielded["iqm_high"]
    assert alone["crash_rate"] == 1.0
    assert expert["crash_rate"] == 0.0
    assert expert["mean"] == 500.0


def test_one_arm_alone_is_what_it_is_among_others(comparison: Comparison) -> None:
    alone = compare_arm(CARTPOLE, comparison.arms[1], episodes=12, seed=5)
    assert alone.returns.tolist() == comparison.episodes[1].returns.tolist()


def test_progress_counts_over_all_arms_and_stops() -> None:
    arms = (Arm("a", "novice"), Arm("b", "untrained"))
    calls: list[tuple[int, int]] = []
    compare(CARTPOLE, arms, episodes=3, progress=lambda *call: calls.append(call))
    assert calls == [(done, 6) for done in range(1, 7)]
    with pytest.raises(CancelledError, match="4 of 6"):
        compare(CARTPOLE, arms, episodes=3, progress=lambda done, _: done < 4)


def test_in_an_environment_that_knows_only_failure_every_end_is_one() -> None:
    episodes = ended([True, False, True], [1.0, 1.0, -100.0])
    assert episodes.failed.tolist() == [True, False, True]
    assert episodes.failures is not None
    assert episodes.failures.rate == pytest.approx(2 / 3)


@pytest.mark.parametrize("env_id", ["MountainCar-v0", "MountainCarContinuous-v0", "Acrobot-v1"])
def test_who_reaches_the_goal_has_not_crashed_and_nothing_is_said_of_failures(env_id: str) -> None:
    lengths = np.array([5, 5, 5])
    episodes = replace(
        ended([True, False, True], [0.0, -1.0, 100.0]), env_id=env_id, lengths=lengths
    )
    assert not episodes.failed.any()
    assert episodes.failures is None
    assert comparison_row(Arm("a", "novice"), episodes)["crash_rate"] is None
    assert not {"failures", "failure_rate", "cost"} & set(episodes.summary())
    assert "failed" not in episodes.to_dict()["episodes"][0]
    assert "fail" not in verdict("novice", "the rules", episodes, episodes)


def test_where_failures_are_not_known_none_is_claimed() -> None:
    lengths = np.array([5, 5, 5])
    episodes = replace(
        ended([True, False, True], [1.0, 1.0, -100.0]), env_id="my:Unknown-v0", lengths=lengths
    )
    assert not failure_known(episodes.env_id)
    assert episodes.failures is None
    assert comparison_row(Arm("a", "novice"), episodes)["crash_rate"] is None
    assert "fail" not in verdict("novice", "the rules", episodes, episodes)


@pytest.mark.parametrize(
    "env_id", ["AntennaX-v0", "CartPoleGoal-v1", "my/CartPole-v1", "LunarLanderEasy-v3", "Ant-vx"]
)
def test_nothing_is_guessed_from_the_beginning_of_a_name(env_id: str) -> None:
    assert not failure_known(env_id)
    episodes = replace(ended([True], [-100.0]), env_id=env_id, lengths=np.ones(1, dtype=np.int64))
    assert "failures" not in episodes.summary()


def test_where_failures_are_known_each_costs_one() -> None:
    episodes = ended([True, True, False, True], [100.0, -100.0, 0.3, -100.0])
    lengths = np.ones(4, dtype=np.int64)
    document = replace(episodes, env_id="LunarLander-v3", lengths=lengths).to_dict()
    assert [episode["cost"] for episode in document["episodes"]] == [0.0, 1.0, 0.0, 1.0]
    assert document["summary"]["cost"] == document["summary"]["failure_rate"] == 0.5


@pytest.mark.parametrize(
    "env_id",
    ["LunarLander-v3", "LunarLanderContinuous-v3", "BipedalWalker-v3", "module:LunarLander-v3"],
)
def test_a_landing_and_an_arrival_are_no_crash(env_id: str) -> None:
    #                 landed, crashed, out of time, out of time
    episodes = ended([True, True, False, False], [100.0, -100.0, 0.3, -100.0], env_id)
    assert episodes.failed.tolist() == [False, True, False, False]
    assert episodes.failures is not None
    assert episodes.failures.rate == 0.25


def test_the_lander_crashes_without_a_pilot_and_lands_with_one() -> None:
    arms = (Arm("alone", "novice"), Arm("expert", "expert"))
    found = compare("LunarLander-v3", arms, episodes=8, seed=1)
    alone, expert = (episodes.failed.mean() for episodes in found.episodes)
    assert alone == 1.0
    assert expert <= 0.25
    assert found.episodes[1].terminated.any()


@pytest.mark.parametrize(
    ("arms", "arguments", "fragment"),
    [
        ((), {}, "nothing to compare"),
        ((Arm("a", "novice"), Arm("a", "expert")), {}, "called 'a'"),
        ((Arm("a", "novice"),), {"episodes": 0}, "episodes is 0"),
        ((Arm("a", "nobody"),), {}, "no agent 'nobody'"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(
    arms: tuple[Arm, ...], arguments: dict[str, Any], fragment: str
) -> None:
    with pytest.raises(InputError, match=fragment) as error:
        compare(CARTPOLE, arms, **arguments)
    assert "\n" not in str(error.value)


def test_rules_of_another_environment_are_refused(rules: RuleSet) -> None:
    with pytest.raises(InputError, match="rules"):
        compare("LunarLander-v3", [Arm("a", "novice", rules)], episodes=1)


def test_an_unknown_projection_is_refused(rules: RuleSet) -> None:
    arm = replace(Arm("a", "novice", rules), projection="nearest")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="projection"):
        compare(CARTPOLE, [arm], episodes=1)
