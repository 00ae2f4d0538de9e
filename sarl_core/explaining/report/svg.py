"""Small pictures of a report: SVG that stretches with the page, without script and without text.

Places are percentages of the width, so that nothing in them shrinks on a small screen. What they
show is said beside them in words, or in their label.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.explaining.markup import percent
from sarl_core.explaining.templates import render

# Of the page's own style, light or dark. The colours of actions stay those of actions.
NEUTRAL, BAD, MUTED = "var(--fill)", "var(--bad)", "var(--muted)"


class SvgScale(NamedTuple):
    """Numbers from left to right.

    Attributes:
        low: At the left edge.
        high: At the right edge, above `low`.
    """

    low: float
    high: float

    @classmethod
    def over(cls, values: Sequence[float], *, margin: float = 0.0) -> SvgScale:
        """The scale that shows all of some finite numbers.

        Args:
            values: At least one.
            margin: Room at either end, as a share of the width.

        Returns:
            Some width, even where all numbers are equal.
        """
        low, high = min(values), max(values)
        room = (high - low) * margin or (0.0 if low < high else max(abs(low), 1.0) / 2)
        return cls(low - room, high + room)

    def place(self, value: float) -> float:
        """Where a number stands, 0 to 1; those outside stand at the edge."""
        return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)


class Shape(NamedTuple):
    """Something drawn.

    Attributes:
        tag: Of the element.
        attributes: Its own; those that are None are left out.
    """

    tag: str
    attributes: dict[str, str | None]


def share_bar(share: float, colour: str) -> Markup:
    """A share as a bar; said in words beside it.

    Args:
        share: 0 to 1.
        colour: As "#0072B2", or one of the page's.

    Returns:
        SVG.
    """
    track = _box(0, 1, 0, 12, "track")
    return _picture("bar", 12, [track, _box(0, share, 0, 12, fill=colour)])


def evidence_bar(
    share: float, interval: tuple[float, float] | None, *, below: bool, threshold: float | None
) -> Markup:
    """A share with its interval, and the threshold it had to reach; said in words beside it.

    Args:
        share: 0 to 1.
        interval: Its lower and upper end; None for none.
        below: Whether the interval lies below the threshold.
        threshold: Marked by a line, None for no line.

    Returns:
        SVG.
    """
    parts = [_box(0, 1, 5, 8, "track"), _box(0, share, 5, 8, fill=BAD if below else NEUTRAL)]
    if threshold is not None:
        parts.append(_line(threshold, 0, 18, "mark"))
    if interval is not None:
        low, high = interval
        parts += [_across(low, high, 9, "ink"), _line(low, 5, 13, "ink"), _line(high, 5, 13, "ink")]
    return _picture("bar", 18, parts)


def interval_bar(
    scale: SvgScale, data: tuple[float, float], bounds: tuple[float, float], states: Sequence[float]
) -> Markup:
    """What a rule asks of a feature, against the data; said in words beside it.

    Args:
        scale: From left to right.
        data: Least and largest demonstrated value.
        bounds: The rule's bounds, infinite where there is none.
        states: Least and largest value of the rule's own states; () where it has none.

    Returns:
        SVG.
    """
    low, high = (scale.place(value) for value in bounds)
    parts = [
        _box(scale.place(data[0]), scale.place(data[1]), 5, 6, "track"),
        _box(low, high, 3, 10, "asked"),
    ]
    if states:
        first, last = (scale.place(value) for value in states)
        parts.append(_box(first, max(last, first + 0.006), 6, 4, "states"))
    for place, bound in ((low, bounds[0]), (high, bounds[1])):
        if math.isfinite(bound):
            parts.append(_line(place, 0, 16, "edge"))
    return _picture("bar", 16, parts)


def columns(
    values: Sequence[float], label: str, colours: Sequence[str], *, zero: float, top: float
) -> Markup:
    """Numbers as columns, side by side.

    Args:
        values: Finite.
        label: What is seen, in words.
        colours: One a column.
        zero: Where the columns begin.
        top: The upper edge, or the lower one if below `zero`; see `column_range`.

    Returns:
        SVG.
    """
    height = 84.0
    low, high = min([zero, top, *values]), max([zero, top, *values])
    span = (high - low) or 1.0
    width = 1 / max(len(values), 1)
    ground = height * (high - zero) / span
    parts = []
    for index, (value, colour) in enumerate(zip(values, colours, strict=True)):
        end = height * (high - value) / span
        y, tall = min(ground, end), max(abs(end - ground), 0.8)
        x = (index + 0.1) * width
        parts.append(_box(x, x + 0.8 * width, round(y, 1), round(tall, 1), fill=colour))
    parts.append(_across(0, 1, round(ground, 1), "axis"))
    return _picture("columns", int(height), parts, label)


def dot_and_interval(
    scale: SvgScale, value: float, low: float, high: float, *, colour: str, zero: bool
) -> Markup:
    """A number and how sure one can be of it; said in words beside it.

    Args:
        scale: The same for all that are compared.
        value: The number.
        low: Lower end of its interval.
        high: Upper end.
        colour: Of the dot.
        zero: Whether to mark zero, where the scale has it inside.

    Returns:
        SVG.
    """
    parts = [_across(0, 1, 8, "axis")]
    if zero and scale.low < 0 < scale.high:
        parts.append(_line(scale.place(0.0), 0, 16, "axis"))
    parts.append(_across(scale.place(low), scale.place(high), 8, "wide", colour))
    places = {"cx": percent(scale.place(value)), "cy": "8", "r": "4.5"}
    parts.append(_shape("circle", places, "dot", f"fill:{colour}"))
    return _picture("bar", 16, parts)


def _box(
    start: float, end: float, y: float, height: float, css: str = "", *, fill: str = ""
) -> Shape:
    places = {
        "x": percent(start),
        "y": f"{y:g}",
        "width": percent(max(end - start, 0.0)),
        "height": f"{height:g}",
    }
    return _shape("rect", places, css, f"fill:{fill}" if fill else "")


def _line(at: float, top: float, bottom: float, css: str) -> Shape:
    place = percent(at)
    return _shape("line", {"x1": place, "x2": place, "y1": f"{top:g}", "y2": f"{bottom:g}"}, css)


def _across(start: float, end: float, y: float, css: str, colour: str = "") -> Shape:
    places = {"x1": percent(start), "x2": percent(end), "y1": f"{y:g}", "y2": f"{y:g}"}
    return _shape("line", places, css, f"stroke:{colour}" if colour else "")


def _shape(tag: str, places: dict[str, str], css: str = "", style: str = "") -> Shape:
    return Shape(tag, {**places, "class": css or None, "style": style or None})


def _picture(css: str, height: int, shapes: Sequence[Shape], label: str = "") -> Markup:
    return render("parts/svg", css=css, height=height, shapes=shapes, label=label)
