"""The rules by features as a picture, drawn without a browser."""

from __future__ import annotations

import io
from collections.abc import Sequence

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.html.rule_matrix import PLACED_LEGEND, PLACED_MARK, RuleMatrix
from sarl_core.mining.action_words import says_label
from sarl_core.mining.language import number_text, one_line, share_text
from sarl_core.mining.rules import Rule
from sarl_core.rendering.canvas import shipped_font

_SCALE = 2  # pixels a unit, for sharp print
_ROW, _CELL, _TEXT = 20, 96, 11
_ACTION, _STATES, _AGREES, _HEAD, _MARGIN = 170, 62, 96, 50, 14
_INK, _MUTED, _LINE, _GROUND = "#1d2730", "#5b6a76", "#d5dde3", "#ffffff"


def matrix_png(matrix: RuleMatrix, rules: Sequence[Rule]) -> bytes:
    """Some rows as a picture on light ground.

    Args:
        matrix: What is to be drawn.
        rules: Some of its rules, as those of one page.

    Returns:
        A PNG file.
    """
    from PIL import Image, ImageDraw

    first = _MARGIN + _ACTION + _STATES + _AGREES
    width = first + _CELL * len(matrix.columns) + _MARGIN
    placed = any(rule.placed for rule in rules)
    height = 2 * _MARGIN + _HEAD + _ROW * (len(rules) + placed)
    picture = Image.new("RGB", (width * _SCALE, height * _SCALE), _GROUND)
    pen = ImageDraw.Draw(picture)
    font = shipped_font(_TEXT * _SCALE)
    small = shipped_font((_TEXT - 2) * _SCALE)

    def write(
        left: float, top: float, text: str, room: float, *, right: bool = False, muted: bool = False
    ) -> None:
        used = small if muted else font
        line = one_line(text)
        while len(line) > 1 and pen.textlength(line, font=used) > room * _SCALE:
            line = f"{line[:-2]}…" if line.endswith("…") else f"{line[:-1]}…"
        at = left + room - pen.textlength(line, font=used) / _SCALE if right else left
        pen.text((at * _SCALE, top * _SCALE), line, fill=_MUTED if muted else _INK, font=used)

    def box(left: float, top: float, right: float, bottom: float, colour: str) -> None:
        pen.rectangle([left * _SCALE, top * _SCALE, right * _SCALE, bottom * _SCALE], fill=colour)

    write(_MARGIN, _MARGIN, "Action", _ACTION - 8)
    write(_MARGIN + _ACTION, _MARGIN, "States", _STATES - 8, right=True)
    write(_MARGIN + _ACTION + _STATES, _MARGIN, "Expert agrees", _AGREES - 8, right=True)
    for place, column in enumerate(matrix.columns):
        left = first + place * _CELL
        for line, words in enumerate(_two_lines(column.name.name)):
            write(left + 4, _MARGIN + 14 * line, words, _CELL - 8)
        low = number_text(column.low, apart_from=column.high)
        high = number_text(column.high, apart_from=column.low)
        scale = f"{low} to {high} {column.name.unit}"
        write(left + 4, _MARGIN + 30, scale, _CELL - 8, muted=True)
    for number, rule in enumerate(rules):
        top = _MARGIN + _HEAD + number * _ROW
        box(_MARGIN, top, width - _MARGIN, top + 0.5, _LINE)
        colour = label_colour(rule.label)
        dimension = matrix.rule_set.actions[rule.dimension]
        box(_MARGIN, top + 6, _MARGIN + 9, top + 15, colour)
        label = says_label(rule, dimension)
        if len(matrix.rule_set.actions) > 1 or dimension.is_interval:
            label = f"{dimension.name}: {label}"
        label = f"{PLACED_MARK}{label}" if rule.placed else label
        label += "" if rule.enabled else ", off"
        write(_MARGIN + 14, top + 4, label, _ACTION - 22)
        write(_MARGIN + _ACTION, top + 4, f"{rule.samples:,}", _STATES - 8, right=True)
        share = share_text(rule.confidence) if rule.samples else "–"
        write(_MARGIN + _ACTION + _STATES, top + 4, share, _AGREES - 8, right=True)
        bars = matrix.bars(rule)
        for place, column in enumerate(matrix.columns):
            left = first + place * _CELL
            box(left, top, left + 0.5, top + _ROW, _LINE)
            bar = bars.get(column.feature)
            if bar is not None:
                start = left + bar.left / 100 * _CELL
                end = max(left + bar.right / 100 * _CELL, start + 1.5)
                box(start, top + 5, end, top + 15, colour)
    if placed:
        below = _MARGIN + _HEAD + len(rules) * _ROW
        write(_MARGIN, below + 8, PLACED_LEGEND, width - 2 * _MARGIN, muted=True)
    content = io.BytesIO()
    picture.save(content, format="PNG")
    return content.getvalue()


def _two_lines(name: str) -> list[str]:
    """A name divided between two words, if it is long."""
    if len(name) <= 14 or " " not in name:
        return [name]
    gaps = [place for place, sign in enumerate(name) if sign == " "]
    middle = min(gaps, key=lambda place: abs(place - len(name) / 2))
    return [name[:middle], name[middle + 1 :]]
