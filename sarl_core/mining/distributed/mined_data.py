"""What is left of rows that nobody holds: trees, what was counted at their nodes, a sample."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import is_cut
from sarl_core.mining.editing.renaming import renamed_trees
from sarl_core.mining.evidence import DataBox, EpisodeCounts, HeldOut
from sarl_core.mining.never.never_rules import forbidding_nodes, mine_at
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import Judged, judged_at

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FeatureHistogram:
    """How often a feature took which values.

    Attributes:
        borders: Between two bins, ascending, (k,): a value is in bin 0 where it is at most the
            first.
        counts: Pairs in each bin, (k + 1,) int64.
    """

    borders: Floats
    counts: NDArray[np.int64]

    def median(self, sample: NDArray[np.float32]) -> float:
        """The middle of all pairs: which bin it is in was counted, and where in it a sample says.

        Args:
            sample: Values of some of these pairs, (M,), M >= 1.

        Returns:
            Exact where bins hold one value each, as those of words and flags do, or the sample is
            all pairs.
        """
        values = np.sort(sample)
        bins = np.searchsorted(self.borders, values.astype(np.float64))
        ends = self.counts.cumsum()

        def value(rank: int) -> float:
            at = int(np.searchsorted(ends, rank, side="right"))
            first, last = np.searchsorted(bins, [at, at + 1]).tolist()
            if first == last:  # the sample has none of them
                return float(self.borders[min(at, len(self.borders) - 1)])
            before = rank - int(ends[at] - self.counts[at])
            return float(values[first + before * (last - first) // int(self.counts[at])])

        pairs = int(ends[-1])
        # Of an infinite and a negatively infinite value none is the middle: then the lower one is.
        with np.errstate(invalid="ignore"):
            middle = float(np.median([value((pairs - 1) // 2), value(pairs // 2)]))
        return -np.inf if np.isnan(middle) else middle


@dataclass(frozen=True, eq=False, repr=False)
class MinedData:
    """Trees over N pairs, and what was counted of all of these.

    Attributes:
        trees: One an action dimension; their rows are those of the sample.
        sample: M of the N pairs.
        boxes: For each tree what `DataBox` has, at each of its n nodes, (4, n, d): the outer two
            of all pairs, the inner two of some hundred thousand; NaN where there is no pair.
        histograms: Of each feature, of all pairs.
        held_out: For each tree, what was counted at its nodes in episodes that were held out; ()
            where none were.
        share: Of the episodes that was to be held out.
        seed: By which they were drawn.
    """

    trees: tuple[PolicyTree, ...]
    sample: Demonstrations
    boxes: tuple[Floats, ...]
    histograms: tuple[FeatureHistogram, ...]
    held_out: tuple[EpisodeCounts, ...] = ()
    share: float = 0.0
    seed: int = 0

    def __repr__(self) -> str:
        """Its size, as `MinedData(steps=900000, episodes=900, nodes=57869, sample=50000)`."""
        source = self.trees[0].source
        return (
            f"MinedData(steps={source.steps}, episodes={source.episodes}, "
            f"nodes={sum(tree.n_nodes for tree in self.trees)}, sample={len(self.sample)})"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the steps were read, and how far the trees go."""
        if not self.min_support:
            return self.sample.notes
        return (
            *self.sample.notes,
            f"these trees were grown down to a support of {self.min_support:g}: rules with less "
            "are not among them",
        )

    @property
    def min_support(self) -> float:
        """No node with less was split further."""
        return self.trees[0].least_support

    @property
    def divider(self) -> int:
        """Number of intervals of continuous dimensions."""
        return self.trees[0].divider

    @cached_property
    def digest(self) -> str:
        """Fingerprint (blake2b, 32 hex digits) of the trees, the sample and what was counted."""
        digest = hashlib.blake2b(digest_size=16)
        for part in (*(tree.digest for tree in self.trees), self.sample.digest):
            digest.update(f"{part} ".encode())
        for counts in self.held_out:
            for column in (counts.subject, counts.episode, counts.samples, counts.correct):
                digest.update(np.ascontiguousarray(column).data)
        return digest.hexdigest()

    @property
    def held_out_episodes(self) -> int:
        """Number of episodes that were held out."""
        return len(self.held_out[0].numbers) if self.held_out else 0

    @property
    def medians(self) -> tuple[float, ...]:
        """Of each feature over all pairs, as `FeatureHistogram.median` has it."""
        columns = self.sample.observations.T
        return tuple(
            one.median(values) for one, values in zip(self.histograms, columns, strict=True)
        )

    def renamed(self, sample: Demonstrations) -> MinedData:
        """The same under the names of its sample.

        Args:
            sample: That of these data, under whatever names.

        Returns:
            With trees that say these names.
        """
        return replace(self, trees=renamed_trees(self.trees, sample), sample=sample)

    @cached_property
    def _of_nodes(self) -> tuple[list[HeldOut], ...]:
        return tuple(counts.held_out() for counts in self.held_out)

    @cached_property
    def _of_nodes_reversed(self) -> tuple[list[HeldOut], ...]:
        """The same where all labels but the most frequent one are right."""
        return tuple(
            replace(counts, correct=counts.samples - counts.correct).held_out()
            for counts in self.held_out
        )

    def mine(
        self,
        *,
        supp_min: float,
        conf_min: float,
        lift_min: float = 0.0,
        max_depth: int | None = None,
    ) -> RuleSet:
        """Mine a rule set, as `mine_rules`, with data boxes and held-out episodes.

        Args:
            supp_min: Minimum support of a rule, 0 to 1.
            conf_min: Minimum confidence, 0 to 1.
            lift_min: Minimum lift, 0 or more.
            max_depth: Longest rule, in queries.

        Returns:
            The rules.

        Raises:
            InputError: If a threshold is out of range, or the trees were not grown down to the
                support.
        """
        return self.at(Thresholds(supp_min, conf_min, lift_min, max_depth))

    def at(self, thresholds: Thresholds) -> RuleSet:
        """Mine rules that demand, that forbid, or both, with data boxes and held-out episodes.

        Args:
            thresholds: At which the trees are cut.

        Returns:
            The rules, without held-out episodes where those were not `counted`.

        Raises:
            InputError: If the trees were not grown down to the support.
        """
        if thresholds.support < self.min_support:
            raise InputError(
                f"the minimum support is {thresholds.support:g}, and these trees were grown down "
                f"to {self.min_support:g}; give that or more, or mine the steps again with less"
            )
        rules, counted = mine_at(self.trees, thresholds), self.counted(thresholds)
        return replace(
            rules, rules=tuple(self._completed(rule, counted=counted) for rule in rules.rules)
        )

    def counted(self, thresholds: Thresholds) -> bool:
        """Whether what was counted in held-out episodes says how often rules are right.

        At each node it is the label that is most frequent there, and all others together: of two
        labels that is both, of more not the one that a rule forbids.

        Args:
            thresholds: Of the rules.
        """
        two = all(tree.dimension.n_labels <= 2 for tree in self.trees)
        return bool(self.held_out) and (thresholds.never is None or two)

    def count_rules(self, rule_set: RuleSet) -> EpisodeCounts:
        """What was counted of rules in the episodes that were held out.

        Args:
            rule_set: Of `at`, or some rules of one, of which these were `counted`.

        Returns:
            The counts, a rule's place in the set being its number.
        """
        first = self.held_out[0]
        columns: list[NDArray[np.int64]] = []
        for number, rule in enumerate(rule_set.rules):
            counts = self.held_out[rule.dimension]
            ends = np.searchsorted(counts.subject, [node_of(rule), node_of(rule) + 1])
            of = slice(*ends.tolist())
            episode, samples, correct = counts.episode[of], counts.samples[of], counts.correct[of]
            if self._forbids_most_frequent(rule):
                correct = samples - correct
            columns.append(np.stack([np.full_like(episode, number), episode, samples, correct]))
        whole = np.concatenate(columns, axis=1) if columns else np.zeros((4, 0), dtype=np.int64)
        place, episode, samples, correct = whole
        return EpisodeCounts(
            len(rule_set.rules), place, episode, samples, correct, first.numbers, first.lengths
        )

    def judged(self, thresholds: Thresholds) -> Judged | None:
        """What the held-out episodes say of all rules at thresholds; None if not `counted`.

        Args:
            thresholds: At which the trees are cut.
        """
        if not self.counted(thresholds):
            return None
        first = self.held_out[0]
        if thresholds.never is None:
            together = [counts.together for counts in self.held_out]
            return judged_at(thresholds, self.trees, together, first.numbers, first.lengths)
        covered, correct = np.zeros((2, len(first.numbers)), dtype=np.int64)
        for tree, counts in zip(self.trees, self.held_out, strict=True):
            some, right = _together(tree, counts, thresholds)
            covered, correct = covered + some, correct + right
        decisions = first.lengths * len(self.trees)
        return Judged(first.numbers, first.lengths, decisions, covered, correct)

    def _completed(self, rule: Rule, *, counted: bool) -> Rule:
        node = node_of(rule)
        sides = self.boxes[rule.dimension][:, node]
        box = None if np.isnan(sides).any() else DataBox(*sides.tolist())
        if not counted:
            return replace(rule, box=box)
        of = self._of_nodes_reversed if self._forbids_most_frequent(rule) else self._of_nodes
        return replace(rule, box=box, held_out=of[rule.dimension][node])

    def _forbids_most_frequent(self, rule: Rule) -> bool:
        return int(self.trees[rule.dimension].label[node_of(rule)]) in rule.forbids


