"""Drawing text and bars straight onto palette indexes, with the font that comes with Pillow."""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_left
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.rendering.film import Colour

_SHADES = 6  # between paper and ink, along the edges of the letters
_FINE = 4  # drawn as many times larger, then reduced

# Not in the font. The strokes, as points of a unit square, y downwards.
_DRAWN: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "→": (((0.05, 0.5), (0.95, 0.5)), ((0.65, 0.2), (0.95, 0.5), (0.65, 0.8))),
    "≤": (((0.85, 0.12), (0.15, 0.42), (0.85, 0.72)), ((0.15, 0.95), (0.85, 0.95))),
    "≥": (((0.15, 0.12), (0.85, 0.42), (0.15, 0.72)), ((0.15, 0.95), (0.85, 0.95))),
    "−": (((0.0, 0.5), (1.0, 0.5)),),
    "–": (((0.0, 0.5), (1.0, 0.5)),),
}
_SPLIT = re.compile(f"([{''.join(_DRAWN)}])")
_WIDTHS = {"→": 1.0, "≤": 0.6, "≥": 0.6, "−": 0.42, "–": 0.55}

PAPER: Colour = (246, 247, 249)
_WHITE: Colour = (255, 255, 255)
_INK: Colour = (31, 41, 51)
_SLATE: Colour = (92, 105, 119)
_ORANGE: Colour = (213, 94, 0)  # vermilion and blue of Okabe and Ito: told apart by everyone
_BLUE: Colour = (0, 114, 178)
_TRACK: Colour = (214, 220, 227)


class Ink(NamedTuple):
    """Shades from a ground to a colour.

    Attributes:
        ground: Index of the ground.
        first: Index of the first shade.
    """

    ground: int
    first: int

    @property
    def full(self) -> int:
        """Index of the colour itself."""
        return self.first + _SHADES - 1


class Inks(NamedTuple):
    """All inks, by what they are for."""

    text: Ink
    quiet: Ink
    changed: Ink
    agreed: Ink
    on_changed: Ink
    on_agreed: Ink
    on_quiet: Ink
    on_text: Ink


def _mix() -> tuple[tuple[Colour, ...], Inks]:
    colours: list[Colour] = [PAPER, _TRACK]
    inks: list[Ink] = []
    pairs = [(PAPER, ink) for ink in (_INK, _SLATE, _ORANGE, _BLUE)]
    pairs += [(ground, _WHITE) for ground in (_ORANGE, _BLUE, _SLATE, _INK)]
    for ground, ink in pairs:
        inks.append(Ink(colours.index(ground), len(colours)))
        for shade in range(1, _SHADES + 1):
            mixed = [g + (i - g) * shade // _SHADES for g, i in zip(ground, ink, strict=True)]
            colours.append((mixed[0], mixed[1], mixed[2]))
    return tuple(colours), Inks(*inks)


OVERLAY_COLOURS, INKS = _mix()
PAPER_INDEX, TRACK_INDEX = 0, 1


@lru_cache(maxsize=16)
def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size=size)


@lru_cache(maxsize=4096)
def text_width(text: str, size: int) -> int:
    """Width of a line of text.

    Args:
        text: One line.
        size: Of the font, in pixels.

    Returns:
        Pixels.
    """
    width = 0.0
    for run in _runs(text):
        width += size * _WIDTHS[run] + 2 if run in _DRAWN else _font(size).getlength(run)
    return int(np.ceil(width)) + 1


def fitted(text: str, size: int, width: int) -> str:
    """Shorten a line until it fits.

    Args:
        text: One line.
        size: Of the font.
        width: Pixels there are.

    Returns:
        The text, or its beginning and "…".
    """
    if text_width(text, size) <= width:
        return text
    # The rules of four joints in one sentence are long: halve, and do not count down.
    count = bisect_left(
        range(1, len(text)), True, key=lambda n: text_width(f"{text[:n].rstrip()}…", size) > width
    )
    return f"{text[:count].rstrip()}…"


def wrapped(text: str, size: int, width: int, lines: int) -> list[str]:
    """Break a text into lines.

    Args:
        text: Words.
        size: Of the font.
        width: Pixels there are.
        lines: Most lines; the last one is shortened where need be.

    Returns:
        The lines.
    """
    found: list[str] = []
    words = text.split()
    while words:
        count = 1
        while count < len(words) and text_width(" ".join(words[: count + 1]), size) <= width:
            count += 1
        if len(found) == lines - 1:
            count = len(words)
        found.append(fitted(" ".join(words[:count]), size, width))
        words = words[count:]
    return found


