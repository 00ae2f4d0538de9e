"""HTML from the templates in this folder: every text escaped, and one style sheet for all of it.

A template is compiled when it is first asked for. What a piece looks like stands in the sheet, once
on a page and not with each piece; a document that opens by itself has it in its head.
"""

from __future__ import annotations

import re
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded

if TYPE_CHECKING:
    import jinja2


def render(name: str, **values: object) -> Markup:
    """Fill in a template.

    Args:
        name: Of its file, with its folder and without the ending, as "parts/note".
        **values: What it asks for; texts are escaped, `Markup` is not.

    Returns:
        HTML without script, or a document.
    """
    return Markup(_template(name).render(values))


def whole_percents(html: Markup) -> Markup:
    """A document in which no line ends between a number and its percent sign.

    Args:
        html: The document.

    Returns:
        The same with spaces between them that do not break; commands and scripts stay as they are,
        because they are copied and run.
    """
    return Markup(
        re.sub(
            r"(<(pre|script)\b.*?</\2>)|(?<=\d) %",
            lambda part: part[1] or "\N{NO-BREAK SPACE}%",
            html,
            flags=re.DOTALL,
        )
    )


@lru_cache(maxsize=1)
def style_sheet() -> Markup:
    """What every piece of HTML looks like, on light and on dark ground.

    Returns:
        A `style` element.
    """
    return render("style", marker=MARKER_COLOUR, muted=MUTED_COLOUR, faded=faded)


@cache
def _template(name: str) -> jinja2.Template:
    return _environment().get_template(f"{name}.html.j2")


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    import jinja2  # not before it is needed: who mines and shields writes no HTML

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )
