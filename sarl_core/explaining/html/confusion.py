"""What one rule set says where another says something, as a table in colour, in HTML."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from sarl_core.explaining.colours import label_colour, layer_colour
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.markup import percent
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.difference import kinds_text, said_text
from sarl_core.mining.language import counted
from sarl_core.shielding.disagreement import Disagreement

_MOST_CHOICES = 12
_WIDTH = 0.88  # of the table, which the columns share


def confusion_html(
    disagreement: Disagreement, dimension: int, *, names: tuple[str, str], noun: str = "state"
) -> Markup:
    """How many states the first set says one thing of and the second another.

    Args:
        disagreement: The comparison.
        dimension: Action dimension.
        names: What the two sets are called.
        noun: What a state is called.

    Returns:
        HTML: a row for each thing the first says, a column for each the second says, "no rule"
        last. Where both say the same the cells are grey; elsewhere the darker the more states.
        Above it the numbers of states by kind; it may be wider than the screen and then scrolls.
        A sentence alone where rules that forbid leave too many choices for a table.
    """
    action = disagreement.first.actions[dimension]
    counts = disagreement.confusion(dimension)
    size = len(counts)
    choices = disagreement.choices[dimension]
    if len(choices) > _MOST_CHOICES:
        return note(
            f"{_caption(disagreement, dimension, names)} What the rules leave in these states are "
            f"{len(choices):,} choices of several actions, too many for a table of one against the "
            "other; the example states say what each leaves."
        )
    labels = [said_text(label, action, choices) for label in range(size)]
    most = int((counts - np.diag(np.diag(counts))).max())
    # The head of a row or column has a stripe in the action's colour; "no rule" has none.
    # Where some are forbidden it is that of the first of them, as of the rule.
    of = [
        *range(action.n_labels),
        *(next(label for label in range(size) if label not in left) for left in choices),
    ]
    heads = [*zip(labels, map(label_colour, of), strict=False), (labels[-1], "")]
    # Every label has its place, and of what several rules leave what there is.
    above, beside = (
        [place for place in range(size) if not action.n_labels <= place < size - 1 or said[place]]
        for said in (counts.sum(axis=0), counts.sum(axis=1))
    )
    rows = []
    for row in beside:
        cells = []
        for column in above:
            count = int(counts[row, column])
            tip = f"{names[0]}: {labels[row]}; {names[1]}: {labels[column]}; {counted(count, noun)}"
            same = row == column
            look = ("", "") if same or not count else layer_colour(count / most)
            cells.append((f"{count:,}" if count else "", tip, same, *look))
        rows.append((heads[row], cells))
    return render(
        "parts/confusion",
        names=names,
        labels=[heads[column] for column in above],
        rows=rows,
        width=percent(_WIDTH / len(above)),  # all as wide, whatever they are called
        title=f"What {names[0]} says against what {names[1]} says, in numbers of states",
        caption=_caption(disagreement, dimension, names),
    )


def _caption(disagreement: Disagreement, dimension: int, names: tuple[str, str]) -> str:
    grey = "Grey: both say the same."
    if len(disagreement.choices[dimension]) > _MOST_CHOICES:
        grey = ""
    if not disagreement.differs[:, dimension].any():
        return f"Both say the same everywhere. {grey}".strip()
    sides = (f"the first ({names[0]})", f"the second ({names[1]})")
    return f"Differently: {kinds_text(disagreement, dimension, sides)}. {grey}".strip()
