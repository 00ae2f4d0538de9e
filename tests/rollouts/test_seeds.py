"""Where seeds begin is said once."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import pytest

from sarl_core import InputError, rollout
from sarl_core.improving.plan import Plan
from sarl_core.improving.probing.probing import ProbePlan
from sarl_core.rollouts import seeds

ROOT = Path(__file__).resolve().parents[2]


def test_parts_of_one_run_cannot_meet_however_large_it_is():
    ends = {
        seeds.ROUNDS: seeds.MOST_ROUNDS * seeds.SEEDS_A_ROUND,
        seeds.VALIDATION: seeds.MOST_VALIDATION,
    }
    later = sorted([*ends, seeds.REFINEMENT])
    for first, count in ends.items():
        assert first + count <= later[later.index(first) + 1]
    assert seeds.MOST_EPISODES_A_ROUND <= seeds.SEEDS_A_ROUND


def test_purposes_share_no_seeds_but_those_that_shipped_files_name():
    for (one, first), (other, second) in combinations(seeds.RANGES.items(), 2):
        meet = max(first.start, second.start) < min(first.stop, second.stop)
        assert meet == (frozenset({one, other}) in seeds.SHARED), (one, other)


def test_every_first_seed_is_the_beginning_of_its_range():
    own = {name: value for name, value in vars(seeds).items() if name in seeds.RANGES}
    assert own == {name: each.start for name, each in seeds.RANGES.items()}
    # Nothing that chose a rule set has the seeds of what the paper is reproduced with.
    assert not {"VALIDATION", "REPRODUCED", "REPORT"} & set().union(*seeds.SHARED)


def test_no_run_of_aggregate_reaches_what_the_paper_is_reproduced_with_or_what_certifies():
    for name in ("RECORDED", "REPRODUCED", "RELEVANCE", "CERTIFIED"):
        assert seeds.RANGES[name].stop <= seeds.ROUNDS


def test_no_other_file_of_the_library_has_seeds_of_its_own():
    """A new first seed belongs into the list, where one sees what it would meet."""
    pattern = re.compile(r"^\w*SEEDS? = [\d_]{5,}", re.MULTILINE)
    found = {
        path.name
        for path in (ROOT / "sarl_core").rglob("*.py")
        if pattern.search(path.read_text(encoding="utf-8"))
    }
    assert found == set()


@pytest.mark.parametrize("agent", ["novice", "untrained"])
def test_a_seed_that_no_file_could_hold_is_refused(agent: str) -> None:
    env_id = "CartPole-v1"
    assert len(rollout(env_id, agent, episodes=2, seed=seeds.LARGEST_SEED, max_steps=3)) == 2
    for seed, said in ((seeds.LARGEST_SEED + 1, "at most"), (10**20, "at most"), (-1, "at least")):
        with pytest.raises(InputError, match=f"seed is {seed} and must be {said}"):
            rollout(env_id, agent, episodes=2, seed=seed, max_steps=3)
    with pytest.raises(InputError, match="seed is far too large"):
        rollout(env_id, agent, episodes=2, seed=10**5_000)
    with pytest.raises(InputError, match="1,000,000,000 or fewer"):
        Plan(2, seed=seeds.LARGEST_RUN + 1)
    with pytest.raises(InputError, match="must be at most 1000000000"):
        ProbePlan(seed=seeds.LARGEST_RUN + 1)
