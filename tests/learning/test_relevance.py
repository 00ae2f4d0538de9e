from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import InputError, load_demonstrations, mine_rules
from sarl_core.learning.relevance import Relevance, relevance_from_frame, study_relevance
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import CancelledError
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.seeds import MOST_LEARNERS

CART = Path(__file__).parents[2] / "data" / "demonstrations" / "cartpole.parquet"
SMALL = {"seeds": (0, 3), "phases": 2, "learning_steps": 60, "test_steps": 333}


@pytest.fixture(scope="module")
def rules() -> dict[str, RuleSet]:
    demonstrations = load_demonstrations(CART)
    filtered = mine_rules(demonstrations, supp_min=0.005, conf_min=0.95)
    unfiltered = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)
    # Whatever the state: push left.
    (always,) = mine_rules(demonstrations, supp_min=0.9, conf_min=0.0).rules
    left = replace(filtered, rules=(replace(always, action=0),))
    return {"filtered": filtered, "unfiltered": unfiltered, "left": left}


@pytest.fixture(scope="module")
def found(rules: dict[str, RuleSet]) -> Relevance:
    return study_relevance("CartPole-v1", rules, **SMALL)  # type: ignore[arg-type]


def test_every_step_of_a_test_counts_and_no_other(found: Relevance) -> None:
    assert found.applied.shape == (3, 2, 3)
    assert (found.applied[2] == 333).all()
    assert (found.applied[1] == 333).all()  # these rules cover every state
    assert ((found.applied[0] > 0) & (found.applied[0] < 333)).all()
    assert (found.obeyed + found.broken == found.applied).all()
    assert found.learned_steps.tolist() == [0, 60, 120]


def test_before_learning_it_is_the_untrained_policy_that_is_watched(
    found: Relevance, rules: dict[str, RuleSet]
) -> None:
    shown = record("CartPole-v1", "untrained", steps=20_000, seed=77)
    for number, rule_set in enumerate(rules.values()):
        applied = broken = 0
        for rule in rule_set.rules:
            states = rule.applies(shown.observations)
            applied += int(states.sum())
            broken += int((shown.actions[states] != rule.action).sum())
        assert found.applied_share[number, :, 0].mean() == pytest.approx(applied / 20_000, abs=0.12)
        # A fresh policy is all but a coin, whatever the rules.
        assert broken / applied == pytest.approx(0.5, abs=0.05)
        assert found.obeyed_share[number, :, 0].mean() == pytest.approx(0.5, abs=0.12)


def test_the_rules_only_watch(found: Relevance, rules: dict[str, RuleSet]) -> None:
    """A shield that pushed left always would end every episode within some ten steps."""
    alone = study_relevance("CartPole-v1", {"left": rules["left"]}, **SMALL)  # type: ignore[arg-type]
    assert (alone.returns == found.returns).all()
    assert (alone.broken[0] == found.broken[2]).all()
    assert found.returns.mean() > 14


def test_learners_differ_by_their_seeds_and_change_as_they_learn(found: Relevance) -> None:
    assert (found.broken[2, 0] != found.broken[2, 1]).any()
    assert len(set(found.broken[2, 0].tolist())) > 1


def test_a_table_brings_back_the_same_numbers(found: Relevance) -> None:
    frame = found.to_frame()
    assert len(frame) == 18
    row = frame.iloc[7]
    assert (row["rules"], row["seed"], row["learned_steps"]) == ("unfiltered", 0, 60)
    assert row["broken"] == found.broken[1, 0, 1]
    again = relevance_from_frame(frame)
    assert again.to_frame().equals(frame)
    assert again.names == found.names
    assert again.rule_counts == (5, 1508, 1)


def test_a_caller_who_wants_no_more_is_heard(rules: dict[str, RuleSet]) -> None:
    told = []

    def progress(done: int, total: int) -> bool:
        told.append((done, total))
        return done < 2

    with pytest.raises(CancelledError):
        study_relevance("CartPole-v1", rules, **SMALL, progress=progress)  # type: ignore[arg-type]
    assert told == [(0, 6), (1, 6), (2, 6)]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"phases": 0}, "phases is 0"),
        ({"test_steps": 0}, "test_steps is 0"),
        ({"learning_steps": 1}, "learning_steps is 1"),
        ({"seeds": ()}, "seeds is 0"),
        ({"seeds": (1, 1)}, "must differ"),
        ({"seeds": (-1,)}, f"from 0 to {MOST_LEARNERS - 1}"),
    ],
)
def test_numbers_out_of_range_are_refused(
    change: dict[str, object], words: str, rules: dict[str, RuleSet]
) -> None:
    with pytest.raises(InputError, match=words):
        study_relevance("CartPole-v1", rules, **(SMALL | change))  # type: ignore[arg-type]


def test_rules_of_another_environment_are_refused(rules: dict[str, RuleSet]) -> None:
    with pytest.raises(InputError, match="CartPole"):
        study_relevance("LunarLander-v3", rules, **SMALL)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rule sets is 0"):
        study_relevance("CartPole-v1", {}, **SMALL)  # type: ignore[arg-type]


def test_the_share_kept_of_no_step_is_no_number() -> None:
    none = np.zeros((1, 1, 1), dtype=np.int64)
    empty = Relevance("X", ("a",), (0,), none[0, 0], none[0, 0], 5, none, none, np.zeros((1, 1)))
    assert np.isnan(empty.obeyed_share).all()
    assert (empty.applied_share == 0).all()