def _runs(text: str) -> list[str]:
    return [run for run in _SPLIT.split(text) if run]


def _writable(run: str) -> str:
    """What the font has; it knows Latin letters without accents."""
    plain = unicodedata.normalize("NFKD", run)
    return "".join(
        c if c in "…·°±" or c.isascii() else "" if unicodedata.combining(c) else "?"
        for c in plain
        if c.isprintable()
    )


@lru_cache(maxsize=1024)
def _mask(text: str, size: int, bold: bool) -> NDArray[np.uint8]:
    """Coverage of a line of text, (height, width), 0 to 255."""
    from PIL import Image, ImageDraw

    font = _font(size)
    ascent, descent = font.getmetrics()
    picture = Image.new("L", (text_width(text, size) + 2, ascent + descent + 2))
    draw = ImageDraw.Draw(picture)
    x = 0.0
    for run in _runs(text):
        if run not in _DRAWN:
            draw.text((x, 0), run, fill=255, font=font, stroke_width=0.35 if bold else 0)
            x += font.getlength(run)
            continue
        width, height = size * _WIDTHS[run], size * 0.52
        glyph = Image.new("L", (int(width + 2) * _FINE, picture.height * _FINE))
        pen = ImageDraw.Draw(glyph)
        for stroke in _DRAWN[run]:
            points = [
                ((1 + px * width) * _FINE, (ascent - height + py * height) * _FINE)
                for px, py in stroke
            ]
            pen.line(
                points, fill=255, width=int(size * (0.12 if bold else 0.09) * _FINE), joint="curve"
            )
        small = glyph.resize((int(width + 2), picture.height), Image.Resampling.BOX)
        picture.paste(small, (round(x), 0))
        x += width + 2
    return np.asarray(picture)


@lru_cache(maxsize=64)
def _rounded(width: int, height: int) -> NDArray[np.uint8]:
    from PIL import Image, ImageDraw

    large = Image.new("L", (width * _FINE, height * _FINE))
    ImageDraw.Draw(large).rounded_rectangle(
        (0, 0, width * _FINE - 1, height * _FINE - 1), radius=4 * _FINE, fill=255
    )
    return np.asarray(large.resize((width, height), Image.Resampling.BOX))


class Canvas:
    """A picture of palette indexes to draw on."""

    def __init__(self, height: int, width: int) -> None:
        """Start with paper.

        Args:
            height: In pixels.
            width: In pixels.
        """
        self.pixels = np.full((height, width), PAPER_INDEX, dtype=np.uint8)

    def box(self, left: int, top: int, width: int, height: int, index: int) -> None:
        """Fill a rectangle."""
        self.pixels[top : top + height, left : left + width] = index

    def text(
        self, left: int, top: int, text: str, size: int, ink: Ink, *, bold: bool = False
    ) -> int:
        """Write a line.

        Args:
            left: Where it begins.
            top: Upper edge of the line.
            text: One line.
            size: Of the font.
            ink: Its ground is what is there already.
            bold: Whether its strokes are thicker.

        Returns:
            Where it ends.
        """
        self._stain(left, top, _mask(_clean(text), size, bold), ink)
        return left + text_width(_clean(text), size)

    def text_right(self, right: int, top: int, text: str, size: int, ink: Ink) -> None:
        """Write a line that ends at `right`."""
        self.text(right - text_width(_clean(text), size), top, text, size, ink)

    def label(self, left: int, top: int, text: str, size: int, ground: Ink, ink: Ink) -> int:
        """Write on a rounded label, and give where it ends."""
        width, height = text_width(text, size) + 14, size + 8
        self._stain(left, top, _rounded(width, height), ground)
        self.text(left + 7, top + 3, text, size, ink, bold=True)
        return left + width

    def _stain(self, left: int, top: int, mask: NDArray[np.uint8], ink: Ink) -> None:
        target = self.pixels[top : top + mask.shape[0], left : left + mask.shape[1]]
        mask = mask[: target.shape[0], : target.shape[1]]
        shades = (mask.astype(np.uint16) * _SHADES + 127) // 255
        marked = shades > 0
        target[marked] = (ink.first + shades[marked] - 1).astype(np.uint8)


@lru_cache(maxsize=4096)
def _clean(text: str) -> str:
    return "".join(run if run in _DRAWN else _writable(run) for run in _runs(text))
