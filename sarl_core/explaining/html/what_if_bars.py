"""What the shield would do along each feature of a state, as bars in HTML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from sarl_core.decimals import decimal_on_scale, decimal_text
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import faded, label_colour
from sarl_core.explaining.html.path import label_key
from sarl_core.explaining.markup import percent
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.states import StateColumn, state_columns
from sarl_core.explaining.words.what_if import with_unit
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import number_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.neighbourhood import FeatureLine

_PALE = 0.32
_BETWEEN = 0.5  # no and yes of a feature that says which word a column holds


class _Row(NamedTuple):
    """A bar, as the template draws it."""

    name: str
    description: str
    now: str
    place: str
    parts: list[tuple[str, str]]
    ends: list[str]
    of_words: bool = False


def lines_html(
    lines: Sequence[FeatureLine],
    ranges: Sequence[tuple[float, float]],
    values: Sequence[float],
    features: Sequence[Feature],
    dimension: int,
    rule_set: RuleSet,
) -> Markup:
    """A bar for each feature, coloured by what would be executed along it.

    Full colour where a rule decides, pale where the agent's action is passed on because no rule
    applies or the rule abstains.

    Args:
        lines: Of the features to show, from top to bottom.
        ranges: Ends of each bar, in the feature's unit.
        values: The present values, each within its bar.
        features: Names and units, likewise.
        dimension: Action dimension that gives the colours.
        rule_set: The shield's.

    Returns:
        HTML. A column of words has one bar, with a part for each word. Every bar is as wide as
        there is room; the present value is marked on it.
    """
    labels = rule_set.actions[dimension]
    at = {feature: place for place, feature in enumerate(features)}
    rows = []
    for column in state_columns(features):
        places = [at[feature] for feature in column.features]
        if column.of_words:
            own = [(lines[place], values[place]) for place in places]
            rows.append(_row_of_words(column, own, dimension, rule_set))
        else:
            (place,) = places
            parts = stretches(lines[place], ranges[place], dimension, rule_set)
            rows.append(_row(parts, ranges[place], values[place], features[place], labels))
    return render("states/lines", labels=label_key(labels), rows=rows)


def stretches(
    line: FeatureLine, ends: tuple[float, float], dimension: int, rule_set: RuleSet
) -> list[tuple[float, float, int, bool]]:
    """The parts of a bar, neighbours that look the same made one.

    Args:
        line: What the shield does along the feature.
        ends: Of the bar.
        dimension: Action dimension.
        rule_set: The shield's.

    Returns:
        Start, end, label of what is executed, and whether a rule decides it; from left to right,
        without gaps.
    """
    low, high = ends
    starts = [-np.inf, *line.starts[1:].astype(np.float64).tolist()]
    joined: list[tuple[float, float, int, bool]] = []
    for place, start in enumerate(starts):
        end = starts[place + 1] if place + 1 < len(starts) else np.inf
        left, right = max(start, low), min(end, high)
        if left >= right:
            continue
        looks = _looks(line, place, dimension, rule_set)
        if joined and joined[-1][2:] == looks:
            joined[-1] = (joined[-1][0], right, *looks)
        else:
            joined.append((left, right, *looks))
    return joined


def _looks(line: FeatureLine, stretch: int, dimension: int, rule_set: RuleSet) -> tuple[int, bool]:
    """The label of what is executed in a stretch, and whether a rule decides it."""
    executed = line.decisions.executed[stretch : stretch + 1, dimension]
    label = int(rule_set.actions[dimension].labels_of(executed)[0])
    number = int(line.decisions.rules[stretch, dimension])
    if number < 0:
        return label, False
    rule = rule_set.rules[number]
    if rule.forbids:  # it decides where it takes something away
        proposed = np.reshape(line.decisions.proposed, line.decisions.executed.shape)
        return label, bool(executed[0] != proposed[stretch, dimension])
    # A rule that abstains is in force, and something else is executed.
    return label, rule.action == label


def _row_of_words(
    column: StateColumn,
    lines: Sequence[tuple[FeatureLine, float]],
    dimension: int,
    rule_set: RuleSet,
) -> _Row:
    """A column of words, with the line and the value of each of its features: a part for each."""
    if len(lines) > 1:
        said = [feature.statement(True) for feature in column.features]
        points = [(line, 1.0) for line, _ in lines]
        here = max(range(len(lines)), key=lambda at: lines[at][1])
    else:
        ((line, value),) = lines
        said = [column.features[0].statement(holds) for holds in (False, True)]
        points = [(line, 0.0), (line, 1.0)]
        here = int(value > _BETWEEN)
    looks = [
        _looks(
            line, int(np.searchsorted(line.starts, value, side="right")) - 1, dimension, rule_set
        )
        for line, value in points
    ]
    labels = rule_set.actions[dimension]
    does = [
        f"{one}: {_done((0.0, 0.0, *how), labels)}" for one, how in zip(said, looks, strict=True)
    ]
    width = 1 / len(said)
    return _Row(
        column.title,
        "; ".join([does[here], *(one for at, one in enumerate(does) if at != here)]),
        said[here],
        percent(width * (here + 0.5)),
        [
            (one, f"left:{percent(width * at)};width:{percent(width)};background:{_colour(*how)}")
            for at, (one, how) in enumerate(zip(does, looks, strict=True))
        ],
        [one.partition(" is ")[2] for one in said],
        of_words=True,
    )


def _colour(label: int, ruled: bool) -> str:
    return label_colour(label) if ruled else faded(label_colour(label), _PALE)


def _row(
    parts: Sequence[tuple[float, float, int, bool]],
    ends: tuple[float, float],
    value: float,
    feature: Feature,
    labels: LabelledDimension,
) -> _Row:
    low, high = ends
    # The narrowest last: they are drawn wider than they are, and stay on top of their neighbours.
    widest_first = sorted(parts, key=lambda part: part[0] - part[1])
    near = decimal_text(decimal_on_scale(value, low, high))
    now = f"{feature.name} is {with_unit(near, feature)}"
    return _Row(
        feature.name,
        f"{now}: {_described(parts, value, feature, labels)}",
        now,
        percent((value - low) / (high - low)),
        [_part(part, ends, feature, labels) for part in widest_first],
        [
            with_unit(number_text(end, apart_from=other), feature)
            for end, other in ((low, high), (high, low))
        ],
    )


def _part(
    part: tuple[float, float, int, bool],
    ends: tuple[float, float],
    feature: Feature,
    labels: LabelledDimension,
) -> tuple[str, str]:
    """What is said of it, and where it stands."""
    start, end, label, ruled = part
    low, high = ends
    # What ends with the bar hangs at its right, so that it stays within it however narrow it is.
    side = (
        f"left:{percent((start - low) / (high - low))}" if end < high or start == low else "right:0"
    )
    between = f"{feature.name} {_between(start, end, feature)}"
    width = percent((end - start) / (high - low))
    return (
        f"{between}: {_done(part, labels)}",
        f"{side};width:{width};background:{_colour(label, ruled)}",
    )


def _described(
    parts: Sequence[tuple[float, float, int, bool]],
    value: float,
    feature: Feature,
    labels: LabelledDimension,
) -> str:
    """What a bar shows, for those who do not see it."""
    place = max((at for at, part in enumerate(parts) if part[0] <= value), default=0)
    here = parts[place]
    stays = f"{_done(here, labels)}, from {_between(here[0], here[1], feature)}"
    if len(parts) == 1:
        return f"{stays}, which is all of the bar"
    below, above = (
        _done(parts[side], labels) if 0 <= side < len(parts) else "the bar ends"
        for side in (place - 1, place + 1)
    )
    return f"{stays}; below that: {below}; above that: {above}"


def _between(start: float, end: float, feature: Feature) -> str:
    return (
        f"{number_text(start, apart_from=end)} to "
        f"{with_unit(number_text(end, apart_from=start), feature)}"
    )


def _done(part: tuple[float, float, int, bool], labels: LabelledDimension) -> str:
    """What is executed in a stretch."""
    _, _, label, ruled = part
    does = label_text(label, labels) if 0 <= label < labels.n_labels else f"action {label}"
    return does + (", by a rule" if ruled else ", as the agent wants")
