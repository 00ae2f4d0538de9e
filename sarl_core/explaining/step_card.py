"""One step of an episode in words, in HTML without script; every name escaped."""

from __future__ import annotations

from base64 import b64encode
from html import escape

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.replay import ActionView, StepView, margin_text

_STYLE = """<style>
.sarl-step { font-size: 0.95rem; line-height: 1.55; }
.sarl-step p { margin: 0 0 0.5rem 0; }
.sarl-step .badge { display: inline-block; padding: 0 0.5rem; border-radius: 0.5rem;
  font-size: 0.85rem; background: rgba(128,140,150,0.18); }
.sarl-step .changed { background: rgba(213,94,0,0.2); }
.sarl-step .allowed { background: rgba(0,158,115,0.2); }
.sarl-step .quiet { opacity: 0.7; font-size: 0.85rem; }
.sarl-step .state { overflow: auto; max-height: 25rem; }
.sarl-step table { width: 100%; border-collapse: collapse; font-size: 0.84rem; }
.sarl-step th { text-align: left; font-weight: 400; opacity: 0.7; padding: 0 0.5rem 0.2rem 0; }
.sarl-step td { padding: 0.16rem 0.5rem 0.16rem 0;
  border-top: 1px solid rgba(128,140,150,0.25); }
.sarl-step .n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
</style>"""


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
    parts = [_action(action, shielded=shielded, named=several) for action in view.actions]
    if view.outside:
        parts.append(
            "<p><b>Outside the data:</b> this state lies beyond the values seen where the rule "
            "applies.</p>"
        )
    if shielded:
        parts.append(f'<p class="quiet">{margin_text(view.margin)}.</p>')
    rows = "".join(
        f'<tr><td>{escape(name)}</td><td class="n">{escape(value)}</td>'
        f"<td>{escape(unit) or '–'}</td></tr>"
        for name, value, unit in view.state
    )
    table = (
        '<div class="state"><table><thead><tr><th>State</th><th class="n">Value</th>'
        f"<th>Unit</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )
    return f'{_STYLE}<div class="sarl-step">{"".join(parts)}{table}</div>'


def _action(action: ActionView, *, shielded: bool, named: bool) -> str:
    done = swatch(action.executed, label_colour(action.executed_label))
    badge, css, text = "", "", f"The agent chose {done}."
    if action.changed:
        wanted = swatch(action.proposed, label_colour(action.proposed_label))
        badge, css = "Changed by the rules", "changed"
        text = f"The agent wanted {wanted}, and {done} was done."
    elif action.abstains:
        badge = "Rule abstains"
        text = f"The agent wanted {done}. The rule left it as it is, outside its data."
    elif action.rule:
        badge, css = "Allowed by the rules", "allowed"
        text = f"The agent wanted {done}, as the rule says."
    elif shielded:
        badge = "No rule applies"
    parts = [f"<p><b>{escape(action.dimension)}</b></p>" if named else ""]
    if badge:
        parts.append(f'<p><span class="badge {css}">{badge}</span></p>')
    parts.append(f"<p>{text}</p>")
    if action.rule:
        parts.append(f"<p><b>Rule {escape(action.rule_id)}.</b> {escape(action.rule)}</p>")
    return "".join(parts)
