"""Steps that are mined on a cluster: the same rules however they are cut, and exact counts."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarl_core import Demonstrations, grow_policy_trees, load_demonstrations
from sarl_core.clusters import cluster
from sarl_core.mining.distributed import growth, mining, pieces
from sarl_core.mining.distributed.mining import ClusterPlan, mine_on_cluster
from sarl_core.mining.distributed.pieces import Reading, parquet_paths
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.holding_out import with_held_out
from sarl_core.progress import CancelledError
from tests.mining.distributed.conftest import Mine, cut

SHIPPED = Path(__file__).resolve().parents[3] / "data" / "demonstrations"


@pytest.fixture(autouse=True)
def many_small_pieces(monkeypatch: pytest.MonkeyPatch, client: Any) -> None:
    """So that all that happens to many rows happens to few."""
    monkeypatch.setattr(pieces, "ROWS", 1_000)
    monkeypatch.setattr(growth, "PART_ROWS", 4_500)


def same_counts(tree: PolicyTree, demonstrations: Demonstrations) -> bool:
    structure = TreeStructure(tree.feature, tree.threshold, tree.children_left, tree.children_right)
    counted = count_tree(structure, demonstrations, tree.index, divider=tree.divider)
    splits = zip(tree.source.features, counted.source.features, strict=True)
    return np.array_equal(tree.counts, counted.counts) and all(
        (one.splits is None and other.splits is None)
        or (
            one.splits is not None
            and other.splits is not None
            and np.array_equal(one.splits.below, other.splits.below)
            and np.array_equal(one.splits.above, other.splits.above)
            and one.splits.binary == other.splits.binary
        )
        for one, other in splits
    )


@pytest.mark.parametrize("held_out", [0.0, 0.25])
def test_the_cut_into_files_and_the_number_of_workers_do_not_matter(
    fleet: Demonstrations, tmp_path: Path, mine: Mine, held_out: float
) -> None:
    whole = mine(cut(fleet, tmp_path / "one", 1), hold_out=held_out)
    parts = mine(cut(fleet, tmp_path / "seven", 7), hold_out=held_out)
    with cluster("local:1") as alone:
        paths = parquet_paths([tmp_path / "seven"])
        single = mine_on_cluster(alone, paths, Reading(), ClusterPlan(hold_out=held_out))
    for other in (parts, single):
        assert [tree.digest for tree in other.trees] == [tree.digest for tree in whole.trees]
        assert other.sample.digest == whole.sample.digest
        rules = [one.mine(supp_min=0.01, conf_min=0.8) for one in (whole, other)]
        assert rules[0].digest == rules[1].digest
        assert len(rules[0]) > 2


@pytest.mark.parametrize("min_support", [0.0, 0.02])
@pytest.mark.parametrize("max_depth", [None, 4])
def test_counts_are_those_of_all_steps(
    fleet: Demonstrations,
    tmp_path: Path,
    mine: Mine,
    min_support: float,
    max_depth: int | None,
) -> None:
    mined = mine(cut(fleet, tmp_path / "parts", 3), min_support=min_support, max_depth=max_depth)
    (tree,) = mined.trees
    assert tree.samples[0] == len(fleet)
    assert same_counts(tree, fleet)
    inner = tree.feature >= 0
    assert (tree.samples[inner] >= min_support * len(fleet)).all()
    assert max_depth is None or tree.depth.max() == max_depth
    leaves = tree.counts[~inner]
    if not min_support and max_depth is None:
        assert ((leaves > 0).sum(axis=1) == 1).mean() > 0.95  # the others are mixed in every bin


def test_rules_have_the_boxes_and_the_held_out_counts_of_one_machine(
    fleet: Demonstrations, tmp_path: Path, mine: Mine
) -> None:
    mined = mine(cut(fleet, tmp_path / "parts", 3), hold_out=0.3, seed=5)
    held = mined.held_out[0].numbers
    assert len(held) == 18
    rules = mined.mine(supp_min=0.01, conf_min=0.8)
    left = np.setdiff1d(fleet.episodes, held)
    boxed = with_boxes(rules, fleet.select(left))
    tried = with_held_out(rules, fleet.select(held))
    assert [rule.box for rule in rules] == [rule.box for rule in boxed]
    assert [rule.held_out for rule in rules] == [rule.held_out for rule in tried]
    assert rules.source.steps == len(fleet) - 18 * 100
    counts = mined.count_rules(rules).held_out()
    assert counts == [rule.held_out for rule in rules]
    other = mine(tmp_path / "parts", hold_out=0.3, seed=6)
    assert not np.array_equal(other.held_out[0].numbers, held)


@pytest.mark.parametrize("task", ["lunar_lander", "pendulum", "driving"])
@pytest.mark.parametrize("min_support", [0.0, 0.003])
def test_trees_are_those_of_the_histogram_learner(
    task: str, min_support: float, mine: Mine
) -> None:
    path = SHIPPED / f"{task}.parquet"
    (tree,) = mine(path, min_support=min_support).trees
    (other,) = grow_policy_trees(
        load_demonstrations(path), learner="histogram", min_support=min_support
    )
    for name in ("feature", "threshold", "children_left", "children_right", "counts"):
        assert np.array_equal(getattr(tree, name), getattr(other, name))


def test_a_node_with_just_the_support_is_split(
    fleet: Demonstrations, tmp_path: Path, mine: Mine
) -> None:
    least = 56
    assert least / 6_000 * 6_000 > least  # as floats
    (tree,) = mine(cut(fleet, tmp_path / "parts", 2), min_support=least / 6_000).trees
    (other,) = grow_policy_trees(fleet, learner="histogram", min_support=least / 6_000)
    assert least in tree.samples[tree.feature >= 0]
    assert np.array_equal(tree.threshold, other.threshold)


def test_continuous_actions_of_several_dimensions(mine: Mine) -> None:
    path = SHIPPED / "bipedal_walker.parquet"
    demonstrations = load_demonstrations(path)
    mined = mine(path, divider=3, min_support=0.01)
    assert [tree.dimension for tree in mined.trees] == [
        tree.dimension for tree in grow_policy_trees(demonstrations, divider=3, max_depth=1)
    ]
    assert all(same_counts(tree, demonstrations) for tree in mined.trees)
    rules = mined.mine(supp_min=0.01, conf_min=0.7)
    assert all(rule.demonstrated_value is not None for rule in rules)


def test_a_worker_that_dies_in_the_middle_is_survived(
    fleet: Demonstrations, tmp_path: Path, mine: Mine
) -> None:
    folder = cut(fleet, tmp_path / "parts", 4)
    whole = mine(folder, hold_out=0.2)
    killed: list[int] = []
    with cluster("local:2") as other:

        def kill(done: int, total: int) -> None:
            if not killed and done > 0.6 * total:  # the rows are binned, and gone with it
                killed.append(next(iter(other.run(os.getpid).values())))
                with suppress(ProcessLookupError):
                    os.kill(killed[0], signal.SIGKILL)

        survived = mine_on_cluster(
            other,
            parquet_paths([folder]),
            Reading(),
            ClusterPlan(hold_out=0.2),
            progress=kill,
        )
        assert killed
    assert [tree.digest for tree in survived.trees] == [tree.digest for tree in whole.trees]


def test_work_can_be_called_off(fleet: Demonstrations, tmp_path: Path, client: Any) -> None:
    folder = cut(fleet, tmp_path / "parts", 2)
    with pytest.raises(CancelledError, match="nothing was kept"):
        mine_on_cluster(
            client,
            parquet_paths([folder]),
            Reading(),
            ClusterPlan(),
            progress=lambda done, total: done < 500,
        )


def test_little_of_many_rows_is_kept_and_always_the_same(
    fleet: Demonstrations, tmp_path: Path, mine: Mine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mining, "SAMPLE_ROWS", 3_000)
    monkeypatch.setattr(mining, "HELD_ROWS", 500)
    one = mine(cut(fleet, tmp_path / "one", 1))
    many = mine(cut(fleet, tmp_path / "many", 5))
    assert len(one.sample) == 500
    assert one.sample.digest == many.sample.digest
    assert one.trees[0].digest == many.trees[0].digest
    (tree,) = one.trees
    assert same_counts(tree, fleet)
    leaves = tree.apply(one.sample.observations)
    for node in range(0, tree.n_nodes, 7):
        below = {node}
        for child in range(node + 1, tree.n_nodes):
            if int(tree.parent[child]) in below:
                below.add(child)
        wanted = np.flatnonzero(np.isin(leaves, list(below)))
        assert sorted(tree.rows(node).tolist()) == wanted.tolist()
    states = fleet.observations
    for rule in one.mine(supp_min=0.01, conf_min=0.7):
        here = states[rule.applies(states)]
        assert rule.box is not None
        assert rule.box.least == tuple(here.min(axis=0).tolist())
        assert rule.box.most == tuple(here.max(axis=0).tolist())
        assert (np.array(rule.box.low) >= rule.box.least).all()
        assert (np.array(rule.box.high) <= rule.box.most).all()
    for feature, histogram in enumerate(one.histograms):
        assert histogram.counts.sum() == len(fleet)
        half = np.quantile(states[:, feature], 0.5)
        assert one.medians[feature] == pytest.approx(half, abs=0.02 if feature < 3 else 0.0)
