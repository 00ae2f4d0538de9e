"""The combinations that a rule asks about, drawn in HTML: pages and reports take them alike.

Points are one picture behind the plot's grid, since an element for each would take a page seconds;
what is written stays text, in the colours of the page.
"""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import MARKER_COLOUR, faded, label_colour
from sarl_core.explaining.combination_plots import CombinationPlot, Point
from sarl_core.explaining.html.plot import Axis, Part, Scale, plot
from sarl_core.explaining.templates import render
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import condition_text, short_condition

_SIZE = 1000  # of the picture, which is stretched to the plot
_X_TICKS, _Y_TICKS = 5, 4  # at most, beside zero


def combinations_html(
    plots: Sequence[CombinationPlot],
    features: Sequence[Feature],
    dimension: LabelledDimension,
    *,
    most: int | None = None,
) -> Markup:
    """A picture for each combination that a rule asks about.

    Args:
        plots: See `combination_plots`.
        features: Those that the rule's conditions are about.
        dimension: Whose actions colour the points.
        most: Draw the first so many; None for all.

    Returns:
        The two features as axes, the demonstrations in the actions' colours, the line where the
        rule draws it, and the side that it takes shaded; "" where there are none.
    """
    if not plots:
        return Markup()
    done = np.unique(np.concatenate([one.labels for one in plots])).tolist()
    key = [(label_text(label, dimension), label_colour(label)) for label in done]
    key.append(("the side that the rule takes", faded(MARKER_COLOUR, 0.25)))
    if most is not None and len(plots) > most:
        key.append((f"the first {most} of {len(plots)} combinations", ""))
    figures = [_figure(one, features) for one in plots[:most]]
    return render("rules/features", key=key, figures=figures)


def _figure(one: CombinationPlot, features: Sequence[Feature]) -> tuple[str, Markup]:
    """What stands above a picture, and the picture."""
    feature = features[one.bounds.feature]
    first, second = (features[index] for index in one.features)
    drawn = plot(
        [Part("area", f'background:url("{_picture(one)}") 0 0/100% 100% no-repeat')],
        _axis(Scale(*one.across), _X_TICKS, first),
        _axis(Scale(*one.upwards), _Y_TICKS, second),
        label=f"{first.name} across and {second.name} upwards, of {len(one.points):,} demonstrated "
        f"states; the rule takes the side where {condition_text(one.bounds, feature)}",
        height=230,
    )
    return short_condition(one.bounds, feature), drawn


def _axis(scale: Scale, most: int, feature: Feature) -> Axis:
    ticks = round_ticks(scale.low, scale.high, most)
    name = f"{feature.name} ({feature.unit})" if feature.unit else feature.name
    return Axis(scale, ticks, list(map(tick_text, ticks)), name)


def _picture(one: CombinationPlot) -> str:
    """The address of a picture that holds itself: side, points and lines."""
    places = [_place(one, (x, y)) for x, y in one.points.tolist()]
    dots = [
        (
            label_colour(label),
            "".join(
                f"M{x} {y}h0"
                for (x, y), own in zip(places, one.labels.tolist(), strict=True)
                if own == label
            ),
        )
        for label in np.unique(one.labels).tolist()
    ]
    lines = [tuple(_place(one, end) for end in line) for line in one.lines]
    corners = " ".join(f"{x},{y}" for x, y in (_place(one, corner) for corner in one.side))
    picture = render(
        "parts/scatter", size=_SIZE, corners=corners, dots=dots, lines=lines, colour=MARKER_COLOUR
    )
    return f"data:image/svg+xml,{quote(picture)}"


def _place(one: CombinationPlot, point: Point) -> tuple[int, int]:
    """Where a state stands in the picture, from its upper left corner."""
    (left, right), (bottom, top) = one.across, one.upwards
    x, y = point
    return round(_SIZE * (x - left) / (right - left)), round(_SIZE * (top - y) / (top - bottom))
