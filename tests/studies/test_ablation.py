from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import ttest_1samp

from sarl_core import (
    InputError,
    RuleSet,
    Shield,
    grow_policy_trees,
    load_demonstrations,
    mine_rules,
    rollout,
)
from sarl_core.agents.agent import Agent
from sarl_core.errors import WorkError
from sarl_core.mining.never.never_rules import mine_never_rules, with_never_rules
from sarl_core.processes import Processes
from sarl_core.progress import CancelledError
from sarl_core.rollouts.rule_use import RuleUse, rule_use
from sarl_core.rollouts.tasks import Task, TaskPiece, run_tasks
from sarl_core.rollouts.trial import make_agent
from sarl_core.studies.ablation import Ablation, rules_to_take_out
from sarl_core.studies.ablation_run import AblationRecord, ablate

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
CART = load_demonstrations(DATA / "cartpole.parquet")


def mined(support: float = 0.005, confidence: float = 0.95) -> RuleSet:
    return mine_rules(CART, supp_min=support, conf_min=confidence)


def overlapping() -> RuleSet:
    """Two rules that a person has placed, before mined ones that also apply there."""
    rules = list(mined().rules)
    rules[2] = replace(rules[2], pinned=True)
    shorter = replace(
        rules[0], id="m1", conditions=rules[0].conditions[:1], origin="manual", action=1
    )
    again = replace(shorter, id="m2", conditions=shorter.conditions)
    return replace(mined(), rules=(shorter, again, *rules))


def of_no_tree() -> RuleSet:
    """Mined rules whose paths are not of one tree: what their order says, holds."""
    rules = mined().rules
    turned = replace(rules[1], conditions=rules[1].conditions[::-1][:1], id="x")
    return replace(mined(), rules=(turned, *rules))


def torque() -> RuleSet:
    return mine_rules(load_demonstrations(DATA / "pendulum.parquet"), supp_min=0.05, conf_min=0.8)


def forbidding() -> RuleSet:
    """Rules that forbid intervals, several of them in one state."""
    shown = load_demonstrations(DATA / "pendulum.parquet")
    return mine_never_rules(shown, epsilon=0.2, supp_min=0.02, divider=5)


def behind_demands() -> RuleSet:
    """Rules that forbid intervals where those that demand one say nothing."""
    trees = grow_policy_trees(load_demonstrations(DATA / "pendulum.parquet"), divider=3)
    demanding = mine_rules(trees, supp_min=0.05, conf_min=0.9)
    return with_never_rules(demanding, trees, 0.2)


@pytest.fixture(scope="module")
def at_once() -> Ablation:
    """What nobody called off, and no process that died, would have given."""
    return ablate("CartPole-v1", "novice", Shield(mined()), episodes=5, seed=9)


def by_brute_force(env_id: str, shield: Shield, rule: int, episodes: int, seed: int) -> object:
    rules = tuple(one for index, one in enumerate(shield.rule_set.rules) if index != rule)
    others = Shield(replace(shield.rule_set, rules=rules), projection=shield.projection)
    return rollout(env_id, "novice", shield=others, episodes=episodes, seed=seed)


@pytest.mark.parametrize(
    ("env_id", "rules"),
    [
        ("CartPole-v1", mined),
        ("CartPole-v1", overlapping),
        ("CartPole-v1", of_no_tree),
        ("Pendulum-v1", torque),
        ("Pendulum-v1", forbidding),
        ("Pendulum-v1", behind_demands),
    ],
    ids=["mined", "overlapping", "of no tree", "continuous", "forbidding", "behind demands"],
)
def test_every_rule_is_what_running_without_it_gives(env_id: str, rules: object) -> None:
    shield = Shield(rules())  # type: ignore[operator]
    found = ablate(env_id, "novice", shield, episodes=3, seed=500)
    base = rollout(env_id, "novice", shield=shield, episodes=3, seed=500)
    assert found.base.returns.tolist() == base.returns.tolist()
    assert not found.left_out
    assert sorted((*found.rules, *found.unused)) == list(range(len(shield.rule_set.rules)))
    for rule in range(len(shield.rule_set.rules)):
        alone = by_brute_force(env_id, shield, rule, 3, 500)
        if rule in found.rules:
            row = found.rules.index(rule)
            assert found.returns[row].tolist() == alone.returns.tolist()
            assert found.failed[row].tolist() == alone.failed.tolist()
        else:
            # Not run, and proved right: the same actions, the same states, step for step.
            assert alone.steps.executed.tolist() == base.steps.executed.tolist()
            assert alone.steps.observation.tolist() == base.steps.observation.tolist()
            assert alone.returns.tolist() == base.returns.tolist()


