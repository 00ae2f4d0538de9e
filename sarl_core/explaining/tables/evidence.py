"""How sure rules are, as columns of tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.words.evidence import (
    VERDICTS,
    band_text,
    held_out_interval_text,
    held_out_text,
    mined_text,
    more_text,
    moved_text,
)
from sarl_core.mining.action_words import label_text, says_text
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.language import conditions_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.validation.contradictions import Contradictions, EpisodeContradictions
from sarl_core.mining.validation.episode_counts import Influence
from sarl_core.mining.validation.holding_out import least_confidence, verdict
from sarl_core.mining.validation.stability import Stability

Columns = dict[str, list[object]]


def held_out_columns(rules: Sequence[Rule], thresholds: Thresholds) -> Columns:
    """What the held-out episodes say of rules, to stand beside `rule_columns`.

    Args:
        rules: Some rules.
        thresholds: At which they were mined.

    Returns:
        Column name to one value a rule, the bound in percent; {} where nothing was held out.
    """
    if not any(rule.held_out is not None for rule in rules):
        return {}
    return {
        "Held out": [held_out_text(rule.held_out) for rule in rules],
        "Verdict": _verdicts(rules, thresholds),
        "Lower bound": [
            None if held is None or held.low is None else 100 * held.low
            for held in (rule.held_out for rule in rules)
        ],
    }


def _verdicts(rules: Sequence[Rule], thresholds: Thresholds) -> list[object]:
    return [VERDICTS[verdict(rule, least_confidence(rule, thresholds))] for rule in rules]


def enough_columns(
    rules: Sequence[Rule],
    rule_set: RuleSet,
    missing: Sequence[float],
    influences: Sequence[Influence | None],
) -> Columns:
    """What is still missing of each rule.

    Args:
        rules: Some rules of the set.
        rule_set: Knows the names and the thresholds.
        missing: What `more_episodes` gives of each.
        influences: The episode that moves the share of each most.

    Returns:
        Column name to one value a rule.
    """
    return {
        "Rule": [rule_set.name_of(rule) for rule in rules],
        "Action": [says_text(rule, rule_set.actions[rule.dimension]) for rule in rules],
        "Still missing": [more_text(more) for more in missing],
        "Held out": [held_out_text(rule.held_out) for rule in rules],
        "Interval": [held_out_interval_text(rule.held_out) for rule in rules],
        "Verdict": _verdicts(rules, rule_set.thresholds),
        "Mined from": [mined_text(rule) for rule in rules],
        "Moved most by": [moved_text(one) for one in influences],
        "When": [conditions_text(rule, rule_set) for rule in rules],
    }


def stability_columns(rules: Sequence[Rule], rule_set: RuleSet, stability: Stability) -> Columns:
    """How often each rule came back, and how far its thresholds moved.

    Args:
        rules: Those of the set, in its order.
        rule_set: Knows the names.
        stability: What was found of them.

    Returns:
        Column name to one value a rule; shares in percent.
    """
    features = rule_set.source.features
    return {
        "Rule": [rule_set.name_of(rule) for rule in rules],
        "Action": [says_text(rule, rule_set.actions[rule.dimension]) for rule in rules],
        "Comes back": [100 * one.returns for one in stability.rules],
        "Overlap": [100 * one.overlap for one in stability.rules],
        "States": [rule.samples for rule in rules],
        "Thresholds and their bands": [
            "; ".join(band_text(band, features[band.feature]) for band in one.bands)
            or "no conditions"
            for one in stability.rules
        ],
    }


def episode_columns(episodes: Sequence[EpisodeContradictions]) -> Columns:
    """Episodes by how much they contradict others.

    Args:
        episodes: In their order.

    Returns:
        Column name to one value an episode; the share in percent.
    """
    return {
        "Episode": [one.episode for one in episodes],
        "Share": [100 * one.share for one in episodes],
        "Contradicting": [one.contradicting for one in episodes],
        "Identical": [one.identical for one in episodes],
        "Near": [one.near for one in episodes],
        "Steps": [one.steps for one in episodes],
    }


def pair_columns(
    demonstrations: Demonstrations,
    contradictions: Contradictions,
    *,
    divider: int = 2,
    dimension: int = 0,
    most: int = 200,
) -> Columns:
    """States and their nearest ones of other episodes that were shown with another label.

    Args:
        demonstrations: N pairs.
        contradictions: What `find_contradictions` found in them.
        divider: Number of intervals of continuous dimensions.
        dimension: Of the action.
        most: How many at most.

    Returns:
        Column name to one value a pair of states, the nearest first.
    """
    rows = np.flatnonzero(contradictions.near[:, dimension])
    # Where two states are each other's nearest, the pair is told once.
    twice = contradictions.near[contradictions.neighbour[rows], dimension] & (
        contradictions.neighbour[contradictions.neighbour[rows]] == rows
    )
    rows = rows[~twice | (rows < contradictions.neighbour[rows])]
    rows = rows[np.argsort(contradictions.distance[rows], kind="stable")][:most]
    others = contradictions.neighbour[rows]
    named = label_dimensions(demonstrations, divider)[dimension]
    labels = named.labels_of(demonstrations.action_columns[:, dimension])
    assert demonstrations.steps is not None

    def did(which: np.ndarray) -> list[object]:
        return [label_text(label, named) for label in labels[which].tolist()]

    return {
        "Episode": demonstrations.episodes[rows].tolist(),
        "Step": demonstrations.steps[rows].tolist(),
        "Did": did(rows),
        "Other episode": demonstrations.episodes[others].tolist(),
        "Other step": demonstrations.steps[others].tolist(),
        "Did there": did(others),
        "Distance": contradictions.distance[rows].tolist(),
    }
