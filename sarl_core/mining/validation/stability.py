"""How often a rule comes back when episodes are drawn again, and how far its thresholds move.

A rule is recognised by what it does to the data, and not by its words: by the states it covers and
the label it gives them. Two rules may ask quite different questions and cover the same states.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.applications import Applications, applications
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Operator, Rule
from sarl_core.processes import run_each
from sarl_core.progress import Progress

SAME_RULE = 0.5
"""Overlap from which on two rules count as the same one: they share more than they do not."""
LOW_QUANTILE, HIGH_QUANTILE = 0.05, 0.95

Floats = NDArray[np.float64]


class Band(NamedTuple):
    """How far one threshold of a rule moves.

    Attributes:
        feature: Index into the observation vector.
        op: Which side of the feature's interval it is.
        threshold: Of the rule itself.
        low: The 5 % quantile over the rules that came back and ask this too; NaN without any.
        high: The 95 % quantile.
        rounds: In how many rounds it was asked.
    """

    feature: int
    op: Operator
    threshold: float
    low: float
    high: float
    rounds: int


@dataclass(frozen=True)
class RuleStability:
    """One rule over all rounds.

    Attributes:
        rule: Its id.
        returns: Share of the rounds in which it came back.
        overlap: Median over the rounds of the overlap with the rule most like it, 0 to 1.
        bands: One entry for each of its thresholds.
    """

    rule: str
    returns: float
    overlap: float
    bands: tuple[Band, ...]


@dataclass(frozen=True)
class Stability:
    """A rule set over all rounds.

    Attributes:
        rounds: How often episodes were drawn.
        limit: Overlap from which on a rule has come back.
        rules: One entry a rule, in the order of the rule set.
    """

    rounds: int
    limit: float
    rules: tuple[RuleStability, ...]


class RuleThreshold(NamedTuple):
    """One threshold of a rule of the original set.

    Attributes:
        rule: Place of the rule.
        feature: Index into the observation vector.
        op: Which side.
        threshold: Where.
    """

    rule: int
    feature: int
    op: Operator
    threshold: float


class ResampledRound(NamedTuple):
    """What one round says of R rules with S thresholds.

    Attributes:
        overlap: With the rule most like each, (R,).
        thresholds: Where that rule has each threshold, (S,); NaN where it has none, or where it
            is too unlike.
    """

    overlap: Floats
    thresholds: Floats


def rule_stability(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    *,
    rounds: int = 30,
    limit: float = SAME_RULE,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Stability:
    """Draw as many episodes as there are, with replacement, mine again, and look for the rules.

    The overlap of two rules is the number of demonstrated states that both cover over the number
    that one of them covers (Jaccard); rules that say different things have none.

    Args:
        rule_set: Mined at thresholds.
        demonstrations: What it was mined from.
        rounds: How often.
        limit: Overlap from which on a rule has come back, above 0.
        seed: Same seed, same draws.
        executor: Its processes do the mining.
        progress: Told how many rounds are done; may stop the rest.

    Returns:
        One entry a rule.

    Raises:
        InputError: If the rules were not cut at thresholds, are for other demonstrations, or a
            setting is out of range.
        CancelledError: If the caller wants no more.
    """
    if rule_set.cut != "thresholds":
        raise InputError(
            "these rules were not cut at thresholds, so they cannot be mined again; choose rules "
            "at the thresholds"
        )
    if rounds < 1 or not 0.0 < limit <= 1.0:
        raise InputError(
            f"{rounds} rounds with a limit of {limit:g} show nothing; give at least one round and "
            "a limit above 0, at most 1"
        )
    rule_set = rules_for(rule_set, demonstrations).rule_set
    rng = np.random.default_rng(seed)
    count = demonstrations.n_episodes
    own = applications(rule_set, demonstrations.observations)
    sides = _sides(rule_set.rules)
    resamples = run_each(
        resampled,
        [
            (rule_set, demonstrations, own, sides, rng.integers(0, count, count), limit)
            for _ in range(rounds)
        ],
        executor=executor,
        progress=progress,
    )
    overlap = np.stack([one.overlap for one in resamples])
    thresholds = np.stack([one.thresholds for one in resamples])
    bands: list[list[Band]] = [[] for _ in rule_set.rules]
    for side, values in zip(sides, thresholds.T, strict=True):
        there = values[~np.isnan(values)]
        low, high = (
            np.quantile(there, [LOW_QUANTILE, HIGH_QUANTILE]).tolist()
            if len(there)
            else (float("nan"), float("nan"))
        )
        bands[side.rule].append(Band(*side[1:], low, high, len(there)))
    return Stability(
        rounds,
        limit,
        tuple(
            RuleStability(
                rule.id,
                float((overlap[:, place] >= limit).mean()),
                float(np.median(overlap[:, place])),
                tuple(bands[place]),
            )
            for place, rule in enumerate(rule_set.rules)
        ),
    )


def _sides(rules: tuple[Rule, ...]) -> list[RuleThreshold]:
    sides = []
    for place, rule in enumerate(rules):
        for feature, low, high in rule.bounds:
            if np.isfinite(low):
                sides.append(RuleThreshold(place, feature, ">", low))
            if np.isfinite(high):
                sides.append(RuleThreshold(place, feature, "<=", high))
    return sides


def resampled(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    own: Applications,
    sides: list[RuleThreshold],
    drawn: NDArray[np.int64],
    limit: float,
) -> ResampledRound:
    """One round: mine from other episodes and look for the rules.

    Args:
        rule_set: The original rules.
        demonstrations: The original pairs.
        own: Which rule applies to which of them.
        sides: The thresholds of the original rules.
        drawn: Places of the episodes, some of them several times.
        limit: Overlap from which on a rule has come back.

    Returns:
        What was found.
    """
    trees = grow_policy_trees(
        _drawn(demonstrations, drawn), divider=rule_set.divider, learner=rule_set.learner
    )
    mined = mine_at(trees, rule_set.thresholds)
    overlap, like = _most_alike(rule_set, own, mined, demonstrations)
    known: dict[int, dict[tuple[int, Operator], float]] = {}
    thresholds = np.full(len(sides), np.nan)
    for place, side in enumerate(sides):
        if overlap[side.rule] < limit:
            continue
        other = int(like[side.rule])
        if other not in known:
            known[other] = {
                (one.feature, one.op): one.threshold for one in _sides((mined.rules[other],))
            }
        thresholds[place] = known[other].get((side.feature, side.op), np.nan)
    return ResampledRound(overlap, thresholds)


def _drawn(demonstrations: Demonstrations, drawn: NDArray[np.int64]) -> Demonstrations:
    """Some episodes, each time as an episode of its own."""
    starts = demonstrations.episode_starts[drawn]
    lengths = demonstrations.episode_lengths[drawn]
    rows = np.concatenate(
        [np.arange(a, a + n) for a, n in zip(starts.tolist(), lengths.tolist(), strict=True)]
    )
    return replace(
        demonstrations,
        observations=demonstrations.observations[rows],
        actions=demonstrations.actions[rows],
        episodes=np.repeat(np.arange(len(drawn)), lengths),
        rewards=None,
        terminated=None,
        truncated=None,
        steps=None,
        times=None,
    )


def _most_alike(
    rule_set: RuleSet, own: Applications, mined: RuleSet, demonstrations: Demonstrations
) -> tuple[Floats, NDArray[np.int64]]:
    """The largest overlap of each rule with one of another set, and with which one."""
    count, others = len(rule_set.rules), len(mined.rules)
    overlap, like = np.zeros(count), np.full(count, -1, dtype=np.int64)
    if not others:
        return overlap, like
    theirs = applications(mined, demonstrations.observations)
    says, they_say = _says(rule_set, mined)
    # Freshly mined rules that say the same do not overlap: a state has one of them, or none.
    kinds = 1 + max(int(one.max(initial=0)) for one in (says, they_say))
    at = np.full((kinds, len(demonstrations)), -1, dtype=np.int64)
    at[they_say[theirs.rule], theirs.row] = theirs.rule
    met = at[says[own.rule], own.row]
    same = met >= 0
    pair, shared = np.unique(own.rule[same] * others + met[same], return_counts=True)
    first, second = np.divmod(pair, others)
    size = np.bincount(own.rule, minlength=count)
    their_size = np.bincount(theirs.rule, minlength=others)
    jaccard = shared / (size[first] + their_size[second] - shared)
    order = np.argsort(jaccard, kind="stable")  # the largest is written last
    overlap[first[order]] = jaccard[order]
    like[first[order]] = second[order]
    return overlap, like


def _says(*rule_sets: RuleSet) -> list[NDArray[np.int64]]:
    """What each rule demands or forbids, as a number that is the same wherever it is the same."""
    numbers: dict[tuple[int, int | tuple[int, ...]], int] = {}
    return [
        np.array(
            [
                numbers.setdefault((rule.dimension, rule.forbids or rule.action), len(numbers))
                for rule in rule_set.rules
            ],
            dtype=np.int64,
        )
        for rule_set in rule_sets
    ]
