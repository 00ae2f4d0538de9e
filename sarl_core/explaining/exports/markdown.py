"""Rules as a Markdown document: a table an action."""

from __future__ import annotations

import math

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.words.evidence import held_out_interval_text, held_out_text
from sarl_core.explaining.words.markdown import markdown_text
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.mining.digits import limit_texts
from sarl_core.mining.edit_counts import edits_counted, is_plain, reading_order, regrown_text
from sarl_core.mining.language import (
    BoundsTexts,
    Wording,
    counted,
    flag_text,
    is_flag,
    one_line,
    share_text,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Bounds, Rule


def rules_to_markdown(rule_set: RuleSet, sign_off: SignOff | None = None) -> str:
    """A rule set as Markdown.

    Args:
        rule_set: Any number of rules.
        sign_off: Who approved them; None to say nothing of it.

    Returns:
        What it was mined from and how, then a table for each action dimension: rules that a
        person placed in their order, then those that apply most often. Every name is escaped.
    """
    from sarl_core.mining.language import formula_texts, limits_text

    source = rule_set.source
    # Rules that overlap or are off have counts that do not add up to a share of the states.
    summary = (
        f"{sum(rule.kind == 'never' for rule in rule_set.rules):,} of them forbid."
        if rule_set.forbids and is_plain(rule_set)
        else f"They cover {share_text(rule_set.coverage)} of the states and are right in "
        f"{share_text(rule_set.fidelity)} of those{regrown_text(rule_set)}."
        if is_plain(rule_set)
        else f"The set was {edits_counted(rule_set)}."
    )
    lines = [
        f"# Rules for {_text(source.env_id) or 'an unnamed environment'}",
        "",
        f"{counted(rule_set.rule_count, 'rule')}, mined from {counted(source.steps, 'step')} in "
        f"{counted(source.episodes, 'episode')}: {limits_text(rule_set)}. {summary}",
        "",
        "They were learned from examples and guarantee nothing.",
        *(["", markdown_text(signed)] if (signed := sign_off_text(sign_off)) else []),
    ]
    if formulas := formula_texts(rule_set):
        lines += [
            "",
            "Formulas that they ask about:",
            "",
            *(f"- {markdown_text(one)}" for one in formulas),
        ]
    held_out = any(rule.held_out is not None for rule in rule_set.rules)
    did = "The expert" if rule_set.forbids else "The expert did so in"
    headings = ["Rule", "If", "Then", did, "States"]
    headings += ["Held out"] if held_out else []
    features, wording = source.features, Wording(rule_set)
    intervals = BoundsTexts(lambda one: _interval(one, features[one.feature]))
    for index, dimension in enumerate(rule_set.actions):
        rules = reading_order(rule_set.of_dimension(index))
        lines += [
            "",
            f"## {_text(dimension.name)}: {counted(len(rules), 'rule')}",
            "",
            f"| {' | '.join(headings)} |",
            "|" + " --- |" * len(headings),
        ]
        for rule in rules:
            conditions = " and ".join(wording.texts(rule, intervals, _text)) or "always"
            action = _text(wording.action(rule))
            cells = [
                _name(rule, rule_set),
                conditions,
                action,
                *_evidence(rule, held_out=held_out, forbids=rule_set.forbids),
            ]
            lines.append(f"| {' | '.join(cells)} |")
    if any(rule.placed for rule in rule_set.rules):
        lines += ["", "Rules written by hand or pinned come before the others, in their order."]
    return "\n".join(lines) + "\n"


def _text(text: str) -> str:
    return markdown_text(one_line(text))


def _name(rule: Rule, rule_set: RuleSet) -> str:
    """What a rule is called, and what a person made of it."""
    name = rule_set.name_of(rule)
    if rule.origin == "manual":
        name += ", by hand"
    elif rule.pinned:
        name += ", pinned"
    if rule.regrown:
        name += ", regrown"
    return f"{name}{'' if rule.enabled else ', off'}"


def _evidence(rule: Rule, *, held_out: bool, forbids: bool) -> list[str]:
    """The counts of a rule; among rules that forbid with what the expert did."""
    share = share_text(rule.confidence)
    if forbids:
        did = "did not in" if rule.forbids else "did so in"
        share = f"{'failed after it in' if rule.origin == 'probed' else did} {share}"
    cells = [
        share if rule.samples else "–",
        f"{rule.samples:,}",
    ]
    if held_out:
        counts = rule.held_out
        text = "–" if counts is None or not counts.samples else held_out_text(counts)
        if forbids and text != "–":
            text = f"{'did not in' if rule.forbids else 'did so in'} {text}"
        cells.append(
            f"{text} ({held_out_interval_text(counts)})" if counts and counts.episodes else text
        )
    return cells


def _interval(bounds: Bounds, feature: Feature) -> str:
    """What is asked of one feature."""
    if feature.indicator is not None and is_flag(feature, bounds):
        return _text(flag_text(feature, bounds))
    name = _text(feature.name)
    unit = f" {_text(feature.unit)}" if feature.unit else ""
    limits = limit_texts(bounds, feature)
    if math.isinf(bounds.low):
        return f"{name} ≤ {limits[0]}{unit}"
    if math.isinf(bounds.high):
        return f"{name} &gt; {limits[0]}{unit}"
    return f"{limits[0]} &lt; {name} ≤ {limits[1]}{unit}"
