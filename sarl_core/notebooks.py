"""How a thing shows itself in a notebook: a caption and a small table, every text escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

MOST_ROWS = 30
"""Of a table in a notebook; what is more is counted."""

_TABLE = """\
<p>{{ caption }}</p>
<table>
<thead><tr>{% for name in header %}<th>{{ name }}</th>{% endfor %}</tr></thead>
<tbody>
{% for row in rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody>
</table>
{% if more %}<p>and {{ "{:,}".format(more) }} more</p>
{% endif %}"""


def table_html(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[object]], *, more: int = 0
) -> str:
    """A table for a notebook.

    Args:
        caption: Above it.
        header: Names of the columns.
        rows: One text or number a column.
        more: How many rows were left out.

    Returns:
        HTML.
    """
    from jinja2 import Environment

    table = Environment(autoescape=True).from_string(_TABLE)
    return table.render(caption=caption, header=header, rows=rows, more=more)
