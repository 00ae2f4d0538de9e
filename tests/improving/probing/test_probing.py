"""What an expert does not recover from, on a ledge where it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest

from sarl_core import Environment, InputError, RuleSet, Shield, rollout
from sarl_core.improving.probing.outcomes import Outcomes, probed
from sarl_core.improving.probing.probing import ProbePlan, Probing, probe
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import limits_text, sentence
from sarl_core.progress import CancelledError
from sarl_core.rollouts.trial import make_agent

EDGE, STEPS, LIMIT = 5, 3, 40
LABELS = LabelledDimension("way", ("left", "stay", "right"))


class Ledge(gymnasium.Env[Any, Any]):
    """A step to either side, or none; more than five from the middle one falls."""

    action_space = gymnasium.spaces.Discrete(3)
    observation_space = gymnasium.spaces.Box(-9.0, 9.0, (1,), np.float32)
    steady = True

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place, self.left = int(self.np_random.integers(-4, 5)), LIMIT
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.place += int(action) - 1
        self.left -= 1
        fell = abs(self.place) > EDGE
        return self._observation(), 1.0, fell, self.left == 0, {"fell": fell}

    def _observation(self) -> Any:
        shaken = 0.0 if self.steady else float(np.random.default_rng().normal())
        return np.array([self.place + shaken], dtype=np.float32)


class Shaking(Ledge):
    """What is seen of it hangs on no seed."""

    steady = False


gymnasium.register("Ledge-v0", Ledge)
gymnasium.register("Shaking-v0", Shaking)
LEDGE = Environment(f"{__name__}:Ledge-v0", failure="fell")
PLAN = ProbePlan(
    rounds=2, episodes=16, states=6, steps=STEPS, leaves=6, validation=10, report=10, combine=False
)


class Inwards:
    """The expert: to the middle."""

    name, n_uniforms = "inwards", 0

    def act(self, observations: Any, uniforms: Any) -> Any:
        return 1 - np.sign(np.round(observations)).astype(np.int64)


class Careless:
    """Whoever is asked and falls: always to the right."""

    name, n_uniforms = "careless", 0

    def act(self, observations: Any, uniforms: Any) -> Any:
        return np.full((len(observations), 1), 2)


class HalfBlind:
    """It stands still on the left, and on the right goes on until it falls."""

    name, n_uniforms = "half blind", 0

    def act(self, observations: Any, uniforms: Any) -> Any:
        return np.where(observations < 0, 1, 2)


INWARDS, CARELESS, HALF_BLIND = Inwards(), Careless(), HalfBlind()


def outcomes_of(expert: Any = INWARDS, env_id: Any = LEDGE) -> list[Outcomes]:
    agent, asked = make_agent("novice", env_id), make_agent(expert, env_id)
    return [
        probed(env_id, agent, asked, None, seed, dimensions=(LABELS,), states=8, steps=STEPS)
        for seed in range(20)
    ]


@pytest.fixture(scope="module")
def probing() -> Probing:
    return probe(LEDGE, PLAN, expert=INWARDS)


def test_each_outcome_is_what_the_ledge_makes_of_it():
    outcomes = Outcomes.join(outcomes_of())
    place = outcomes.observations[:, 0]
    assert len({*place.tolist()}) > 5
    (failed,) = outcomes.failed
    assert (outcomes.actions == INWARDS.act(outcomes.observations, None)).all()
    # To its own side the expert goes anyway; from the fourth place outwards three steps fall.
    assert (failed[:, 0] == (place - STEPS < -EDGE)).all()
    assert (failed[:, 2] == (place + STEPS > EDGE)).all()
    assert not failed[:, 1].any()


def test_a_state_that_is_lost_whatever_is_done_says_nothing():
    """Episodes begin on both sides, and this expert falls from the middle and beyond it."""
    outcomes = Outcomes.join(outcomes_of(HALF_BLIND))
    assert len(outcomes) > 10
    assert (outcomes.observations < 0).all()


def test_a_state_in_which_an_action_was_cut_short_says_nothing():
    steps = Outcomes.join(outcomes_of()).steps
    assert LIMIT - 2 * STEPS < steps.max() <= LIMIT - STEPS


def test_rules_forbid_what_falls_and_nothing_else(probing):
    rules = probing.rule_set
    assert sorted((rule.forbids, len(rule.bounds)) for rule in rules) == [((0,), 1), ((2,), 1)]
    for rule in rules:
        side = -1 if rule.forbids == (0,) else 1
        places = np.arange(-EDGE, EDGE + 1, dtype=np.float32)
        assert (
            rule.applies(places[:, None]).tolist() == (side * places >= EDGE - STEPS + 1).tolist()
        )
        assert (rule.origin, rule.confidence) == ("probed", 1.0)
        assert sentence(rule, rules).endswith(
            f"after it the expert failed in 100 % of {rule.samples:,} states."
        )
    assert limits_text(rules) == "forbidden what the expert fails after in more than 0.2"
    assert not probing.reported.failed.any()
    assert rollout(LEDGE, "novice", episodes=30, seed=7).failed.any()
    assert 0.7 < probing.reported.freedom.mean() < 1.0


def test_a_shield_of_them_never_lets_one_fall(probing, tmp_path):
    probing.rule_set.save(tmp_path / "rules.json")
    rules = RuleSet.load(tmp_path / "rules.json")
    assert not rollout(LEDGE, "novice", shield=Shield(rules), episodes=50, seed=9).failed.any()


def test_the_same_for_any_number_of_processes():
    plan = ProbePlan(rounds=1, episodes=24, validation=4, report=4, leaves=4, states=4)
    one, two = (probe("CartPole-v1", plan, jobs=jobs) for jobs in (1, 2))
    assert any(rule.conditions for rule in one.rule_set)
    assert one.rule_set.digest == two.rule_set.digest
    assert (one.reported.returns == two.reported.returns).all()


def test_of_several_rounds_the_one_that_fails_least_is_chosen(probing):
    scores = [one.score for one in probing.rounds]
    assert probing.chosen is probing.rounds[scores.index(max(scores))]


def test_it_counts_episodes_and_can_be_stopped():
    calls: list[Sequence[int]] = []
    watched: list[int] = []
    probe(
        LEDGE,
        PLAN,
        expert=INWARDS,
        progress=lambda *count: calls.append(count),
        watch=lambda one: watched.append(one.number),
    )
    assert watched == [1, 2]
    assert calls[-1] == (62, 62)
    assert [one[0] for one in calls] == sorted(one[0] for one in calls)
    with pytest.raises(CancelledError, match="of 62"):
        probe(LEDGE, PLAN, expert=INWARDS, progress=lambda done, _: done < 9)


# --- what cannot be probed -----------------------------------------------------------------------


def test_an_environment_that_does_not_repeat_itself_is_said_to_be_one():
    shaking = Environment(f"{__name__}:Shaking-v0", failure="fell")
    with pytest.raises(InputError, match="the environment does not repeat itself"):
        outcomes_of(env_id=shaking)


def test_an_environment_of_unknown_failures_is_refused():
    with pytest.raises(InputError, match="--failure"):
        probe(f"{__name__}:Ledge-v0", PLAN, expert=INWARDS)


def test_an_expert_that_always_fails_protects_nothing():
    with pytest.raises(InputError, match="states of 16 episodes, too few to learn from"):
        probe(LEDGE, PLAN, expert=CARELESS)


def test_actions_without_bounds_are_refused():
    with pytest.raises(InputError, match="have no bounds"):
        probe(Environment("toy/Open-v0", failure="reward > 0"), PLAN, expert="novice")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"risk": 0.0}, "the risk is 0.0"),
        ({"risk": 1.0}, "the risk is 1.0"),
        ({"rounds": 0}, "rounds"),
        ({"leaves": 1}, "leaves"),
        ({"steps": 0}, "steps"),
        ({"episodes": 10**6}, "at most 10,000"),
        ({"validation": 25_000_000}, "at most 500,000"),
        ({"report": 25_000_000}, "at most 500,000"),
        ({"divider": 10**9}, "intervals; give at most"),
        ({"risk": "much"}, "the risk must be a number"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        ProbePlan(**wrong)
