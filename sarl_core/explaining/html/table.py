"""Short tables in HTML without script, for what follows a control; every cell escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

TABLE_STYLE = """<style>
.sarl-rows { overflow: auto; max-height: 24rem; margin-bottom: 0.5rem; }
.sarl-rows table { width: 100%; border-collapse: collapse; font-size: 0.875rem; }
.sarl-rows th { text-align: left; font-weight: 400; opacity: 0.7; white-space: nowrap;
  padding: 0 0.8rem 0.2rem 0; }
.sarl-rows th[title] { text-decoration: underline dotted; text-underline-offset: 3px;
  cursor: help; }
.sarl-rows td { padding: 0.24rem 0.8rem 0.24rem 0;
  border-top: 1px solid rgba(128,140,150,0.25); }
.sarl-rows .w { min-width: 11rem; }
.sarl-rows .m { min-width: 7rem; }
.sarl-rows .n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
</style>"""


class Column(NamedTuple):
    """What stands above the cells of a column, and how they look.

    Attributes:
        title: The heading.
        css: "n" for numbers, "m" and "w" for words that want some room and much, or "".
        told: What the heading means, "" where it says so itself.
    """

    title: str
    css: str = ""
    told: str = ""


def table_html(columns: Sequence[Column], rows: Sequence[Sequence[str]], label: str) -> str:
    """A table that scrolls within itself where there is not enough room.

    Args:
        columns: From left to right.
        rows: From top to bottom, each with a text a column.
        label: What it shows, for those who do not see it.

    Returns:
        HTML; `TABLE_STYLE` has to stand before the first.
    """
    head = "".join(
        f'<th scope="col"{_attribute("class", css)}{_attribute("title", told)}>{escape(title)}</th>'
        for title, css, told in columns
    )
    body = "".join(
        "<tr>"
        + "".join(
            f"<td{_attribute('class', column.css)}>{escape(cell)}</td>"
            for column, cell in zip(columns, row, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="sarl-rows" role="region" tabindex="0" aria-label="{escape(label)}"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _attribute(name: str, value: str) -> str:
    return f' {name}="{escape(value)}"' if value else ""
