"""Moving the thresholds, ratios and labels of a few rules to where they achieve more.

A tree that imitates its expert is not yet the best tree of its size. An evolution strategy
(Salimans et al. 2017) shakes all of them at once, in pairs of opposite directions and on the same
episodes, and follows those that bring more return. The queries' features, of combinations the two
that are combined, and their order stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.mining.budgeted_trees import leaf_rules, without_idle_queries
from sarl_core.mining.combining.candidates import rounded_ratio
from sarl_core.mining.combining.queries import over_queried, with_ratios
from sarl_core.mining.tree import LEAF, PolicyTree, TreeStructure, count_tree
from sarl_core.processes import executor_of, run_each
from sarl_core.progress import Progress, report
from sarl_core.rollouts.choices import Choice, mean_score, scores
from sarl_core.rollouts.episodes import LOST, rollout
from sarl_core.rollouts.seeds import REFINEMENT, of_run
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

PAIRS = 12  # of opposite directions a generation
EPISODES = 16  # for each direction, the same for all of a generation

_SHAKE = 0.15  # in units of half the spread of a feature where it is asked about
_STEP = 0.15  # of a generation, in units of the shake
_MEMORY = (0.9, 0.99)  # of the step's direction and of its size (Adam)
_SPREAD = (0.1, 0.9)  # quantiles
_LEAST_SHARE = 0.02  # a label that is shown less often is no alternative
_FEW = 2_000  # rows that tell a shield nothing but that its rules exist


@dataclass(frozen=True)
class _Candidate:
    """Trees to try, one an action dimension, and what they derive."""

    structures: tuple[TreeStructure, ...]
    derived: tuple[DerivedFeature, ...]

    def trees(self, pairs: Demonstrations, divider: int) -> tuple[PolicyTree, ...]:
        """The trees with what these pairs say of them."""
        known = pairs if pairs.derived == self.derived else pairs.deriving(self.derived)
        return tuple(
            count_tree(structure, known, index, divider=divider)
            for index, structure in enumerate(self.structures)
        )


@dataclass(frozen=True)
class _CombinedQuery:
    """A query about a combination, and how its line is turned.

    Attributes:
        node: Of the query.
        ratio: From which it starts.
        scale: What the ratio changes by, so that values change by their spread.
        centre: Value of the second feature around which the line turns.
    """

    node: int
    ratio: float
    scale: float
    centre: float


@dataclass(frozen=True)
class _Parameters:
    """What is moved: thresholds and ratios in units of their spread, a score a label at leaves."""

    trees: tuple[PolicyTree, ...]
    spreads: tuple[NDArray[np.float64], ...]
    lines: tuple[tuple[_CombinedQuery, ...], ...]
    derived: tuple[DerivedFeature, ...]
    observed: int

    @classmethod
    def of(cls, trees: Sequence[PolicyTree], pairs: Demonstrations) -> _Parameters:
        """What may be moved in trees that were grown from these pairs."""
        spreads = tuple(_spread(tree, pairs) for tree in trees)
        lines = tuple(
            _lines(tree, pairs, spread) for tree, spread in zip(trees, spreads, strict=True)
        )
        return cls(tuple(trees), spreads, lines, pairs.derived, len(pairs.observed))

    def start(self) -> NDArray[np.float64]:
        parts = []
        for tree, lines in zip(self.trees, self.lines, strict=True):
            leaves = tree.feature == LEAF
            shares = tree.counts[leaves] / np.maximum(tree.samples[leaves], 1)[:, None]
            likely = np.log(np.maximum(shares, _LEAST_SHARE))
            # What the leaf says is ahead, if only by nothing.
            labels = tree.label[leaves][:, None]
            best = likely.max(axis=1, keepdims=True)
            np.put_along_axis(likely, labels, best, axis=1)
            parts += [np.zeros(int((~leaves).sum()) + len(lines)), (likely - best).reshape(-1)]
        return np.concatenate(parts)

    def candidate(self, values: NDArray[np.float64]) -> _Candidate:
        structures = []
        derived: list[DerivedFeature] = list(self.derived)
        at = 0
        for tree, spread, lines in zip(self.trees, self.spreads, self.lines, strict=True):
            leaves = tree.feature == LEAF
            inner, labels = ~leaves, tree.dimension.n_labels
            threshold, label = tree.threshold.copy(), tree.label.copy()
            threshold[inner] += values[at : at + inner.sum()] * spread[inner]
            at += int(inner.sum())
            ratios = {}
            for line, turn in zip(lines, values[at : at + len(lines)].tolist(), strict=True):
                ratio = rounded_ratio(line.ratio + turn * line.scale)
                if ratio:  # of 0 the query would ask about one feature
                    ratios[line.node] = ratio
                    threshold[line.node] += (ratio - line.ratio) * line.centre
            at += len(lines)
            count = int(leaves.sum()) * labels
            label[leaves] = values[at : at + count].reshape(-1, labels).argmax(axis=1)
            at += count
            structure, derived = with_ratios(
                TreeStructure(
                    tree.feature, threshold, tree.children_left, tree.children_right, label
                ),
                derived,
                ratios,
                observed=self.observed,
            )
            structures.append(without_idle_queries(structure))
        used, definitions = over_queried(structures, derived, observed=self.observed)
        return _Candidate(tuple(used), definitions)


def refine(
    env_id: EnvironmentOrId,
    trees: Sequence[PolicyTree],
    pairs: Demonstrations,
    *,
    agent: Agent,
    projection: Projection = "centre",
    generations: int,
    marks: int,
    max_steps: int | None = None,
    choose: Choice = "return",
    seed: int = 0,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    better: Callable[[tuple[PolicyTree, ...]], None] | None = None,
) -> list[tuple[PolicyTree, ...]]:
    """Search around trees for better ones of the same shape.

    What combinations count their second feature for is moved too, to ratios of two digits.

    Args:
        env_id: The environment.
        trees: One an action dimension; every leaf is a rule.
        pairs: What they were grown from.
        agent: Who is shielded.
        projection: How the shield replaces a continuous action.
        generations: How many steps to go.
        marks: How many points on the way to give back.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
        choose: What comes first where two directions are compared.
        seed: Another one gives another way.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (episodes done, in all); returning False stops.
        better: Called with the trees of a point on the way whenever the episodes around it
            brought more than those around any point before, the start included; so that
            something is there when the way is not gone to its end.

    Returns:
        The trees at `marks` points, the last at the end of the way. Which is best is not known:
        choose by episodes.

    Raises:
        WorkError: If a process ended in the middle of its work.
        CancelledError: If `progress` returned False.
    """
    parameters = _Parameters.of(trees, pairs)
    few = pairs_of(pairs, _FEW)
    generator = np.random.default_rng(seed)
    here = parameters.start()
    momentum, size = np.zeros_like(here), np.zeros_like(here)
    candidates = []
    stops = {round(generations * (number + 1) / marks) for number in range(marks)}
    total = generations * generation_cost()
    most: tuple[float, ...] = ()

    def trees_at(point: NDArray[np.float64]) -> tuple[PolicyTree, ...]:
        return parameters.candidate(point).trees(pairs, trees[0].divider)

    workers = executor_of(jobs, executor)
    for number in range(1, generations + 1):
        directions = generator.normal(size=(PAIRS, len(here)))
        first = generation_seed(seed, number)
        shaken = [
            parameters.candidate(here + side * _SHAKE * direction)
            for direction in directions
            for side in (1, -1)
        ]
        means = run_each(
            _mean_scores,
            [
                (
                    env_id,
                    candidate,
                    few,
                    trees[0].divider,
                    agent,
                    projection,
                    first,
                    max_steps,
                    choose,
                )
                for candidate in shaken
            ],
            lost=LOST,
            executor=workers,
        )
        if (mean := mean_score(np.array(means))) > most:
            most = mean
            if better is not None and number > 1:
                better(trees_at(here))
        ranks = _ranks(np.array(means))
        slope = (ranks[0::2] - ranks[1::2]) @ directions / PAIRS
        momentum = _MEMORY[0] * momentum + (1 - _MEMORY[0]) * slope
        size = _MEMORY[1] * size + (1 - _MEMORY[1]) * slope**2
        steady = momentum / (1 - _MEMORY[0] ** number)
        scale = np.sqrt(size / (1 - _MEMORY[1] ** number)) + 1e-12
        here = here + _STEP * _SHAKE * steady / scale
        report(progress, number * generation_cost(), total)
        if number in stops:
            candidates.append(trees_at(here))
    return candidates


def generation_cost() -> int:
    """Episodes of one generation."""
    return 2 * PAIRS * EPISODES


def generation_seed(seed: int, number: int) -> int:
    """First seed of the episodes of one generation.

    Args:
        seed: Of the run.
        number: Of the generation, counted from 1.
    """
    return of_run(REFINEMENT, seed) + number * EPISODES


def pairs_of(pairs: Demonstrations, most: int) -> Demonstrations:
    """The first pairs, whole episodes, at least `most` of them where there are as many."""
    ends = np.cumsum(pairs.episode_lengths)
    return pairs.select(np.arange(1 + int(np.searchsorted(ends, min(most, len(pairs))))))


def _ranks(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places from -0.5, the least, to 0.5, by the first column, of equals by the next, (n, K)."""
    # Equal means share theirs, so that nothing is followed where all do as well as can be.
    ladder = np.empty(len(means))
    ladder[np.lexsort(means.T[::-1])] = np.linspace(-0.5, 0.5, len(means))
    _, group, size = np.unique(means, axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    shared: NDArray[np.float64] = (np.bincount(group, weights=ladder) / size)[group]
    return shared


def _spread(tree: PolicyTree, pairs: Demonstrations) -> NDArray[np.float64]:
    """Half the spread of the asked feature among the pairs that reach each inner node, (n,)."""
    spread = np.zeros(tree.n_nodes)
    for node in np.flatnonzero(tree.feature != LEAF).tolist():
        values = pairs.observations[tree.rows(node), tree.feature[node]]
        if len(values):
            low, high = np.quantile(values, _SPREAD)
            spread[node] = 0.5 * float(high - low)
    return spread


def _lines(
    tree: PolicyTree, pairs: Demonstrations, spread: NDArray[np.float64]
) -> tuple[_CombinedQuery, ...]:
    """The queries of a tree about combinations."""
    lines = []
    observed = len(pairs.observed)
    for node in np.flatnonzero(tree.feature >= observed).tolist():
        queried = pairs.derived[int(tree.feature[node]) - observed].definition
        values = pairs.observations[tree.rows(node)]
        if not isinstance(queried, Combination) or not len(values):
            continue
        second = values[:, queried.features[1]]
        low, high = np.quantile(second, _SPREAD)
        if high > low:
            scale = spread[node] / (0.5 * float(high - low))
            lines.append(_CombinedQuery(node, queried.ratio, scale, float(np.median(second))))
    return tuple(lines)


def _mean_scores(
    env_id: EnvironmentOrId,
    candidate: _Candidate,
    few: Demonstrations,
    divider: int,
    agent: Agent,
    projection: Projection,
    seed: int,
    max_steps: int | None,
    choose: Choice,
) -> tuple[float, ...]:
    shield = Shield(leaf_rules(candidate.trees(few, divider)), projection=projection)
    played = rollout(
        env_id,
        agent,
        shield=shield,
        episodes=EPISODES,
        seed=seed,
        keep_steps=False,
        max_steps=max_steps,
    )
    return mean_score(scores(played, choose))