def test_of_the_episodes_only_those_are_run_that_can_differ() -> None:
    tasks: list[Task] = []

    def runner(given: Sequence[Task]) -> Iterator[TaskPiece]:
        tasks.extend(given)
        return run_tasks(given)

    shield = Shield(mined())
    record = AblationRecord("CartPole-v1", make_agent("novice", "CartPole-v1"), shield, 40)
    list(record.run(6, 200, runner))
    found = record.result(6, 200)
    assert found is not None
    with_steps = rollout("CartPole-v1", "novice", shield=shield, episodes=6, seed=40).steps
    assert with_steps is not None
    changed = {
        (int(rule), int(episode))
        for rule, episode, on in zip(
            with_steps.rules[:, 0], with_steps.episode, with_steps.intervened, strict=True
        )
        if on
    }
    assert sum(len(task.seeds) for task in tasks[1:]) == len(changed) == found.played
    assert {rule for rule, _ in changed} == set(found.rules)
    # Asked again, nothing is run; with more episodes, only what is new.
    tasks.clear()
    list(record.run(6, 200, runner))
    assert not tasks
    assert record.result(6, 200) is found
    list(record.run(8, 200, runner))
    assert tasks[0].seeds.tolist() == [46, 47]
    assert all(task.seeds.min() >= 46 for task in tasks)
    more = record.result(8, 200)
    whole = ablate("CartPole-v1", "novice", shield, episodes=8, seed=40)
    assert more is not None
    assert more.rules == whole.rules
    assert more.returns.tolist() == whole.returns.tolist()


@pytest.mark.parametrize(
    ("env_id", "rules", "jobs"),
    [("CartPole-v1", overlapping, 2), ("Pendulum-v1", torque, 2)],
    ids=["overlapping", "continuous"],
)
def test_processes_change_nothing(env_id: str, rules: object, jobs: int) -> None:
    shield = Shield(rules(), projection="clip")  # type: ignore[operator]
    here = ablate(env_id, "novice", shield, episodes=5, seed=9)
    there = ablate(env_id, "novice", shield, episodes=5, seed=9, jobs=jobs)
    assert here.rules == there.rules
    assert here.returns.tolist() == there.returns.tolist()
    assert here.failed.tolist() == there.failed.tolist()
    assert here.to_frame().equals(there.to_frame())


@dataclass(frozen=True)
class DeadlyOnce:
    """An agent that takes its process with it when a file says so, and takes the file away."""

    inner: Agent
    file: Path
    name: str = "novice"
    n_uniforms: int = 1

    def act(self, observations: NDArray[np.float32], uniforms: Any) -> NDArray[Any]:
        if self.file.exists():
            self.file.unlink(missing_ok=True)
            os._exit(1)
        return self.inner.act(observations, uniforms)


def test_when_a_process_dies_it_is_said_and_asked_again_the_work_goes_on(
    tmp_path: Path, at_once: Ablation
) -> None:
    shield, novice = Shield(mined()), make_agent("novice", "CartPole-v1")
    file = tmp_path / "deadly"
    agent = DeadlyOnce(novice, file, n_uniforms=novice.n_uniforms)
    record = AblationRecord("CartPole-v1", agent, shield, 9)
    with Processes(2) as processes:
        runner = partial(run_tasks, executor=processes)
        steps = record.run(5, 200, runner)
        for step in steps:
            if step.text.startswith("Taking rules out"):
                file.touch()
                break
        with pytest.raises(WorkError, match="ended unexpectedly"):
            list(steps)
        assert not file.exists()
        # The new processes were given nothing before, and need nothing of what the others knew.
        list(record.run(5, 200, runner))
    found = record.result(5, 200)
    assert found is not None
    assert found.to_frame().equals(at_once.to_frame())


def test_called_off_what_is_finished_stays(at_once: Ablation) -> None:
    shield = Shield(mined())
    record = AblationRecord("CartPole-v1", make_agent("novice", "CartPole-v1"), shield, 9)
    assert record.result(5, 200) is None
    steps = record.run(5, 200, run_tasks)
    for step in steps:
        if step.text.startswith("Without rule 2"):
            break
    steps.close()  # type: ignore[attr-defined]
    some = record.result(5, 200)
    assert some is not None
    assert 1 <= len(some.rules) < len(some.rules) + len(some.left_out)
    list(record.run(5, 200, run_tasks))
    whole = record.result(5, 200)
    assert whole is not None
    assert whole.to_frame().equals(at_once.to_frame())


def test_two_callers_at_the_same_ablation_get_what_one_would(at_once: Ablation) -> None:
    shield = Shield(mined())
    record = AblationRecord("CartPole-v1", make_agent("novice", "CartPole-v1"), shield, 9)
    for both in zip_longest(record.run(5, 200, run_tasks), record.run(5, 200, run_tasks)):
        assert all(step is None or step.done <= step.total for step in both)
    found = record.result(5, 200)
    assert found is not None
    assert found.to_frame().equals(at_once.to_frame())


