"""A study as a page of its own and as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from sarl_core.explaining.figures.markup import plain
from sarl_core.explaining.figures.png import Draw, sheet
from sarl_core.paper.chance import how_decided
from sarl_core.paper.report import Entry
from sarl_core.paper.study import Drawing, Study, replication
from sarl_core.paper.verdicts import Verdict

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

SCRIPT = "plotly.min.js"  # beside the pages, which share it
# Where the script is not there, or may not run, a page shows its picture.
_SOONEST = "python -m sarl_core reproduce --figure table-1 --out DIR"
_LIVE = '<script>if (window.Plotly) document.documentElement.className = "live";</script>'

_WIDTH = 1240  # of a picture, in points
_INK = "#1d2730"
_STYLE = """
body { margin: 0; font: 16px/1.5 system-ui, sans-serif; color: #1d2730; background: #ffffff; }
main { max-width: 1240px; margin: 0 auto; padding: 24px; }
h1 { font-size: 1.7rem; margin: 0 0 0.4rem; } h2 { font-size: 1.2rem; margin: 2rem 0 0.5rem; }
p.about, footer { color: #51606c; max-width: 75ch; }
.row { display: none; flex-wrap: wrap; gap: 12px; }
.live .row { display: flex; }
.live .still { display: none; }
.still img { max-width: 100%; }
figure { margin: 0 0 16px; min-width: min(420px, 100%); }
figcaption { font-weight: 600; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 8px 14px 8px 0;
  border-bottom: 1px solid #d5dde3; }
td.verdict { white-space: nowrap; font-weight: 600; }
small { color: #51606c; display: block; }
code { overflow-wrap: anywhere; }
@media (max-width: 700px) {
  thead { display: none; } tr { display: block; padding: 10px 0; border-bottom: 1px solid #d5dde3; }
  td { display: block; border: none; padding: 3px 0; }
}
"""
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
    parts = study.parts(frame)
    figures = []
    for part in parts:
        for row in in_rows(study.draw(frame, part, False)):
            figures.append('<div class="row">')
            figures += [
                f'<figure style="flex: {one.share:g} 1 0"><figcaption>{escape(one.title)}'
                f"</figcaption>{_html(one.figure, f'{study.slug}_{number}')}</figure>"
                for number, one in enumerate(row, len(figures))
            ]
            figures.append("</div>")
    claims = [
        f"<tr><td>{escape(one.paper)}<small>{escape(one.where)}</small></td>"
        f"<td>{escape(one.ours)}<small>{escape(how_decided(one))}</small></td>"
        f'<td class="verdict" style="color: {_COLOURS[one.verdict]}">{one.verdict}</td></tr>'
        for one in entry.claims
    ]
    table = (
        "<h2>What the paper says, and what we find</h2><table><thead><tr><th>The paper</th>"
        f"<th>Here</th><th></th></tr></thead><tbody>{''.join(claims)}</tbody></table>"
        if claims
        else ""
    )
    quick = "<p><strong>A quick run: these numbers mean little.</strong></p>" if entry.quick else ""
    title = escape(f"{study.place}. {study.title}")
    versions = ", ".join(f"{name} {version}" for name, version in entry.versions.items())
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{title}</title><script src="{SCRIPT}"></script>{_LIVE}<style>{_STYLE}</style>'
        "</head>"
        f'<body><main><h1>{title}</h1><p class="about">{escape(study.about)} Made from '
        f"{replication(frame)} for each environment.</p>{quick}"
        f"{_still(study, entry)}{''.join(figures)}{table}"
        f"<footer><p>Made on {escape(entry.made)} by <code>{escape(entry.command)}</code>, with "
        f"{escape(versions)}. Every value is in "
        f'<a href="{escape(entry.files["table"])}">{escape(entry.files["table"])}</a>, and the '
        'seeds in <a href="report.json">report.json</a>.</p></footer></main></body></html>\n'
    )


def _still(study: Study, entry: Entry) -> str:
    return (
        f'<div class="still"><img loading="lazy" src="{escape(entry.files["picture"])}" '
        f'alt="{escape(f"{study.place}. {study.title}")}">'
        f'<p class="about">This is a picture, because {SCRIPT} is not beside this page, or no '
        "code may run in it. Every run of <code>reproduce</code> into this folder brings the "
        f"interactive figures back, soonest <code>{escape(_SOONEST)}</code>.</p></div>"
    )


def _html(figure: go.Figure, name: str) -> str:
    figure.update_layout(template="plotly_white", font={"color": _INK})
    html: str = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        default_width="100%",
        div_id=name,  # else a new one at random, and every page would change every time
        config={"displaylogo": False, "responsive": True},
    )
    return html


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
