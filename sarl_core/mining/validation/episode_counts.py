"""In which episodes something applies, how often, and how often it is right there."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.applications import applications, labels_of
from sarl_core.mining.evidence import EpisodeCounts, Integers
from sarl_core.mining.growing.structure import tree_levels
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.mining.tree import LEAF, PolicyTree


def episode_of_each(demonstrations: Demonstrations) -> Integers:
    """Which episode each of N pairs belongs to, counted from 0, (N,)."""
    return np.repeat(np.arange(demonstrations.n_episodes), demonstrations.episode_lengths)


def count_rules(rule_set: RuleSet, demonstrations: Demonstrations) -> EpisodeCounts:
    """Try every rule on pairs, whether or not another rule would come first.

    Args:
        rule_set: R rules.
        demonstrations: N pairs.

    Returns:
        The counts, a rule's place in the set being its number.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    labels = labels_of(rule_set, demonstrations)
    applied = applications(rule_set, demonstrations.observations)
    dimension = np.array([rule.dimension for rule in rule_set.rules], dtype=np.int64)
    obeying = obeying_labels(rule_set)
    right = obeying[applied.rule, labels[applied.row, dimension[applied.rule]]]
    return count_applied(len(rule_set.rules), applied.rule, applied.row, right, demonstrations)


