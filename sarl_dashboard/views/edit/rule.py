"""The chosen rule on the page Edit, and what can be done to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import streamlit as st

from sarl_core.explaining.words.edits import state_text
from sarl_core.mining.editing.edits import Edit, Move, Pin, Remove, Switch, Unpin, peers_of
from sarl_core.mining.language import counted, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.effects import Verdicts
from sarl_dashboard.state import edits, in_force
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.text import escaped


@dataclass(frozen=True)
class Button:
    """A button that makes an edit.

    Attributes:
        label: What it says.
        icon: Name of its picture.
        edit: What it makes.
        key: Of the widget, after "edit_".
        hint: What it is for.
        disabled: Whether it cannot be pressed now.
    """

    label: str
    icon: str
    edit: Edit
    key: str
    hint: str | None = None
    disabled: bool = False


def chosen_rule(of: Base, rule: Rule, verdicts: Verdicts) -> str | None:
    """The chosen rule and what can be done to it; gives what the form is to do with it."""
    rule_set, wish = verdicts.rule_set, None
    with st.container(border=True, key="chosen_rule"):
        # What a demanding rule of a file was worth where it was learned is on the page Rules: here
        # stands what it does in the states that the table counts.
        st.markdown(f"**{escaped(sentence(rule, rule_set, evidence=bool(rule.forbids)))}**")
        at = next(at for at, one in enumerate(rule_set.rules) if one.id == rule.id)
        decided = int(verdicts.decided[at])
        states = counted(decided, edits.basis_of(of).noun)
        decides = f"has a say in {states}" if rule.forbids else f"decides {states}"
        if decided and verdicts.right is not None:
            share = share_text(int(verdicts.right[at]) / decided)
            decides += f", and the expert did as it says in {share} of them"
        st.caption(f"{rule_set.name_of(rule)} · {state_text(rule)} · {decides}")
        with st.container(horizontal=True, gap="small"):
            for button in _buttons(rule, rule_set):
                st.button(
                    button.label,
                    on_click=in_force.edit,
                    args=(of, button.edit),
                    icon=f":material/{button.icon}:",
                    key=f"edit_{button.key}",
                    help=button.hint,
                    disabled=button.disabled,
                )
            if rule.origin == "manual" and st.button(
                "Change", icon=":material/edit:", key="change_rule"
            ):
                wish = "change"
            if st.button(
                "Copy",
                icon=":material/content_copy:",
                key="copy_rule",
                help="Fill the form below with its conditions, to add a rule like it.",
            ):
                wish = "copy"
    return wish


def _buttons(rule: Rule, rule_set: RuleSet) -> Iterator[Button]:
    """The edits that can be made of a rule."""
    if rule.enabled:
        yield Button("Switch off", "toggle_off", Switch(rule.id, False), "switch")
    else:
        yield Button("Switch on", "toggle_on", Switch(rule.id, True), "switch")
    if rule.origin == "mined":
        hint = "A pinned rule stays in force when the thresholds move" + (
            "." if rule.forbids else ", and comes before those that were only mined."
        )
        if rule.pinned:
            yield Button("Unpin", "keep_off", Unpin(rule.id), "pin", hint)
        else:
            yield Button("Pin", "keep", Pin(rule), "pin", hint)
    if rule.origin == "manual":
        yield Button("Remove", "delete", Remove(rule.id), "remove")
    if rule.forbids:  # they add up, so they have no order
        return
    peers = peers_of(rule, rule_set.rules) if rule.placed else []
    hint = (
        "Its place among the placed rules of its action"
        if rule.placed
        else "Mined rules never overlap, so they have no order. Pin it first."
    )
    for way, up, end in (("up", True, peers[:1]), ("down", False, peers[-1:])):
        last = end in ([], [rule.id])
        yield Button(f"Move {way}", f"arrow_{way}ward", Move(rule.id, up), way, hint, disabled=last)