def _together(
    tree: PolicyTree, counts: EpisodeCounts, thresholds: Thresholds
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """What was counted at the nodes of a tree with two labels, of all its rules together.

    Where a rule begins to have a say on a path, other labels are right from there on: what that
    changes is added up over the nodes, so that each pair counts as the last of them says.

    Args:
        tree: With n nodes.
        counts: At these, in E episodes.
        thresholds: Of rules that forbid, alone or behind those that demand.

    Returns:
        Pairs of each episode to which a rule applies, and those of them that are right, (E,) each.
    """
    right, says = _right_labels(tree, thresholds)
    change, begins = right.astype(np.int64), says.astype(np.int64)
    below = np.flatnonzero(tree.parent >= 0)
    above = tree.parent[below]
    change[below] -= right[above]
    begins[below] -= says[above]
    at = counts.subject
    most = tree.label[at]
    weights = (
        begins[at] * counts.samples,
        change[at, most] * counts.correct
        + change[at, most - 1] * (counts.samples - counts.correct),
    )
    covered, correct = (
        np.bincount(counts.episode, weight, minlength=len(counts.numbers)) for weight in weights
    )
    return covered.astype(np.int64), correct.astype(np.int64)


def _right_labels(
    tree: PolicyTree, thresholds: Thresholds
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which labels the rules on the way to each node leave right, and whether any has a say.

    Args:
        tree: With n nodes and L labels.
        thresholds: Of rules that forbid, alone or behind those that demand.

    Returns:
        Shapes (n, L), where nothing has a say no label, and (n,).
    """
    at, epsilon = thresholds, thresholds.never or 0.0
    allowed = ~forbidding_nodes(tree, epsilon=epsilon, supp_min=at.support, max_depth=at.max_depth)
    demands = is_cut(tree, at) if at.demands else np.zeros(tree.n_nodes, dtype=np.bool_)
    allowed[demands] = np.arange(allowed.shape[1]) == tree.label[demands, None]
    for depth in range(1, int(tree.depth.max()) + 1):
        nodes = np.flatnonzero(tree.depth == depth)
        above = tree.parent[nodes]
        # What forbids is added to what stands above; what demands comes before all of it.
        allowed[nodes] = np.where(
            demands[nodes, None],
            allowed[nodes],
            allowed[above] & (allowed[nodes] | demands[above, None]),
        )
        demands[nodes] |= demands[above]
    says = demands | ~allowed.all(axis=1)
    return allowed & says[:, None], says


def node_of(rule: Rule) -> int:
    """The node that a mined rule was cut at; nothing was regrown, so its number is its place."""
    return int(rule.id.rpartition(".")[2])


def boxes_of(
    tree: PolicyTree,
    least: NDArray[np.float32],
    most: NDArray[np.float32],
    states: NDArray[np.float32],
    quantiles: Sequence[float],
) -> Floats:
    """The data boxes at all nodes of a tree.

    Args:
        tree: With n nodes.
        least: Least value of each feature at each node, (n, d).
        most: Largest, likewise.
        states: A sample of the pairs, (M, d).
        quantiles: The two that stand within.

    Returns:
        Shape (4, n, d); NaN at nodes without a pair.
    """
    largest = np.finfo(np.float32).max
    boxes = np.empty((4, *least.shape))
    boxes[0], boxes[3] = np.clip(least, -largest, largest), np.clip(most, -largest, largest)
    boxes[:, tree.samples == 0] = np.nan
    boxes[1], boxes[2] = boxes[0], boxes[3]
    leaves = tree.apply(states)
    start = tree.sample_start[leaves]
    order = np.argsort(start, kind="stable")
    begins, ordered = start[order], np.clip(states[order], -largest, largest)
    first = np.searchsorted(begins, tree.sample_start)
    last = np.searchsorted(begins, tree.sample_start + tree.samples)
    for node in np.flatnonzero((last > first) & (tree.samples > 0)).tolist():
        inner = np.quantile(ordered[first[node] : last[node]].astype(np.float64), quantiles, axis=0)
        boxes[1:3, node] = np.clip(inner, boxes[0, node], boxes[3, node])
    return boxes
