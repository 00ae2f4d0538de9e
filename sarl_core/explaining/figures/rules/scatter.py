"""All rules as dots: one measure to the right, another upwards, the action as colour."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any, NamedTuple

import plotly.graph_objects as go

from sarl_core.explaining.colours import MARKER_COLOUR, label_colour
from sarl_core.explaining.figures.rules.measures import RuleMeasure, measures_of
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import round_ticks, share_ticks, tick_text
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

SYMBOLS = (
    ("circle", "Circles"),
    ("diamond", "Diamonds"),
    ("square", "Squares"),
    ("triangle-up", "Triangles"),
    ("cross", "Crosses"),
    ("star", "Stars"),
)
"""What the rules of an action dimension are drawn as: several dimensions share the colours."""
MOST_DOTS = 4_000
_MANY_DOTS = 300
_LEAST_SIZE, _LEAST_OF_MANY, _LARGEST_SIZE = 10.0, 7.0, 28.0  # pixels
_DECADES = 20.0  # an axis over more than so many times its least value goes by powers of ten
_LINE = 46  # letters of a line of a tooltip: as much as a phone shows


@dataclass(frozen=True)
class RuleDot:
    """The rules of which two measures are equal: each would hide the others.

    Attributes:
        x: The measure to the right.
        y: The measure upwards.
        rules: The one with the most states first.
    """

    x: float
    y: float
    rules: tuple[Rule, ...]

    def after(self, rule_id: str) -> Rule:
        """The rule that follows another one of the dot, the first after the last.

        Args:
            rule_id: Of any rule; the first follows those of other dots.
        """
        ids = [rule.id for rule in self.rules]
        return self.rules[(ids.index(rule_id) + 1) % len(ids) if rule_id in ids else 0]


def rule_dots(rules: Sequence[Rule], x: Sequence[float], y: Sequence[float]) -> tuple[RuleDot, ...]:
    """Where rules stand.

    Args:
        rules: Any, R of them.
        x: The measure to the right of each, (R,).
        y: The measure upwards of each, (R,).

    Returns:
        The dot with the most rules first, so that no dot lies hidden under a larger one; rules
        of which a measure is NaN are in none.
    """
    places: dict[tuple[float, float], list[Rule]] = {}
    for rule, *place in sorted(zip(rules, x, y, strict=True), key=lambda row: -row[0].samples):
        if not any(map(math.isnan, place)):
            places.setdefault((place[0], place[1]), []).append(rule)
    dots = [RuleDot(*place, tuple(some)) for place, some in places.items()]
    return tuple(sorted(dots, key=lambda dot: -len(dot.rules)))


def largest_dots(dots: Sequence[RuleDot], most: int = MOST_DOTS) -> tuple[RuleDot, ...]:
    """Few enough dots to draw.

    Args:
        dots: Any.
        most: How many to keep.

    Returns:
        Those of the rules with the most states, in the order given.
    """
    if len(dots) <= most:
        return tuple(dots)
    first = sorted(range(len(dots)), key=lambda place: -dots[place].rules[0].samples)[:most]
    return tuple(dots[place] for place in sorted(first))


def colour_entries(dots: Sequence[RuleDot], rule_set: RuleSet) -> list[list[tuple[str, str]]]:
    """What the colours mean.

    Args:
        dots: What is drawn.
        rule_set: Knows the names.

    Returns:
        For each action dimension the actions that are drawn, and their colours as "#0072B2".
    """
    there = {
        (rule.dimension, rule.label, says_text(rule, rule_set.actions[rule.dimension]))
        for dot in dots
        for rule in dot.rules
    }
    return [
        [(text, label_colour(label)) for place, label, text in sorted(there) if place == number]
        for number in range(len(rule_set.actions))
    ]


def rule_scatter(
    dots: Sequence[RuleDot],
    rule_set: RuleSet,
    x: RuleMeasure,
    y: RuleMeasure,
    *,
    chosen: str | None = None,
) -> go.Figure:
    """Rules as dots, each in the colour of its action.

    A dot is the larger the more rules stand at its place. Where they differ in what they say, it
    has a ring for each action.

    Args:
        dots: Of `rule_dots`, for the same measures.
        rule_set: Knows the names.
        x: The measure to the right.
        y: The measure upwards.
        chosen: Id of the rule to mark.

    Returns:
        Each point is a ring, and carries the id of the first rule of its dot as `customdata`.
    """
    most = max((len(dot.rules) for dot in dots), default=1)
    least = _LEAST_OF_MANY if len(dots) > _MANY_DOTS else _LEAST_SIZE
    # One trace, so that no ring of a large dot lies over a small one beside it.
    rings = [(dot, ring) for dot in dots for ring in _rings(dot)]
    texts = {dot.rules[0].id: dot_text(dot, rule_set) for dot in dots}
    figure = go.Figure()
    figure.add_scatter(
        x=[dot.x for dot, _ in rings],
        y=[dot.y for dot, _ in rings],
        mode="markers",
        name="rules",
        customdata=[[dot.rules[0].id] for dot, _ in rings],
        hovertext=[texts[dot.rules[0].id] for dot, _ in rings],
        hovertemplate="%{hovertext}<extra></extra>",
        marker={
            "size": [_size(ring.rules, most, least) for _, ring in rings],
            "color": [label_colour(ring.label) for _, ring in rings],
            "symbol": [SYMBOLS[ring.dimension % len(SYMBOLS)][0] for _, ring in rings],
            "opacity": 0.8,
            "line": {"width": 0.5, "color": "rgba(128,128,128,0.6)"},
        },
        # The mark says which rule was clicked; all others stay as they are.
        selected={"marker": {"opacity": 0.8}},
        unselected={"marker": {"opacity": 0.8}},
    )
    for dot in dots:
        if any(rule.id == chosen for rule in dot.rules):
            figure.add_scatter(
                x=[dot.x],
                y=[dot.y],
                mode="markers",
                hoverinfo="skip",
                name="chosen",
                marker={
                    "size": _size(len(dot.rules), most, least) + 8,
                    "symbol": "circle-open",
                    "color": MARKER_COLOUR,
                    "line": {"width": 3},
                },
            )
    figure.update_layout(
        **figure_layout(
            380,
            margin={"l": 72, "r": 14, "b": 52},
            showlegend=False,
            clickmode="event+select",
            hoverlabel={"align": "left"},
        )
    )
    figure.update_xaxes(**_axis(x, [dot.x for dot in dots]))
    figure.update_yaxes(**_axis(y, [dot.y for dot in dots]))
    return figure


class _Ring(NamedTuple):
    """The rules of a dot that say the same, and those that are yet to be drawn over them.

    Attributes:
        dimension: Action dimension.
        label: What the rules say.
        rules: How many there are of both.
    """

    dimension: int
    label: int
    rules: int


def _rings(dot: RuleDot) -> list[_Ring]:
    """The outermost first."""
    counts = sorted(Counter((rule.dimension, rule.label) for rule in dot.rules).items())
    left, rings = len(dot.rules), []
    for (dimension, label), count in counts:
        rings.append(_Ring(dimension, label, left))
        left -= count
    return rings


def dot_text(dot: RuleDot, rule_set: RuleSet) -> str:
    """What a dot says of its rules: the sentence of the first one, its numbers, and how many more.

    Args:
        dot: At least one rule.
        rule_set: Knows the names.

    Returns:
        Lines as Plotly has them.
    """
    rule, features = dot.rules[0], rule_set.source.features
    lines = []
    if len(dot.rules) > 1:
        says = Counter(says_text(one, rule_set.actions[one.dimension]) for one in dot.rules)
        lines.append(f"<b>{len(dot.rules):,} rules with these two numbers</b>")
        lines += _wrapped(", ".join(f"{count:,} {name}" for name, count in says.most_common()))
        lines.append("The one with the most states:")
    name, *rest = _wrapped(f"{rule_set.name_of(rule)}: {sentence(rule, rule_set)}")
    lines += [f"<b>{name}</b>" if len(dot.rules) == 1 else name, *rest]
    numbers = [
        f"{measure.title.lower()} {measure.text(measure.read(rule, features))}"
        for measure in measures_of([rule], features)
    ]
    return "<br>".join([*lines, *_wrapped(" · ".join(numbers))])


def _wrapped(text: str) -> list[str]:
    return [plain(line) for line in wrap(text, _LINE)]


def _size(rules: int, most: int, least: float) -> float:
    """Pixels across: one rule is the least dot, and the area grows with their number."""
    largest = min(least * math.sqrt(most), _LARGEST_SIZE)
    if most <= 1:
        return least
    return least + (largest - least) * (math.sqrt(rules) - 1) / (math.sqrt(most) - 1)


def _axis(measure: RuleMeasure, values: Sequence[float]) -> dict[str, Any]:
    low, high = min(values, default=0.0), max(values, default=1.0)
    axis: dict[str, Any] = {
        "title": {"text": measure.title, "standoff": 10},
        "fixedrange": True,
        "zeroline": False,
        "tickmode": "array",
    }
    if low == high:  # around one number there is no other round one
        room = 0.1 * (abs(low) or 1.0)
        axis["range"] = [low - room, high + room]
        return axis | {"tickvals": [low], "ticktext": [measure.text(low)]}
    if measure.powers and 0 < low <= high / _DECADES:
        axis["type"] = "log"
        ticks = _power_ticks(measure, low, high)
    elif measure.share:
        return axis | share_ticks(low, high)
    else:
        ticks = round_ticks(low, high, 6, whole=measure.whole)
    texts = [f"{tick_text(tick)} %" if measure.share else tick_text(tick) for tick in ticks]
    places = [tick / 100 for tick in ticks] if measure.share else ticks
    return axis | {"tickvals": places, "ticktext": texts}


def _power_ticks(measure: RuleMeasure, low: float, high: float) -> list[float]:
    """Powers of ten, of shares as percentages; where those are few, what lies halfway, too."""
    factor = 100 if measure.share else 1
    powers = range(math.floor(math.log10(factor * low)), math.ceil(math.log10(factor * high)) + 1)
    steps = (1,) if factor * high > 1_000 * factor * low else (1, 3)
    ticks = [float(f"{step}e{power}") for power in powers for step in steps]
    return [tick for tick in ticks if factor * low * 0.99 <= tick <= factor * high * 1.01]
