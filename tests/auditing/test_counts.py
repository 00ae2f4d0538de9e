"""What is counted of episodes: the same, into whatever parts a log is cut."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, RuleSet, Shield, audit
from sarl_core.auditing import near
from sarl_core.auditing.audit import Audit
from sarl_core.auditing.clock import clock_of, steps_in_episodes, usual_step
from sarl_core.auditing.counts import LogCounts, counts_of, together
from sarl_core.auditing.matching import matched_log
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.auditing.reference import drift_of, reference_of
from sarl_core.auditing.steps import Yardsticks, held_steps
from sarl_core.demonstrations.formats import read_demonstrations


@pytest.fixture(scope="module")
def log(fleet: pd.DataFrame) -> Demonstrations:
    content = fleet.to_csv(index=False).encode()
    return read_demonstrations(content, "fleet.csv", missing="drop")


@pytest.fixture(scope="module")
def whole(fleet_rules: RuleSet, log: Demonstrations) -> Audit:
    return audit(fleet_rules, log)


def counted(
    shield: Shield, log: Demonstrations, yardsticks: Yardsticks, cuts: list[int]
) -> LogCounts:
    numbers = log.episodes[log.episode_starts]
    parts = []
    before = 0
    for own in np.split(numbers, cuts):
        if len(own):
            part = log.select(own)
            held = held_steps(
                shield, part, matched_log(shield.rule_set, part), yardsticks, before=before
            )
            parts.append(counts_of(held, yardsticks.quarters, before=before))
            before += len(part)
    return together(parts)


@settings(max_examples=25)
@given(
    cuts=st.lists(st.integers(0, 40), max_size=6).map(sorted),
    every=st.integers(1, 7),
    compared=st.booleans(),
)
def test_parts_together_say_what_the_whole_says(
    fleet_rules: RuleSet,
    log: Demonstrations,
    whole: Audit,
    cuts: list[int],
    every: int,
    compared: bool,
) -> None:
    shield = Shield(fleet_rules)
    reference = reference_of(shield, log.select(range(0, 40, 2))) if compared else None
    yardsticks = Yardsticks(
        near.spreads_of(whole.observations, near.sample_keys(log)),
        every,
        whole.step_seconds,
        None if reference is None else reference.edges.quarters,
    )
    documents = []
    for own in ([], cuts):
        counts = counted(shield, log, yardsticks, own)
        drift = drift_of(fleet_rules, counts, reference)
        numbers = AuditNumbers(
            rule_set=fleet_rules,
            counts=counts,
            looked_at=every,
            step_seconds=whole.step_seconds,
            drift=drift,
            notes=whole.notes,
        )
        documents.append(json.dumps(numbers.to_dict()))
    assert documents[0] == documents[1]
    if every == 1 and not compared:
        assert documents[0] == json.dumps(whole.to_dict())


def test_all_that_is_counted_occurs(whole: Audit) -> None:
    document = whole.to_dict()
    assert len(document["worst"]) == 10
    assert document["time"]["worst_minute"]["breaks"] > 2
    assert document["near"]["count"] > 20
    assert document["missing_steps"] > 20
    assert min(document["covered"], document["broken"], document["outside"]) > 0
    assert whole.outside_by_rule.sum() >= whole.outside_count
    assert int(whole.is_covered.sum()) == document["covered"]


def test_the_usual_step_is_that_of_most_steps(log: Demonstrations) -> None:
    times = np.arange(len(log)) * 0.02
    few = log.episodes < 2
    times[few] = np.arange(few.sum()) * 5.0
    timed = replace(log, times=times)
    step = usual_step(*steps_in_episodes(timed))
    assert step == pytest.approx(0.02)
    clock = clock_of(timed, step)
    assert clock is not None
    assert len(clock.gaps) == few.sum() - 2
    still = replace(log, times=np.zeros(len(log)))
    assert usual_step(*steps_in_episodes(still)) is None
    assert clock_of(still, None) is None


def test_spreads_are_those_of_the_same_steps_in_any_order(
    log: Demonstrations, whole: Audit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(near, "SAMPLE", 500)
    keys = near.sample_keys(log)
    chosen = near.in_sample(keys)
    assert chosen.sum() == 500
    assert len(np.unique(log.episodes[chosen])) > 30
    order = np.random.default_rng(0).permutation(len(log))
    spreads = near.spreads_of(whole.observations, keys)
    assert np.array_equal(near.spreads_of(whole.observations[order], keys[order]), spreads)
    assert not np.array_equal(near.spreads_of(whole.observations[:500], keys[:500]), spreads)
