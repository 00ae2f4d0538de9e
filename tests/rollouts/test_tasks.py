from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError, SarlError, WorkError
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.processes import Processes
from sarl_core.rollouts.episodes import Episodes, join, rollout
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.tasks import Task, run_tasks
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

COLUMNS = ("seeds", "returns", "lengths", "interventions", "covered", "terminated", "last_rewards")


@dataclass(frozen=True)
class Misbehaving:
    """An agent whose actions no environment takes, or that takes its process with it."""

    deadly: bool
    name: str = "misbehaving"
    n_uniforms: int = 0

    def act(self, observations: NDArray[np.float32], uniforms: Any) -> NDArray[np.int64]:
        if self.deadly:
            os._exit(1)
        raise RuntimeError("this is\nnot an action")


@pytest.fixture(scope="module")
def pool() -> Iterator[Processes]:
    with Processes(2) as processes:
        yield processes


def gathered(pool: Executor, tasks: list[Task]) -> dict[int, list[Episodes | SarlError]]:
    found: dict[int, list[Episodes | SarlError]] = {}
    for task, result in run_tasks(tasks, pool):
        found.setdefault(task, []).append(result)
    return found


def task(agent: str = "novice", episodes: int = 40, seed: int = 3) -> Task:
    return Task("CartPole-v1", make_agent(agent, "CartPole-v1"), None, seed, episodes)


def test_pieces_together_are_what_one_rollout_gives(pool: Processes) -> None:
    rules = mine_rules(record("CartPole-v1", "expert", steps=1_000), supp_min=0.0, conf_min=1.0)
    novice = make_agent("novice", "CartPole-v1")
    tasks = [task(), Task("CartPole-v1", novice, Shield(rules), 7, 45), task("expert", 1)]
    found = gathered(pool, tasks)
    for index, asked in enumerate(tasks):
        pieces = [piece for piece in found[index] if isinstance(piece, Episodes)]
        whole = rollout(
            asked.env_id,
            asked.agent,
            shield=asked.shield,
            episodes=asked.episodes,
            seed=asked.seed,
            keep_steps=False,
        )
        together = join(pieces)
        assert together.steps is None
        for name in COLUMNS:
            assert (getattr(together, name) == getattr(whole, name)).all()
    assert len(found[1]) > 1


def test_chosen_episodes_without_a_rule_are_what_a_rollout_without_it_gives(
    pool: Processes,
) -> None:
    rules = mine_rules(record("CartPole-v1", "expert", steps=1_000), supp_min=0.0, conf_min=1.0)
    novice, shield = make_agent("novice", "CartPole-v1"), Shield(rules)
    used = rollout("CartPole-v1", novice, shield=shield, episodes=45, seed=7).steps
    assert used is not None
    rule = int(np.bincount(used.rules[used.rules >= 0]).argmax())
    which = (0, 3, *range(9, 40), 44)
    tasks = [
        Task("CartPole-v1", novice, shield, 7, 45, without=rule, which=which),
        Task("CartPole-v1", novice, shield, 7, 45),
        Task("CartPole-v1", novice, None, 7, 45, which=(44,)),
    ]
    found = gathered(pool, tasks)
    others = replace(rules, rules=tuple(one for one in rules.rules if one is not rules.rules[rule]))
    wholes = [
        rollout("CartPole-v1", novice, shield=one, episodes=45, seed=7, keep_steps=False)
        for one in (Shield(others), shield, None)
    ]
    assert wholes[0].returns.tolist() != wholes[1].returns.tolist()
    for index, places in enumerate([list(which), list(range(45)), [44]]):
        pieces = join([piece for piece in found[index] if isinstance(piece, Episodes)])
        for name in COLUMNS:
            assert (getattr(pieces, name) == getattr(wholes[index], name)[places]).all()


def test_what_is_done_stays_when_the_rest_is_called_off(pool: Processes) -> None:
    work = run_tasks([task(episodes=1_000)], pool)
    index, first = next(work)
    work.close()
    assert index == 0
    assert isinstance(first, Episodes)
    assert first.seeds.tolist() == list(range(3, 3 + len(first)))
    # The processes are there for others.
    assert sum(len(piece) for piece in gathered(pool, [task(episodes=5)])[0]) == 5  # type: ignore[arg-type]


