"""The colours: one for each label, the same in every table, tree, bar and overlay.

The first seven are those of Okabe and Ito, told apart with every kind of colour vision and legible
on light and on dark; their vermilion is kept for interventions. Should a label need an eighth, a
second ring follows, and a third for the many intervals of a finely divided action.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LABEL_COLOURS = (
    "#0072B2",  # blue
    "#E69F00",  # orange
    "#009E73",  # green
    "#CC79A7",  # purple
    "#56B4E9",  # sky
    "#D9C514",  # yellow, darkened for white ground
    "#8C8C8C",  # grey
    "#7A4FBF",
    "#A0612B",
    "#5F8F3E",
)
_MANY_COLOURS = (
    *LABEL_COLOURS,
    "#17A2A8",
    "#B493E6",
    "#A33B64",
    "#9CC53B",
    "#D2A679",
    "#5566D8",
)
INTERVENTION_COLOUR = "#D55E00"  # vermilion
OUTSIDE_COLOUR = "#C2185B"  # where the data behind a rule does not reach
MARKER_COLOUR = "#D55E00"  # what is chosen: a point, a rule's path, its interval
MUTED_COLOUR = "#8796A3"  # what is there for comparison
LAYER_SCALE = (
    # Perceptually even, from ground to ink, legible with every kind of colour vision.
    (0.0, "#f4ecd8"),
    (0.2, "#c9dcc0"),
    (0.4, "#8fc3b5"),
    (0.6, "#4f9fae"),
    (0.8, "#2c6f99"),
    (1.0, "#1c3f6e"),
)


def label_colour(index: int) -> str:
    """The colour of a label.

    Args:
        index: The label.

    Returns:
        As "#0072B2".
    """
    return _MANY_COLOURS[index % len(_MANY_COLOURS)]


def faded(colour: str, opacity: float) -> str:
    """A colour that lets the ground through.

    Args:
        colour: As "#0072B2".
        opacity: 0 to 1.

    Returns:
        As "rgba(0,114,178,0.3)", which Plotly and CSS both know.
    """
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def layer_colour(share: float) -> tuple[str, str]:
    """The colour of a cell of a landscape, and one that is legible on it.

    Args:
        share: 0 to 1, from ground to ink.

    Returns:
        Ground and text, as "#f4ecd8".
    """
    places = [place for place, _ in LAYER_SCALE]
    channels: NDArray[np.float64] = np.array(
        [[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for _, colour in LAYER_SCALE], float
    )
    mixed = [round(float(np.interp(share, places, channels[:, index]))) for index in range(3)]
    ground = "#" + "".join(f"{value:02x}" for value in mixed)
    dark, light = "#15202a", "#ffffff"
    return ground, dark if _contrast(ground, dark) >= _contrast(ground, light) else light


def chip_colour(colour: str) -> str:
    """A colour, darkened until white can be read on it: at least 4.5 to 1.

    Args:
        colour: As "#0072B2".

    Returns:
        Of the same hue; the colour itself where it is dark enough.
    """
    channels = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
    darker = (
        "#" + "".join(f"{channel * part // 100:02X}" for channel in channels)
        for part in range(100, -1, -1)
    )
    return next(one for one in darker if _contrast(one, "#ffffff") >= 4.5)


def _contrast(one: str, other: str) -> float:
    """The contrast of two colours as WCAG defines it, 1 to 21."""
    first, second = sorted((_luminance(one), _luminance(other)))
    return (second + 0.05) / (first + 0.05)


def _luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
