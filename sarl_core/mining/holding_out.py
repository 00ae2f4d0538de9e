"""Rules on episodes that they were not mined from, and how sure one can be of each.

Whole episodes are held out, because the steps within one are alike: a rule that has seen half of an
episode knows the other half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.applying import applications, labels_of
from sarl_core.mining.evidence import Z_95, HeldOut, Interval, wilson
from sarl_core.mining.landscape import NodeCounts
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rules import Rule, RuleSet
from sarl_core.mining.tree import PolicyTree

Verdict = Literal["below", "open", "reached"]


class Split(NamedTuple):
    """Demonstrations in two parts, by whole episodes.

    Attributes:
        mined: What rules are mined from.
        held_out: What they are tried on.
    """

    mined: Demonstrations
    held_out: Demonstrations


def hold_out(demonstrations: Demonstrations, share: float, *, seed: int = 0) -> Split:
    """Hold out some episodes, drawn by chance.

    Args:
        demonstrations: E episodes.
        share: Of the episodes to hold out, above 0 and below 1; rounded to whole episodes, and at
            least one.
        seed: Same seed, same episodes. A larger share holds out the same ones and more.

    Returns:
        Both parts, each in its present order.

    Raises:
        InputError: If the share, or the number of episodes, leaves none for one of the parts.
    """
    if not 0.0 < share < 1.0:
        raise InputError(
            f"the held-out share is {share:g}; give one above 0 and below 1, so that there are "
            "episodes to mine from and others to try the rules on"
        )
    episodes = demonstrations.episodes[demonstrations.episode_starts]
    count = len(episodes)
    held = max(round(share * count), 1)
    if held >= count:
        there = "one episode" if count == 1 else f"{count} episodes"
        raise InputError(
            f"a held-out share of {share:g} of {there} leaves none to mine from; "
            + ("give more episodes" if count == 1 else "give a smaller share")
        )
    drawn = np.random.default_rng(seed).permutation(count)[:held]
    rest = np.setdiff1d(np.arange(count), drawn)
    return Split(demonstrations.select(episodes[rest]), demonstrations.select(episodes[drawn]))


def with_held_out(rule_set: RuleSet, held_out: Demonstrations) -> RuleSet:
    """Try every rule on pairs that it was not mined from.

    Args:
        rule_set: Its rules.
        held_out: Pairs of other episodes.

    Returns:
        The same rules with `Rule.held_out`.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    rule_set = rules_for(rule_set, held_out).rule_set
    shown = labels_of(rule_set, held_out)
    found = applications(rule_set, held_out.observations)
    count = len(rule_set.rules)
    dimension = np.array([rule.dimension for rule in rule_set.rules], dtype=np.int64)
    says = np.array([rule.action for rule in rule_set.rules], dtype=np.int64)
    right = shown[found.row, dimension[found.rule]] == says[found.rule]
    samples = np.bincount(found.rule, minlength=count)
    correct = np.bincount(found.rule[right], minlength=count)
    return replace(
        rule_set,
        rules=tuple(
            replace(rule, held_out=HeldOut(*numbers))
            for rule, numbers in zip(
                rule_set.rules,
                zip(samples.tolist(), correct.tolist(), strict=True),
                strict=True,
            )
        ),
    )


