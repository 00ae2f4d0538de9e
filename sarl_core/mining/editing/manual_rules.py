"""A rule written by a person: what it asks and says, checked, and counted on demonstrations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.envelope import box_of
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Bounds, Condition, Operator, Rule

_MOST_NAMES = 8  # as many features as a sentence can name


class Ask(NamedTuple):
    """One condition as a person fills it in.

    Attributes:
        feature: Its name.
        op: Whether the feature must be at most the threshold, or above it.
        threshold: None while there is none.
    """

    feature: str
    op: Operator
    threshold: float | None


def manual_rule(
    rule_set: RuleSet,
    asks: Sequence[Ask],
    *,
    rule_id: str,
    action: int | None,
    forbids: Sequence[int] = (),
    dimension: int = 0,
    demonstrations: Demonstrations | None = None,
) -> Rule:
    """Make a rule of what a person filled in.

    Args:
        rule_set: The rules it comes to, or is among under the same id.
        asks: Conditions, joined by *and*; several on one feature become one interval. Without
            any, the rule applies always.
        rule_id: Its name.
        action: The label, None while none is chosen.
        forbids: In its place, the labels that it forbids; then the action is None.
        dimension: Action dimension it speaks of.
        demonstrations: What it is counted on. They are left alone where the rule set was mined
            from others, because the shares of one set are of the same pairs.

    Returns:
        A rule of origin "manual", with the box of the states to which it applies; without
        demonstrations its numbers are 0 and it has none.

    Raises:
        InputError: If a condition is wrong, the conditions contradict each other, no action is
            chosen or one beside what is forbidden, or another rule asks and says the same.
    """
    if not 0 <= dimension < len(rule_set.actions):
        raise InputError(
            f"there is no action dimension {dimension}; the rules have {len(rule_set.actions)}"
        )
    conditions = _conditions(rule_set, asks)
    forbidden = tuple(sorted(set(forbids)))
    if forbidden and action is not None:
        raise InputError(
            f"the rule says both what to do (label {action}) and what not to do; choose one of them"
        )
    speaks_of = forbidden if action is None else (action,)
    if not speaks_of:
        raise InputError("the rule has no action; choose what it says")
    count = rule_set.actions[dimension].n_labels
    for label in speaks_of:
        if not 0 <= label < count:
            raise InputError(
                f"{rule_set.actions[dimension].name!r} has no label {label}; choose one of its "
                f"{count}"
            )
    if len(forbidden) == count:
        raise InputError("the rule forbids every action; leave one at least")
    instead = tuple(label for label in range(count) if label not in forbidden) if forbids else ()
    rule = Rule(
        rule_id,
        dimension,
        conditions,
        (instead or speaks_of)[0],
        *(0.0, 0.0, 0.0, 0),
        origin="manual",
        forbids=forbidden,
        instead=instead,
    )
    _refuse_duplicate(rule_set, rule)
    if demonstrations is None or demonstrations.digest != rule_set.source.digest:
        return rule
    return _counted(rule_set, rule, demonstrations)


def asks_of(rule: Rule, rule_set: RuleSet) -> tuple[Ask, ...]:
    """A rule as a person would fill it in.

    Args:
        rule: Any.
        rule_set: Knows the names.

    Returns:
        One or two conditions a feature.
    """
    return tuple(
        Ask(rule_set.source.features[condition.feature].name, condition.op, condition.threshold)
        for condition in _queries(rule.bounds)
    )


def region_of(rule: Rule) -> tuple[Bounds, ...]:
    """What a rule asks, the same for all rules that apply to the same states by their bounds.

    Args:
        rule: Any.

    Returns:
        Its bounds by feature.
    """
    return tuple(sorted(rule.bounds))


def _conditions(rule_set: RuleSet, asks: Sequence[Ask]) -> tuple[Condition, ...]:
    names = [feature.name for feature in rule_set.source.features]
    intervals: dict[int, Bounds] = {}
    for name, op, threshold in asks:
        if name not in names:
            listed = ", ".join(names[:_MOST_NAMES]) + (", ..." * (len(names) > _MOST_NAMES))
            raise InputError(f"there is no feature {name!r}; the features are {listed}")
        if op not in ("<=", ">"):
            raise InputError(f"the sign {op!r} is neither '<=' nor '>'; choose one of them")
        if threshold is None:
            raise InputError(f"the condition on {name!r} has no number; give one, or remove it")
        if not math.isfinite(threshold):
            raise InputError(
                f"the condition on {name!r} has the number {threshold}; give a finite one"
            )
        feature = names.index(name)
        before = intervals.get(feature, Bounds(feature, -math.inf, math.inf))
        intervals[feature] = (
            before._replace(high=min(before.high, threshold))
            if op == "<="
            else before._replace(low=max(before.low, threshold))
        )
    for bounds in intervals.values():
        _refuse_empty(bounds, names[bounds.feature])
    return _queries(intervals.values())


def _queries(bounds: Iterable[Bounds]) -> tuple[Condition, ...]:
    conditions = []
    for feature, low, high in bounds:
        if math.isfinite(low):
            conditions.append(Condition(feature, ">", low))
        if math.isfinite(high):
            conditions.append(Condition(feature, "<=", high))
    return tuple(conditions)


def _refuse_empty(bounds: Bounds, name: str) -> None:
    _, low, high = bounds
    if low >= high:
        raise InputError(
            f"{name!r} cannot be above {decimal_text(low)} and at most {decimal_text(high)}; "
            "change one of the two"
        )
    # The largest float32 that is allowed; states are float32, thresholds are not.
    largest = float(np.finfo(np.float32).max)
    top = np.float32(np.clip(high, -largest, largest))
    if float(top) > high >= -largest:
        top = np.nextafter(top, np.float32(-np.inf))
    if not low < float(top) <= high:
        limits = [f"above {decimal_text(low)}"] * math.isfinite(low)
        limits += [f"at most {decimal_text(high)}"] * math.isfinite(high)
        raise InputError(
            f"no value of {name!r} is {' and '.join(limits)}, because states are 32-bit numbers "
            "and there is none; leave more room"
        )


def _refuse_duplicate(rule_set: RuleSet, rule: Rule) -> None:
    for other in rule_set.rules:
        if (
            other.id != rule.id
            and (other.dimension, _says(other)) == (rule.dimension, _says(rule))
            and region_of(other) == region_of(rule)
        ):
            instead = "pin it" if other.origin == "mined" else "move it up"
            if not other.enabled:
                instead = "switch it on"
            raise InputError(f"{rule_set.name_of(other)} asks and says the same; {instead} instead")


def _says(rule: Rule) -> int | tuple[int, ...]:
    return rule.forbids or rule.action


def _counted(rule_set: RuleSet, rule: Rule, demonstrations: Demonstrations) -> Rule:
    values = demonstrations.action_columns[:, rule.dimension]
    dimension = rule_set.actions[rule.dimension]
    labels = dimension.labels_of(values)
    carries = rule.obeyed_by(labels)
    holds = rule.applies(demonstrations.observations)
    samples = int(holds.sum())
    if not samples:
        return rule
    correct, labelled = int(carries[holds].sum()), int(carries.sum())
    if rule.forbids:  # what is most frequent there comes in the place of what is forbidden
        often = np.bincount(labels[holds], minlength=dimension.n_labels)
        order = tuple(sorted(rule.instead, key=lambda label: -int(often[label])))
        rule = replace(rule, action=order[0], instead=order)
    return replace(
        rule,
        support=samples / len(demonstrations),
        confidence=correct / samples,
        lift=correct * len(demonstrations) / (samples * labelled) if labelled else 0.0,
        samples=samples,
        demonstrated_value=float(np.median(values[holds]))
        if dimension.is_interval and not rule.forbids
        else None,
        box=box_of(rule, demonstrations.observations),
    )
