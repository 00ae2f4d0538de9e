"""What rules mined from fewer episodes would have been: whether more demonstrations would help."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import Learner
from sarl_core.mining.validation.cross_fitting import judge_pairs
from sarl_core.processes import run_each
from sarl_core.progress import Progress

Floats = NDArray[np.float64]


class CurvePoint(NamedTuple):
    """The rule set of some episodes.

    Attributes:
        rules: Number of rules.
        mean_length: Mean number of queries a rule.
        coverage: Share of the pairs mined from to which a rule applies.
        fidelity: Share of the covered pairs of another episode whose label the rule gives, on
            average over these; NaN where none is covered.
    """

    rules: int
    mean_length: float
    coverage: float
    fidelity: float


@dataclass(frozen=True, eq=False)
class MiningCurve:
    """Rule sets of more and more episodes, for several orders of the episodes.

    Attributes:
        episodes: Numbers of episodes mined from, ascending, (P,).
        rules: Number of rules, (orders, P).
        mean_length: Mean number of queries a rule, (orders, P).
        coverage: Share of the pairs mined from to which a rule applies, (orders, P).
        fidelity: Share right of the covered pairs of another episode, on average, (orders, P), NaN
            where none is covered.
        tried_on: Whether these are the episodes held out, or those that come later in the order.
    """

    episodes: NDArray[np.int64]
    rules: Floats
    mean_length: Floats
    coverage: Floats
    fidelity: Floats
    tried_on: Literal["held out", "not yet used"]

    @property
    def orders(self) -> int:
        """Number of orders."""
        return len(self.rules)


def learning_curve(
    demonstrations: Demonstrations,
    thresholds: Thresholds,
    *,
    divider: int = 2,
    learner: Learner = "exact",
    held_out: Demonstrations | None = None,
    orders: int = 6,
    points: int = 8,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> MiningCurve:
    """Mine from one episode, from a few more, ... from all of them, in several orders.

    Args:
        demonstrations: What rules are mined from, E episodes.
        thresholds: Of every rule set.
        divider: Number of intervals of continuous dimensions.
        learner: What grows the trees.
        held_out: What every rule set is tried on; where not given, the episodes that come later
            in the order, so that there is nothing to try the last point on.
        orders: Drawn by chance; they show how much depends on which episodes came first.
        points: At most so many numbers of episodes, closer together where there are few.
        seed: Same seed, same orders.
        executor: Its processes do the mining.
        progress: Told how many rule sets are mined; may stop the rest.

    Returns:
        The curve.

    Raises:
        InputError: If a setting is out of range.
        CancelledError: If the caller wants no more.
    """
    if orders < 1 or points < 2:
        raise InputError(
            f"a learning curve of {orders} orders and {points} points has nothing to show; give "
            "at least one order and two points"
        )
    episodes = demonstrations.episodes[demonstrations.episode_starts]
    count = len(episodes)
    sizes = np.unique(np.geomspace(1, count, points).round().astype(np.int64))
    rng = np.random.default_rng(seed)
    drawn = [episodes[rng.permutation(count)] for _ in range(orders)]
    # All episodes are the same ones in every order.
    places = [
        (row, column)
        for column, size in enumerate(sizes.tolist())
        for row in range(orders if size < count else 1)
    ]
    curve_points = run_each(
        curve_point,
        [
            (demonstrations, drawn[row], int(sizes[column]), thresholds, divider, learner, held_out)
            for row, column in places
        ],
        executor=executor,
        progress=progress,
    )
    layers = np.full((len(CurvePoint._fields), orders, len(sizes)), np.nan)
    for (row, column), point in zip(places, curve_points, strict=True):
        rows = slice(None) if sizes[column] == count else slice(row, row + 1)
        layers[:, rows, column] = np.reshape(point, (-1, 1))
    rules, mean_length, coverage, fidelity = layers
    return MiningCurve(
        episodes=sizes,
        rules=rules,
        mean_length=mean_length,
        coverage=coverage,
        fidelity=fidelity,
        tried_on="held out" if held_out is not None else "not yet used",
    )


def curve_point(
    demonstrations: Demonstrations,
    order: NDArray[np.int64],
    size: int,
    thresholds: Thresholds,
    divider: int,
    learner: Learner,
    held_out: Demonstrations | None,
) -> CurvePoint:
    """Mine from the first episodes of an order.

    Args:
        demonstrations: E episodes.
        order: Their numbers, (E,).
        size: How many of them.
        thresholds: Of the rule set.
        divider: Number of intervals of continuous dimensions.
        learner: What grows the trees.
        held_out: What the rules are tried on; where not given, the rest of the order.

    Returns:
        The numbers of the rule set.
    """
    try:
        some = demonstrations.select(order[:size])
        rest = held_out
        if rest is None and size < len(order):
            rest = demonstrations.select(order[size:])
    except InputError:  # an episode of a single step is no demonstration by itself
        return CurvePoint(0, 0.0, 0.0, float("nan"))
    mined = mine_at(grow_policy_trees(some, divider=divider, learner=learner), thresholds)
    fidelity, coverage = float("nan"), mined.coverage
    if mined.forbids:  # they overlap, so the pairs tell
        here = judge_pairs(mined, some)
        coverage = float(here.covered.sum() / here.decisions.sum())
    if rest is not None and mined.rules:
        share = judge_pairs(mined, rest).fidelity.share
        fidelity = fidelity if share is None else share
    return CurvePoint(len(mined), mined.mean_length, coverage, fidelity)
