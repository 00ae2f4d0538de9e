"""The landscape of never-rules: every cell is what mining there gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, grow_policy_trees, load_demonstrations
from sarl_core.mining.never.landscape import NEVER_LAYERS, NeverLandscape, never_landscape
from sarl_core.mining.never.never_rules import mine_never_rules, upper_bound
from sarl_core.mining.tree import PolicyTree
from sarl_core.shielding.leeway import leeway_of
from tests.mining.strategies import labelled_states


def expect_cell(
    landscape: NeverLandscape,
    place: tuple[int, int],
    trees: tuple[PolicyTree, ...],
    demonstrations: Demonstrations,
    max_depth: int | None = None,
) -> None:
    rules = mine_never_rules(
        trees,
        epsilon=float(landscape.epsilons[place[1]]),
        supp_min=float(landscape.supports[place[0]]),
        max_depth=max_depth,
    )
    assert landscape.rule_count[place] == len(rules)
    lengths = [len(rule.conditions) for rule in rules]
    assert landscape.mean_length[place] == pytest.approx(np.mean(lengths) if lengths else 0)
    leeway = leeway_of(rules, demonstrations)
    for name in ("coverage", "fidelity", "freedom"):
        layer = getattr(landscape, name)
        assert layer[place] == pytest.approx(getattr(leeway, name), nan_ok=True), name


def edges(values: np.ndarray) -> np.ndarray:
    """Every value at which something changes, and its two neighbours."""
    values = np.unique(values)
    return np.unique(
        np.concatenate([np.nextafter(values, -np.inf), values, np.nextafter(values, np.inf)])
    )


@settings(max_examples=60)
@given(labelled_states(), st.sampled_from([None, 0, 1, 3]), st.data())
def test_random_landscapes_are_mining_in_every_cell_edges_included(demonstrations, depth, data):
    trees = grow_policy_trees(demonstrations)
    (tree,) = trees
    supports, epsilons = edges(tree.support), edges(upper_bound(tree.counts, tree.samples[:, None]))
    supports = supports[(supports >= 0) & (supports <= 1)]
    epsilons = epsilons[(epsilons > 0) & (epsilons < 1)]
    landscape = never_landscape(trees, supports, epsilons, max_depth=depth)
    for _ in range(6):
        row = data.draw(st.integers(0, len(supports) - 1))
        column = data.draw(st.integers(0, len(epsilons) - 1))
        expect_cell(landscape, (row, column), trees, demonstrations, depth)


@pytest.mark.parametrize(
    ("name", "divider"), [("lunar_lander", 2), ("bipedal_walker", 3), ("driving", 2)]
)
def test_shipped_landscapes_are_mining_in_their_cells(name, divider):
    demonstrations = load_demonstrations(f"data/demonstrations/{name}.parquet")
    trees = grow_policy_trees(demonstrations, divider=divider)
    landscape = never_landscape(trees, [0.0, 0.005, 0.2], [0.05, 0.15, 0.4, 0.7])
    assert landscape.rule_count.max() > landscape.rule_count.min()
    for place in np.ndindex(landscape.rule_count.shape):
        expect_cell(landscape, place, trees, demonstrations)


def test_each_action_dimension_stands_alone_too():
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (600, 2)).astype(np.float32)
    actions = np.stack([rng.integers(0, 2, 600) + (states[:, 0] > 0), np.zeros(600)], axis=1)
    shown = Demonstrations(states, actions.astype(int), np.arange(600) // 50)
    trees = grow_policy_trees(shown)
    landscape = never_landscape(trees, [0.0, 0.1], [0.05, 0.3])
    for tree, part in zip(trees, landscape.dimensions, strict=True):
        alone = never_landscape(tree, [0.0, 0.1], [0.05, 0.3])
        for name in NEVER_LAYERS:
            assert np.array_equal(getattr(part, name), getattr(alone, name), equal_nan=True)
    # The second has one label, and so nothing to forbid and nothing to choose from.
    assert (landscape.dimensions[1].freedom == 1).all()
    assert (landscape.dimensions[1].coverage == 0).all()
    for place in np.ndindex(2, 2):
        expect_cell(landscape, place, trees, shown)


def test_a_row_of_the_table_is_a_cell():
    trees = grow_policy_trees(load_demonstrations("data/demonstrations/cartpole.parquet"))
    landscape = never_landscape(trees, [0.0, 0.1], [0.05, 0.1, 0.3])
    frame = landscape.to_frame()
    assert list(frame.columns) == ["support", "epsilon", *NEVER_LAYERS]
    row = frame[(frame["support"] == 0.1) & (frame["epsilon"] == 0.05)].iloc[0]
    assert row["freedom"] == landscape.freedom[1, 0]
    assert row["rule_count"] == landscape.rule_count[1, 0]
    assert repr(landscape).startswith("NeverLandscape(supports=2, epsilons=3, rules=")


@pytest.mark.parametrize(
    ("supports", "epsilons", "said"),
    [
        ([0.0], [0.0, 0.1], "give a share above 0 and below 1"),
        ([0.0], [0.1, 1.0], "give a share above 0 and below 1"),
        ([0.0], [0.2, 0.1], "epsilons of a landscape must be finite numbers in ascending order"),
        ([0.0], [], "epsilons of a landscape must be finite"),
        ([0.0, 1.5], [0.1], "supports of a landscape go from 0 to 1.5"),
    ],
)
def test_a_grid_that_is_none_is_refused(supports, epsilons, said):
    trees = grow_policy_trees(load_demonstrations("data/demonstrations/cartpole.parquet"))
    with pytest.raises(InputError, match=said):
        never_landscape(trees, supports, epsilons)


def test_nothing_is_no_landscape():
    with pytest.raises(InputError, match="grow the trees first"):
        never_landscape([], [0.0], [0.1])
