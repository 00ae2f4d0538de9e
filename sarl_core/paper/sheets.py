"""A study as a page of its own and as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING

from markupsafe import Markup

from sarl_core.explaining.figures.png import Draw, sheet
from sarl_core.explaining.markup import plain
from sarl_core.explaining.templates import render
from sarl_core.paper.chance import how_decided
from sarl_core.paper.report import Entry
from sarl_core.paper.study import Drawing, Study, replication
from sarl_core.paper.verdicts import Verdict

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

SCRIPT = "plotly.min.js"  # beside the pages, which share it
_SOONEST = "python -m sarl_core reproduce --figure table-1 --out DIR"

_WIDTH = 1240  # of a picture, in points
_INK = "#1d2730"
_COLOURS: dict[Verdict, str] = {
    "agrees": "#00694b",
    "partly": "#8a5a00",
    "does not agree": "#a83f00",
    "cannot be judged": "#51606c",
}


def in_rows(drawings: Sequence[Drawing]) -> list[list[Drawing]]:
    """Drawings as they stand beside each other.

    Args:
        drawings: In order.

    Returns:
        Rows whose shares of the width add up to 1 at most.
    """
    rows: list[list[Drawing]] = []
    for drawing in drawings:
        if rows and sum(one.share for one in rows[-1]) + drawing.share <= 1.001:
            rows[-1].append(drawing)
        else:
            rows.append([drawing])
    return rows


def page(study: Study, frame: pd.DataFrame, entry: Entry) -> str:
    """A study as an HTML page: with `SCRIPT` beside it interactive, without it a picture.

    Args:
        study: The study.
        frame: Its table.
        entry: What the report says of it.

    Returns:
        The page.
    """
    number = count(1)
    rows = [
        [
            (f"{one.share:g}", one.title, _html(one.figure, f"{study.slug}_{next(number)}"))
            for one in row
        ]
        for part in study.parts(frame)
        for row in in_rows(study.draw(frame, part, False))
    ]
    return render(
        "documents/sheet",
        title=f"{study.place}. {study.title}",
        about=f"{study.about} Made from {replication(frame)} for each environment.",
        script=SCRIPT,
        soonest=_SOONEST,
        entry=entry,
        rows=rows,
        claims=[(one, how_decided(one), _COLOURS[one.verdict]) for one in entry.claims],
    )


def _html(figure: go.Figure, name: str) -> Markup:
    figure.update_layout(template="plotly_white", font={"color": _INK})
    return Markup(
        figure.to_html(
            full_html=False,
            include_plotlyjs=False,
            default_width="100%",
            div_id=name,  # else a new one at random, and every page would change every time
            config={"displaylogo": False, "responsive": True},
        )
    )


def picture(study: Study, frame: pd.DataFrame, draw: Draw) -> bytes:
    """A study as one picture, all its parts under each other.

    Args:
        study: The study.
        frame: Its table.
        draw: Draws one figure.

    Returns:
        A PNG file.
    """
    rows = [row for part in study.parts(frame) for row in in_rows(study.draw(frame, part, False))]
    return sheet([[draw(_titled(one)) for one in row] for row in rows])


def _titled(drawing: Drawing) -> go.Figure:
    figure = drawing.figure
    margin = figure.layout.margin
    figure.update_layout(
        template="plotly_white",
        width=round(_WIDTH * drawing.share),
        height=figure.layout.height + 68,
        margin={
            "t": (margin.t or 0) + 48,
            "b": (margin.b or 0) + 20,
            "l": (margin.l or 0) + 12,
            "r": (margin.r or 0) + 8,
        },
        title={
            "text": plain(drawing.title),
            "font": {"size": 15},
            "x": 0.02,
            "y": 0.985,
            "yanchor": "top",
        },
        paper_bgcolor="#ffffff",
        plot_bgcolor="#ffffff",
        font={"color": _INK},
    )
    return figure
