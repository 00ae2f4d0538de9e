"""The frame of a plot in HTML without script: ground, grid, numbers at two axes, and tooltips.

For plots that follow a control: a page takes them in a fraction of the time that a figure of
Plotly takes. Places are shares of the ground and text is text, so that all of it fits a wide window
and a phone alike. (Streamlit takes SVG out of HTML, so outlines are cut with ``clip-path``.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # of round numbers

PLOT_STYLE = """<style>
.sarl-plot { position: relative; margin: 0.4rem 0.6rem 0 3.4rem; }
.sarl-plot i, .sarl-plot b { position: absolute; }
.sarl-plot .grid { left: 0; right: 0; height: 1px; background: currentColor; opacity: 0.13; }
.sarl-plot small { position: absolute; font-size: 0.8rem; line-height: 1; opacity: 0.65;
  white-space: nowrap; font-variant-numeric: tabular-nums; }
.sarl-plot .y { right: 100%; margin-right: 0.45rem; transform: translateY(50%); }
.sarl-plot .x { top: 100%; margin-top: 0.4rem; transform: translateX(-50%); }
.sarl-plot .bins { position: absolute; inset: 0; display: flex; }
.sarl-plot .bins u { flex: 1 1 0; }
.sarl-plot .bins u[title]:hover { background: rgba(128,140,150,0.16); }
.sarl-plot-name { font-size: 0.8rem; opacity: 0.75; }
.sarl-plot-under { text-align: center; margin: 1.5rem 0.6rem 0 3.4rem; }
</style>"""


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
        return f"{100 * (value - self.low) / (self.high - self.low):.2f}%"

    def length(self, first: float, last: float) -> str:
        """How far it is from one number to a larger one, likewise."""
        return f"{100 * (last - first) / (self.high - self.low):.2f}%"


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


def plot(
    content: str,
    across: Axis,
    upwards: Axis,
    *,
    label: str,
    height: int,
    tips: Sequence[str] = (),
) -> str:
    """A plot around what is drawn in it.

    Args:
        content: HTML of parts that are placed on the ground, which is as wide as there is room.
        across: The axis below.
        upwards: The axis at the left.
        label: What is seen, in words, for those who do not see it.
        height: Of the ground, in pixels.
        tips: What is said where the pointer is, for as many equal parts from left to right; "" for
            nothing.

    Returns:
        HTML without script; `label`, `tips` and the axes' texts are escaped. `PLOT_STYLE` has to
        stand before the first.
    """
    grid = "".join(
        f'<i class="grid" style="bottom:{upwards.scale.place(tick)}"></i>' for tick in upwards.ticks
    )
    numbers = "".join(
        f'<small class="y" style="bottom:{upwards.scale.place(tick)}">{escape(text)}</small>'
        for tick, text in zip(upwards.ticks, upwards.texts, strict=True)
    ) + "".join(
        f'<small class="x" style="left:{across.scale.place(tick)}">{escape(text)}</small>'
        for tick, text in zip(across.ticks, across.texts, strict=True)
    )
    bins = "".join(f'<u title="{escape(tip)}"></u>' if tip else "<u></u>" for tip in tips)
    above = f'<div class="sarl-plot-name">{escape(upwards.name)}</div>' if upwards.name else ""
    below = f'<div class="sarl-plot-name sarl-plot-under">{escape(across.name) or "&nbsp;"}</div>'
    return (
        f'{above}<div class="sarl-plot" style="height:{height}px">'
        f'<div role="img" aria-label="{escape(label)}">{grid}{content}</div>'
        f'<span aria-hidden="true">{numbers}</span>'
        f'<div class="bins" aria-hidden="true">{bins}</div></div>{below}'
    )


def round_ticks(low: float, high: float, most: int, *, whole: bool = False) -> list[float]:
    """Round numbers for an axis.

    Args:
        low: Where it begins.
        high: Where it ends, above `low`.
        most: So many, and one more where it begins with a round number.
        whole: Whether only whole numbers will do.

    Returns:
        Ascending, evenly apart, at least one where there is a round number in between.
    """
    rough = max((high - low) / most, 1.0 if whole else 0.0)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(
        power * one
        for one in _STEPS
        if power * one >= rough * (1 - 1e-9) and not (whole and power * one % 1)
    )
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    digits = max(1 - math.floor(math.log10(step)), 0)  # 0.30000000000000004 is 0.3
    return [round(index * step, digits) for index in range(first, last + 1)]


def tick_text(tick: float) -> str:
    """A round number in full, since a rounded one would stand at a wrong place.

    Args:
        tick: See `round_ticks`.

    Returns:
        As "102.5".
    """
    return f"{tick:,.10g}"


def area(corners: Sequence[tuple[float, float]], across: Scale, upwards: Scale, colour: str) -> str:
    """What lies below a line, as one element that is cut along it.

    Args:
        corners: Of the line, from left to right, (x, y).
        across: The axis below.
        upwards: The axis at the left, from 0.
        colour: Of the area.

    Returns:
        HTML, to be placed on the ground of a plot.
    """
    height = upwards.high - upwards.low
    points = [
        f"{across.place(x)} {100 - 100 * (y - upwards.low) / height:.2f}%" for x, y in corners
    ]
    first, last = across.place(corners[0][0]), across.place(corners[-1][0])
    outline = ",".join([f"{first} 100%", *points, f"{last} 100%"])
    return f'<i style="inset:0;background:{colour};clip-path:polygon({outline})"></i>'
