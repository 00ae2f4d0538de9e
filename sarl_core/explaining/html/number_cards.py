"""A few numbers side by side, in HTML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.explaining.templates import render


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


def number_cards(numbers: Sequence[Number], *, framed: bool = False) -> Markup:
    """Numbers side by side, as many as there is room for, and what they mean one click away.

    Args:
        numbers: From left to right.
        framed: Whether each stands in a frame.

    Returns:
        A list of terms in HTML.
    """
    meanings = [(one.label, one.meaning) for one in numbers if one.meaning]
    return render("parts/number_cards", numbers=numbers, framed=framed, meanings=meanings)
