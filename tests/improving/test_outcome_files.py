"""What came of improving rules, read back from its files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.errors import InputError
from sarl_core.improving.aggregation import Aggregation, aggregate
from sarl_core.improving.aggregation_files import aggregation_card
from sarl_core.improving.gaps import Gaps, gaps_so_far
from sarl_core.improving.outcome_files import (
    aggregation_contents,
    aggregation_from,
    gaps_contents,
    gaps_from,
)
from sarl_core.improving.plan import Plan

CARTPOLE = load_demonstrations(
    Path(__file__).parents[2] / "data" / "demonstrations" / "cartpole.parquet"
)
PLAN = Plan(4, rounds=2, episodes=4, validation=8, report=8)


def files(contents: dict[str, tuple[bytes, str]]) -> dict[str, bytes]:
    return {role: content for role, (content, _) in contents.items()}


@pytest.fixture(scope="module")
def improved() -> Aggregation:
    return aggregate(CARTPOLE, PLAN)


@pytest.fixture(scope="module")
def gaps() -> Gaps:
    rules = mine_rules(CARTPOLE, supp_min=0.2, conf_min=0.9)
    *_, last = gaps_so_far("CartPole-v1", rules, episodes=3)
    return last


def test_an_aggregation_says_the_same_when_it_is_read_back(improved: Aggregation) -> None:
    again = aggregation_from(files(aggregation_contents(improved)), PLAN)
    assert aggregation_card(again, command="x") == aggregation_card(improved, command="x")
    assert again.rule_set == improved.rule_set
    assert again.demonstrations.digest == improved.demonstrations.digest
    assert again.remarks == improved.remarks
    assert again.is_finished
    for one, other in zip(again.rounds, improved.rounds, strict=True):
        assert one.returns.tolist() == other.returns.tolist()
        assert one.failures == other.failures
        assert (one.needed, one.cut) == (other.needed, other.cut)


def test_a_stopped_aggregation_is_still_a_stopped_one() -> None:
    def stop(done: int, total: int) -> bool:
        return done < 6

    stopped = aggregate(CARTPOLE, PLAN, progress=stop)
    again = aggregation_from(files(aggregation_contents(stopped)), PLAN)
    assert not again.is_finished
    assert len(again.rounds) == len(stopped.rounds) == 1
    assert again.seeds == stopped.seeds


def test_gaps_say_the_same_when_they_are_read_back(gaps: Gaps) -> None:
    again = gaps_from(files(gaps_contents(gaps)))
    assert len(again)
    for name in ("episode", "step", "observations", "missing"):
        assert getattr(again, name).dtype == getattr(gaps, name).dtype
        assert np.array_equal(getattr(again, name), getattr(gaps, name))
    assert (again.met, again.episodes, again.cut, again.notes) == (
        gaps.met,
        gaps.episodes,
        gaps.cut,
        gaps.notes,
    )
    assert again.to_frame().equals(gaps.to_frame())


@pytest.mark.parametrize("role", ["run", "rules", "demonstrations", "report"])
def test_what_is_damaged_is_refused_in_a_sentence(improved: Aggregation, role: str) -> None:
    whole = files(aggregation_contents(improved))
    with pytest.raises(InputError):
        aggregation_from(whole | {role: whole[role][:-20]}, PLAN)
    if role != "report":
        with pytest.raises(InputError, match=f"lacks its {role}"):
            aggregation_from({name: one for name, one in whole.items() if name != role}, PLAN)


def test_what_another_version_kept_is_refused(improved: Aggregation, gaps: Gaps) -> None:
    whole = files(aggregation_contents(improved))
    document = json.loads(whole["run"])
    for changed in (document | {"version": 2}, document | {"more": 1}, [document]):
        with pytest.raises(InputError, match="what is kept of the run"):
            aggregation_from(whole | {"run": json.dumps(changed).encode()}, PLAN)
    states = files(gaps_contents(gaps))
    with pytest.raises(InputError):
        gaps_from(states | {"states": states["states"][:-30]})
    with pytest.raises(InputError, match="what is kept of the run"):
        gaps_from(states | {"run": whole["run"]})
