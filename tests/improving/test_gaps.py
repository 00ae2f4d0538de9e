"""Which states need a demonstration, at once and a few episodes at a time."""

from __future__ import annotations

import numpy as np
import pytest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.agents.agent import EXPERT_FOLDER
from sarl_core.improving.gaps import gaps_so_far
from sarl_core.progress import CancelledError
from sarl_core.rollouts.episodes import rollout
from sarl_core.shielding.shield import Shield

CART = "CartPole-v1"


@pytest.fixture(scope="module")
def cart():
    path = EXPERT_FOLDER.parent / "demonstrations" / "cartpole.parquet"
    return load_demonstrations(path).select(range(4))


def test_gaps_are_the_states_without_a_rule(cart):
    rules = mine_rules(cart, supp_min=0.05, conf_min=0.95)
    (found,) = gaps_so_far(CART, rules, episodes=5, seed=3)
    run = rollout(CART, "novice", shield=Shield(rules), episodes=5, seed=3)
    uncovered = ~np.any([rule.applies(run.steps.observation) for rule in rules.rules], axis=0)
    assert len(found) == uncovered.sum() > 0
    assert (found.observations == run.steps.observation[uncovered]).all()
    assert found.met == len(run.steps)
    assert found.share == pytest.approx(uncovered.mean())
    frame = found.to_frame()
    assert list(frame)[:3] == ["episode", "step", "obs_cart position"]
    assert len(frame) == len(found)


def test_a_few_episodes_at_a_time_end_where_all_at_once_do(cart):
    """Also for an agent whose weights depend on the first seed."""
    rules = mine_rules(cart, supp_min=0.05, conf_min=0.95)
    told = []
    *before, last = gaps_so_far(
        CART,
        rules,
        agent="untrained",
        episodes=10,
        seed=7,
        progress=lambda done, total: told.append((done, total)),
    )
    run = rollout(CART, "untrained", shield=Shield(rules), episodes=10, seed=7)
    missing = run.steps.rules < 0
    gaps = missing.any(axis=1)
    assert [one.episodes for one in before] == [8]
    assert last.episodes == 10
    assert last.met == len(run.steps)
    assert np.array_equal(last.missing, missing[gaps])
    assert np.array_equal(last.observations, run.steps.observation[gaps])
    assert np.array_equal(last.episode, run.steps.episode[gaps])
    assert np.array_equal(last.step, run.steps.step[gaps])
    assert told == [(done, 10) for done in range(1, 11)]


def test_what_was_found_before_a_stop_is_there(cart):
    rules = mine_rules(cart, supp_min=0.05, conf_min=0.95)
    found = []
    with pytest.raises(CancelledError):
        found.extend(gaps_so_far(CART, rules, episodes=20, progress=lambda done, _: done < 12))
    assert [one.episodes for one in found] == [8]