def test_a_task_that_fails_leaves_the_others_alone(pool: Processes) -> None:
    bad = Task("CartPole-v1", Misbehaving(deadly=False), None, 0, 50)
    found = gathered(pool, [task(episodes=9), bad, task(episodes=9)])
    (error,) = found[1]
    assert isinstance(error, InputError)
    assert str(error) == (
        "an episode in CartPole-v1 failed (RuntimeError: this is not an action); choose another "
        "environment or agent"
    )
    for index in (0, 2):
        assert sum(len(piece) for piece in found[index] if isinstance(piece, Episodes)) == 9


def test_rules_of_another_environment_are_one_sentence(pool: Processes) -> None:
    rules = mine_rules(record("Pendulum-v1", "expert", steps=400), supp_min=0.0, conf_min=1.0)
    bad = Task("CartPole-v1", make_agent("novice", "CartPole-v1"), Shield(rules), 0, 10)
    (error,) = gathered(pool, [bad])[0]
    assert isinstance(error, InputError)
    assert "rules" in str(error)


def test_after_a_process_has_died_there_are_new_ones() -> None:
    deadly = Task("CartPole-v1", Misbehaving(deadly=True), None, 0, 2)
    with Processes(1) as pool:
        with pytest.raises(WorkError, match="ended unexpectedly"):
            gathered(pool, [deadly])
        assert sum(len(piece) for piece in gathered(pool, [task(episodes=3)])[0]) == 3


def test_where_a_process_dies_a_rollout_says_so_and_the_next_one_runs() -> None:
    with pytest.raises(WorkError, match="a process that ran episodes ended unexpectedly"):
        rollout("CartPole-v1", Misbehaving(deadly=True), episodes=4, jobs=2)
    again = rollout("CartPole-v1", "novice", episodes=4, jobs=2)
    assert again.returns.tolist() == rollout("CartPole-v1", "novice", episodes=4).returns.tolist()


def test_any_executor_fits_in() -> None:
    """As a Dask client's: one that is no process of ours, and says nothing of its size."""
    rules = mine_rules(record("CartPole-v1", "expert", steps=1_000), supp_min=0.0, conf_min=1.0)
    cart = Environment("CartPole-v1", '{"max_episode_steps": 60}')
    asked = Task(cart, make_agent("novice", cart), Shield(rules), 7, 45)
    whole = rollout(asked.env_id, asked.agent, shield=asked.shield, episodes=45, seed=7)
    with ThreadPoolExecutor(2) as executor:
        pieces = gathered(executor, [asked])[0]
        ours = rollout(
            asked.env_id,
            asked.agent,
            shield=asked.shield,
            episodes=45,
            seed=7,
            jobs=2,
            executor=executor,
        )
    assert len(pieces) > 1
    for one in (ours, join([piece for piece in pieces if isinstance(piece, Episodes)])):
        for name in COLUMNS:
            assert (getattr(one, name) == getattr(whole, name)).all()


@dataclass(frozen=True)
class Telling:
    """An agent that writes down how far its process gives way to others."""

    inner: Agent
    file: Path
    n_uniforms: int
    name: str = "telling"

    def act(self, observations: NDArray[np.float32], uniforms: Any) -> NDArray[Any]:
        self.file.write_text(str(os.nice(0)))
        return self.inner.act(observations, uniforms)


def test_processes_give_way_to_those_who_serve_pages_and_not_where_a_caller_waits(
    tmp_path: Path,
) -> None:
    novice = make_agent("novice", "CartPole-v1")
    agent = Telling(novice, tmp_path / "nice", novice.n_uniforms)
    told = []
    for gives_way in (True, False):
        with Processes(1, gives_way=gives_way) as pool:
            gathered(pool, [Task("CartPole-v1", agent, None, 0, 1)])
        told.append(int(agent.file.read_text()))
    assert told[0] > told[1] == os.nice(0)


@pytest.mark.parametrize(("episodes", "seed"), [(0, 0), (-1, 0), (1, -1)])
def test_nothing_to_run_is_refused(episodes: int, seed: int) -> None:
    with pytest.raises(InputError, match="at least one episode"):
        task(episodes=episodes, seed=seed)
