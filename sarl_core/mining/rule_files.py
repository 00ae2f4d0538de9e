"""The rule file: JSON, thresholds at full precision, and nothing in it that is not understood."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.demonstrations.splits import Splits
from sarl_core.documents import LARGEST_WHOLE, DocumentReader, is_number, parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.mining.labels import MAX_DIVIDER, LabelledDimension
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source
from sarl_core.mining.validation.evidence import DataBox, HeldOut

if TYPE_CHECKING:
    from sarl_core.mining.rule_set import RuleSet

FORMAT = "sarl-rules"
VERSIONS = (1, 2)
"""Version 2 tells in how many episodes held-out pairs lie. A file without such pairs is written as
version 1, which is what it was before there was another."""
_MOST_CONDITIONS = 500_000  # a line for each of their values: a file of 50 MB


class RuleFile(NamedTuple):
    """What a rule file says, as `RuleSet` has it."""

    rules: tuple[Rule, ...]
    actions: tuple[LabelledDimension, ...]
    source: Source
    thresholds: Thresholds
    divider: int
    cut: Literal["thresholds", "leaves"]


def write_rules(rule_set: RuleSet, path: Path) -> None:
    """Write a rule file without ever having it whole.

    Args:
        rule_set: To write.
        path: The file.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(file_parts(rule_set))


def read_rules(text: str | bytes, name: str) -> RuleFile:
    """Read the text of a rule file.

    Args:
        text: JSON, UTF-8.
        name: Of the file, for errors.

    Returns:
        What is in it.

    Raises:
        InputError: If it is no rule file, or holds anything this version does not know.
    """
    try:
        document = parse_json(text, finite=False)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    except ValueError as error:
        raise InputError(
            f"{name} is not JSON ({error}); give a rule file that `mine` wrote"
        ) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(
            f"{name} is not a rule file (its format is not {FORMAT!r}); give one that `mine` wrote"
        )
    version = document.get("version")
    if isinstance(version, bool) or version not in VERSIONS:
        raise InputError(
            f"{name} has version {quoted(version)} of the rule format, and this program reads "
            f"versions {VERSIONS[0]} to {VERSIONS[-1]}; use a program of its version"
        )
    return _rule_file(DocumentReader(document, name, ""))


def file_parts(rule_set: RuleSet) -> Iterator[str]:
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
        for entry in value:
            yield f"{start}\n  {_value(entry, 2, indented)}"
            start = ","
        yield "[]" if start == "[" else "\n ]"
    yield "\n}\n"


def _value(value: Any, depth: int, indented: bool) -> str:
    """A value so deep in the document: with a line for each of what is in it, or on one line."""
    indent = 1 if indented else None
    text = json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False)
    return text.replace("\n", "\n" + " " * depth)  # texts hold none: there it is an escape


def _document(rule_set: RuleSet) -> dict[str, Any]:
    """What stands under each key: a value of JSON, or what makes those of a list one by one."""
    source, thresholds = rule_set.source, rule_set.thresholds
    asked: list[set[float]] = [set() for _ in source.features]
    for rule in rule_set.rules:
        for feature, _, threshold in rule.conditions:
            asked[feature].add(threshold)
    return {
        "format": FORMAT,
        "version": 2 if any(rule.held_out is not None for rule in rule_set.rules) else 1,
        "env_id": source.env_id,
        "features": map(_feature, source.features, asked),
        "actions": map(_action, rule_set.actions),
        "thresholds": {
            "support": _number(thresholds.support),
            "confidence": _number(thresholds.confidence),
            "lift": _number(thresholds.lift),
            "max_depth": thresholds.max_depth,
        },
        "divider": rule_set.divider,
        # Where it is the paper's cut, the file is what it was before there was another.
        **({"cut": rule_set.cut} if rule_set.cut != "thresholds" else {}),
        "demonstrations": {
            "digest": source.digest,
            "steps": source.steps,
            "episodes": source.episodes,
        },
        "rules": map(_rule, rule_set.rules),
    }


