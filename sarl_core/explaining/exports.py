"""Rule sets for other programs and for reading: CSV and text, every rule, never cut short."""

from __future__ import annotations

import csv
import io

from sarl_core.explaining.language import (
    counted,
    exact_condition,
    label_text,
    sentence,
    share_text,
)
from sarl_core.mining.rules import RuleSet

CSV_COLUMNS = (
    "id",
    "dimension",
    "action",
    "rule",
    "conditions",
    "support",
    "confidence",
    "lift",
    "joint_support",
    "samples",
    "length",
    "merged_length",
    "enabled",
    "origin",
)
_FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")


def rules_to_csv(rule_set: RuleSet) -> str:
    """A rule set as CSV.

    Args:
        rule_set: Any number of rules.

    Returns:
        A header and one line a rule; `conditions` holds the queries in path order with their
        thresholds at full precision, `rule` the sentence with rounded numbers.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    features = rule_set.source.features
    for rule in rule_set.rules:
        dimension = rule_set.actions[rule.dimension]
        conditions = " and ".join(exact_condition(c, features) for c in rule.conditions)
        writer.writerow(
            (
                rule.id,
                _cell(dimension.name),
                _cell(label_text(rule.action, dimension)),
                _cell(sentence(rule, rule_set, evidence=False)),
                _cell(conditions or "always"),
                repr(rule.support),
                repr(rule.confidence),
                repr(rule.lift),
                repr(rule.joint_support),
                rule.samples,
                rule.length,
                rule.merged_length,
                "yes" if rule.enabled else "no",
                rule.origin,
            )
        )
    return text.getvalue()


def rules_to_text(rule_set: RuleSet) -> str:
    """A rule set for reading.

    Args:
        rule_set: Any number of rules.

    Returns:
        What it was mined from and how, then every rule as a numbered sentence, by action
        dimension, the most general first.
    """
    source, thresholds = rule_set.source, rule_set.thresholds
    limits = [
        f"support at least {thresholds.support:g}",
        f"confidence at least {thresholds.confidence:g}",
    ]
    if thresholds.lift:
        limits.append(f"lift at least {thresholds.lift:g}")
    if thresholds.max_depth is not None:
        limits.append(f"at most {counted(thresholds.max_depth, 'condition')}")
    if any(dimension.is_interval for dimension in rule_set.actions):
        limits.append(f"divider {rule_set.divider}")
    lines = [
        f"Rules for {source.env_id or 'an unnamed environment'}",
        f"Mined from {counted(source.steps, 'step')} in "
        f"{counted(source.episodes, 'episode')}: {', '.join(limits)}.",
        f"{counted(rule_set.rule_count, 'rule')}, {rule_set.mean_length:.2f} conditions on "
        f"average; they cover {share_text(rule_set.coverage)} of the states and are right in "
        f"{share_text(rule_set.fidelity)} of those.",
        "They were learned from examples and guarantee nothing.",
    ]
    for index, dimension in enumerate(rule_set.actions):
        rules = sorted(rule_set.of_dimension(index), key=lambda rule: -rule.support)
        lines += ["", f"{dimension.name}: {counted(len(rules), 'rule')}", ""]
        lines += [
            f"{number:>4}. {sentence(rule, rule_set)}" for number, rule in enumerate(rules, start=1)
        ]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula; numbers and ranges stay as they are."""
    looks_numeric = text[:1] == "-" and text[1:2].isdigit()
    return f"'{text}" if text.startswith(_FORMULA_SIGNS) and not looks_numeric else text
