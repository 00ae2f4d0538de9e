"""Writing a rule file: JSON, thresholds at full precision."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterator, Sequence, Set
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import Combination
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_contents import RuleContents
from sarl_core.mining.rules import Condition, Kind, Rule

FORMAT = "sarl-rules"
VERSIONS = (1, 2)
"""Version 2 tells in how many episodes held-out pairs lie, what features say of words, how they are
derived from others, which actions labels stand for that do not count, that a histogram learner grew
the trees, and what rules forbid. A file without all that is written as version 1, which is what it
was before there was another."""
_MOST_CONDITIONS = 500_000  # a line for each of their values: a file of 50 MB
_JSON = json.JSONEncoder(allow_nan=False, ensure_ascii=False)


def write_rules(rule_set: RuleContents, path: Path) -> None:
    """Write a rule file without ever having it whole.

    Args:
        rule_set: To write.
        path: The file.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(file_parts(rule_set))


def file_parts(rule_set: RuleContents) -> Iterator[str]:
    """The text of a rule file, so that nobody need have it whole.

    Args:
        rule_set: To write.

    Yields:
        Parts of JSON of which each has one rule at most.
    """
    indented = sum(len(rule.conditions) for rule in rule_set.rules) <= _MOST_CONDITIONS
    opening = "{"
    for key, value in _document(rule_set).items():
        yield f"{opening}\n {json.dumps(key)}: "
        opening = ","
        if not isinstance(value, Iterator):
            yield _value(value, 1, indented)
            continue
        start = "["
        lines: Iterator[str] = (_value(entry, 2, indented) for entry in value)
        if key == "rules" and not indented:
            lines = _rule_lines(rule_set.rules)
        for line in lines:
            yield f"{start}\n  {line}"
            start = ","
        yield "[]" if start == "[" else "\n ]"
    yield "\n}\n"


def _value(value: Any, depth: int, indented: bool) -> str:
    """A value so deep in the document: with a line for each of what is in it, or on one line."""
    text = _JSON.encode(value)
    if indented:
        # As `json` would, which has no fast way to indent; half a pair has no other encoding.
        encoded = text.encode(errors="surrogatepass")
        text = msgspec.json.format(encoded, indent=1).decode(errors="surrogatepass")
    return text.replace("\n", "\n" + " " * depth)  # texts hold none: there it is an escape


def _rule_lines(rules: Sequence[Rule]) -> Iterator[str]:
    """The same of many rules: what they share is written once, and boxes in the fast way."""
    query = cache(_query_text)
    for rule in rules:
        queries = ", ".join(map(query, rule.conditions))
        box = "" if rule.box is None else _box_text(rule.box)
        # Within a text of JSON no quotation mark stands by itself: these are the keys.
        line = _JSON.encode(rule_document(rule, [], {} if box else None))
        line = line.replace('"conditions": []', f'"conditions": [{queries}]', 1)
        yield line.replace('"box": {}', f'"box": {box}', 1) if box else line


def _query_text(condition: Condition) -> str:
    """A query on one line, as `json` writes it."""
    feature, op, threshold = condition
    if not math.isfinite(threshold):
        return _JSON.encode(_condition(condition))  # which refuses it
    return f'{{"feature": {feature}, "op": "{op}", "threshold": {_number(threshold)!r}}}'


def _box_text(box: DataBox) -> str:
    """A box on one line, as `json` writes it; it takes most of the room in a file of many rules."""
    text = msgspec.json.encode(tuple(box)).decode()
    if "e" in text or "null" in text or "0.0000" in text:  # which `json` writes otherwise
        return _JSON.encode(_box(box))
    least, low, high, most = text[2:-2].replace(",", ", ").split("], [")
    return f'{{"least": [{least}], "low": [{low}], "high": [{high}], "most": [{most}]}}'


def _document(rule_set: RuleContents) -> dict[str, Any]:
    """What stands under each key: a value of JSON, or what makes those of a list one by one."""
    source, thresholds = rule_set.source, rule_set.thresholds
    queries: set[Condition] = set().union(*(rule.conditions for rule in rule_set.rules))
    by_feature: list[set[float]] = [set() for _ in source.features]
    for feature, _, threshold in queries:
        by_feature[feature].add(threshold)
    return {
        "format": FORMAT,
        "version": 2 if _needs_version_2(rule_set) else 1,
        "env_id": source.env_id,
        "features": map(_feature, source.features, by_feature),
        "actions": map(_action, rule_set.actions),
        "thresholds": {
            "support": _number(thresholds.support),
            "confidence": _number(thresholds.confidence),
            "lift": _number(thresholds.lift),
            "max_depth": thresholds.max_depth,
            **_never(rule_set),
        },
        "divider": rule_set.divider,
        # Where it is the paper's cut, the file is what it was before there was another.
        **({"cut": rule_set.cut} if rule_set.cut != "thresholds" else {}),
        **({"learner": rule_set.learner} if rule_set.learner != "exact" else {}),
        "demonstrations": {
            "digest": source.digest,
            "steps": source.steps,
            "episodes": source.episodes,
        },
        "rules": map(rule_document, rule_set.rules),
    }


