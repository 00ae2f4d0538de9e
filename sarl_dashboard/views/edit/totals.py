"""What the edits come to: undo, redo, the file, and what they change, on the page Edit."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.samples import sample_text
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.html.number_cards import Number, number_cards
from sarl_core.explaining.words.edits import edit_text, edits_change_text
from sarl_core.mining.editing.edits import Edit, Regrow
from sarl_core.mining.language import share_text
from sarl_core.mining.rule_set import RuleSet, rules_to_json
from sarl_core.shielding.effects import Verdicts, change
from sarl_dashboard.components.downloads import download
from sarl_dashboard.state import edits, in_force
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.rule_choice import comparison_address
from sarl_dashboard.state.rule_files import EDITED, UNEDITED
from sarl_dashboard.text import escaped, refuse


def bar(of: Base) -> None:
    """Undo, redo, and the file."""
    history = edits.history(of)
    rule_set = edits.edited(of)
    error = st.session_state.pop("_edit_error", None)
    if error:
        refuse(error)
    with st.container(horizontal=True, gap="small", vertical_alignment="center"):
        for name, icon, step, waiting in (
            ("Undo", "undo", in_force.undo, history.edits[-1:]),
            ("Redo", "redo", in_force.redo, history.undone[-1:]),
        ):
            sentence = edit_text(waiting[0], _with(of, waiting)) if waiting else ""
            st.button(
                f"{name}: {escaped(_short(sentence))}" if sentence else name,
                on_click=step,
                args=(of,),
                disabled=not waiting,
                icon=f":material/{icon}:",
                key=name.lower(),
                help=escaped(sentence) if sentence else f"Nothing to {name.lower()}",
            )
        source = rule_set.source.env_id.rsplit("/", 1)[-1] or "unnamed"
        download(
            "Rule file",
            lambda: rules_to_json(rule_set),
            f"rules-{source}-edited.json",
            key="edited_file",
            meaning="The set with all edits: what is off, what is pinned, what was added by hand.",
        )
        if history.edits:
            st.page_link(
                "difference.py",
                label="Compare with the unedited set",
                icon=":material/difference:",
                query_params=comparison_address(UNEDITED, EDITED),
            )


def _with(of: Base, waiting: tuple[Edit, ...]) -> RuleSet:
    """The rules that know what an edit speaks of: of one that is undone, those it would make."""
    made = edits.history(of).edits
    if isinstance(waiting[0], Regrow) and waiting != made[-1:]:
        return edits.grown(of, (*made, *waiting))
    return edits.edited(of)


def _short(text: str, most: int = 44) -> str:
    return text if len(text) <= most else f"{text[: most - 1].rstrip()}…"


def numbers(of: Base, before: Verdicts, after: Verdicts) -> None:
    """What the edits change at once, against the unedited set."""
    changed, noun = change(before, after), edits.basis_of(of).noun
    forbids = after.rule_set.forbids
    on = [sum(rule.enabled for rule in one.rule_set.rules) for one in (before, after)]
    totals = (
        ("Rules in force", f"{on[1]:,}", f"{on[0]:,}"),
        ("Coverage", *(share_text(one.coverage, decimals=1) for one in (after, before))),
        ("Fidelity", *(share_text(one.fidelity, decimals=1) for one in (after, before))),
        ("Decided differently", f"{changed.different:,}", ""),
        ("Freedom", *(share_text(one.freedom, decimals=1) for one in (after, before)))
        if forbids
        else ("Conflicts", f"{sum(one.states for one in after.conflicts):,}", ""),
    )
    meanings = (
        "Rules that are switched on",
        "Share of the states in which some rule applies",
        "Share of the covered states in which the expert did as the rule in force says"
        + ", or nothing that is forbidden there" * forbids,
        "States of which the edited set says something else than the unedited one",
        "What the rules leave to choose from, in the mean of all states"
        if forbids
        else "States in which a placed rule overrules another that says something else",
    )
    sentence = edits_change_text(changed, before, after, states=noun)
    cards = [
        Number(label, value, meaning, was if was != value else "")
        for (label, value, was), meaning in zip(totals, meanings, strict=True)
    ]
    with st.container(key="numbers"):
        st.html(
            number_cards(cards, framed=True)
            + note(f"Against the unedited set: {sentence[:1].lower() + sentence[1:]}{where(of)}")
        )


def where(of: Base) -> str:
    """Which states these are, where they are not the demonstrated ones."""
    demonstrations = edits.demonstrations_for(of.rule_set)
    if demonstrations is not None:
        if len(demonstrations) < demonstrations.whole.steps:
            return f" What edits change is counted on {sample_text(demonstrations)}."
        return ""
    return (
        " The chosen demonstrations are of something else, so this is counted on random states "
        "over the range of the rules' thresholds."
    )
