"""One step of an episode in words, in HTML."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence

from markupsafe import Markup

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.html.table import Column, table_html
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.replay import StepView, margin_text

_STATE = (Column("State"), Column("Value", "n"), Column("Unit"))


def legend(entries: Sequence[tuple[str, str]], *, before: str = "", after: str = "") -> Markup:
    """Coloured squares and what has their colour.

    Args:
        entries: Names, and colours as "#0072B2".
        before: Words before them.
        after: Words after them, standing back.

    Returns:
        HTML.
    """
    return render("parts/legend", entries=entries, before=before, after=after)


def picture(png: bytes, alt: str, ways: Sequence[tuple[str, Markup]] = ()) -> Markup:
    """A picture that comes with the page, so that it is there as soon as the words are.

    Args:
        png: The file's content.
        alt: What is seen, in words.
        ways: What stands below it: headings, or "", and HTML.

    Returns:
        HTML, as wide as there is room.
    """
    return render("states/picture", png=b64encode(png).decode("ascii"), alt=alt, ways=ways)


def state_table(state: Sequence[tuple[str, str, str]]) -> Markup:
    """A state, a row a feature.

    Args:
        state: Name, value and unit of each feature.

    Returns:
        HTML.
    """
    rows = [(name, value, unit or "–") for name, value, unit in state]
    return table_html(_STATE, rows, "The state")


def step_card(view: StepView, *, shielded: bool, left: Sequence[str] = ()) -> Markup:
    """What the agent wanted, what was done and why, and the state in which it was done.

    Args:
        view: The step.
        shielded: Whether there was a shield.
        left: Of each action dimension what never-rules forbid there and leave, as a sentence, ""
            where they say nothing; () without such rules.

    Returns:
        HTML.
    """
    return render(
        "states/step_card",
        view=view,
        shielded=shielded,
        left=left,
        margin=margin_text(view.margin),
        state=state_table(view.state),
        label_colour=label_colour,
    )
