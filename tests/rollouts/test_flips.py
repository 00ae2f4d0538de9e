from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest

from sarl_core import Shield, load_demonstrations, mine_rules, rollout
from sarl_core.rendering.replay import render_episode
from sarl_core.rollouts.episodes import join
from sarl_core.rollouts.flips import Pace, pace_of

DATA = Path(__file__).parents[2] / "data"
CARTPOLE = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield(mine_rules(CARTPOLE, supp_min=0.0, conf_min=1.0))


def test_a_rollout_counts_the_flips_of_its_own_record(shield: Shield) -> None:
    found = rollout("CartPole-v1", "novice", shield=shield, episodes=7, seed=11, batch=3)
    assert found.steps is not None
    assert found.flips is not None
    for number, flips in enumerate(found.flips.tolist()):
        on = found.steps.of_episode(number).intervened.tolist()
        assert flips == sum(a != b for a, b in pairwise(on))
    assert found.flips.sum() > 0
    without = rollout("CartPole-v1", "novice", shield=shield, episodes=7, seed=11, keep_steps=False)
    assert without.flips is not None
    assert without.flips.tolist() == found.flips.tolist()


def test_parts_and_wholes_keep_their_flips(shield: Shield) -> None:
    found = rollout("CartPole-v1", "novice", shield=shield, episodes=5, seed=3)
    pieces = [found.part(0, 2), found.part(2, 5)]
    whole = join(pieces)
    assert found.flips is not None
    assert whole.flips is not None
    assert whole.flips.tolist() == found.flips.tolist()
    assert pieces[1].flips is not None
    assert len(pieces[1].flips) == 3


def test_a_film_counts_as_the_rollout_does(shield: Shield) -> None:
    film = render_episode("CartPole-v1", "novice", shield=shield, seed=11)
    found = rollout("CartPole-v1", "novice", shield=shield, episodes=1, seed=11)
    assert film.episodes[0].flips is not None
    assert found.flips is not None
    assert film.episodes[0].flips.tolist() == found.flips.tolist()


def test_the_pace_is_that_of_the_pictures_or_a_hundred_steps() -> None:
    assert pace_of("CartPole-v1") == Pace(50.0, "second")
    assert pace_of("toy/Offset-v0") == Pace(100, "100 steps")
    assert Pace(50.0, "second").rate(12, 200) == 3.0  # in four seconds
    assert math.isnan(Pace(50.0, "second").rate(0, 0))
