"""What `mine` answers about episodes that rules were not mined from."""

from __future__ import annotations

from typing import Any, NamedTuple

from sarl_core.explaining.words.cross_fit import parting_text
from sarl_core.explaining.words.evidence import (
    evidence_text,
    held_out_interval_text,
    influence_text,
    remedy_text,
    shortfall_text,
    verdict_counts,
)
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import counted, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.cross_fitting import Judged
from sarl_core.mining.validation.episode_counts import Influence
from sarl_core.mining.validation.holding_out import Shortfall, best_lower_bound


class Tried(NamedTuple):
    """How a rule set was tried.

    Attributes:
        share: Of the episodes, held out.
        seed: That drew them.
        mined: Episodes that it was mined from.
        judged: The rule set on those held out.
        short: Of all rules there were, before those below a lower bound were dropped; None where
            there is no such bound.
    """

    share: float
    seed: int
    mined: int
    judged: Judged
    short: Shortfall | None = None

    @property
    def there(self) -> int:
        """Episodes in all."""
        return self.mined + len(self.judged.numbers)


def describe_tried(rule_set: RuleSet, tried: Tried) -> dict[str, Any]:
    """What the held-out episodes say of a rule set.

    Args:
        rule_set: With what was counted on them.
        tried: How they were chosen.

    Returns:
        A document for JSON.
    """
    fidelity = tried.judged.fidelity
    counts = verdict_counts(rule_set.rules, rule_set.thresholds)
    return {
        "share": tried.share,
        "seed": tried.seed,
        "episodes": sorted(tried.judged.numbers.tolist()),
        "steps": int(tried.judged.lengths.sum()),
        "samples": fidelity.samples,
        "correct": fidelity.correct,
        "fidelity": fidelity.share,
        "interval": None if fidelity.interval is None else list(fidelity.interval),
        "coverage": tried.judged.coverage._asdict(),
        **_influences(tried.judged),
        "rules_below": counts["below"],
        "rules_open": counts["open"],
        "rules_reached": counts["reached"],
        "rules_unknown": counts["unknown"],
        **({"lower_bound": _described_short(tried)} if tried.short is not None else {}),
    }


def _described_short(tried: Tried) -> dict[str, Any]:
    short = tried.short
    assert short is not None
    remedy = remedy_text(short, tried.there, in_command=True)
    return {
        "least": short.least,
        "most_possible": best_lower_bound(short.episodes),
        "rules": short.rules,
        "kept": short.reached,
        "too_few_episodes": short.too_few,
        "too_often_wrong": short.wrong,
        "highest": short.best,
        "warnings": [remedy] if remedy else [],
    }


def describe_judged(judged: Judged, fidelity: float) -> dict[str, Any]:
    """What a rule set is worth on episodes that it was not mined from.

    Args:
        judged: Cross-fitted.
        fidelity: Of the rules that were mined from all of them, there.

    Returns:
        A document for JSON.
    """
    warning = parting_text(fidelity, judged)
    return {
        "folds": judged.folds,
        "whole_episodes": judged.whole_episodes,
        "episodes": len(judged.numbers),
        "fidelity": judged.fidelity._asdict(),
        "coverage": judged.coverage._asdict(),
        **_influences(judged),
        "warnings": [warning] if warning else [],
    }


def _influences(judged: Judged) -> dict[str, Any]:
    return {
        "most_influential": _described(judged.influence),
        "most_influential_by_states": _described(judged.influence_by_states),
    }


def _described(influence: Influence | None) -> dict[str, Any] | None:
    return None if influence is None else influence._asdict()


def tried_facts(rule_set: RuleSet, tried: Tried) -> list[tuple[str, str]]:
    """The same as names and values for people.

    Args:
        rule_set: With what was counted on them.
        tried: How they were chosen.

    Returns:
        To be printed below the other facts.
    """
    judged = tried.judged
    facts = [
        (
            "held out",
            f"{counted(len(judged.numbers), 'episode')} of {tried.there:,}, "
            f"{counted(int(judged.lengths.sum()), 'state')} (seed {tried.seed})",
        )
    ]
    facts += _facts(tried.judged, "these")
    if tried.short is not None:
        facts.append(("lower bound", shortfall_text(tried.short)))
    if not len(rule_set):
        return facts
    counts, least = verdict_counts(rule_set.rules, rule_set.thresholds), "the minimum confidence"
    if rule_set.forbids:
        never = share_text(1.0 - (rule_set.thresholds.never or 0.0))
        alone = all(rule.forbids for rule in rule_set.rules)
        least = never if alone else f"{least} ({never} if they forbid)"
    facts.append(
        (
            "by rule",
            f"{counts['reached']:,} reach {least} with their whole interval, "
            f"{counts['open']:,} open, {counts['below']:,} below it, {counts['unknown']:,} met in "
            "too few of these episodes",
        )
    )
    return facts


def none_left(tried: Tried | None, *, forbids: bool = False) -> str:
    """What to do where no rule is left.

    Args:
        tried: Which episodes were held out, if any were.
        forbids: Whether rules that forbid were wanted.

    Returns:
        A sentence.
    """
    remedy = ""
    if tried is not None and tried.short is not None:
        remedy = remedy_text(tried.short, tried.there, in_command=True)
    if remedy:
        return f"No rule reaches the lower bound: {remedy}."
    if forbids:
        return "No rule reaches these thresholds; lower the support, or raise epsilon."
    return "No rule reaches these thresholds; lower one of them."


def judged_facts(judged: Judged) -> list[tuple[str, str]]:
    """What `describe_judged` says, as names and values for people.

    Args:
        judged: Cross-fitted.

    Returns:
        To be printed below the other facts.
    """
    kind = "episode" if judged.whole_episodes else "stretch"
    return [
        (
            "cross-fitted",
            f"every {kind} judged by rules mined without it, in {counted(judged.folds, 'part')}",
        ),
        *_facts(judged, "others"),
    ]


def _facts(judged: Judged, where: str) -> list[tuple[str, str]]:
    facts = [
        (
            f"coverage on {where}",
            f"{_share_and_interval(judged.coverage)} of the states of an episode, on average",
        ),
    ]
    if judged.fidelity.share is not None:
        facts.append(
            (
                f"fidelity on {where}",
                f"{_share_and_interval(judged.fidelity)} of those with a rule, on average",
            )
        )
    moves = influence_text(judged.influence)
    if moves:
        facts.append(("one episode", moves))
    by_states = influence_text(judged.influence_by_states)
    if by_states and judged.influence_by_states is not None:
        share = share_text(judged.influence_by_states.share)
        facts.append(("counting states", f"fidelity would be {share}; {by_states}"))
    return facts


def _share_and_interval(held_out: HeldOut) -> str:
    share = "none" if held_out.share is None else share_text(held_out.share)
    return f"{share} ({held_out_interval_text(held_out)})"


def rule_line(rule: Rule, rule_set: RuleSet) -> str:
    """A rule in words, with its counts where episodes were held out."""
    if rule.held_out is None:
        return sentence(rule, rule_set)
    did = "the expert did not in " if rule.forbids else ""
    text = f"{sentence(rule, rule_set, evidence=False)[:-1]}: {did}{evidence_text(rule)}"
    if not rule.held_out.samples:
        return f"{text}."
    return f"{text}, {held_out_interval_text(rule.held_out)}."
