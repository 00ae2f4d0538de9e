"""The colours: one for each label, the same in every table, tree, bar and overlay.

The first seven are those of Okabe and Ito, told apart with every kind of colour vision and legible
on light and on dark; their vermilion is kept for interventions. Should a label need an eighth, a
second ring follows, and a third for the many intervals of a finely divided action.
"""

from __future__ import annotations

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
        As "#0072B24C".
    """
    return f"{colour}{round(255 * opacity):02X}"
