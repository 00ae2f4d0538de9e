"""A few numbers side by side, in HTML without script; every name escaped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

_STYLE = """<style>
.sarl-numbers { display: grid; gap: 0.6rem 0.9rem; margin: 0 !important; padding: 0 !important;
  grid-template-columns: repeat(auto-fit, minmax(8.6rem, 1fr)); }
.sarl-numbers div { margin: 0; }
.sarl-numbers.framed div { border: 1px solid rgba(128,140,150,0.3); border-radius: 0.4rem;
  padding: 0.8rem 1rem; }
.sarl-numbers dt { font-size: 0.875rem; font-weight: 400; line-height: 1.5; margin: 0; }
.sarl-numbers dd { font-size: 1.6rem; line-height: 1.35; margin: 0; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
.sarl-numbers small { display: block; font-size: 0.8rem; line-height: 1.4; opacity: 0.7; }
</style>"""
_MEANINGS_STYLE = """<style>
.sarl-meanings { font-size: 0.875rem; margin: 0.6rem 0 0; }
.sarl-meanings summary { cursor: pointer; opacity: 0.7; width: fit-content; }
.sarl-meanings p { margin: 0.25rem 0 0; }
</style>"""


class Number(NamedTuple):
    """One of them.

    Attributes:
        label: What it is called.
        value: As it is shown.
        meaning: What it counts, for whoever asks.
        was: What it was before, "" if that is the same or not known.
    """

    label: str
    value: str
    meaning: str = ""
    was: str = ""


def number_cards(numbers: Sequence[Number], *, framed: bool = False) -> str:
    """Numbers side by side, as many as there is room for, and what they mean one click away.

    Args:
        numbers: From left to right.
        framed: Whether each stands in a frame.

    Returns:
        A list of terms in HTML.
    """
    cards = "".join(
        f"<div{_tip(one.meaning)}><dt>{escape(one.label)}</dt><dd>{escape(one.value)}"
        + (f"<small>was {escape(one.was)}</small>" if one.was else "")
        + "</dd></div>"
        for one in numbers
    )
    look = "sarl-numbers framed" if framed else "sarl-numbers"
    told = meanings({one.label: one.meaning for one in numbers if one.meaning})
    return f'{_STYLE}<dl class="{look}">{cards}</dl>{told}'


def meanings(found: Mapping[str, str]) -> str:
    """What numbers mean, one click away.

    Args:
        found: What each number is called, and what it counts.

    Returns:
        HTML without script; "" where there is nothing to say.
    """
    if not found:
        return ""
    told = "".join(
        f"<p><b>{escape(label)}</b>: {escape(meaning)}.</p>" for label, meaning in found.items()
    )
    return (
        f'{_MEANINGS_STYLE}<details class="sarl-meanings">'
        f"<summary>What these numbers mean</summary>{told}</details>"
    )


def _tip(meaning: str) -> str:
    return f' title="{escape(meaning)}"' if meaning else ""