def _number(value: float) -> float:
    """Equal numbers are written alike, as 1 and 1.0, or zero with a sign and without."""
    return float(value) + 0.0


def _feature(feature: Feature, asked: set[float]) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": feature.name, "unit": feature.unit}
    if feature.splits is not None:
        splits = feature.splits.only(asked)
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
        "first": action.first,
    }


def _rule(rule: Rule) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "id": rule.id,
        "dimension": rule.dimension,
        "conditions": [
            {"feature": feature, "op": op, "threshold": _number(threshold)}
            for feature, op, threshold in rule.conditions
        ],
        "action": rule.action,
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
        entry["box"] = {name: list(values) for name, values in rule.box._asdict().items()}
    if rule.held_out is not None:
        entry["held_out"] = rule.held_out._asdict()
    return entry


def _rule_file(document: DocumentReader) -> RuleFile:
    document.take("format", str)
    version: int = document.take("version", int)
    features = tuple(_read_feature(part) for part in document.parts("features"))
    actions = tuple(_read_action(part) for part in document.parts("actions"))
    if not features or not actions:
        raise document.fail("there are no features or no actions")
    thresholds = document.part("thresholds")
    demonstrations = document.part("demonstrations")
    steps = demonstrations.count("steps", low=1)
    found = RuleFile(
        rules=tuple(
            _read_rule(part, len(features), actions, steps, version)
            for part in document.parts("rules")
        ),
        actions=actions,
        source=Source(
            env_id=document.take("env_id", str),
            features=features,
            digest=demonstrations.take("digest", str),
            steps=steps,
            episodes=demonstrations.count("episodes", low=1),
        ),
        thresholds=Thresholds(
            support=thresholds.number("support", low=0, high=1),
            confidence=thresholds.number("confidence", low=0, high=1),
            lift=thresholds.number("lift", 0.0, low=0),
            max_depth=thresholds.limit("max_depth"),
        ),
        divider=document.count("divider", low=2, high=MAX_DIVIDER),
        cut=_read_cut(document),
    )
    for part in (thresholds, demonstrations, document):
        part.finish()
    ids = [rule.id for rule in found.rules]
    if len(set(ids)) < len(ids):
        doubled = next(one for one, count in Counter(ids).items() if count > 1)
        raise document.fail(f"the rule id {quoted(doubled)} stands twice")
    return found


def _read_cut(document: DocumentReader) -> Literal["thresholds", "leaves"]:
    cut: Literal["thresholds", "leaves"] = document.take("cut", str, "thresholds")
    if cut not in ("thresholds", "leaves"):
        raise document.fail(f"the cut {quoted(cut)} is neither 'thresholds' nor 'leaves'")
    return cut


def _read_feature(part: DocumentReader) -> Feature:
    name, unit = part.take("name", str), part.take("unit", str, "")
    splits = _read_splits(part) if part.has("splits") else None
    part.finish()
    return Feature(name, unit, splits)


def _read_splits(part: DocumentReader) -> Splits:
    rows = part.take("splits", list)
    found = np.empty((len(rows), 3))
    for place, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != 3:
            raise part.fail("'splits' must be a threshold and the two values around it each")
        ends = (-math.inf, math.inf)
        sides = (end if one is None else one for one, end in zip(row[1:], ends, strict=True))
        filled = [row[0], *sides]
        if not all(is_number(one) or one in ends for one in filled):
            raise part.fail("'splits' holds something that is no number")
        found[place] = filled
    thresholds, below, above = found.T
    apart = np.isfinite(thresholds) & (below <= thresholds) & (thresholds < above)
    if not apart.all() or not (np.diff(thresholds) > 0).all():
        raise part.fail("'splits' are not in ascending order, each between its two values")
    return Splits(thresholds, below, above, part.take("binary", bool, False))


