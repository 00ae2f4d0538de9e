"""Rule sets that are tried side by side bring what each brings alone."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import load_demonstrations
from sarl_core.agents.agent import EpisodicAgent
from sarl_core.improving.candidate import Candidate, Evaluator
from sarl_core.improving.movement import Movement
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.progress import CancelledError
from sarl_core.rollouts.choices import weighed
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
WORTH = 30.0
EPISODES = 5
STEPS = 250


class Remembering:
    """An agent that acts by what it remembers of its episode."""

    name = "remembering"
    n_uniforms = 0

    def __init__(self):
        self.steps = 0

    def begin_episode(self, seed):
        self.steps = seed % 3

    def act(self, observations, uniforms):
        self.steps += 1
        return np.full((len(observations), 1), self.steps % 2, dtype=np.int64)


class Placed:
    """An agent that acts by where in its episode it is."""

    name = "placed"
    n_uniforms = 1

    def place(self, episodes, steps):
        self.where = episodes + steps

    def act(self, observations, uniforms):
        assert len(self.where) == len(observations)
        return (self.where[:, None] % 4 - 2 + uniforms).astype(np.float32)


CASES = {
    "labels": ("cartpole", "untrained", 2, "centre"),
    "an amount": ("pendulum", "novice", 9, "clip"),
    "amounts": ("lunar_lander_continuous", "untrained", 8, "clip"),
    "one episode after the other": ("cartpole", Remembering(), 2, "centre"),
    "by place": ("pendulum", Placed(), 9, "clip"),
}


def candidates(pairs, divider, count=9):
    trees = grow_budgeted_trees(pairs, max_rules=4, divider=divider, seed=0)
    moved = Movement(trees, pairs, step=0.6, seed=3).ask()
    return [Candidate.of_trees(trees), *moved][:count]


def require_alike(pairs, agent, divider, projection, workers=None):
    """All together bring what each brings alone."""
    tried = candidates(pairs, divider)
    evaluator = Evaluator(
        pairs.env_id, agent, projection=projection, divider=divider, worth=WORTH, max_steps=STEPS
    )
    told = []
    together = evaluator.scores(
        tried,
        pairs,
        seed=40,
        episodes=EPISODES,
        workers=workers,
        progress=lambda *numbers: told.append(numbers),
    )
    alone = [
        weighed(
            rollout(
                pairs.env_id,
                agent,
                shield=Shield(leaf_rules(one.trees(pairs, divider)), projection=projection),
                episodes=EPISODES,
                seed=40,
                keep_steps=False,
                max_steps=STEPS,
            ),
            WORTH,
        )
        for one in tried
    ]
    np.testing.assert_array_equal(together, alone)
    assert len(np.unique(together)) > EPISODES
    assert (told[0], told[-1]) == ((0, len(tried)), (len(tried), len(tried)))
    assert told == sorted(told)


@pytest.mark.parametrize("case", CASES)
def test_each_brings_what_it_brings_alone(case):
    task, named, divider, projection = CASES[case]
    pairs = load_demonstrations(DATA / f"{task}.parquet")
    agent = make_agent(named, pairs.env_id)
    require_alike(pairs, agent, divider, projection)
    assert isinstance(agent, EpisodicAgent) == (case == "one episode after the other")


@pytest.mark.parametrize(
    "name", ["Offset", "MultiDiscrete", "MultiBinary", "Matrix", "Precise", "Whole"]
)
def test_in_every_kind_of_space(name):
    env_id = f"toy/{name}-v0"
    require_alike(record(env_id, "novice", steps=150), make_agent("novice", env_id), 3, "centre")


def test_rules_that_know_the_features_in_another_order():
    pairs = load_demonstrations(DATA / "cartpole.parquet")
    turned = replace(
        pairs,
        observations=pairs.observations[:, ::-1].copy(),
        feature_names=pairs.feature_names[::-1],
        feature_units=pairs.feature_units[::-1],
    )
    require_alike(turned, make_agent("novice", pairs.env_id), 2, "centre")


class Counting(ThreadPoolExecutor):
    """Says how many it works on at once, and counts what it is given."""

    def __init__(self, workers):
        super().__init__(workers)
        self.workers, self.given = workers, 0

    def submit(self, *arguments, **named):
        self.given += 1
        return super().submit(*arguments, **named)


@pytest.mark.parametrize(("workers", "tasks"), [(1, 2), (2, 2), (4, 4), (16, 9)])
def test_whoever_does_the_work_has_about_as_much_of_it(workers, tasks):
    pairs = load_demonstrations(DATA / "pendulum.parquet").select(range(4))
    with Counting(workers) as executor:
        require_alike(pairs, make_agent("novice", pairs.env_id), 5, "clip", executor)
    assert executor.given == tasks


def test_who_stops_need_not_wait_for_all_that_are_tried_together():
    pairs = load_demonstrations(DATA / "cartpole.parquet")
    tried = candidates(pairs, 2)
    agent = make_agent("novice", pairs.env_id)
    evaluator = Evaluator(
        pairs.env_id, agent, projection="centre", divider=2, worth=0.0, max_steps=20
    )
    told = []

    def stop(done, _):
        told.append(done)
        return len(told) < 3

    with pytest.raises(CancelledError):
        evaluator.scores(tried, pairs, seed=0, episodes=4, workers=None, progress=stop)
    assert told == [0, 0, 0]
