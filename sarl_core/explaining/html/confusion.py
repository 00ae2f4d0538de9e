"""What one rule set says where another says something, as a table in colour.

In HTML without script; every name escaped.
"""

from __future__ import annotations

from html import escape

import numpy as np

from sarl_core.explaining.figures.colours import MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.html.scrolling import WIDE_STYLE, wide_html
from sarl_core.explaining.report.svg import layer_colour
from sarl_core.explaining.words.difference import kinds_text, said_text
from sarl_core.mining.language import counted
from sarl_core.shielding.disagreement import Disagreement

_WIDTH = 88  # percent of the table that the columns share

_STYLE = (
    WIDE_STYLE
    + """<style>
.sarl-confusion { margin: 0; }
.sarl-confusion figcaption { font-size: 0.875rem; opacity: 0.75; margin-bottom: 0.7rem;
  overflow-wrap: anywhere; }
.sarl-confusion table { width: 100%; border-collapse: separate; border-spacing: 2px;
  font-size: 0.85rem; }
.sarl-confusion th, .sarl-confusion td { border: 0; text-align: center; }
.sarl-confusion th { font-weight: 400; padding: 0 3px; }
.sarl-confusion td { height: 2.7rem; min-width: 2.8rem; padding: 0 4px;
  font-variant-numeric: tabular-nums; }
.sarl-confusion td.same { background: SAME; }
.sarl-confusion .axis { font-weight: 600; overflow-wrap: anywhere; }
.sarl-confusion th.axis[scope=rowgroup] { padding: 0; width: 1%; }
.sarl-confusion th.axis div { writing-mode: vertical-rl; transform: rotate(180deg);
  max-height: 14rem; margin: auto; }
.sarl-confusion th.name { border: 0 solid transparent; line-height: 1.25; }
.sarl-confusion th.name div { width: max-content; max-width: 9rem; overflow-wrap: break-word;
  text-wrap: balance; }
.sarl-confusion th.name[scope=col] { border-bottom-width: 5px; vertical-align: bottom; }
.sarl-confusion th.name[scope=col] div { margin: 0 auto 2px; }
.sarl-confusion th.name[scope=row] { width: 1%; border-right-width: 8px; text-align: right; }
.sarl-confusion th.name[scope=row] div { margin-left: auto; }
@media (max-width: 640px) {
  .sarl-confusion th.name div { max-width: 4.8rem; }
  .sarl-confusion th.name[scope=col] div { width: auto; }
  .sarl-confusion th.axis[scope=colgroup] { text-align: left; } }
</style>""".replace("SAME", faded(MUTED_COLOUR, 0.28))
)


def confusion_html(
    found: Disagreement, dimension: int, *, names: tuple[str, str], noun: str = "state"
) -> str:
    """How many states the first set says one thing of and the second another.

    Args:
        found: The comparison.
        dimension: Action dimension.
        names: What the two sets are called.
        noun: What a state is called.

    Returns:
        HTML: a row for each thing the first says, a column for each the second says, "no rule"
        last. Where both say the same the cells are grey; elsewhere the darker the more states.
        Above it the numbers of states by kind; it may be wider than the screen and then scrolls.
    """
    action = found.first.actions[dimension]
    counts = found.confusion(dimension)
    size = len(counts)
    said = [said_text(label, action) for label in range(size)]
    most = int((counts - np.diag(np.diag(counts))).max())
    rows = []
    for row in range(size):
        cells = []
        for column in range(size):
            count = int(counts[row, column])
            told = f"{names[0]}: {said[row]}; {names[1]}: {said[column]}; {counted(count, noun)}"
            cells.append(_cell(count, told, same=row == column, most=most))
        axis = _first_axis(names[0], size) if row == 0 else ""
        rows.append(f"<tr>{axis}{_name(said[row], row, size, 'row')}{''.join(cells)}</tr>")
    columns = "".join(_name(text, column, size, "col") for column, text in enumerate(said))
    title = f"What {names[0]} says against what {names[1]} says, in numbers of states"
    table = (
        f'<table aria-label="{escape(title)}"><thead><tr><td colspan="2" rowspan="2"></td>'
        f'<th class="axis" scope="colgroup" colspan="{size}">{escape(names[1])} says</th></tr>'
        f"<tr>{columns}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )
    return (
        f'{_STYLE}<figure class="sarl-confusion"><figcaption>{_caption(found, dimension, names)}'
        f"</figcaption>{wide_html(table, title)}</figure>"
    )


def _caption(found: Disagreement, dimension: int, names: tuple[str, str]) -> str:
    grey = "Grey: both say the same."
    if not found.differs[:, dimension].any():
        return grey
    told = (f"the first ({names[0]})", f"the second ({names[1]})")
    return f"Differently: {escape(kinds_text(found, dimension, told))}. {grey}"


def _first_axis(name: str, size: int) -> str:
    return f'<th class="axis" scope="rowgroup" rowspan="{size}"><div>{escape(name)} says</div></th>'


def _name(text: str, label: int, size: int, scope: str) -> str:
    """The head of a row or column, with a stripe in the action's colour; "no rule" has none."""
    side = "bottom" if scope == "col" else "right"
    look = f"border-{side}-color:{label_colour(label)}" if label < size - 1 else ""
    if scope == "col":  # all as wide, whatever they are called
        look = f"width:{_WIDTH / size:.2f}%;{look}"
    return f'<th class="name" scope="{scope}" style="{look}"><div>{escape(text)}</div></th>'


def _cell(count: int, told: str, *, same: bool, most: int) -> str:
    text, look = f"{count:,}" if count else "", ""
    if same:
        look = ' class="same"'
    elif count:
        ground, ink = layer_colour(count / most)
        look = f' style="background:{ground};color:{ink}"'
    return f'<td title="{escape(told)}"{look}>{text}</td>'
