"""Where marks lie over figures: they move by style alone, while a figure would be drawn anew."""

from __future__ import annotations

from markupsafe import Markup

from sarl_core.explaining.templates import render


def placed(key: str, **places: str) -> Markup:
    """Style that puts the marks of a container in their places.

    Args:
        key: Of the container.
        **places: What the style sheet asks for, as ``left="58px"``.

    Returns:
        HTML without anything to see.
    """
    return render("parts/places", key=key, places=places)
