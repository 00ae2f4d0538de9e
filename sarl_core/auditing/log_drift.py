"""Whether a log still looks like what the rules were mined from: which shares are compared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing.drift import (
    Drift,
    Moved,
    Shares,
    against_expected,
    by_episode,
    differences,
    moved,
    quarters,
    rule_counts,
)
from sarl_core.auditing.matching import MatchedLog
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.language import number_text
from sarl_core.mining.rule_set import RuleSet

_BEYOND = 0.02  # of a rule's own states lie outside their 1 % and 99 % quantiles
_HALF = 0.5  # of a feature that says which word a column holds


def _rule_names(rule_set: RuleSet) -> list[tuple[str, str]]:
    several = len(rule_set.actions) > 1
    names = [(rule_set.name_of(rule), "steps in which it applies") for rule in rule_set]
    return names + [
        ("no rule", f"steps without a rule{f' for {action.name}' if several else ''}")
        for action in rule_set.actions
    ]


def drift_from_rules(
    rule_set: RuleSet,
    log: Demonstrations,
    matched: MatchedLog,
    in_force: NDArray[np.int64],
) -> Drift:
    """Compare with what a rule file keeps of the demonstrations: supports, and data boxes.

    Args:
        rule_set: R rules.
        log: N steps in E episodes.
        matched: The same as the rules see it.
        in_force: Index of the rule in force or -1, (N, m).

    Returns:
        What moved.
    """
    starts = log.episode_starts
    lengths = log.episode_lengths.astype(np.float64)
    size, episodes = len(rule_set), rule_set.source.episodes
    counts = rule_counts(rule_set, in_force, starts)
    # A rule of a person's own says nothing of how often it applied, nor one that is switched off.
    known = [place for place, rule in enumerate(rule_set) if rule.enabled and not rule.placed]
    expected = [rule_set[place].support for place in known]
    if len(known) == size:
        known += range(size, size + len(rule_set.actions))
        expected += [
            1.0 - sum(rule.support for rule in rule_set.of_dimension(dimension))
            for dimension in range(len(rule_set.actions))
        ]
    names = [_rule_names(rule_set)[place] for place in known]
    rules = against_expected(Shares(counts[:, known], lengths), np.array(expected), episodes)
    beyond, ruled, usual = _beyond(rule_set, matched.observations, in_force, starts)
    features: tuple[Moved, ...] = ()
    # A word has no middle; whether it is one that a rule has never met, the breaks outside say.
    numbers = [at for at, one in enumerate(rule_set.source.features) if one.indicator is None]
    if ruled.sum() and numbers:
        shares = Shares(beyond[:, numbers], ruled)
        before, now, low, high = against_expected(shares, usual[numbers], episodes)
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
        (len(starts), episodes),
    )


def _beyond(
    rule_set: RuleSet,
    observations: NDArray[np.float32],
    in_force: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Steps whose feature lies outside the middle of the data of the rule in force.

    Returns:
        Such steps (E, d), all steps of rules that keep a box (E,), and the share that is usual
        (d,): of n states, about 2 / n of others like them lie outside all of them.
    """
    d = observations.shape[1]
    counts, ruled = np.zeros((len(starts), d)), np.zeros(len(starts))
    usual = 0.0
    boxes = [rule.box for rule in rule_set]
    has_box = np.array([box is not None for box in boxes] + [False])
    low, high = np.zeros((2, len(boxes), d))
    for place, box in enumerate(boxes):
        if box is not None:
            low[place], high[place] = box.low, box.high
    chance = np.array([min(_BEYOND + 2.0 / (rule.samples + 1), 1.0) for rule in rule_set])
    for column in in_force.T:
        known = has_box[column]
        ruled += by_episode(known, starts)
        rules = np.where(known, column, 0)
        usual += float(chance[rules][known].sum()) if len(boxes) else 0.0
        for feature in range(d if len(boxes) else 0):
            values = observations[:, feature]
            out = (values < low[rules, feature]) | (values > high[rules, feature])
            counts[:, feature] += by_episode(out & known, starts)
    return counts, ruled, np.full(d, usual / max(ruled.sum(), 1.0))


def drift_from_demonstrations(
    rule_set: RuleSet,
    now: tuple[Demonstrations, NDArray[np.float32], NDArray[np.int64]],
    before: tuple[Demonstrations, NDArray[np.float32], NDArray[np.int64]],
) -> Drift:
    """Compare distributions: where the quarters of each feature lie, and each rule's share.

    Args:
        rule_set: R rules.
        now: The log, its observations as the rules see them (N, d), and the index of the rule in
            force or -1, (N, m).
        before: The same of the demonstrations.

    Returns:
        What moved.
    """
    features = rule_set.source.features
    numbers = [at for at, one in enumerate(features) if one.indicator is None]
    words = [at for at, one in enumerate(features) if one.indicator is not None]
    edges = quarters(before[1])
    sides = []
    for log, observations, in_force in (now, before):
        starts = log.episode_starts
        sides.append(
            Shares(
                np.hstack(
                    [
                        *(by_episode((observations <= edge)[:, numbers], starts) for edge in edges),
                        by_episode(observations[:, words] > _HALF, starts),
                        rule_counts(rule_set, in_force, starts),
                    ]
                ),
                log.episode_lengths.astype(np.float64),
            )
        )
    names = [
        (
            features[at].name,
            f"states at or below {number_text(float(row[at]))} {features[at].unit}".rstrip(),
        )
        for row in edges
        for at in numbers
    ] + [(features[at].statement(True), "states in which it is so") for at in words]
    all_moved = moved([*names, *_rule_names(rule_set)], differences(sides[0], sides[1]))
    return Drift(
        "the demonstrations",
        all_moved[: len(names)],
        all_moved[len(names) :],
        (now[0].n_episodes, before[0].n_episodes),
    )