def made(returns: list[list[float]], failed: list[list[bool]], env_id: str) -> Ablation:
    """An ablation of a rule a row, by hand; the base returns 100 and never fails."""
    shield = Shield(mined())
    episodes = len(returns[0])
    base = replace(
        rollout("CartPole-v1", "expert", episodes=episodes, seed=1, keep_steps=False),
        env_id=env_id,
        returns=np.full(episodes, 100.0),
        terminated=np.zeros(episodes, dtype=np.bool_),
    )
    ones = np.ones((len(shield.rule_set.rules), episodes), dtype=np.int64)
    return Ablation(
        shield,
        base,
        RuleUse(ones, ones.copy(), ones.astype(np.bool_)),
        tuple(range(len(returns))),
        np.array(returns),
        np.array(failed),
        (),
        0,
    )


def test_verdicts_by_hand() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 1, size=20)
    never, always = [False] * 20, [True] * 20
    found = made(
        [
            (60 + noise).tolist(),  # less without it
            (140 + noise).tolist(),  # more without it
            (100 + noise).tolist(),  # the same
            (140 + noise).tolist(),  # more, but every episode fails
            [100.0] * 20,
        ],
        [never, never, never, always, never],
        "CartPole-v1",
    )
    assert [effect.verdict for effect in found.effects] == [
        "load-bearing",
        "harmful",
        "no difference seen",
        "load-bearing",
        "no difference seen",
    ]
    assert found.tests == 5  # four returns and one row of failures are not all zero
    first = found.effects[0]
    interval = ttest_1samp(found.returns[0] - 100.0, 0.0).confidence_interval(0.95)
    assert (first.difference.low, first.difference.high) == pytest.approx(
        (interval.low, interval.high)
    )
    assert first.difference.mean == pytest.approx(-40 + noise.mean())
    frame = found.to_frame()
    assert frame["failures_without"].tolist() == [0, 0, 0, 20, 0]


def test_many_comparisons_are_allowed_for() -> None:
    """Alone, eight episodes that all lose are clear; among many others they are not."""
    losing = [90.0] * 8 + [100.0] * 12
    rng = np.random.default_rng(5)
    others = (100 + rng.normal(size=(4, 20))).tolist()
    nothing = [[False] * 20] * 5
    assert made([losing], nothing[:1], "CartPole-v1").effects[0].verdict == "load-bearing"
    together = made([losing, *others], nothing, "CartPole-v1").effects
    assert together[0].verdict == "load-bearing"
    assert together[0].return_p > 4 * made([losing], nothing[:1], "CartPole-v1").effects[0].return_p
    losing = [90.0] * 6 + [100.0] * 14
    assert made([losing], nothing[:1], "CartPole-v1").effects[0].verdict == "load-bearing"
    assert made([losing, *others], nothing, "CartPole-v1").effects[0].verdict != "load-bearing"


def test_where_failures_are_unknown_the_return_decides() -> None:
    found = made([[50.0] * 20], [[False] * 20], "Elsewhere-v0")
    assert not found.failures_known
    assert found.effects[0].verdict == "load-bearing"
    assert found.to_frame()["failures_without"].isna().all()


def test_of_many_rules_the_most_used_are_taken_out() -> None:
    changed = np.array([[0, 0], [5, 1], [2, 9], [3, 3], [0, 0]])
    use = RuleUse(changed + 1, changed, changed > 0)
    assert rules_to_take_out(use, 2) == ((2, 1), (3,))
    assert rules_to_take_out(use, 9) == ((2, 1, 3), ())


def test_nothing_is_unused_that_was_switched_off_and_use_needs_steps() -> None:
    rules = mined()
    off = replace(rules, rules=(replace(rules.rules[0], enabled=False), *rules.rules[1:]))
    found = ablate("CartPole-v1", "novice", Shield(off), episodes=2, seed=1)
    assert 0 not in (*found.rules, *found.unused)
    bare = rollout("CartPole-v1", "novice", shield=Shield(off), episodes=1, keep_steps=False)
    with pytest.raises(ValueError, match="not kept"):
        rule_use(bare, Shield(off))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"episodes": 1}, "episodes is 1"),
        ({"seed": -1}, "seed is -1"),
        ({"most": 0}, "most is 0"),
        ({"jobs": 0}, "jobs is 0"),
    ],
)
def test_numbers_out_of_range_are_refused(change: dict[str, int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        ablate("CartPole-v1", "novice", Shield(mined()), **change)


def test_rules_of_another_environment_are_refused() -> None:
    with pytest.raises(InputError, match="CartPole"):
        ablate("LunarLander-v3", "novice", Shield(mined()))


def test_a_caller_who_wants_no_more_is_heard() -> None:
    with pytest.raises(CancelledError):
        ablate(
            "CartPole-v1",
            "novice",
            Shield(mined()),
            episodes=3,
            progress=lambda done, total: done < 2,
        )
