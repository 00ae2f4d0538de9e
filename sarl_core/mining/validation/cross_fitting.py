"""What a whole rule set is worth on episodes that it was not mined from, none being held out.

The episodes are dealt into a few folds. For each fold trees are grown from all other episodes, and
its own are sent down them. So every episode is judged by rules mined without it, at whatever
thresholds: trees do not depend on those, and one growing serves all of them.

It judges the way of mining, with so many episodes and at these thresholds, and not the very rules
that all episodes together give. Rules that a person wrote or moved cannot be mined again, so for
them there is `hold_out` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import is_cut
from sarl_core.mining.combining.candidates import Pair
from sarl_core.mining.combining.choice import chosen_again
from sarl_core.mining.evidence import EpisodeCounts, HeldOut, held_out_of
from sarl_core.mining.growing.growth import cut_back, fewest_pairs, grow_policy_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import Learner, PolicyTree, without_rows
from sarl_core.mining.validation.episode_counts import (
    Influence,
    LeafCounts,
    count_above,
    count_leaves,
    count_together,
    most_influential,
)
from sarl_core.processes import run_each
from sarl_core.progress import Progress

FOLDS = 10
"""Enough that each tree is grown from nearly as many episodes as all together are."""
FEWER_FOLDS, MANY_STEPS = 5, 100_000
"""Of so many steps a tree takes its time and its room, and a fifth less of them are still many."""
_STEPS_AT_ONCE = 25_000  # that are counted at all nodes: some hundred megabytes of a deep tree
PARTING = 0.03
"""From so much on, the number on what was mined from is said to part from the other."""

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Fold:
    """Trees, and the episodes that they were grown without.

    Attributes:
        trees: One an action dimension, without the rows that they were counted over.
        leaves: Those episodes at their leaves.
    """

    trees: tuple[PolicyTree, ...]
    leaves: tuple[LeafCounts, ...]

    def counts(self) -> Iterator[tuple[EpisodeCounts, ...]]:
        """Those episodes at all nodes, some episodes after others.

        At all nodes they take many times as much memory as at leaves.
        """
        lengths = self.leaves[0].lengths
        pieces = min(len(lengths), -(-int(lengths.sum()) // _STEPS_AT_ONCE))
        for some in np.array_split(np.arange(len(lengths)), pieces):
            yield tuple(
                count_above(tree, leaves.of(int(some[0]), int(some[-1]) + 1))
                for tree, leaves in zip(self.trees, self.leaves, strict=True)
            )

    def at(self, thresholds: Thresholds) -> Judged:
        """What those episodes say of the rules at some thresholds.

        Args:
            thresholds: At which the trees are cut.

        Returns:
            The same as `judge` of these rules.
        """
        first = self.leaves[0]
        together = [
            partial(leaves.together, tree)
            for tree, leaves in zip(self.trees, self.leaves, strict=True)
        ]
        return judged_at(thresholds, self.trees, together, first.numbers, first.lengths)


@dataclass(frozen=True, eq=False)
class CrossFit:
    """Rule sets of every pair of thresholds, on episodes that they were not mined from.

    Attributes:
        folds: Each with other episodes; together, all there are.
        whole_episodes: Whether these are episodes; else there was one only, and they are
            stretches of it, which are alike.
        parted: The pairs, in these episodes.
        least_support: Of rules that are known. Where it is not 0, nothing is known of the rules at
            a lower minimum support.
    """

    folds: tuple[Fold, ...]
    whole_episodes: bool
    parted: Demonstrations
    least_support: float = 0.0

    def at(self, thresholds: Thresholds) -> Judged:
        """What is known of the rules at some thresholds.

        Args:
            thresholds: Of the rules.

        Returns:
            The same as mining at them once for each fold gives.

        Raises:
            InputError: If the minimum support is less than `least_support`.
        """
        if thresholds.support < self.least_support:
            raise InputError(
                f"these trees know rules from a support of {self.least_support:g} on, and the "
                f"minimum support is {thresholds.support:g}; fit without min_support"
            )
        return self._together([fold.at(thresholds) for fold in self.folds])

    def of(self, mine: Callable[[Sequence[PolicyTree]], RuleSet]) -> Judged:
        """What is known of rules of any kind, such as those that forbid.

        Args:
            mine: Mines them from trees, one an action dimension; of `least_support` at least.

        Returns:
            As `at`; it is called once for each fold.
        """
        return self._together(
            [
                judge_pairs(mine(fold.trees), self.parted.select(fold.leaves[0].numbers))
                for fold in self.folds
            ]
        )

    def _together(self, judged: list[Judged]) -> Judged:
        return Judged(
            numbers=np.concatenate([one.numbers for one in judged]),
            lengths=np.concatenate([one.lengths for one in judged]),
            decisions=np.concatenate([one.decisions for one in judged]),
            covered=np.concatenate([one.covered for one in judged]),
            correct=np.concatenate([one.correct for one in judged]),
            folds=len(self.folds),
            whole_episodes=self.whole_episodes,
        )


@dataclass(frozen=True, eq=False)
class Judged:
    """A rule set on E episodes that it was not mined from.

    Attributes:
        numbers: What the episodes are called, (E,).
        lengths: Their steps, (E,).
        decisions: Steps times action dimensions, (E,).
        covered: In how many of those a rule applied, (E,).
        correct: In how many of these the expert did what it says, (E,).
        folds: How many rule sets it took, each judged on other episodes; 0 where it was one.
        whole_episodes: As of `CrossFit`.
    """

    numbers: Integers
    lengths: Integers
    decisions: Integers
    covered: Integers
    correct: Integers
    folds: int = 0
    whole_episodes: bool = True

    @property
    def fidelity(self) -> HeldOut:
        """How often the expert did what the rules say, where one applied."""
        return self._counted(self.covered, self.correct)

    @property
    def coverage(self) -> HeldOut:
        """How often a rule applied."""
        return self._counted(self.decisions, self.covered)

    def _counted(self, whole: Integers, part: Integers) -> HeldOut:
        # Any two of the rule sets share nearly all that they were mined from, so what an episode
        # says of one depends on the episodes of the others. The mean of K such folds varies about
        # 1 + K / (K - 1) times as much as that of as many independent numbers (Nadeau and Bengio,
        # "Inference for the generalization error", 2003).
        widened = (1.0 + self.folds / (self.folds - 1)) ** 0.5 if self.folds > 1 else 1.0
        held_out = held_out_of(whole, part, whole_set=True, widened=widened)
        return held_out if self.whole_episodes else held_out._replace(low=None, high=None)

    @property
    def influence(self) -> Influence | None:
        """The episode that moves `fidelity` most."""
        return most_influential(self.covered, self.correct, self.numbers, self.lengths)

    @property
    def influence_by_states(self) -> Influence | None:
        """The episode that would move it most if every state counted for itself."""
        return most_influential(self.covered, self.correct, self.numbers, self.lengths, by="states")


def judged_at(
    thresholds: Thresholds,
    trees: Sequence[PolicyTree],
    together: Sequence[Callable[[NDArray[np.bool_]], tuple[Integers, Integers]]],
    numbers: Integers,
    lengths: Integers,
) -> Judged:
    """The rules that trees are cut to, in episodes that were counted at their nodes.

    Args:
        thresholds: At which the trees are cut.
        trees: One an action dimension, with n nodes each.
        together: Of each tree, what gives the pairs of each episode at some nodes (n,) that do not
            lie above one another, and those of them that are right, (E,) each.
        numbers: What the episodes are called, (E,).
        lengths: Their steps, (E,).

    Returns:
        The same as `judge` of these rules.
    """
    samples, correct = np.zeros((2, len(numbers)), dtype=np.int64)
    for tree, counted in zip(trees, together, strict=True):
        some, right = counted(is_cut(tree, thresholds))
        samples, correct = samples + some, correct + right
    return Judged(numbers, lengths, lengths * len(trees), samples, correct)


def judge(rule_set: RuleSet, counts: EpisodeCounts) -> Judged:
    """A whole rule set on episodes that were held out.

    Args:
        rule_set: Rules of one action dimension do not overlap, as mined ones do not.
        counts: What `count_rules` counted of them.

    Returns:
        What these episodes say of it.
    """
    covered, correct = counts.together(np.ones(counts.size, dtype=np.bool_))
    return Judged(
        numbers=counts.numbers,
        lengths=counts.lengths,
        decisions=counts.lengths * len(rule_set.actions),
        covered=covered,
        correct=correct,
    )


def judge_pairs(rule_set: RuleSet, held_out: Demonstrations) -> Judged:
    """The same of rules that may overlap, as those that forbid do.

    Args:
        rule_set: Any rules; those that demand do not overlap.
        held_out: Pairs of other episodes.

    Returns:
        What these episodes say of it.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    covered, correct = count_together(rule_set, held_out)
    lengths = held_out.episode_lengths
    return Judged(
        numbers=held_out.episodes[held_out.episode_starts],
        lengths=lengths,
        decisions=lengths * len(rule_set.actions),
        covered=covered,
        correct=correct,
    )


