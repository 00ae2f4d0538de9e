"""The learning curve and stability, against mining each set by hand."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Demonstrations, InputError, mine_rules
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.holding_out import hold_out
from sarl_core.mining.validation.learning_curve import learning_curve
from sarl_core.mining.validation.stability import rule_stability
from sarl_core.progress import CancelledError

THRESHOLDS = Thresholds(0.01, 0.85)


def mined_at(demonstrations, thresholds=THRESHOLDS):
    return mine_rules(demonstrations, supp_min=thresholds.support, conf_min=thresholds.confidence)


def right_share(rules, pairs):
    covered = np.zeros(len(pairs), bool)
    right = np.zeros(len(pairs), bool)
    for rule in rules.rules:
        applies = rule.applies(pairs.observations)
        covered |= applies
        right |= applies & (pairs.actions == rule.action)
    episodes = [pairs.episodes == episode for episode in np.unique(pairs.episodes)]
    return np.mean([right[rows].sum() / covered[rows].sum() for rows in episodes])


@pytest.fixture(scope="module")
def steps_of_two() -> Demonstrations:
    """Twelve episodes whose labels follow one threshold, in which each is a little noisy."""
    rng = np.random.default_rng(5)
    states = rng.uniform(-1, 1, (1200, 2)).astype(np.float32)
    labels = (states[:, 0] + 0.02 * rng.normal(size=1200) > 0.2).astype(int)
    return Demonstrations(states, labels, np.repeat(np.arange(12), 100))


def test_the_curve_holds_what_mining_each_part_gives(lander_like):
    split = hold_out(lander_like, 0.25, seed=1)
    curve = learning_curve(
        split.mined, THRESHOLDS, held_out=split.held_out, orders=3, points=4, seed=2
    )
    assert curve.episodes.tolist() == [1, 2, 6, 15]
    assert curve.tried_on == "held out"
    rng = np.random.default_rng(2)
    episodes = np.unique(split.mined.episodes)
    for row in range(3):
        order = episodes[rng.permutation(15)]
        for column, size in enumerate(curve.episodes):
            rules = mined_at(split.mined.select(order[:size]))
            assert curve.rules[row, column] == len(rules)
            assert curve.mean_length[row, column] == pytest.approx(rules.mean_length)
            assert curve.coverage[row, column] == pytest.approx(rules.coverage)
            expected = right_share(rules, split.held_out)
            assert curve.fidelity[row, column] == pytest.approx(expected)


def test_without_held_out_episodes_the_later_ones_are_tried(lander_like):
    curve = learning_curve(lander_like, THRESHOLDS, orders=2, points=3)
    order = np.random.default_rng(0).permutation(20)
    size = curve.episodes[1]
    rules = mined_at(lander_like.select(order[:size]))
    rest = lander_like.select(order[size:])
    assert curve.fidelity[0, 1] == pytest.approx(right_share(rules, rest))
    assert np.isnan(curve.fidelity[:, -1]).all()
    assert curve.tried_on == "not yet used"
    assert (curve.rules[:, -1] == len(mined_at(lander_like))).all()


def test_one_episode_is_a_curve_of_one_point():
    rng = np.random.default_rng(0)
    alone = Demonstrations(rng.normal(size=(30, 2)), rng.integers(0, 2, 30), np.zeros(30, int))
    assert learning_curve(alone, THRESHOLDS, orders=2).episodes.tolist() == [1]


def test_processes_and_one_after_the_other_give_the_same(lander_like):
    rules = mined_at(lander_like)
    with ThreadPoolExecutor(2) as executor:
        curve = learning_curve(lander_like, THRESHOLDS, orders=2, points=3, executor=executor)
        stable = rule_stability(rules, lander_like, rounds=3, executor=executor)
    alone = learning_curve(lander_like, THRESHOLDS, orders=2, points=3)
    assert np.array_equal(curve.fidelity, alone.fidelity, equal_nan=True)
    assert repr(stable) == repr(rule_stability(rules, lander_like, rounds=3))


@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor(1)])
def test_work_is_called_off_where_the_caller_says_so(lander_like, executor):
    told = []

    def stop(done, total):
        told.append((done, total))
        return done < 1

    with pytest.raises(CancelledError, match="stopped after 1 of 5"):
        rule_stability(
            mined_at(lander_like), lander_like, rounds=5, executor=executor, progress=stop
        )
    assert told[0] == (0, 5)
    assert told[-1] == (1, 5)


# --- stability ------------------------------------------------------------------------------------


def stability_by_hand(rules, demonstrations, rounds, limit, seed=0):
    """Overlaps by sets of rows; one entry a rule: overlaps and thresholds of each round."""
    rng = np.random.default_rng(seed)
    count = demonstrations.n_episodes
    numbers = np.unique(demonstrations.episodes)
    found = [([], []) for _ in rules.rules]
    for _ in range(rounds):
        drawn = numbers[rng.integers(0, count, count)]
        parts = [np.flatnonzero(demonstrations.episodes == number) for number in drawn]
        rows = np.concatenate(parts)
        again = mined_at(
            Demonstrations(
                demonstrations.observations[rows],
                demonstrations.actions[rows],
                np.repeat(np.arange(count), [len(part) for part in parts]),
                label_names=demonstrations.label_names,
            )
        )
        for rule, (overlaps, thresholds) in zip(rules.rules, found, strict=True):
            own = set(np.flatnonzero(rule.applies(demonstrations.observations)))
            best, like = 0.0, None
            for other in again.rules:
                theirs = set(np.flatnonzero(other.applies(demonstrations.observations)))
                overlap = len(own & theirs) / len(own | theirs) if own | theirs else 0.0
                if other.action == rule.action and overlap > best:
                    best, like = overlap, other
            overlaps.append(best)
            thresholds.append(like.bounds if best >= limit else ())
    return found


def test_stability_is_what_sets_of_rows_say(steps_of_two):
    rules = mined_at(steps_of_two)
    assert len(rules) > 1
    stable = rule_stability(rules, steps_of_two, rounds=6, limit=0.4)
    by_hand = stability_by_hand(rules, steps_of_two, 6, 0.4)
    for rule, one, (overlaps, bounds) in zip(rules.rules, stable.rules, by_hand, strict=True):
        assert one.rule == rule.id
        assert one.returns == np.mean(np.array(overlaps) >= 0.4)
        assert one.overlap == pytest.approx(np.median(overlaps))
        for band in one.bands:
            own = next(b for b in rule.bounds if b.feature == band.feature)
            assert band.threshold == (own.high if band.op == "<=" else own.low)
            values = [
                b.high if band.op == "<=" else b.low
                for round_ in bounds
                for b in round_
                if b.feature == band.feature
            ]
            values = [value for value in values if np.isfinite(value)]
            assert band.rounds == len(values)
            if values:
                expected = np.quantile(values, [0.05, 0.95])
                assert (band.low, band.high) == pytest.approx(tuple(expected))


def test_a_clear_rule_comes_back_with_its_threshold(steps_of_two):
    rules = mined_at(steps_of_two)
    large = max(rules.rules, key=lambda rule: rule.samples)
    stable = rule_stability(rules, steps_of_two, rounds=10)
    one = next(entry for entry in stable.rules if entry.rule == large.id)
    assert one.returns == 1.0
    assert one.overlap > 0.8
    band = one.bands[0]
    assert band.feature == 0
    assert band.low == pytest.approx(0.2, abs=0.1)
    assert band.high == pytest.approx(0.2, abs=0.1)


def test_rules_of_several_dimensions_meet_only_their_own():
    rng = np.random.default_rng(2)
    states = rng.uniform(-1, 1, (600, 2)).astype(np.float32)
    actions = (states > 0.0).astype(int)
    both = Demonstrations(states, actions, np.repeat(np.arange(6), 100))
    rules = mine_rules(both, supp_min=0.1, conf_min=0.9)
    stable = rule_stability(rules, both, rounds=4)
    assert {rule.dimension for rule in rules.rules} == {0, 1}
    assert all(one.returns == 1.0 for one in stable.rules)
    for rule, one in zip(rules.rules, stable.rules, strict=True):
        assert [band.feature for band in one.bands] == [rule.dimension]


def test_no_rule_comes_back_where_none_is_found(lander_like):
    rules = replace(mined_at(lander_like), thresholds=Thresholds(1.0, 1.0))
    stable = rule_stability(rules, lander_like, rounds=2)
    assert {one.returns for one in stable.rules} == {0.0}
    assert all(np.isnan(band.low) for one in stable.rules for band in one.bands)


def test_settings_out_of_range_are_refused(lander_like):
    rules = mined_at(lander_like)
    with pytest.raises(InputError, match="were not cut at thresholds"):
        rule_stability(replace(rules, cut="leaves"), lander_like)
    with pytest.raises(InputError, match="at least one round"):
        rule_stability(rules, lander_like, rounds=0)
    with pytest.raises(InputError, match="a limit above 0"):
        rule_stability(rules, lander_like, limit=0.0)
    with pytest.raises(InputError, match="at least one order and two points"):
        learning_curve(lander_like, THRESHOLDS, points=1)


def test_processes_that_take_no_more_work_end_it_quietly(steps_of_two):
    from concurrent.futures import ThreadPoolExecutor

    closed = ThreadPoolExecutor(1)
    closed.shutdown()
    with pytest.raises(CancelledError, match="the program ends"):
        learning_curve(steps_of_two, THRESHOLDS, executor=closed)