def with_untried_held_out(rule_set: RuleSet, held_out: Demonstrations) -> RuleSet:
    """Try the rules on held-out pairs that were not tried yet, as those written by hand.

    Args:
        rule_set: Its rules.
        held_out: Pairs of other episodes.

    Returns:
        The same rules, each with `Rule.held_out`; the set itself where none was missing.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    if all(rule.held_out is not None for rule in rule_set.rules):
        return rule_set
    rule_set = rules_for(rule_set, held_out).rule_set
    untried = tuple(rule for rule in rule_set.rules if rule.held_out is None)
    tried = iter(with_held_out(replace(rule_set, rules=untried), held_out).rules)
    return replace(
        rule_set,
        rules=tuple(next(tried) if rule.held_out is None else rule for rule in rule_set.rules),
    )


def count_held_out(trees: Sequence[PolicyTree], held_out: Demonstrations) -> tuple[NodeCounts, ...]:
    """Send other pairs down trees and count them at every node, for the landscape.

    Args:
        trees: One an action dimension.
        held_out: Pairs of other episodes.

    Returns:
        One entry a tree.
    """
    return tuple(_count(tree, held_out) for tree in trees)


def _count(tree: PolicyTree, held_out: Demonstrations) -> NodeCounts:
    n, n_labels = tree.n_nodes, tree.dimension.n_labels
    labels = tree.dimension.labels_of(held_out.action_columns[:, tree.index])
    counts = np.bincount(
        tree.apply(held_out.observations) * n_labels + labels, minlength=n * n_labels
    ).reshape(n, n_labels)
    for depth in range(int(tree.depth.max()), 0, -1):
        level = np.flatnonzero(tree.depth == depth)
        np.add.at(counts, tree.parent[level], counts[level])
    correct = np.take_along_axis(counts, tree.label[:, None], axis=1)[:, 0]
    return NodeCounts(counts.sum(axis=1), correct)


# --- how sure one can be ------------------------------------------------------------------------


def mined_interval(rule: Rule) -> Interval:
    """The 95 % Wilson interval of a rule's confidence on what it was mined from.

    It flatters: the rule was chosen for this confidence.
    """
    return wilson(rule.correct, rule.samples)


def held_out_interval(rule: Rule) -> Interval | None:
    """The same on what was held out; None where nothing was, or no pair of it is the rule's."""
    if rule.held_out is None or not rule.held_out.samples:
        return None
    return wilson(rule.held_out.correct, rule.held_out.samples)


def lower_bound(rule: Rule) -> float:
    """Lower end of the held-out interval; where there is none, of that of the mined pairs."""
    return (held_out_interval(rule) or mined_interval(rule)).low


def verdict(rule: Rule, threshold: float) -> Verdict:
    """What the evidence says of a rule's confidence.

    Args:
        rule: With what was held out, if anything was.
        threshold: The minimum confidence.

    Returns:
        "below" if the whole interval lies below the threshold, "reached" if none of it does, and
        "open" between the two. Without held-out pairs it is the mined pairs' interval.
    """
    interval = held_out_interval(rule) or mined_interval(rule)
    if interval.high < threshold:
        return "below"
    return "reached" if interval.low >= threshold else "open"


def with_lower_bound(rule_set: RuleSet, least: float) -> RuleSet:
    """Keep the rules of whose confidence one can be sure.

    Args:
        rule_set: With what was held out, if anything was.
        least: Of the `lower_bound`, 0 to 1.

    Returns:
        The rules that reach it, in their order.

    Raises:
        InputError: If the bound is no share.
    """
    if not 0.0 <= least <= 1.0:
        raise InputError(f"the lower bound is {least:g}; give a share from 0 to 1")
    return replace(
        rule_set, rules=tuple(rule for rule in rule_set.rules if lower_bound(rule) >= least)
    )


def pairs_needed(confidence: float, threshold: float) -> float:
    """Pairs after which the lower end of the interval reaches a threshold.

    Wilson's ends are where (confidence - end)^2 = z^2 end (1 - end) / n, which gives n.

    Args:
        confidence: Share of the pairs that are right, and stays so.
        threshold: To be reached.

    Returns:
        A number that need not be whole; infinity where it is never reached.
    """
    if threshold <= 0.0:
        return 0.0
    if confidence <= threshold:
        return float("inf")
    return Z_95**2 * threshold * (1.0 - threshold) / (confidence - threshold) ** 2


def more_episodes(rule: Rule, episodes: int, threshold: float) -> float:
    """Episodes still missing until the `lower_bound` reaches a threshold, at the present rate.

    Every further episode is taken to bring as many pairs of the rule as one did so far, as often
    right as so far. Of episodes held out, only the same share is held out again.

    Args:
        rule: With what was held out, if anything was.
        episodes: Demonstrated so far, the held-out ones among them.
        threshold: The minimum confidence.

    Returns:
        A whole number; infinity where it is never reached at this rate.
    """
    tried = rule.held_out if rule.held_out is not None and rule.held_out.samples else None
    samples, correct = tried if tried is not None else (rule.samples, rule.correct)
    if not samples:
        return float("inf")
    if lower_bound(rule) >= threshold:
        return 0.0
    missing = pairs_needed(correct / samples, threshold) - samples
    if not np.isfinite(missing):
        return float("inf")
    return max(float(np.ceil(missing * episodes / samples)), 1.0)
