"""Which pairs of features a round's rules may combine."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

from sarl_core import load_demonstrations
from sarl_core.improving.questions import Answers, ask
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.trial import make_agent

DATA = Path(__file__).resolve().parents[2] / "data"
WALKER = "BipedalWalker-v3"


@pytest.mark.parametrize("features", [11, 12])  # 55 pairs, and 66
def test_of_many_pairs_none_is_offered_in_every_other_round(features: int) -> None:
    start = load_demonstrations(DATA / "demonstrations" / "bipedal_walker.parquet")
    start = start.select([0])
    pairs = list(combinations([*range(8), *range(9, 13)][:features], 2))
    expert = make_agent("expert", WALKER)
    answers = Answers(WALKER, expert, start, pairs=pairs, divider=5)
    for seed in range(2):
        played = rollout(WALKER, "novice", episodes=1, seed=seed, keep_steps=True, max_steps=40)
        assert played.steps is not None
        wanted = ask(expert, played.steps.observation, played.steps.episode)
        answers.add(played.steps, wanted, seed=seed)
    derives = [bool(answers.pairs(rounds).derived) for rounds in range(3)]
    assert derives == [True, features == 11, True]
    assert answers.pairs(2, derived=()).derived == ()