def _read_action(part: DocumentReader) -> LabelledDimension:
    name, kind = part.take("name", str), part.take("kind", str)
    if kind == "discrete":
        action = LabelledDimension(
            name, part.texts("labels"), first=part.count("first", 0, low=-LARGEST_WHOLE)
        )
        if not action.label_names:
            raise part.fail("'labels' is empty")
    elif kind == "interval":
        edges = part.take("edges", list)
        numeric = all(is_number(edge, LARGEST) for edge in edges)
        single = numeric and len(edges) == 2 and edges[0] == edges[1]
        if not single and (not numeric or len(edges) < 3 or sorted(set(edges)) != edges):
            raise part.fail(
                "'edges' must be three or more numbers in ascending order, or one number twice"
            )
        action = LabelledDimension.of_edges(
            name, edges, bounds_from=part.take("bounds_from", str, "action space")
        )
    else:
        raise part.fail(f"the kind {quoted(kind)} is neither 'discrete' nor 'interval'")
    part.finish()
    return action


def _read_rule(
    part: DocumentReader,
    n_features: int,
    actions: tuple[LabelledDimension, ...],
    steps: int,
    version: int,
) -> Rule:
    conditions = []
    for entry in part.parts("conditions"):
        feature, op = entry.take("feature", int), entry.take("op", str)
        if not 0 <= feature < n_features:
            raise entry.fail(f"there is no feature {quoted(feature)}")
        if op not in ("<=", ">"):
            raise entry.fail(f"the operator {quoted(op)} is neither '<=' nor '>'")
        conditions.append(Condition(feature, op, entry.number("threshold")))
        entry.finish()
    dimension, action = part.take("dimension", int), part.take("action", int)
    if not 0 <= dimension < len(actions):
        raise part.fail(f"there is no action dimension {quoted(dimension)}")
    if not 0 <= action < actions[dimension].n_labels:
        raise part.fail(
            f"the action {quoted(action)} is none of the {actions[dimension].n_labels} labels"
        )
    origin = part.take("origin", str, "mined")
    if origin not in ("mined", "manual"):
        raise part.fail(f"the origin {quoted(origin)} is neither 'mined' nor 'manual'")
    if part.take("length", int, len(conditions)) != len(conditions):
        raise part.fail(f"'length' does not match its {len(conditions)} conditions")
    value = (
        part.number("demonstrated_value", low=-LARGEST, high=LARGEST)
        if part.has("demonstrated_value")
        else None
    )
    rule = Rule(
        id=part.take("id", str),
        dimension=dimension,
        conditions=tuple(conditions),
        action=action,
        support=part.number("support", low=0, high=1),
        confidence=part.number("confidence", low=0, high=1),
        lift=part.number("lift", low=0),
        samples=part.count("samples", high=steps),
        enabled=part.take("enabled", bool, True),
        origin=origin,
        demonstrated_value=value,
        pinned=part.take("pinned", bool, False),
        box=_read_box(part.part("box"), n_features) if part.has("box") else None,
        held_out=_read_held_out(part.part("held_out"), version) if part.has("held_out") else None,
    )
    part.finish()
    return rule


def _read_box(part: DocumentReader, n_features: int) -> DataBox:
    box = DataBox(*(part.numbers(name, n_features) for name in DataBox._fields))
    part.finish()
    for least, low, high, most in zip(*box, strict=True):
        if not least <= low <= high <= most:
            raise part.fail("the values are not in the order least, low, high, most")
    return box


def _read_held_out(part: DocumentReader, version: int) -> HeldOut:
    samples = part.count("samples")
    correct = part.count("correct", high=samples)
    if version == 1:  # in how many episodes, it did not say
        part.finish()
        return HeldOut(samples, correct, 0, None, None, None)
    found = HeldOut(
        samples,
        correct,
        part.count("episodes", high=samples),
        part.share("share"),
        part.share("low"),
        part.share("high"),
    )
    part.finish()
    if (found.share is None) != (found.episodes == 0):
        raise part.fail("'share' does not match its episodes")
    low, high = found.low, found.high
    if (low is None) != (high is None) or (low is not None and high is not None and low > high):
        raise part.fail("'low' and 'high' are no interval")
    return found
