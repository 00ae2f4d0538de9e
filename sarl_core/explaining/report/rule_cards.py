"""One rule of a report in full: its sentence, its evidence, its conditions and its pictures."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.derived import extended_state
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.combination_plots import combination_plots
from sarl_core.explaining.figures.distributions import FeatureRow
from sarl_core.explaining.html.rule_combinations import combinations_html
from sarl_core.explaining.report.svg import SvgScale, evidence_bar, interval_bar
from sarl_core.explaining.report.tally import Share, Tally
from sarl_core.explaining.words.evidence import what_tells
from sarl_core.mining.action_words import done_text, says_text
from sarl_core.mining.digits import value_text
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import (
    counted,
    is_flag,
    least_conditions,
    neither_text,
    number_text,
    sentence,
    share_text,
    short_condition,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Bounds, Rule
from sarl_core.mining.validation.holding_out import least_confidence
from sarl_core.rendering.example_frames import ExampleFrame, Examples

_MOST_VALUES = 3  # under a picture
_MOST_POINTS = 500  # of a combination: a report holds many
_MOST_COMBINATIONS = 6  # drawn of one rule; the dashboard draws all


@dataclass(frozen=True)
class Evidence:
    """How often the expert did what a rule says.

    Attributes:
        did: As "The expert did so in".
        source: Of which states, as "that the rule was made from".
        text: As "412 of 425 states (97 %)".
        interval: What other episodes can tell, in words; "" of those that the rule was made from.
        bar: SVG.
        below: Whether the interval lies below the threshold.
    """

    did: str
    source: str
    text: str
    interval: str
    bar: Markup
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
    bar: Markup


@dataclass(frozen=True)
class Picture:
    """An example frame.

    Attributes:
        source: A data address.
        alt: What it is, in words.
        caption: What was done.
        values: Of features that the rule asks about.
        place: Where to find it again.
    """

    source: str
    alt: str
    caption: str
    values: str
    place: str


@dataclass(frozen=True)
class Card:
    """A rule in full.

    Attributes:
        name: As "R12", by its place in the rule file.
        title: The rule as a sentence.
        colour: Of its action.
        action: Its name.
        tags: As "switched off".
        support: How often it applies, in words.
        evidence: One entry a source.
        conditions: One a feature.
        combinations: Of two features, drawn; "" where it asks about none.
        pictures: Frames at which it applied.
    """

    name: str
    title: str
    colour: str
    action: str
    tags: tuple[str, ...]
    support: str
    evidence: tuple[Evidence, ...]
    conditions: tuple[ConditionRow, ...]
    combinations: Markup
    pictures: tuple[Picture, ...]


def rule_card(
    rule_set: RuleSet,
    index: int,
    demonstrations: Demonstrations,
    tally: Tally,
    ranges: Sequence[FeatureRow],
    examples: Examples | None,
) -> Card:
    """A rule in full.

    Args:
        rule_set: The rules.
        index: Of the rule.
        demonstrations: Of the report.
        tally: The rules on them.
        ranges: Every feature of them in numbers.
        examples: Frames at which rules applied, None without pictures.

    Returns:
        What is shown of it.
    """
    rule = rule_set.rules[index]
    dimension = rule_set.actions[rule.dimension]
    frames = examples.frames.get(index, ()) if examples is not None else ()
    features = rule_set.source.features
    planes = combination_plots(demonstrations, rule, dimension, features, most=_MOST_POINTS)
    # Where several rules apply, or this one is off, it applies to more states than it decides.
    rows = np.flatnonzero(rule.applies(demonstrations.observations))
    applying, decided = len(rows), len(tally.rows(index, rule.dimension))
    if rule.forbids and rule.enabled:  # what one forbids, no other one that forbids allows
        decided = applying
    return Card(
        name=rule_set.name_of(rule),
        title=sentence(rule, rule_set, evidence=False),
        colour=label_colour(rule.label),
        action=says_text(rule, dimension),
        tags=tags(rule),
        support=_support(rule, applying, decided, tally),
        evidence=_evidence(rule, rule_set, index, tally, applying),
        conditions=_conditions(rule, rule_set, ranges, demonstrations.observations[rows]),
        combinations=combinations_html(planes, features, dimension, most=_MOST_COMBINATIONS),
        pictures=tuple(_picture(frame, rule, rule_set, ranges) for frame in frames),
    )


def tags(rule: Rule) -> tuple[str, ...]:
    """What is special about a rule.

    Args:
        rule: Any.

    Returns:
        As ("switched off", "written by hand").
    """
    labels = []
    if not rule.enabled:
        labels.append("switched off")
    if rule.origin == "manual":
        labels.append("written by hand")
    if rule.pinned:
        labels.append("put in its place by hand")
    if rule.regrown:
        labels.append("of a part of the tree that was regrown by hand")
    return tuple(labels)


def _support(rule: Rule, applying: int, decided: int, tally: Tally) -> str:
    number = f"{decided:,}" if decided else "none"
    if tally.sampled and rule.origin == "mined":
        decides = share_text(decided / applying) if applying else "none"
        return (
            f"Applies in {share_text(rule.support)} of the demonstrated states "
            f"({counted(rule.samples, 'state')})"
            + (f"; in the sample it decides {decides} of them." if decided != applying else ".")
        )
    if tally.same and rule.origin == "mined" and rule.samples == applying:
        return (
            f"Applies in {share_text(rule.support)} of the demonstrated states "
            f"({counted(rule.samples, 'state')})"
            + (f"; it decides {number} of them." if decided != applying else ".")
        )
    text = f"Applies in {share_text(applying / len(tally.rules))} of this report's states "
    text += f"({applying:,})"
    if rule.origin != "manual" and rule.samples:
        made = "probed ones" if rule.origin == "probed" else "those"
        text += f", and in {share_text(rule.support)} of {made} it was made from"
    if decided != applying:
        text += f"; it decides {number} of this report's"
    return f"{text}."


def _evidence(
    rule: Rule, rule_set: RuleSet, index: int, tally: Tally, applying: int
) -> tuple[Evidence, ...]:
    threshold = least_share(rule, rule_set)
    did = "The expert did not in" if rule.forbids else "The expert did so in"
    evidence = []
    if rule.origin != "manual":
        failed = "After it the expert failed in" if rule.origin == "probed" else did
        evidence.append(_mined(failed, Share(rule.correct, rule.samples), threshold))
    if rule.held_out is not None:
        source = "of episodes kept aside, which it was not made from"
        evidence.append(_tried(did, source, rule.held_out, threshold))
    if not (tally.same or tally.split) or rule.origin != "mined":
        here = tally.by_episode[index]
        decided = "that it decides " if here.samples != applying else ""
        states = "the sample" if tally.sampled else "this report's demonstrations"
        at_least = None if rule.origin == "probed" else threshold
        evidence.append(_tried(did, f"{decided}of {states}", here, at_least))
    return tuple(evidence)


def least_share(rule: Rule, rule_set: RuleSet) -> float | None:
    """What its share in the states that a rule was made from had to reach.

    Args:
        rule: One of the set.
        rule_set: The rules.

    Returns:
        None where no thresholds cut the rules.
    """
    if rule_set.cut != "thresholds":
        return None
    return least_confidence(rule, rule_set.thresholds)


def _states(share: Share) -> str:
    states = "1 state" if share.whole == 1 else f"{share.whole:,} states"
    return f"{share.part:,} of {states} ({share_text(share.value)})"


def _nothing(did: str, source: str) -> Evidence:
    return Evidence(did, source, "0 of 0 states", "nothing is known there", Markup(), below=False)


def _mined(did: str, share: Share, threshold: float | None) -> Evidence:
    """No interval: a rule was chosen for being right there."""
    source = "that the rule was made from"
    if not share.whole:
        return _nothing(did, source)
    bar = evidence_bar(share.value, None, below=False, threshold=threshold)
    return Evidence(did, source, _states(share), "", bar, below=False)


def _tried(did: str, source: str, held_out: HeldOut, threshold: float | None) -> Evidence:
    if not held_out.samples:
        return _nothing(did, source)
    interval = held_out.interval
    below = threshold is not None and interval is not None and interval.high < threshold
    of_all = _states(Share(held_out.correct, held_out.samples))
    text, on_average, interval_text = of_all, "", "the file does not say in how many episodes"
    share = held_out.share
    if share is not None:  # the number is the bar's: each episode counts once
        text, of_all = (
            f"{share_text(share)} of its states in an episode",
            f"of all together: {of_all}",
        )
        on_average = f", on average over {counted(held_out.episodes, 'episode')}"
        extent = "too few to say more" if interval is None else what_tells(interval)
        interval_text = f"{extent}; {of_all}"
    return Evidence(
        did=did,
        source=f"{source}{on_average}",
        text=text,
        interval=f"{interval_text}{'; below the threshold' if below else ''}",
        bar=evidence_bar(
            held_out.correct / held_out.samples if share is None else share,
            interval,
            below=below,
            threshold=threshold,
        ),
        below=below,
    )


def _conditions(
    rule: Rule,
    rule_set: RuleSet,
    ranges: Sequence[FeatureRow],
    states: NDArray[np.float32],
) -> tuple[ConditionRow, ...]:
    features = rule_set.source.features
    rows: list[ConditionRow] = []
    for entry in least_conditions(rule, features):
        neither = neither_text(entry, features)
        if neither is not None:
            rows.append(ConditionRow(neither, "", Markup()))
            continue
        for one in entry:
            values = states[:, one.feature]
            ends = (values.min().item(), values.max().item()) if len(values) else ()
            rows.append(_condition(one, features[one.feature], ranges[one.feature], ends))
    return tuple(rows)


def _condition(
    bounds: Bounds,
    feature: Feature,
    row: FeatureRow,
    states: Sequence[float],
) -> ConditionRow:
    text = short_condition(bounds, feature)
    if is_flag(feature, bounds):
        return ConditionRow(text, "", Markup())
    unit = f" {feature.unit}" if feature.unit else ""
    low = number_text(row.low, apart_from=row.high)
    high = number_text(row.high, apart_from=row.low)
    # A formula may be infinite; what is stands at the edge.
    ends = (row.low, row.high, bounds.low, bounds.high)
    finite = [value for value in ends if math.isfinite(value)]
    scale = SvgScale.over(finite, margin=0.04)
    return ConditionRow(
        text,
        f"{low} to {high}{unit}",
        interval_bar(scale, (row.low, row.high), (bounds.low, bounds.high), states),
    )


def _picture(
    frame: ExampleFrame, rule: Rule, rule_set: RuleSet, ranges: Sequence[FeatureRow]
) -> Picture:
    dimension, features = rule_set.actions[rule.dimension], rule_set.source.features
    state = extended_state(frame.observation.tolist(), features)
    value = frame.executed[rule.dimension].item()
    did = done_text(value, dimension)
    followed = bool(rule.obeyed_by(np.array([dimension.label_of(value)])).all())
    name = frame.player[:1].upper() + frame.player[1:]
    return Picture(
        source=f"data:image/png;base64,{base64.b64encode(frame.picture).decode('ascii')}",
        alt=f"The scene at step {frame.step} of the episode with seed {frame.seed}, where the "
        f"rule applies; {frame.player} chose {did}",
        caption=f"{name}: {did}{'' if followed else ', against the rule'}",
        values="; ".join(
            _value_text(state[bounds.feature], features[bounds.feature], bounds)
            for bounds in rule.bounds[:_MOST_VALUES]
            if not is_flag(features[bounds.feature], bounds)
        ),
        place=f"seed {frame.seed}, step {frame.step}",
    )


def _value_text(value: float, feature: Feature, bounds: Bounds) -> str:
    return (
        f"{feature.name} {value_text(value, feature, [bounds])}"
        f"{f' {feature.unit}' if feature.unit else ''}"
    )
