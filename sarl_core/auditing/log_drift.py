"""Whether a log still looks like what the rules were mined from: which shares are compared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing.counts import LogCounts
from sarl_core.auditing.drift import (
    Drift,
    Moved,
    Shares,
    against_expected,
    differences,
    moved,
    quarters,
    rule_counts,
)
from sarl_core.auditing.feature_counts import Edges, numbers_and_words, quarter_counts
from sarl_core.auditing.overlap import comparable
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.language import number_text
from sarl_core.mining.rule_set import RuleSet

_BEYOND = 0.02  # of a rule's own states lie outside their 1 % and 99 % quantiles


def _rule_names(rule_set: RuleSet) -> list[tuple[str, str]]:
    several = len(rule_set.actions) > 1
    names = [(rule_set.name_of(rule), "steps in which it applies") for rule in rule_set]
    return names + [
        ("no rule", f"steps without a rule{f' for {action.name}' if several else ''}")
        for action in rule_set.actions
    ]


def drift_from_rules(rule_set: RuleSet, counts: LogCounts) -> Drift:
    """Compare with what a rule file keeps of the demonstrations: supports, and data boxes.

    Args:
        rule_set: R rules.
        counts: Of the log, with `beyond_counts` as what is counted of features.

    Returns:
        What moved.
    """
    lengths = counts.steps.astype(np.float64)
    size, episodes = len(rule_set), rule_set.source.episodes
    in_force = counts.in_force(size).astype(np.float64)
    # A rule of a person's own says nothing of how often it applied, nor one that is switched off.
    mined = [place for place, rule in enumerate(rule_set) if rule.enabled and not rule.placed]
    compared = comparable(rule_set)
    known = [place for place in mined if compared[place]]
    expected = [rule_set[place].support for place in known]
    if len(mined) == size:
        # How far rules that forbid overlap, and so what they leave, is not in the file.
        forbidding = {rule.dimension for rule in rule_set if rule.forbids}
        free = [at for at in range(len(rule_set.actions)) if at not in forbidding]
        known += [size + dimension for dimension in free]
        expected += [
            1.0 - sum(rule.support for rule in rule_set.of_dimension(dimension))
            for dimension in free
        ]
    names = [_rule_names(rule_set)[place] for place in known]
    rules = against_expected(Shares(in_force[:, known], lengths), np.array(expected), episodes)
    features: tuple[Moved, ...] = ()
    # A word has no middle; whether it is one that a rule has never met, the breaks outside say.
    numbers, _ = numbers_and_words(rule_set)
    ruled = counts.boxed.astype(np.float64)
    if ruled.sum() and numbers:
        usual = np.full(len(numbers), _usual_share(rule_set, in_force[:, :size].sum(axis=0)))
        shares = Shares(counts.features[:, numbers].astype(np.float64), ruled)
        before, now, low, high = against_expected(shares, usual, episodes)
        said = "states outside the middle 98 % of the data of the rule that applies"
        features = moved(
            [(rule_set.source.features[at].name, said) for at in numbers],
            # Fewer than usual is no drift: a narrower log looks like the demonstrations.
            (before, now, low, np.maximum(high, 0.0)),
        )
    return Drift(
        "what the rules say of their demonstrations",
        features,
        moved(names, rules),
        (len(counts.steps), episodes),
    )


def _usual_share(rule_set: RuleSet, applied: NDArray[np.float64]) -> float:
    """The share of states outside: of n, about 2 / n of others like them lie outside all of them.

    Args:
        rule_set: R rules.
        applied: Steps in which each is in force, (R,); one or more of a rule that keeps a box.
    """
    boxed = np.array([rule.box is not None for rule in rule_set]) & comparable(rule_set)
    chance = np.array([min(_BEYOND + 2.0 / (rule.samples + 1), 1.0) for rule in rule_set])
    return float((chance * applied)[boxed].sum() / applied[boxed].sum())


def drift_from_demonstrations(rule_set: RuleSet, counts: LogCounts, edges: Edges) -> Drift:
    """Compare distributions: where the quarters of each feature lie, and each rule's share.

    Args:
        rule_set: R rules.
        counts: Of the log, with `quarter_counts` as what is counted of features.
        edges: Of the demonstrations.

    Returns:
        What moved.
    """
    features = rule_set.source.features
    numbers, words = numbers_and_words(rule_set)
    now = np.hstack([counts.features, counts.in_force(len(rule_set))]).astype(np.float64)
    names = [
        (
            features[at].name,
            f"states at or below {number_text(float(row[at]))} {features[at].unit}".rstrip(),
        )
        for row in edges.quarters
        for at in numbers
    ] + [(features[at].statement(True), "states in which it is so") for at in words]
    shares = Shares(now, counts.steps.astype(np.float64))
    all_moved = moved([*names, *_rule_names(rule_set)], differences(shares, edges.before))
    return Drift(
        "the demonstrations",
        all_moved[: len(names)],
        all_moved[len(names) :],
        (len(counts.steps), len(edges.before.steps)),
    )


def edges_of(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    observations: NDArray[np.float32],
    in_force: NDArray[np.int64],
) -> Edges:
    """What logs are compared with, of demonstrations.

    Args:
        rule_set: R rules.
        demonstrations: N steps.
        observations: Their states as the rules see them, (N, d).
        in_force: Index of the rule in force or -1, (N, m).

    Returns:
        Little of them.
    """
    cuts, starts = quarters(observations), demonstrations.episode_starts
    counts = np.hstack(
        [
            quarter_counts(rule_set, observations, starts, cuts),
            rule_counts(rule_set, observations, in_force, starts),
        ]
    )
    lengths = demonstrations.episode_lengths.astype(np.float64)
    return Edges(cuts, Shares(counts.astype(np.float64), lengths))
