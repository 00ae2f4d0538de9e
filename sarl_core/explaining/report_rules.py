"""The part of a report that shows the rules: sentence, evidence, conditions, pictures."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.colours import INTERVENTION_COLOUR, label_colour
from sarl_core.explaining.distributions import FeatureRow, feature_rows
from sarl_core.explaining.language import (
    action_text,
    conditions_text,
    counted,
    is_flag,
    label_text,
    number_text,
    sentence,
    share_text,
    short_condition,
)
from sarl_core.explaining.report_counts import Share, Tally
from sarl_core.explaining.report_svg import Scale, evidence_bar, interval_bar
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Bounds, Rule, RuleSet
from sarl_core.rollouts.example_frames import ExampleFrame, Examples

MOST_IN_TABLE = 5_000
_PRINTED_LINES = 150  # of the table; the file itself holds all


@dataclass(frozen=True)
class Evidence:
    """How often the expert did what a rule says.

    Attributes:
        source: Of which states, as "of the states it was mined from".
        text: As "412 of 425 states (97 %)".
        interval: In words.
        bar: SVG.
        below: Whether the interval lies below the threshold.
    """

    source: str
    text: str
    interval: str
    bar: str
    below: bool


@dataclass(frozen=True)
class ConditionRow:
    """What a rule asks of one feature.

    Attributes:
        text: As "pole angle > 0.02 rad".
        data: The demonstrated range, as "-0.2 to 0.2".
        bar: SVG; "" where it is yes or no.
    """

    text: str
    data: str
    bar: str


@dataclass(frozen=True)
class Picture:
    """An example frame.

    Attributes:
        source: A data address.
        alt: What it is, in words.
        caption: Under it.
    """

    source: str
    alt: str
    caption: str


@dataclass(frozen=True)
class Card:
    """A rule in full.

    Attributes:
        number: In this report.
        id: In the rule file.
        title: The rule as a sentence.
        colour: Of its action.
        action: Its name.
        tags: As "switched off".
        support: How often it applies, in words.
        evidence: One entry a source.
        conditions: One a feature.
        pictures: Frames at which it applied.
    """

    number: int
    id: str
    title: str
    colour: str
    action: str
    tags: tuple[str, ...]
    support: str
    evidence: tuple[Evidence, ...]
    conditions: tuple[ConditionRow, ...]
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class Line:
    """A rule in a table.

    Attributes:
        number: In this report.
        id: In the rule file.
        action: Its name.
        colour: Of its action.
        when: Its conditions, in signs.
        support: Share of the states to which it applies.
        samples: Number of those.
        confidence: Share of those with its action.
        tags: As "switched off".
    """

    number: int
    id: str
    action: str
    colour: str
    when: str
    support: str
    samples: str
    confidence: str
    tags: tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """The rules of one action dimension.

    Attributes:
        name: Of the dimension; "" where there is only one.
        cards: Rules in full.
    """

    name: str
    cards: tuple[Card, ...]


@dataclass(frozen=True)
class Rules:
    """The rules.

    Attributes:
        introduction: What is shown how, in sentences.
        groups: Rules in full, by action dimension.
        lines: The others.
        printed: How many of those are printed.
        left_out: Number of rules that are not even in the table.
    """

    introduction: tuple[str, ...]
    groups: tuple[Group, ...]
    lines: tuple[Line, ...]
    printed: int
    left_out: int


def in_order(rule_set: RuleSet, most: int) -> tuple[list[int], list[int]]:
    """Which rules are shown in full, and which in a table.

    Args:
        rule_set: The rules.
        most: So many in full, the same number of each action dimension as far as there are.

    Returns:
        Indices: those in full by dimension and support; the others likewise. Rules that a person
        placed come first, in their order.
    """
    queues = []
    for dimension in range(len(rule_set.actions)):
        own = [index for index, rule in enumerate(rule_set.rules) if rule.dimension == dimension]
        own.sort(key=lambda index: _rank(rule_set.rules[index]))
        queues.append(own)
    shares = [0] * len(queues)
    for _ in range(min(most, len(rule_set.rules))):
        open_ones = [place for place, own in enumerate(queues) if shares[place] < len(own)]
        shares[min(open_ones, key=lambda place: shares[place])] += 1
    full = [index for own, share in zip(queues, shares, strict=True) for index in own[:share]]
    rest = [index for own, share in zip(queues, shares, strict=True) for index in own[share:]]
    rest.sort(key=lambda index: -rule_set.rules[index].support)
    return full, rest


def _rank(rule: Rule) -> tuple[bool, float]:
    return (not rule.placed, 0.0 if rule.placed else -rule.support)


def rules_part(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    tally: Tally,
    order: tuple[Sequence[int], Sequence[int]],
    examples: Examples | None,
) -> Rules:
    """The rules, the first in full.

    Args:
        rule_set: The rules.
        demonstrations: Of the report.
        tally: The rules on them.
        order: As `in_order` gives it.
        examples: Frames at which rules applied, None without pictures.

    Returns:
        The part of the report.
    """
    full, rest = order
    ranges = feature_rows(demonstrations)
    numbers = {index: number for number, index in enumerate([*full, *rest], start=1)}
    groups = []
    for dimension, action in enumerate(rule_set.actions):
        cards = tuple(
            _card(rule_set, index, numbers[index], demonstrations, tally, ranges, examples)
            for index in full
            if rule_set.rules[index].dimension == dimension
        )
        if cards:
            groups.append(Group(action.name if len(rule_set.actions) > 1 else "", cards))
    lines = tuple(_line(rule_set, index, numbers[index]) for index in rest[:MOST_IN_TABLE])
    return Rules(
        introduction=_introduction(rule_set, tally, len(full), len(rest)),
        groups=tuple(groups),
        lines=lines,
        printed=_PRINTED_LINES,
        left_out=max(len(rest) - MOST_IN_TABLE, 0),
    )


def _introduction(rule_set: RuleSet, tally: Tally, full: int, rest: int) -> tuple[str, ...]:
    if not rule_set.rules:
        return (
            "There is no rule: no part of the tree reaches the thresholds. Such a shield leaves "
            "every action as it is.",
        )
    found = [
        "Of several conditions in a rule all must hold. In a state at most one rule for each "
        "action applies; where none does, the agent acts as it likes.",
    ]
    if rest:
        each = " of each action" if len(rule_set.actions) > 1 else ""
        found.append(
            f"There are {len(rule_set.rules):,} rules. The {full:,} that apply most often{each} "
            f"are shown in full, the other {rest:,} in a table after them."
        )
    if tally.split:
        found.append(
            f"The rules were mined from {counted(rule_set.source.episodes, 'episode')} of these "
            "demonstrations; the others were kept aside to try the rules on."
        )
    elif not tally.same:
        found.append(
            "The rules were made from other data than the demonstrations of this report (from "
            f"{counted(rule_set.source.steps, 'state')}); both counts are shown."
        )
    return tuple(found)


# --- a rule in full ----------------------------------------------------------------------------


def _card(
    rule_set: RuleSet,
    index: int,
    number: int,
    demonstrations: Demonstrations,
    tally: Tally,
    ranges: Sequence[FeatureRow],
    examples: Examples | None,
) -> Card:
    rule = rule_set.rules[index]
    dimension = rule_set.actions[rule.dimension]
    frames = examples.frames.get(index, ()) if examples is not None else ()
    rows = tally.rows(index, rule.dimension)
    return Card(
        number=number,
        id=rule.id,
        title=sentence(rule, rule_set, evidence=False),
        colour=label_colour(rule.action),
        action=action_text(rule.action, dimension),
        tags=tags(rule),
        support=_support(rule, tally.shares[index], tally),
        evidence=_evidence(rule, rule_set, tally.shares[index], tally),
        conditions=tuple(
            _condition(
                bounds,
                demonstrations,
                ranges[bounds.feature],
                (
                    demonstrations.observations[rows, bounds.feature].min().item(),
                    demonstrations.observations[rows, bounds.feature].max().item(),
                )
                if len(rows)
                else (),
            )
            for bounds in rule.bounds
        ),
        pictures=tuple(_picture(frame, rule, dimension) for frame in frames),
    )


def tags(rule: Rule) -> tuple[str, ...]:
    """What is special about a rule.

    Args:
        rule: Any.

    Returns:
        As ("switched off", "written by hand").
    """
    found = []
    if not rule.enabled:
        found.append("switched off")
    if rule.origin == "manual":
        found.append("written by hand")
    if rule.pinned:
        found.append("put in its place by hand")
    return tuple(found)


def _support(rule: Rule, here: Share, tally: Tally) -> str:
    if tally.same and rule.origin == "mined":
        return (
            f"Applies in {share_text(rule.support)} of the demonstrated states "
            f"({counted(rule.samples, 'state')})."
        )
    text = f"Applies in {counted(here.whole, 'state')} of this report's demonstrations"
    if rule.origin == "mined" and rule.samples:
        text += f", and in {share_text(rule.support)} of those it was made from"
    return f"{text}."


def _evidence(rule: Rule, rule_set: RuleSet, here: Share, tally: Tally) -> tuple[Evidence, ...]:
    threshold = rule_set.thresholds.confidence if rule_set.cut == "thresholds" else None
    found = []
    if rule.origin == "mined":
        found.append(("in the states it was mined from", Share(rule.correct, rule.samples)))
    if rule.held_out is not None:
        held = Share(rule.held_out.correct, rule.held_out.samples)
        found.append(("in episodes kept aside, which it was not mined from", held))
    if not (tally.same or tally.split) or rule.origin != "mined":
        found.append(("in the demonstrations of this report", here))
    return tuple(_evidence_of(name, share, threshold) for name, share in found)


def _evidence_of(source: str, share: Share, threshold: float | None) -> Evidence:
    if not share.whole:
        return Evidence(source, "no such state: nothing is known", "", "", below=False)
    low, high = share.interval
    below = threshold is not None and high < threshold
    states = "1 state" if share.whole == 1 else f"{share.whole:,} states"
    return Evidence(
        source=source,
        text=f"{share.part:,} of {states} ({share_text(share.value)})",
        interval=f"the true share probably lies between {_share(low)} and {_share(high)}"
        + (", below the threshold" if below else ""),
        bar=evidence_bar(
            share.value,
            low,
            high,
            colour=INTERVENTION_COLOUR if below else label_colour(0),
            threshold=threshold,
        ),
        below=below,
    )


def _share(value: float) -> str:
    """An end of an interval: with one decimal, unless that says nothing."""
    return share_text(value, decimals=1) if 0.0 < value < 1.0 else share_text(value)


def _condition(
    bounds: Bounds,
    demonstrations: Demonstrations,
    row: FeatureRow,
    states: Sequence[float],
) -> ConditionRow:
    feature = demonstrations.features[bounds.feature]
    text = short_condition(bounds, feature)
    if is_flag(feature, bounds):
        return ConditionRow(text, "", "")
    unit = f" {feature.unit}" if feature.unit else ""
    low = number_text(row.low, apart_from=row.high)
    high = number_text(row.high, apart_from=row.low)
    finite = [value for value in (bounds.low, bounds.high) if math.isfinite(value)]
    scale = Scale.over([row.low, row.high, *finite], margin=0.04)
    return ConditionRow(
        text,
        f"{low} to {high}{unit}",
        interval_bar(scale, (row.low, row.high), (bounds.low, bounds.high), states),
    )


def _picture(frame: ExampleFrame, rule: Rule, dimension: LabelledDimension) -> Picture:
    value = frame.executed[rule.dimension].item()
    did = (
        f"{dimension.name} {number_text(float(value))}"
        if dimension.is_interval
        else label_text(dimension.label_of(value), dimension)
    )
    followed = dimension.label_of(value) == rule.action
    name = frame.player[:1].upper() + frame.player[1:]
    return Picture(
        source=f"data:image/png;base64,{base64.b64encode(frame.picture).decode('ascii')}",
        alt=f"The scene at step {frame.step} of the episode with seed {frame.seed}, where the "
        f"rule applies; {frame.player} chose {did}",
        caption=f"{name}: {did}{'' if followed else ', against the rule'}. Seed {frame.seed}, "
        f"step {frame.step}",
    )


# --- the others --------------------------------------------------------------------------------


def _line(rule_set: RuleSet, index: int, number: int) -> Line:
    rule = rule_set.rules[index]
    return Line(
        number=number,
        id=rule.id,
        action=action_text(rule.action, rule_set.actions[rule.dimension]),
        colour=label_colour(rule.action),
        when=conditions_text(rule, rule_set),
        support=share_text(rule.support),
        samples=f"{rule.samples:,}",
        confidence=share_text(rule.confidence) if rule.samples else "–",
        tags=tags(rule),
    )