def _never(rule_set: RuleContents) -> dict[str, Any]:
    """What thresholds say of rules that forbid, and of others beside them where that is unusual."""
    at = rule_set.thresholds
    if at.never is None:
        return {}
    usual = usually_demands(at.never, {rule.kind for rule in rule_set.rules})
    return {"never": _number(at.never)} | ({} if at.demands == usual else {"demands": at.demands})


def usually_demands(never: float | None, kinds: Set[Kind]) -> bool:
    """Whether rules are mined that demand, where a file does not say: where there is one.

    Args:
        never: Epsilon of rules that forbid; None where none are mined.
        kinds: Of the rules in the file.
    """
    return never is None or "do" in kinds


def _needs_version_2(rule_set: RuleContents) -> bool:
    """Whether there is something that version 1 did not know."""
    return (
        any(rule.held_out is not None or rule.forbids for rule in rule_set.rules)
        or rule_set.thresholds.never is not None
        or any(one.indicator or one.derived for one in rule_set.source.features)
        or any(action.codes for action in rule_set.actions)
        or rule_set.learner != "exact"
    )


def _number(value: float) -> float:
    """Equal numbers are written alike, as 1 and 1.0, or zero with a sign and without."""
    return float(value) + 0.0


def _feature(feature: Feature, thresholds: set[float]) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": feature.name, "unit": feature.unit}
    if isinstance(feature.derived, Combination):
        entry["derived"] = {"terms": [list(term) for term in feature.derived.terms]}
    elif feature.derived is not None:
        entry["derived"] = {"formula": feature.derived.text}
    if feature.indicator is not None:
        entry["indicator"] = {
            key: text for key, text in dataclasses.asdict(feature.indicator).items() if text
        }
    if feature.splits is not None:
        splits = feature.splits.only(thresholds)
        columns = (splits.thresholds, splits.below, splits.above)
        entry["splits"] = [
            [value if math.isfinite(value) else None for value in row]
            for row in zip(*(column.tolist() for column in columns), strict=True)
        ]
        if splits.binary:
            entry["binary"] = True
    return entry


def _action(action: LabelledDimension) -> dict[str, Any]:
    if action.is_interval:
        return {
            "name": action.name,
            "kind": "interval",
            "edges": list(action.edges),
            "bounds_from": action.bounds_from,
        }
    return {
        "name": action.name,
        "kind": "discrete",
        "labels": list(action.label_names),
        **({"codes": list(action.codes)} if action.codes else {"first": action.first}),
    }


def _condition(condition: Condition) -> dict[str, Any]:
    feature, op, threshold = condition
    return {"feature": feature, "op": op, "threshold": _number(threshold)}


def _box(box: DataBox) -> dict[str, Any]:
    return {name: list(values) for name, values in box.by_name().items()}


def rule_document(
    rule: Rule,
    conditions: list[dict[str, Any]] | None = None,
    box: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """A rule as the file has it.

    Args:
        rule: To write.
        conditions: Its conditions as the file has them, where they are at hand.
        box: Its box as the file has it, where that is at hand.
    """
    if conditions is None:
        conditions = list(map(_condition, rule.conditions))
    entry: dict[str, Any] = {
        "id": rule.id,
        "dimension": rule.dimension,
        "conditions": conditions,
        **_consequence(rule),
        "support": _number(rule.support),
        "confidence": _number(rule.confidence),
        "lift": _number(rule.lift),
        "samples": rule.samples,
        "length": rule.length,
        "enabled": rule.enabled,
        "origin": rule.origin,
    }
    if rule.demonstrated_value is not None:
        entry["demonstrated_value"] = _number(rule.demonstrated_value)
    if rule.pinned:
        entry["pinned"] = True
    if rule.box is not None:
        entry["box"] = _box(rule.box) if box is None else box
    if rule.held_out is not None:
        entry["held_out"] = rule.held_out._asdict()
    return entry


def _consequence(rule: Rule) -> dict[str, Any]:
    """What a rule says, as the file has it."""
    if not rule.forbids:
        return {"action": rule.action}
    return {"kind": "never", "forbids": list(rule.forbids), "instead": list(rule.instead)}
