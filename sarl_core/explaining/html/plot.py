"""The frame of a plot in HTML without script: ground, grid, numbers at two axes, and tooltips.

For plots that follow a control: a page takes them in a fraction of the time that a figure of
Plotly takes. Places are shares of the ground and text is text, so that all of it fits a wide window
and a phone alike. (Streamlit takes SVG out of HTML, so outlines are cut with ``clip-path``.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.explaining.markup import percent
from sarl_core.explaining.templates import render


class Scale(NamedTuple):
    """Numbers along an axis.

    Attributes:
        low: Where it begins.
        high: Where it ends, above `low`.
    """

    low: float
    high: float

    def place(self, value: float) -> str:
        """Where a number stands, as "12.5%"."""
        return percent((value - self.low) / (self.high - self.low))

    def length(self, first: float, last: float) -> str:
        """How far it is from one number to a larger one, likewise."""
        return percent((last - first) / (self.high - self.low))


class Axis(NamedTuple):
    """What is written along one side.

    Attributes:
        scale: Its numbers.
        ticks: Those that are written.
        texts: How.
        name: What they are; "" for nothing.
    """

    scale: Scale
    ticks: Sequence[float]
    texts: Sequence[str]
    name: str = ""


class Part(NamedTuple):
    """What is drawn on the ground of a plot.

    Attributes:
        css: How it looks.
        style: Where it stands.
    """

    css: str
    style: str


def plot(
    parts: Sequence[Part],
    across: Axis,
    upwards: Axis,
    *,
    label: str,
    height: int,
    tips: Sequence[str] = (),
    css: str = "",
) -> Markup:
    """A plot around what is drawn in it.

    Args:
        parts: Drawn one over the other on the ground, which is as wide as there is room.
        across: The axis below.
        upwards: The axis at the left.
        label: What is seen, in words, for those who do not see it.
        height: Of the ground, in pixels.
        tips: What is said where the pointer is, for as many equal parts from left to right; "" for
            nothing.
        css: Classes of the plot, beside its own.

    Returns:
        HTML.
    """
    along, up = (
        [(axis.scale.place(tick), text) for tick, text in zip(axis.ticks, axis.texts, strict=True)]
        for axis in (across, upwards)
    )
    return render(
        "parts/plot",
        parts=parts,
        along=along,
        across=across.name,
        up=up,
        upwards=upwards.name,
        label=label,
        height=height,
        tips=tips,
        css=css,
    )


def area(
    corners: Sequence[tuple[float, float]], across: Scale, upwards: Scale, colour: str
) -> Part:
    """What lies below a line, as one element that is cut along it.

    Args:
        corners: Of the line, from left to right, (x, y).
        across: The axis below.
        upwards: The axis at the left, from 0.
        colour: Of the area.

    Returns:
        For `plot`.
    """
    height = upwards.high - upwards.low
    points = [f"{across.place(x)} {percent(1 - (y - upwards.low) / height)}" for x, y in corners]
    first, last = across.place(corners[0][0]), across.place(corners[-1][0])
    outline = ",".join([f"{first} 100%", *points, f"{last} 100%"])
    return Part("area", f"background:{colour};clip-path:polygon({outline})")