def cross_fit(
    demonstrations: Demonstrations,
    *,
    divider: int = 2,
    folds: int | None = None,
    seed: int = 0,
    combined: Sequence[Pair] = (),
    learner: Learner = "exact",
    min_support: float = 0.0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> CrossFit:
    """Grow trees without each fold of the episodes, and send the fold down them.

    Args:
        demonstrations: E episodes. A single one is cut into stretches: rules that know one
            stretch know the next, so what comes of it flatters, and no interval is given.
        divider: Number of intervals of continuous dimensions.
        folds: How many; one an episode where there are fewer. Where not given `FOLDS`, or
            `FEWER_FOLDS` from `MANY_STEPS` on.
        seed: Same seed, same folds.
        combined: Pairs of features that rules may combine. Where there are some, each fold's trees
            choose their own combinations of them: the fold has no say in that either.
        learner: What grows the trees.
        min_support: Least share of the pairs, 0 to 1, of rules that are to be known: fully grown
            trees of very many pairs take several times as much memory.
        executor: Its processes grow the trees.
        progress: Told how many folds are done; may stop the rest.

    Returns:
        What `CrossFit.at` asks at any thresholds.

    Raises:
        InputError: If there are fewer than two folds, or too few steps for two; or if the support
            is no share.
        CancelledError: If the caller wants no more.
    """
    require_every_step(demonstrations, "judging rules in other episodes")
    if not 0.0 <= min_support <= 1.0:
        raise InputError(f"the least support is {min_support:g}; give 0 to 1")
    if folds is None:
        folds = FOLDS if len(demonstrations) < MANY_STEPS else FEWER_FOLDS
    if folds < 2:
        raise InputError(f"{folds} folds leave nothing to mine from; give at least 2")
    whole = demonstrations.n_episodes > 1
    parted = demonstrations if whole else _in_stretches(demonstrations, folds)
    count = parted.n_episodes
    if count < 2 or len(parted) < 4:
        raise InputError(
            "the demonstrations are too short to be parted; give at least two episodes"
        )
    episodes = parted.episodes[parted.episode_starts]
    order = episodes[np.random.default_rng(seed).permutation(count)]
    dealt = [order[first :: min(folds, count)] for first in range(min(folds, count))]
    fitted = run_each(
        fold_of,
        [(parted, some, divider, tuple(combined), learner, min_support) for some in dealt],
        executor=executor,
        progress=progress,
    )
    return CrossFit(tuple(fitted), whole, parted, min_support)


def fold_of(
    demonstrations: Demonstrations,
    episodes: Integers,
    divider: int,
    combined: Sequence[Pair] = (),
    learner: Learner = "exact",
    min_support: float = 0.0,
) -> Fold:
    """Grow trees without some episodes, and send those down them.

    Args:
        demonstrations: E episodes.
        episodes: Numbers of those that the trees are not to know.
        divider: Number of intervals of continuous dimensions.
        combined: Pairs of features of which combinations are chosen, without those episodes.
        learner: What grows the trees.
        min_support: Least share of the pairs of rules that are to be known.

    Returns:
        Both.
    """
    mined = demonstrations.select(np.setdiff1d(demonstrations.episodes, episodes))
    if combined:
        mined = chosen_again(mined, combined, divider=divider)
    trees = grow_policy_trees(mined, divider=divider, learner=learner)
    least = fewest_pairs(min_support, len(mined))
    if least > 2:  # a pair alone is split no further
        trees = tuple(cut_back(tree, least, mined) for tree in trees)
    judged = demonstrations.select(episodes)
    if combined:
        judged = judged.deriving(mined.derived)
    leaves = tuple(count_leaves(tree, judged) for tree in trees)
    # Nobody asks which pairs they are, and of many pairs that takes more room than all else.
    return Fold(tuple(map(without_rows, trees)), leaves)


def _in_stretches(demonstrations: Demonstrations, count: int) -> Demonstrations:
    """One episode, cut into so many stretches of about the same length."""
    episodes = np.arange(len(demonstrations)) * count // len(demonstrations)
    return replace(
        demonstrations,
        episodes=episodes,
        steps=None,
        rewards=None,
        terminated=None,
        truncated=None,
    )


def parts(mined: float, elsewhere: HeldOut) -> bool:
    """Whether what was mined from says clearly more than other episodes do.

    Args:
        mined: A share on what was mined from; NaN where there is none.
        elsewhere: The same on other episodes.

    Returns:
        True if the other number lies lower by more than `PARTING`, its whole interval included;
        where it has none, the number itself.
    """
    high = elsewhere.high if elsewhere.high is not None else elsewhere.share
    return high is not None and mined - high > PARTING