def count_together(rule_set: RuleSet, demonstrations: Demonstrations) -> tuple[Integers, Integers]:
    """Try all rules together on pairs, also where several apply at once.

    A pair is right in an action dimension if it is as every rule says that has a say there: behind
    one that demands, rules that forbid have none.

    Args:
        rule_set: Rules that demand do not overlap, as mined ones do not.
        demonstrations: N pairs, in E episodes.

    Returns:
        Pairs of each episode to which a rule applies, and those of them that are right, (E,) each;
        each pair counts once an action dimension.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    labels = labels_of(rule_set, demonstrations)
    applied = applications(rule_set, demonstrations.raw_observations)
    dimension = np.array([rule.dimension for rule in rule_set.rules], dtype=np.int64)
    forbids = np.array([bool(rule.forbids) for rule in rule_set.rules], dtype=np.bool_)
    row, column, behind = applied.row, dimension[applied.rule], forbids[applied.rule]
    right = obeying_labels(rule_set)[applied.rule, labels[row, column]]
    demanded, covered, broken = np.zeros((3, *labels.shape), dtype=np.bool_)
    demanded[row[~behind], column[~behind]] = True
    says = ~behind | ~demanded[row, column]
    covered[row[says], column[says]] = True
    broken[row[says & ~right], column[says & ~right]] = True
    episode, episodes = episode_of_each(demonstrations), demonstrations.n_episodes
    samples, correct = (
        np.bincount(episode, which.sum(axis=1), minlength=episodes).astype(np.int64)
        for which in (covered, covered & ~broken)
    )
    return samples, correct


def count_applied(
    size: int,
    subject: Integers,
    row: Integers,
    right: NDArray[np.bool_],
    demonstrations: Demonstrations,
) -> EpisodeCounts:
    """Count what is known to apply to which pair.

    Args:
        size: Number of subjects.
        subject: Which one applies, (K,).
        row: To which pair, (K,).
        right: Whether it is right about it, (K,).
        demonstrations: The pairs.

    Returns:
        The counts.
    """
    each = np.ones(len(row), dtype=np.int64)
    episode = episode_of_each(demonstrations)[row]
    numbers, lengths = _episodes_of(demonstrations)
    return _counted(size, subject, episode, each, right.astype(np.int64), numbers, lengths)


class LeafCounts(NamedTuple):
    """Pairs at the leaves of a tree, K entries: a small part of what is counted at all nodes.

    Attributes:
        leaf: Node number, (K,).
        episode: In which episode, 0 to E - 1, (K,).
        label: Which label, (K,).
        samples: Pairs of these three, (K,).
        numbers: What the episodes are called, (E,).
        lengths: Their steps, (E,).
    """

    leaf: Integers
    episode: Integers
    label: Integers
    samples: Integers
    numbers: Integers
    lengths: Integers

    def of(self, first: int, end: int) -> LeafCounts:
        """Those of the episodes from one on, counted from 0, and before another."""
        inside = (self.episode >= first) & (self.episode < end)
        leaf, episode, label, samples = (column[inside] for column in self[:4])
        return LeafCounts(
            leaf, episode - first, label, samples, self.numbers[first:end], self.lengths[first:end]
        )

    def together(self, tree: PolicyTree, chosen: NDArray[np.bool_]) -> tuple[Integers, Integers]:
        """Some nodes that do not lie above one another, taken as one.

        Args:
            tree: Whose leaves they are, with n nodes.
            chosen: Which, (n,).

        Returns:
            As `EpisodeCounts.together` of what `count_above` counts.
        """
        over = np.where(chosen, np.arange(tree.n_nodes), LEAF)
        for level in tree_levels(tree.children_left, tree.children_right)[1:]:
            inherited = over[tree.parent[level]]
            over[level] = np.where(inherited == LEAF, over[level], inherited)
        node = over[self.leaf]
        inside = node != LEAF
        episode, samples = self.episode[inside], self.samples[inside]
        right = tree.label[node[inside]] == self.label[inside]
        some, correct = (
            np.bincount(episode, weights, minlength=len(self.numbers)).astype(np.int64)
            for weights in (samples, samples * right)
        )
        return some, correct


def count_leaves(tree: PolicyTree, demonstrations: Demonstrations) -> LeafCounts:
    """Send pairs down a tree and count them where they end.

    Args:
        tree: With n nodes.
        demonstrations: N pairs, of the same features and actions.

    Returns:
        The counts.
    """
    n_labels, episodes = tree.dimension.n_labels, demonstrations.n_episodes
    label = tree.dimension.labels_of(demonstrations.action_columns[:, tree.index])
    leaf = tree.apply(demonstrations.observations)
    # The pairs of one leaf, episode and label stay together.
    key = (leaf * episodes + episode_of_each(demonstrations)) * n_labels + label
    key, samples = np.unique(key, return_counts=True)
    above, label = np.divmod(key, n_labels)
    leaf, episode = np.divmod(above, episodes)
    return LeafCounts(leaf, episode, label, samples, *_episodes_of(demonstrations))


def count_nodes(tree: PolicyTree, demonstrations: Demonstrations) -> EpisodeCounts:
    """Send pairs down a tree and count them at every node on their way.

    Args:
        tree: With n nodes.
        demonstrations: N pairs, of the same features and actions.

    Returns:
        The counts, by node number.
    """
    return count_above(tree, count_leaves(tree, demonstrations))


def count_above(tree: PolicyTree, counts: LeafCounts) -> EpisodeCounts:
    """What was counted at leaves, at every node above them.

    Args:
        tree: With n nodes.
        counts: At its leaves.

    Returns:
        The counts, by node number.
    """
    leaf, episode, label, samples, numbers, lengths = counts
    node = leaf
    parts: list[tuple[Integers, ...]] = []
    while len(node):
        parts.append((node, episode, samples, samples * (tree.label[node] == label)))
        inner = tree.parent[node] >= 0
        node, episode = tree.parent[node[inner]], episode[inner]
        samples, label = samples[inner], label[inner]
    none = np.zeros((4, 0), dtype=np.int64)
    columns = [np.concatenate(part) for part in zip(*parts, strict=True)] if parts else none
    return _counted(tree.n_nodes, columns[0], columns[1], columns[2], columns[3], numbers, lengths)


def _episodes_of(demonstrations: Demonstrations) -> tuple[Integers, Integers]:
    """What episodes are called, and their steps."""
    starts = demonstrations.episode_starts
    return demonstrations.episodes[starts], demonstrations.episode_lengths


def _counted(
    size: int,
    subject: Integers,
    episode: Integers,
    samples: Integers,
    correct: Integers,
    numbers: Integers,
    lengths: Integers,
) -> EpisodeCounts:
    """Add up what belongs to one subject and one episode."""
    key = subject * len(numbers) + episode
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    if len(first):
        samples = np.add.reduceat(samples[order], first)
        correct = np.add.reduceat(correct[order], first)
    subject, episode = np.divmod(key[first], len(numbers))
    return EpisodeCounts(size, subject, episode, samples, correct, numbers, lengths)


# --- an episode that alone moves a number --------------------------------------------------------


class Influence(NamedTuple):
    """The episode without which a share would differ most.

    Attributes:
        episode: What it is called.
        steps: How long it is.
        share: The share with it.
        without: The share without it.
    """

    episode: int
    steps: int
    share: float
    without: float

    @property
    def moves(self) -> float:
        """How far it moves the share, 0 to 1."""
        return abs(self.share - self.without)


def most_influential(
    samples: ArrayLike,
    correct: ArrayLike,
    numbers: Integers,
    lengths: Integers,
    *,
    by: Literal["episodes", "states"] = "episodes",
) -> Influence | None:
    """Leave out each episode in turn.

    Args:
        samples: Pairs that count in each episode, (E,).
        correct: Those of them that are right, (E,).
        numbers: What the episodes are called, (E,).
        lengths: Their steps, (E,).
        by: Whether each episode counts once, or each state.

    Returns:
        The episode that moves the share most, the first of several; None where fewer than two
        count.
    """
    pairs, right = np.asarray(samples, dtype=np.float64), np.asarray(correct, dtype=np.float64)
    counting = np.flatnonzero(pairs > 0)
    if len(counting) < 2:
        return None
    whole, part = pairs[counting], right[counting]
    if by == "episodes":
        whole, part = np.ones(len(counting)), part / whole
    share = part.sum() / whole.sum()
    without = (part.sum() - part) / (whole.sum() - whole)
    most = int(np.argmax(np.abs(without - share)))
    place = counting[most]
    return Influence(int(numbers[place]), int(lengths[place]), float(share), float(without[most]))
