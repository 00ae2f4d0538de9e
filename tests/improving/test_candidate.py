"""Rule sets that are tried side by side bring what each brings alone."""

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


def candidates(task, divider, count=9):
    pairs = load_demonstrations(DATA / f"{task}.parquet")
    trees = grow_budgeted_trees(pairs, max_rules=4, divider=divider, seed=0)
    return pairs, [Candidate.of_trees(trees), *Movement(trees, pairs, step=0.6, seed=3).ask()][
        :count
    ]


@pytest.mark.parametrize("case", CASES)
def test_each_brings_what_it_brings_alone(case):
    task, named, divider, projection = CASES[case]
    pairs, tried = candidates(task, divider)
    agent = make_agent(named, pairs.env_id)
    evaluator = Evaluator(
        pairs.env_id, agent, projection=projection, divider=divider, worth=WORTH, max_steps=STEPS
    )
    told = []
    together = evaluator.scores(
        tried,
        pairs,
        seed=40,
        episodes=EPISODES,
        workers=None,
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
    assert isinstance(agent, EpisodicAgent) == (case == "one episode after the other")


def test_who_stops_need_not_wait_for_all_that_are_tried_together():
    pairs, tried = candidates("cartpole", 2)
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
