"""One step of an episode in words, in HTML without script; every name escaped."""

from __future__ import annotations

from base64 import b64encode
from html import escape

from sarl_core.explaining.figures.colours import label_colour
from sarl_core.explaining.html.badges import BADGE_STYLE, badge
from sarl_core.explaining.html.table import TABLE_STYLE, Column, table_html
from sarl_core.explaining.replay import ActionView, StepView, margin_text

_STYLE = (
    """<style>
.sarl-step { font-size: 0.95rem; line-height: 1.55; }
.sarl-step p { margin: 0 0 0.5rem 0; }
.sarl-step .quiet { opacity: 0.7; font-size: 0.85rem; }
</style>"""
    + TABLE_STYLE
    + BADGE_STYLE
)


def swatch(name: str, colour: str) -> str:
    """A coloured square and a name.

    Args:
        name: Of what has the colour.
        colour: As "#0072B2".

    Returns:
        HTML without script, styled in place.
    """
    return (
        f'<span style="white-space:nowrap"><span style="display:inline-block;width:.75em;'
        f'height:.75em;border-radius:2px;margin-right:.4em;background:{colour}"></span>'
        f"{escape(name)}</span>"
    )


def picture(png: bytes, alt: str) -> str:
    """A picture that comes with the page, so that it is there as soon as the words are.

    Args:
        png: The file's content.
        alt: What is seen, in words.

    Returns:
        HTML, as wide as there is room.
    """
    source = f"data:image/png;base64,{b64encode(png).decode('ascii')}"
    style = "width:100%;margin-bottom:0.7rem"
    return f'<img class="sarl-picture" style="{style}" src="{source}" alt="{escape(alt)}">'


def step_card(view: StepView, *, shielded: bool) -> str:
    """What the agent wanted, what was done and why, and the state in which it was done.

    Args:
        view: The step.
        shielded: Whether there was a shield.

    Returns:
        HTML without script.
    """
    several = len(view.actions) > 1
    parts = [
        _action(action, shielded=shielded, named=several, checked=not view.invalid)
        for action in view.actions
    ]
    if view.invalid:
        parts.append(
            f"<p><b>No rule was asked:</b> {escape(view.invalid)}. The action stays as it is.</p>"
        )
    if view.outside:
        parts.append(
            "<p><b>Outside the data:</b> this state lies beyond the values seen where the rule "
            "applies.</p>"
        )
    if shielded:
        parts.append(f'<p class="quiet">{margin_text(view.margin)}.</p>')
    rows = [(name, value, unit or "–") for name, value, unit in view.state]
    table = table_html((Column("State"), Column("Value", "n"), Column("Unit")), rows, "The state")
    return f'{_STYLE}<div class="sarl-step">{"".join(parts)}{table}</div>'


def _action(action: ActionView, *, shielded: bool, named: bool, checked: bool) -> str:
    done = swatch(action.executed, label_colour(action.executed_label))
    said, text = "", f"The agent chose {done}."
    if action.changed:
        wanted = swatch(action.proposed, label_colour(action.proposed_label))
        said = badge("Changed by the rules", "changed")
        text = f"The agent wanted {wanted}, and {done} was done."
    elif action.abstains:
        said = badge("Rule abstains")
        text = f"The agent wanted {done}. The rule left it as it is, outside its data."
    elif action.rule:
        said = badge("Allowed by the rules", "allowed")
        text = f"The agent wanted {done}, as the rule says."
    elif shielded:
        said = badge("No rule applies" if checked else "Not checked")
    parts = [f"<p><b>{escape(action.dimension)}</b></p>" if named else ""]
    if said:
        parts.append(f"<p>{said}</p>")
    parts.append(f"<p>{text}</p>")
    if action.rule:
        parts.append(f"<p><b>{action.rule_name}.</b> {escape(action.rule)}</p>")
    return "".join(parts)
