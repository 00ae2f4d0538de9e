"""What `mine` answers about episodes held out."""

from __future__ import annotations

from typing import Any, NamedTuple

from sarl_core.explaining.evidence_words import (
    decimal_text,
    evidence_text,
    interval_text,
    verdict_counts,
)
from sarl_core.explaining.language import counted, sentence
from sarl_core.mining.evidence import wilson
from sarl_core.mining.holding_out import Split
from sarl_core.mining.rules import Rule, RuleSet


class Tried(NamedTuple):
    """How a rule set was tried.

    Attributes:
        share: Of the episodes, held out.
        seed: That drew them.
        split: Both parts.
    """

    share: float
    seed: int
    split: Split


def describe_tried(rule_set: RuleSet, tried: Tried) -> dict[str, Any]:
    """What the held-out episodes say of a rule set.

    Args:
        rule_set: With what was counted on them.
        tried: How they were chosen.

    Returns:
        A document for JSON.
    """
    held = tried.split.held_out
    samples, correct = _totals(rule_set)
    interval = wilson(correct, samples)
    counts = verdict_counts(rule_set.rules, rule_set.thresholds.confidence)
    return {
        "share": tried.share,
        "seed": tried.seed,
        "episodes": sorted(set(held.episodes.tolist())),
        "steps": len(held),
        "samples": samples,
        "correct": correct,
        "fidelity": correct / samples if samples else None,
        "interval": list(interval),
        "rules_below": counts["below"],
        "rules_open": counts["open"],
        "rules_reached": counts["reached"],
    }


def tried_facts(rule_set: RuleSet, tried: Tried) -> list[tuple[str, str]]:
    """The same as names and values for people.

    Args:
        rule_set: With what was counted on them.
        tried: How they were chosen.

    Returns:
        To be printed below the other facts.
    """
    held = tried.split.held_out
    samples, correct = _totals(rule_set)
    facts = [
        (
            "held out",
            f"{counted(held.n_episodes, 'episode')} of "
            f"{held.n_episodes + tried.split.mined.n_episodes:,}, "
            f"{counted(len(held), 'state')} (seed {tried.seed})",
        )
    ]
    if samples:
        facts.append(
            (
                "right on these",
                f"{decimal_text(correct / samples)} of {counted(samples, 'state')} with a rule "
                f"(95 % interval {interval_text(wilson(correct, samples))})",
            )
        )
    counts = verdict_counts(rule_set.rules, rule_set.thresholds.confidence)
    facts.append(
        (
            "by rule",
            f"{counts['reached']:,} reach the minimum confidence with their whole interval, "
            f"{counts['open']:,} open, {counts['below']:,} below it",
        )
    )
    return facts


def rule_line(rule: Rule, rule_set: RuleSet) -> str:
    """A rule in words, with its counts where episodes were held out."""
    if rule.held_out is None:
        return sentence(rule, rule_set)
    return f"{sentence(rule, rule_set, evidence=False)[:-1]}: {evidence_text(rule)}."


def _totals(rule_set: RuleSet) -> tuple[int, int]:
    tried = [rule.held_out for rule in rule_set.rules if rule.held_out is not None]
    return sum(one.samples for one in tried), sum(one.correct for one in tried)
