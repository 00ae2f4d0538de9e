"""What the page Edit shows: the rules as edited, what the edits change, whom they overrule."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.html.number_cards import Number, number_cards
from sarl_core.explaining.words.edits import change_text, edit_text, state_text
from sarl_core.mining.editing.edits import Move, Pin, Remove, Switch, Unpin, peers_of
from sarl_core.mining.language import (
    action_text,
    conditions_text,
    counted,
    sentence,
    share_text,
)
from sarl_core.mining.rule_files import rules_to_json
from sarl_core.mining.rules import Rule, RuleSet
from sarl_core.shielding.effects import Verdicts, change
from sarl_dashboard.cache import cached
from sarl_dashboard.components.tables import action_column, table_height
from sarl_dashboard.state import edits
from sarl_dashboard.state.edits import Base
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.text import escaped, in_full

TABLE_ROWS = 9
EVERY, TOUCHED = "All rules", "Edited"


# --- the bar above -----------------------------------------------------------------------------


def bar(of: Base) -> None:
    """Undo, redo, and the file."""
    history = edits.history(of)
    rule_set = edits.edited(of)
    error = st.session_state.pop("_edit_error", None)
    if error:
        st.error(in_full(error), icon=":material/error:")
    with st.container(horizontal=True, gap="small", vertical_alignment="center"):
        for name, icon, step, waiting in (
            ("Undo", "undo", edits.undo, history.edits[-1:]),
            ("Redo", "redo", edits.redo, history.undone[-1:]),
        ):
            told = edit_text(waiting[0], rule_set) if waiting else ""
            st.button(
                f"{name}: {escaped(_short(told))}" if told else name,
                on_click=step,
                args=(of,),
                disabled=not waiting,
                icon=f":material/{icon}:",
                key=name.lower(),
                help=escaped(told) if told else f"Nothing to {name.lower()}",
            )
        source = rule_set.source.env_id.rsplit("/", 1)[-1] or "unnamed"
        st.download_button(
            "Rule file",
            lambda: rules_to_json(rule_set),
            f"rules-{source}-edited.json",
            "application/json",
            on_click="ignore",
            icon=":material/download:",
            key="edited_file",
            help="The set with all edits: what is off, what is pinned, what was added by hand.",
        )
        if history.edits:
            st.page_link(
                "difference.py",
                label="Compare with the unedited set",
                icon=":material/difference:",
                query_params={"first": "before the edits", "second": "edited"},
            )


def _short(text: str, most: int = 44) -> str:
    return text if len(text) <= most else f"{text[: most - 1].rstrip()}…"


def numbers(of: Base, before: Verdicts, after: Verdicts) -> None:
    """What the edits change at once, against the unedited set."""
    found, noun = change(before, after), of.basis.noun
    in_force = [sum(rule.enabled for rule in one.rule_set.rules) for one in (before, after)]
    shown = (
        ("Rules in force", f"{in_force[1]:,}", f"{in_force[0]:,}"),
        ("Coverage", *(share_text(one.coverage, decimals=1) for one in (after, before))),
        ("Fidelity", *(share_text(one.fidelity, decimals=1) for one in (after, before))),
        ("Decided differently", f"{found.different:,}", ""),
        ("Conflicts", f"{sum(one.states for one in after.conflicts):,}", ""),
    )
    meanings = (
        "Rules that are switched on",
        "Share of the states in which some rule applies",
        "Share of the covered states in which the expert did as the rule in force says",
        "States of which the edited set says something else than the unedited one",
        "States in which a placed rule overrules another that says something else",
    )
    told = change_text(found, before, after, states=noun)
    cards = [
        Number(label, value, meaning, was if was != value else "")
        for (label, value, was), meaning in zip(shown, meanings, strict=True)
    ]
    with st.container(key="numbers"):
        st.html(
            number_cards(cards, framed=True)
            + '<div style="height:0.8rem"></div>'
            + note(f"Against the unedited set: {told[:1].lower() + told[1:]}{where(of)}")
        )


def where(of: Base) -> str:
    """Which states these are, where they are not the demonstrated ones."""
    if of.basis.expert is not None:
        return ""
    return (
        " The chosen demonstrations are of something else, so this is counted on random states "
        "over the range of the rules' thresholds."
    )


# --- the table ---------------------------------------------------------------------------------


@cached(show_spinner="Writing the rules in plain language …")
def _texts(digest: str, _rule_set: RuleSet) -> dict[str, tuple[str, str]]:
    return {rule.id: _text(rule, _rule_set) for rule in _rule_set.rules}


def _text(rule: Rule, rule_set: RuleSet) -> tuple[str, str]:
    does = action_text(rule.action, rule_set.actions[rule.dimension])
    return does, conditions_text(rule, rule_set)


def in_order(rule_set: RuleSet) -> list[int]:
    """Places of the rules, the placed ones in their order, then the largest first."""
    rules = rule_set.rules
    placed = [at for at, rule in enumerate(rules) if rule.placed]
    samples = np.array([rule.samples for rule in rules])
    samples[placed] = 0
    largest = np.argsort(-samples, kind="stable").tolist()
    first = set(placed)
    return placed + [at for at in largest if at not in first] if placed else largest


def table(of: Base, found: Verdicts) -> Rule | None:
    """The rules as edited; returns the chosen one."""
    rule_set, texts = found.rule_set, _texts(of.digest, of.rule_set)
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        words = st.text_input(
            "Search",
            key="search",
            bind="query-params",
            icon=":material/search:",
            width=300,
            placeholder="a feature, an action, a number",
            label_visibility="collapsed",
        )
        view = st.segmented_control(
            "Show",
            [EVERY, TOUCHED],
            default=EVERY,
            key="rules_shown",
            bind="query-params",
            required=True,
            label_visibility="collapsed",
        )
    order = in_order(rule_set)
    if view == TOUCHED:
        order = [at for at in order if _touched(rule_set.rules[at])]
    told: dict[int, tuple[str, str]] = {}
    for at in order:
        rule = rule_set.rules[at]
        known = None if rule.origin == "manual" else texts.get(rule.id)
        told[at] = known or _text(rule, rule_set)
    wanted = (words or "").lower().split()
    if wanted:
        order = [
            at
            for at in order
            if all(
                w in f"{' '.join(told[at])} {rule_set.name_of(rule_set.rules[at])}".lower()
                for w in wanted
            )
        ]
    if not order:
        st.info(
            "No rule is edited yet; show all rules and choose one."
            if view == TOUCHED and not wanted
            else "No rule matches; clear the search to see all.",
            icon=":material/search_off:",
        )
        return None
    ids = [rule_set.rules[at].id for at in order]
    chosen = url_choice("rule", [rule.id for rule in rule_set.rules], ids[0])
    row = ids.index(chosen) if chosen in ids else None
    # What is selected is a row: where the rows change places, it is another table.
    key = f"edit_table_{hash(tuple(ids))}"

    def pick() -> None:
        rows = st.session_state[key].selection.rows
        if rows and rows[0] < len(ids):
            set_url_choice("rule", ids[rows[0]])

    by_hand = tuple(told[at] for at in order if rule_set.rules[at].origin == "manual")
    written = _written(of.digest, key, by_hand, [told[at] for at in order])
    st.dataframe(
        _with_numbers(written, order, found),
        hide_index=True,
        column_config=_columns(rule_set),
        height=table_height(len(order), TABLE_ROWS),
        key=key,
        on_select=pick,
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="The rules with all edits",
    )
    several = counted(len(rule_set), "rule")
    st.caption(
        (f"{len(order):,} of {several}. " if len(order) < len(rule_set) else f"{several}. ")
        + "Placed rules (manual or pinned) come first, in their order: the first that applies "
        "decides. Mined rules never overlap. Click the box at the left of a row to edit its rule."
    )
    return next(rule for rule in rule_set.rules if rule.id == chosen)


def _touched(rule: Rule) -> bool:
    return rule.placed or not rule.enabled


@cached()
def _written(
    digest: str,
    key: str,
    by_hand: tuple[tuple[str, str], ...],
    _texts: list[tuple[str, str]],
) -> Any:
    """The columns that no edit changes as long as the same rules are shown, as an Arrow table."""
    import pyarrow as pa

    return pa.table(
        {
            "Action": [[does] for does, _ in _texts],
            "When": [when for _, when in _texts],
        }
    )


def _with_numbers(written: Any, order: list[int], found: Verdicts) -> Any:
    """The table with what edits change."""
    import pyarrow as pa

    rules = [found.rule_set.rules[at] for at in order]
    decided = found.decided[order]
    kinds = [state_text(rule).split(",")[0] if _touched(rule) else "mined" for rule in rules]
    table = (
        written.add_column(0, "On", pa.array([rule.enabled for rule in rules]))
        .add_column(1, "Kind", pa.array(kinds))
        .add_column(2, "Rule", pa.array(list(map(found.rule_set.name_of, rules))))
        .append_column("Decides", pa.array(decided))
    )
    if found.right is not None:
        right = found.right[order].astype(float)
        right[decided == 0] = float("nan")
        share = pa.array(100 * right / decided.clip(min=1), from_pandas=True)
        table = table.append_column("Expert agrees", share)
    return table


def _columns(rule_set: RuleSet) -> dict[str, Any]:
    column = st.column_config
    action, action_width = action_column(rule_set.actions, "What the rule says")
    return {
        "On": column.CheckboxColumn(width=40, help="Whether a shield uses the rule"),
        "Kind": column.TextColumn(
            width=70, help="Mined; pinned, so that it keeps its place; or added by hand"
        ),
        "Rule": column.TextColumn(
            width=80, help="Its name: rules are numbered by their place in the set"
        ),
        "Action": action,
        "When": column.TextColumn(
            width=570 - action_width, help="The conditions under which the rule applies"
        ),
        "Decides": column.NumberColumn(
            width=80, format="localized", help="States in which it is the rule in force"
        ),
        "Expert agrees": column.ProgressColumn(
            width=112,
            min_value=0.0,
            max_value=100.0,
            format="%.2f %%",
            color="gray",
            help="Share of those in which the expert did as it says",
        ),
    }


# --- one rule ----------------------------------------------------------------------------------


def chosen_rule(of: Base, rule: Rule, found: Verdicts) -> str | None:
    """The chosen rule and what can be done to it; gives what the form is to do with it."""
    rule_set, wish = found.rule_set, None
    with st.container(border=True, key="chosen_rule"):
        st.markdown(f"**{escaped(sentence(rule, rule_set))}**")
        at = next(at for at, one in enumerate(rule_set.rules) if one.id == rule.id)
        decides = f"decides {counted(int(found.decided[at]), of.basis.noun)}"
        st.caption(f"{rule_set.name_of(rule)} · {state_text(rule)} · {decides}")
        with st.container(horizontal=True, gap="small"):
            on = rule.enabled
            _button(
                of,
                "Switch off" if on else "Switch on",
                "toggle_off" if on else "toggle_on",
                Switch(rule.id, not on),
                "switch",
            )
            if rule.origin == "mined":
                edit = Unpin(rule.id) if rule.pinned else Pin(rule)
                _button(
                    of,
                    "Unpin" if rule.pinned else "Pin",
                    "keep_off" if rule.pinned else "keep",
                    edit,
                    "pin",
                    "A pinned rule stays in force when the thresholds move, and comes before "
                    "those that were only mined.",
                )
            peers = peers_of(rule, rule_set.rules) if rule.placed else []
            for up in (True, False):
                last = not peers or peers[0 if up else -1] == rule.id
                _button(
                    of,
                    f"Move {'up' if up else 'down'}",
                    f"arrow_{'up' if up else 'down'}ward",
                    Move(rule.id, up),
                    "up" if up else "down",
                    "Its place among the placed rules of its action"
                    if rule.placed
                    else "Mined rules never overlap, so they have no order. Pin it first.",
                    disabled=last,
                )
            if rule.origin == "manual":
                _button(of, "Remove", "delete", Remove(rule.id), "remove")
                if st.button("Change", icon=":material/edit:", key="change_rule"):
                    wish = "change"
            if st.button(
                "Copy",
                icon=":material/content_copy:",
                key="copy_rule",
                help="Fill the form below with its conditions, to add a rule like it.",
            ):
                wish = "copy"
    return wish


def _button(
    of: Base,
    label: str,
    icon: str,
    edit: Any,
    key: str,
    hint: str | None = None,
    *,
    disabled: bool = False,
) -> None:
    st.button(
        label,
        on_click=edits.do,
        args=(of, edit),
        icon=f":material/{icon}:",
        key=f"edit_{key}",
        help=hint,
        disabled=disabled,
    )


def refuse(error: SarlError) -> None:
    """Say what cannot be done, in place."""
    st.warning(in_full(str(error)), icon=":material/error:")
