"""Whole rule sets on episodes they were not mined from, and episodes that move a number."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from sarl_core import Demonstrations, InputError, grow_policy_trees, mine_rules
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF
from sarl_core.mining.validation.cross_fitting import Judged, cross_fit, judge, parts
from sarl_core.mining.validation.episode_counts import (
    count_nodes,
    count_rules,
    episode_of_each,
    most_influential,
)
from sarl_core.progress import CancelledError
from tests.mining.strategies import labelled_states


def by_hand(demonstrations, judged, thresholds, folds, seed, divider=2):
    """Mine once a fold, and look at every state: (decisions, covered, correct) an episode."""
    episodes = demonstrations.episodes[demonstrations.episode_starts]
    order = episodes[np.random.default_rng(seed).permutation(len(episodes))]
    found = {}
    for first in range(folds):
        held = order[first::folds]
        rules = mine_rules(
            demonstrations.select(np.setdiff1d(episodes, held)),
            supp_min=thresholds.support,
            conf_min=thresholds.confidence,
            lift_min=thresholds.lift,
            max_depth=thresholds.max_depth,
            divider=divider,
        )
        for episode in held.tolist():
            one = demonstrations.select([episode])
            covered = correct = 0
            for rule in rules.rules:
                rows = rule.applies(one.observations)
                values = one.action_columns[rows, rule.dimension]
                shown = rules.actions[rule.dimension].labels_of(values)
                covered += int(rows.sum())
                correct += int((shown == rule.action).sum())
            found[episode] = (len(one) * len(rules.actions), covered, correct)
    assert sorted(found) == sorted(judged.numbers.tolist())
    return [found[episode] for episode in judged.numbers.tolist()]


@pytest.mark.parametrize(
    "thresholds",
    [Thresholds(0.01, 0.8), Thresholds(0.0, 1.0), Thresholds(0.02, 0.6, 1.2, 3)],
)
def test_every_episode_is_judged_by_rules_mined_without_it(lander_like, thresholds):
    found = cross_fit(lander_like, folds=4, seed=3).at(thresholds)
    expected = by_hand(lander_like, found, thresholds, 4, 3)
    assert list(zip(found.decisions, found.covered, found.correct, strict=True)) == expected
    assert found.lengths.tolist() == [100] * 20
    assert found.folds == 4


def test_all_dimensions_count_and_processes_give_the_same():
    rng = np.random.default_rng(0)
    states = rng.normal(size=(400, 2)).astype(np.float32)
    actions = np.clip(states + 0.3 * rng.normal(size=(400, 2)), -1, 1).astype(np.float32)
    both = Demonstrations(
        states, actions, np.repeat(np.arange(8), 50), action_low=(-1, -1), action_high=(1, 1)
    )
    thresholds = Thresholds(0.02, 0.7)
    with ThreadPoolExecutor(2) as executor:
        found = cross_fit(both, divider=3, folds=4, executor=executor).at(thresholds)
    expected = by_hand(both, found, thresholds, 4, 0, divider=3)
    assert list(zip(found.decisions, found.covered, found.correct, strict=True)) == expected
    assert found.decisions.tolist() == [100] * 8


def test_the_interval_is_students_widened_because_the_folds_share_their_episodes(lander_like):
    found = cross_fit(lander_like, folds=5).at(Thresholds(0.01, 0.8))
    for told, part, whole in (
        (found.fidelity, found.correct, found.covered),
        (found.coverage, found.covered, found.decisions),
    ):
        shares = part / whole
        values, weights = np.append(shares, 0.5), np.append(np.ones(20), 20 / whole.sum())
        mean = np.average(values, weights=weights)
        n = weights.sum()
        variance = (weights * (values - mean) ** 2).sum() / (n - 1)
        reach = stats.t.ppf(0.975, n - 1) * np.sqrt(variance / n * (1 + 5 / 4))
        assert told.interval == pytest.approx((max(mean - reach, 0), min(mean + reach, 1)))
        assert told.share == pytest.approx(shares.mean())
        assert told.episodes == 20


def test_a_rule_set_that_is_tried_has_no_folds_to_widen_for(lander_like):
    first, rest = lander_like.select(np.arange(8)), lander_like.select(np.arange(8, 20))
    rules = mine_rules(first, supp_min=0.02, conf_min=0.8)
    found = judge(rules, count_rules(rules, rest))
    same = replace(found, folds=5)
    assert found.folds == 0
    assert found.fidelity.share == same.fidelity.share
    low, high = found.fidelity.interval
    wider, higher = same.fidelity.interval
    assert high - low == pytest.approx((higher - wider) / (1 + 5 / 4) ** 0.5, rel=0.02)


def test_fewer_episodes_than_folds_are_left_out_one_by_one(lander_like):
    found = cross_fit(lander_like.select([3, 7, 11]), folds=10).at(Thresholds(0.0, 1.0))
    assert found.folds == 3
    assert found.fidelity.episodes == 3
    assert found.fidelity.interval is None


def test_one_episode_is_cut_into_stretches_and_nothing_is_said_of_others():
    rng = np.random.default_rng(1)
    states = rng.normal(size=(500, 2)).astype(np.float32)
    alone = Demonstrations(states, rng.integers(0, 2, 500), np.full(500, 7))
    found = cross_fit(alone, folds=5).at(Thresholds(0.0, 1.0))
    assert not found.whole_episodes
    assert sorted(found.lengths.tolist()) == [100] * 5
    assert found.fidelity.share == pytest.approx(0.5, abs=0.1)
    assert found.fidelity.interval is None
    assert found.coverage.interval is None


@pytest.mark.parametrize(
    ("steps", "folds", "told"), [(3, 10, "too short to be parted"), (40, 1, "give at least 2")]
)
def test_what_cannot_be_parted_is_refused(steps, folds, told):
    few = Demonstrations(
        np.arange(steps, dtype=np.float32)[:, None], np.arange(steps) % 2, np.zeros(steps, int)
    )
    with pytest.raises(InputError, match=told):
        cross_fit(few, folds=folds)


def test_cross_fitting_can_be_called_off(lander_like):
    with pytest.raises(CancelledError):
        cross_fit(lander_like, progress=lambda done, _: done < 2)


def told(share, high):
    return HeldOut(100, 90, 20, share, None if high is None else 0.1, high)


@pytest.mark.parametrize(
    ("mined", "elsewhere", "expected"),
    [
        (1.0, told(0.5, 0.53), True),
        (0.97, told(0.95, 0.96), False),  # apart, and by little
        (0.97, told(0.90, 0.95), False),  # it may be no more than that
        (0.97, told(0.90, None), True),
        (0.97, told(None, None), False),
        (float("nan"), told(0.9, 0.95), False),
    ],
)
def test_numbers_part_where_one_lies_clearly_lower(mined, elsewhere, expected):
    assert parts(mined, elsewhere) is expected


@pytest.mark.parametrize("learner", ["exact", "histogram"])
def test_rules_of_many_states_are_known_without_the_others(lander_like, learner):
    whole = cross_fit(lander_like, folds=4, learner=learner)
    short = cross_fit(lander_like, folds=4, learner=learner, min_support=0.02)
    assert (whole.least_support, short.least_support) == (0.0, 0.02)
    for full, cut in zip(whole.folds, short.folds, strict=True):
        (large,), (small,) = full.trees, cut.trees
        assert 1 < small.n_nodes < large.n_nodes / 2
        assert small.learner == large.learner == learner
        assert (small.samples[small.feature != LEAF] >= 0.02 * len(small.sample_order)).all()
        (few,), (many,) = next(cut.counts()), next(full.counts())
        assert few.samples.sum() < many.samples.sum()
    for thresholds in (Thresholds(0.02, 0.7), Thresholds(0.05, 0.0), Thresholds(0.3, 0.5)):
        some, others = whole.at(thresholds), short.at(thresholds)
        assert some.covered.sum() > 0
        for name in ("numbers", "lengths", "decisions", "covered", "correct"):
            assert getattr(some, name).tolist() == getattr(others, name).tolist()
    with pytest.raises(InputError, match=r"from a support of 0.02 on, and the minimum support is"):
        short.at(Thresholds(0.01, 0.7))
    for wrong in (-0.1, 1.5):
        with pytest.raises(InputError, match=f"the least support is {wrong:g}; give 0 to 1"):
            cross_fit(lander_like, folds=4, min_support=wrong)


# --- counts at the nodes, and influence -----------------------------------------------------------


@settings(max_examples=40)
@given(labelled_states(), st.integers(1, 6), st.integers(0, 2**16))
def test_nodes_are_counted_in_every_episode(demonstrations, episodes, seed):
    tree = grow_policy_trees(demonstrations)[0]
    rng = np.random.default_rng(seed)
    other = replace(
        demonstrations,
        observations=demonstrations.observations[rng.permutation(len(demonstrations))],
        episodes=np.sort(rng.integers(0, episodes, len(demonstrations))),
        steps=None,
    )
    counts = count_nodes(tree, other)
    leaf, episode = tree.apply(other.observations), episode_of_each(other)
    labels = tree.dimension.labels_of(other.action_columns[:, 0])
    for node in range(tree.n_nodes):
        below = [one for one in range(tree.n_nodes) if node in tree.path(one)]
        here = np.isin(leaf, below)
        samples, correct = counts.of(node)
        size = other.n_episodes
        assert samples.tolist() == np.bincount(episode[here], minlength=size).tolist()
        right = here & (labels == tree.label[node])
        assert correct.tolist() == np.bincount(episode[right], minlength=size).tolist()
    assert (counts.samples > 0).all()


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.integers(0, 50), st.floats(0, 1)), min_size=1, max_size=12),
    st.sampled_from(["episodes", "states"]),
)
def test_the_most_influential_episode_is_the_one_whose_absence_moves_most(pairs, by):
    samples = np.array([samples for samples, _ in pairs])
    correct = np.array([round(samples * share) for samples, share in pairs])
    numbers, lengths = np.arange(len(pairs)) * 10, samples + 5
    found = most_influential(samples, correct, numbers, lengths, by=by)

    def share_of(rows):
        return (
            correct[rows].sum() / samples[rows].sum()
            if by == "states"
            else (correct[rows] / samples[rows]).mean()
        )

    counting = np.flatnonzero(samples)
    if len(counting) < 2:
        assert found is None
        return
    moves = {one: share_of(counting[counting != one]) for one in counting}
    assert found.share == pytest.approx(share_of(counting))
    place = found.episode // 10
    assert found.without == pytest.approx(moves[place])
    assert found.steps == lengths[place]
    assert found.moves == pytest.approx(
        max(abs(without - found.share) for without in moves.values()), abs=1e-12
    )


def test_a_long_episode_moves_what_counts_states_and_not_what_counts_episodes():
    """As a lander that stands on the ground for 1,000 steps and keeps its engine on."""
    found = Judged(
        numbers=np.arange(40, 53),
        lengths=np.array([1000] + [200] * 12),
        decisions=np.array([1000] + [200] * 12),
        covered=np.array([900] + [60] * 12),
        correct=np.array([540] + [58] * 12),
    )
    by_states = found.influence_by_states
    assert (by_states.episode, by_states.steps) == (40, 1000)
    assert by_states.share == pytest.approx((540 + 12 * 58) / (900 + 12 * 60))
    assert by_states.without == pytest.approx(58 / 60)
    assert found.influence.episode == 40
    assert found.influence.moves < 0.03 < by_states.moves
