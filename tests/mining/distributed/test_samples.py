"""A sample that a cluster leaves never passes for the steps it is of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, InputError, grow_policy_trees
from sarl_core.demonstrations.names import names_of, renamed
from sarl_core.explaining.figures.distributions import counted_feature_rows, label_histogram
from sarl_core.explaining.report.report import make_report
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.distributed import mining
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.editing.regrowing import next_queries
from sarl_core.mining.never.never_rules import mine_at, never_thresholds
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.pareto import pareto_front
from sarl_core.mining.tree import Source
from sarl_core.mining.validation.contradictions import find_contradictions
from sarl_core.mining.validation.cross_fitting import cross_fit, judge, judge_pairs
from sarl_core.mining.validation.episode_counts import count_rules
from sarl_core.mining.validation.holding_out import count_held_out, hold_out, with_held_out
from tests.mining.distributed.conftest import Mine, cut

LEAST = 0.005


@pytest.fixture
def mined(
    fleet: Demonstrations, tmp_path: Path, mine: Mine, monkeypatch: pytest.MonkeyPatch
) -> MinedData:
    monkeypatch.setattr(mining, "HELD_ROWS", 500)
    return mine(cut(fleet, tmp_path / "parts", 2), hold_out=0.2, min_support=LEAST)


def test_a_sample_knows_what_it_is_of(mined: MinedData) -> None:
    sample = mined.sample
    assert len(sample) == 500
    assert (sample.whole.steps, sample.whole.episodes) == (4_800, 48)
    assert replace(sample, sample_of=None).digest != sample.digest
    assert Source.of(sample) == mined.trees[0].source
    names = names_of(sample)
    other = renamed(sample, names._replace(features=("lean", *names.features[1:])))
    again = mined.renamed(other)
    assert again.trees[0].source.features[0].name == "lean"
    assert again.trees[0].source.digest == sample.whole.digest
    assert (again.trees[0].counts == mined.trees[0].counts).all()
    assert mined.renamed(sample).trees == mined.trees


@pytest.mark.parametrize(
    ("work", "what"),
    [
        (grow_policy_trees, "growing trees"),
        (cross_fit, "judging rules in other episodes"),
        (find_contradictions, "looking for contradictions"),
        (with_combinations, "choosing combinations"),
        (lambda sample: hold_out(sample, 0.2), "holding out other episodes"),
    ],
)
def test_what_would_pass_for_the_whole_is_refused(
    mined: MinedData, work: Callable[[Demonstrations], object], what: str
) -> None:
    sentence = f"{what} needs the demonstrations themselves, .* 4,800 steps .* sample of 500;"
    with pytest.raises(InputError, match=sentence):
        work(mined.sample)


def test_no_part_of_its_trees_is_regrown(mined: MinedData) -> None:
    with pytest.raises(InputError, match="regrowing a part of the tree needs the demonstrations"):
        next_queries(mined.trees[0], 0, mined.sample)


def test_all_rules_are_judged_as_each_is_counted(mined: MinedData) -> None:
    for thresholds in (Thresholds(0.01, 0.8), Thresholds(LEAST, 0.95, 1.2, 4)):
        rules = mined.mine(
            supp_min=thresholds.support,
            conf_min=thresholds.confidence,
            lift_min=thresholds.lift,
            max_depth=thresholds.max_depth,
        )
        judged, counted = mined.judged(thresholds), judge(rules, mined.count_rules(rules))
        assert judged is not None
        assert judged.fidelity == counted.fidelity
        assert judged.coverage == counted.coverage
    assert replace(mined, held_out=()).judged(Thresholds(0.01, 0.8)) is None


def with_counts(labels: int, *, dimensions: int) -> tuple[MinedData, Demonstrations]:
    """What a cluster would leave of noisy steps, and those that it holds out."""
    rng = np.random.default_rng(labels)
    states = rng.normal(size=(2_000, 3)).astype(np.float32)
    actions = (states[:, :dimensions] > 0).astype(np.int64) * (labels - 1)
    noisy = rng.random(actions.shape) < 0.2
    actions[noisy] = rng.integers(0, labels, noisy.sum())
    split = hold_out(Demonstrations(states, actions, np.repeat(np.arange(20), 100)), 0.4)
    trees = grow_policy_trees(split.mined)
    boxes = tuple(np.full((4, tree.n_nodes, 3), np.nan) for tree in trees)
    counts = count_held_out(trees, split.held_out)
    return MinedData(trees, split.mined, boxes, (), counts, 0.4), split.held_out


@pytest.mark.parametrize("epsilon", [0.15, 0.4, 0.7])
@pytest.mark.parametrize("demands", [False, True])
@pytest.mark.parametrize("dimensions", [1, 2])
def test_of_two_labels_its_counts_are_those_of_the_steps_for_rules_that_forbid(
    epsilon: float, demands: bool, dimensions: int
) -> None:
    mined, held_out = with_counts(2, dimensions=dimensions)
    for support in (0.0, 0.02):
        at = Thresholds(support, 0.85, never=epsilon) if demands else None
        at = at or never_thresholds(epsilon, support, 6)
        rules, steps = mined.at(at), with_held_out(mine_at(mined.trees, at), held_out)
        assert rules.forbids
        assert [rule.held_out for rule in rules] == [rule.held_out for rule in steps]
        judged, counted = mined.judged(at), judge_pairs(steps, held_out)
        assert judged is not None
        for name in ("numbers", "lengths", "decisions", "covered", "correct"):
            np.testing.assert_array_equal(getattr(judged, name), getattr(counted, name))
        counts, other = mined.count_rules(rules), count_rules(steps, held_out)
        for name in ("subject", "episode", "samples", "correct"):
            np.testing.assert_array_equal(getattr(counts, name), getattr(other, name))


def test_of_more_labels_its_counts_do_not_say_how_often_one_was_done() -> None:
    mined, _ = with_counts(3, dimensions=1)
    never = never_thresholds(0.2, 0.02)
    assert mined.counted(Thresholds(0.02, 0.8))
    assert not mined.counted(never)
    assert mined.judged(never) is None
    assert len(mined.at(never))
    assert {rule.held_out for rule in mined.at(never)} == {None}


def test_no_trade_off_is_promised_below_what_was_grown(mined: MinedData) -> None:
    assert mined.min_support == LEAST
    front = pareto_front(mined.trees)
    assert min(point.support for point in front) >= LEAST
    unknown = tuple(replace(tree, least_support=0.0) for tree in mined.trees)
    assert min(point.support for point in pareto_front(unknown)) < LEAST


def test_grown_trees_know_how_far_down_they_go(fleet: Demonstrations) -> None:
    (tree,) = grow_policy_trees(fleet, min_support=0.01)
    assert tree.least_support == 0.01
    assert grow_policy_trees(fleet)[0].least_support == 0.0


def test_numbers_of_features_and_actions_are_of_all_steps(
    mined: MinedData, fleet: Demonstrations
) -> None:
    held = mined.held_out[0].numbers
    rest = fleet.select(np.setdiff1d(fleet.episodes, held))
    for index, row in enumerate(counted_feature_rows(mined)):
        values = rest.observations[:, index]
        assert (row.low, row.high) == (values.min(), values.max())
        assert abs(float((values <= row.median).mean()) - 0.5) < 0.2
        assert index < 3 or row.median == np.median(values)  # a few values, which bins part
    tree = mined.trees[0]
    drawn = label_histogram(tree.counts[0], tree.dimension)
    assert drawn.counts.sum(axis=1).tolist() == np.bincount(rest.actions).tolist()


def test_a_report_counts_rules_on_all_steps(mined: MinedData) -> None:
    rules = mined.mine(supp_min=0.02, conf_min=0.8)
    text = make_report(rules, mined.sample, trees=mined.trees, frames=0).html
    assert "4,800 steps in 48 episodes" in text
    assert "a sample of 500 of 4,800 steps" in text
    assert mined.sample.whole.digest in text
    assert all(f"{rule.samples:,} states)" in text for rule in rules)
    assert "sampled states" in text
    assert "did something else" not in text  # nobody looked for contradictions in a sample
