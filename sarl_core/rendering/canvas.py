"""Drawing text and bars straight onto palette indexes, with a font that is shipped."""

from __future__ import annotations

import math
import unicodedata
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.rendering.film import Colour
from sarl_core.shipped import DATA

_SHADES = 6  # between paper and ink, along the edges of the letters
_FINE = 4  # drawn as many times larger, then reduced

FONTS = DATA / "fonts"
_RANGES = (
    (0x20, 0x7E),  # ASCII
    (0xA0, 0x17F),  # Latin letters with accents, and signs such as ° ± ² ³ · ×
    (0x386, 0x3CE),  # Greek
    (0x400, 0x45F),  # Cyrillic
    (0x2070, 0x2079),  # raised and lowered digits
    (0x2080, 0x2089),
    (0x2190, 0x2195),  # arrows
)
_SIGNS = "–—‘’“”„†•…‰′″‹›⁻₋€∂∆∈∑−∕√∞∫≈≠≤≥"
ALPHABET = frozenset(_SIGNS) | {
    chr(code)
    for first, last in _RANGES
    for code in range(first, last + 1)
    if unicodedata.name(chr(code), "") and chr(code) not in "\xadⁱ"
}
"""The characters that the font has; `docs/scripts/font.py` makes it of them."""

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
def shipped_font(size: int, bold: bool = False) -> Any:
    """The font that pictures are lettered with.

    Args:
        size: In pixels.
        bold: Whether its letters are.

    Returns:
        One of Pillow's; it has the characters of `ALPHABET`.
    """
    from PIL import ImageFont

    name = f"DejaVuSansCondensed{'-Bold' if bold else ''}.ttf"
    # Pillow's own layout, which is the same on every machine.
    return ImageFont.truetype(FONTS / name, size, layout_engine=ImageFont.Layout.BASIC)


class _Advances(dict[str, float]):
    """How far each character goes; letters stand one by one, so that these may be added up."""

    def __init__(self, size: int, bold: bool) -> None:
        super().__init__()
        self._font = shipped_font(size, bold)

    def __missing__(self, character: str) -> float:
        advance: float = self._font.getlength(_written(character))
        self[character] = advance
        return advance


@lru_cache(maxsize=16)
def _advances(size: int, bold: bool) -> _Advances:
    return _Advances(size, bold)


def _ends(text: str, size: int, bold: bool) -> NDArray[np.float64]:
    """Where each character of a line ends, (n,)."""
    advances = _advances(size, bold)
    return np.cumsum([advances[character] for character in text])


def text_width(text: str, size: int, *, bold: bool = False) -> int:
    """Width of a line of text.

    Args:
        text: One line.
        size: Of the font, in pixels.
        bold: Whether its strokes are thicker.

    Returns:
        Pixels.
    """
    advances = _advances(size, bold)
    return math.ceil(sum(advances[character] for character in text)) + 1


def fitted(text: str, size: int, width: int, *, bold: bool = False) -> str:
    """Shorten a line until it fits.

    Args:
        text: One line.
        size: Of the font.
        width: Pixels there are.
        bold: Whether its strokes are thicker.

    Returns:
        The text, or its beginning and "…".
    """
    if text_width(text, size, bold=bold) <= width:
        return text
    room = width - 1 - _advances(size, bold)["…"]
    count = int(np.searchsorted(_ends(text, size, bold), room, side="right"))
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
    broken: list[str] = []
    text = " ".join(text.split())
    while text:
        end = int(np.searchsorted(_ends(text, size, False), width - 1, side="right"))
        if end < len(text) and len(broken) < lines - 1:
            space = text.rfind(" ", 0, end + 1)
            end = space if space > 0 else text.find(" ")  # else a word alone is too long
        if end < 0 or len(broken) == lines - 1:
            end = len(text)
        broken.append(fitted(text[:end], size, width))
        text = text[end:].lstrip()
    return broken


def _written(character: str) -> str:
    """What the font has: a letter without its accent where it lacks that, else "?"."""
    if character in ALPHABET:
        return character
    if not character.isprintable():
        return ""
    plain = unicodedata.normalize("NFKD", character)
    return "".join(c if c in ALPHABET else "" if unicodedata.combining(c) else "?" for c in plain)


@lru_cache(maxsize=1024)
def _mask(text: str, size: int, bold: bool) -> NDArray[np.uint8]:
    """Coverage of a line of text, (height, width), 0 to 255."""
    from PIL import Image, ImageDraw

    font = shipped_font(size, bold)
    picture = Image.new("L", (text_width(text, size, bold=bold) + 2, sum(font.getmetrics()) + 2))
    ImageDraw.Draw(picture).text((0, 0), "".join(map(_written, text)), fill=255, font=font)
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
        self._stain(left, top, _mask(text, size, bold), ink)
        return left + text_width(text, size, bold=bold)

    def text_right(self, right: int, top: int, text: str, size: int, ink: Ink) -> None:
        """Write a line that ends at `right`."""
        self.text(right - text_width(text, size), top, text, size, ink)

    def label(self, left: int, top: int, text: str, size: int, ground: Ink, ink: Ink) -> int:
        """Write on a rounded label, and give where it ends."""
        width, height = text_width(text, size, bold=True) + 14, size + 8
        self._stain(left, top, _rounded(width, height), ground)
        self.text(left + 7, top + 3, text, size, ink, bold=True)
        return left + width

    def _stain(self, left: int, top: int, mask: NDArray[np.uint8], ink: Ink) -> None:
        target = self.pixels[top : top + mask.shape[0], left : left + mask.shape[1]]
        mask = mask[: target.shape[0], : target.shape[1]]
        shades = (mask.astype(np.uint16) * _SHADES + 127) // 255
        marked = shades > 0
        target[marked] = (ink.first + shades[marked] - 1).astype(np.uint8)
