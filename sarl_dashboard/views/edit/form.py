"""The form for a rule by hand, with what the rule would change while it is filled in.

What is filled in stays in the session, like the edits, so that neither an error nor a visit to
another page loses it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.explaining.words.edits import conflict_text, edits_change_text
from sarl_core.mining.action_words import action_text
from sarl_core.mining.editing.edits import Add, Change, next_manual_id
from sarl_core.mining.editing.manual_rules import Ask, asks_of, manual_rule
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import number_text, sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Operator, Rule
from sarl_core.shielding.effects import Verdicts, change
from sarl_dashboard.state import edits, in_force
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.url import set_url_choice
from sarl_dashboard.text import escaped, in_full

Says = int | tuple[int, ...]
ABOVE, AT_MOST = "above", "at most"
SIGNS: dict[str, Operator] = {ABOVE: ">", AT_MOST: "<="}
MOST_CONFLICTS = 3


@dataclass
class Draft:
    """What the form is about.

    Attributes:
        number: Tells its widgets from those of other drafts.
        rows: Numbers of the conditions.
        latest: The largest number given to one.
        changing: Id of the manual rule that is changed, "" for a new one.
    """

    number: int = 0
    rows: list[int] = field(default_factory=lambda: [0])
    latest: int = 0
    changing: str = ""

    def key(self, name: str, row: int | None = None) -> str:
        """The key of a widget."""
        return f"draft{self.number}_{name}" + ("" if row is None else f"_{row}")


def _drafts() -> dict[str, Draft]:
    return cast("dict[str, Draft]", st.session_state.setdefault("_drafts", {}))


def draft_of(of: Base) -> Draft:
    """What is being filled in for some rules."""
    draft = _drafts().get(of.key)
    return draft if draft is not None else begin(of)


def _clear(of: Base) -> None:
    begin(of)


def begin(of: Base, rule: Rule | None = None, *, changing: bool = False) -> Draft:
    """Begin with an empty form, or with what a rule asks and says."""
    number = int(st.session_state.get("_draft_number", 0)) + 1
    st.session_state["_draft_number"] = number
    draft = Draft(number)
    if rule is not None:
        asks = asks_of(rule, of.rule_set)
        names = [feature.name for feature in of.rule_set.source.features]
        draft = Draft(number, list(range(len(asks))), len(asks), rule.id if changing else "")
        for row, ask in enumerate(asks):
            sign = next(word for word, op in SIGNS.items() if op == ask.op)
            place = names.index(ask.feature)
            filled = ("feature", place), ("sign", sign), ("at", ask.threshold), ("says", ask.op)
            for name, value in filled:
                st.session_state[draft.key(name, row)] = value
        st.session_state[draft.key("dimension")] = rule.dimension
        st.session_state[draft.key("action")] = rule.forbids or rule.action
    _drafts()[of.key] = draft
    return draft


def _more(draft: Draft) -> None:
    draft.latest += 1
    draft.rows.append(draft.latest)


def _fewer(draft: Draft, row: int) -> None:
    draft.rows.remove(row)


@dataclass(frozen=True, eq=False)
class Filling:
    """A draft, and the rules that it is for.

    Attributes:
        base: The rules without edits.
        now: What they say with the edits so far.
        draft: What is filled in.
    """

    base: Base
    now: Verdicts
    draft: Draft

    def edit(self, rule: Rule) -> Add | Change:
        """The edit that puts a rule in force."""
        return Change(rule) if self.draft.changing else Add(rule)


@dataclass(frozen=True)
class Filled:
    """What the widgets say.

    Attributes:
        asks: The conditions.
        dimension: Action dimension.
        action: What the rule demands there, or the labels that it forbids; None while that was
            not chosen.
    """

    asks: list[Ask]
    dimension: int
    action: Says | None


def form(base: Base, now: Verdicts) -> None:
    """The form and the preview."""
    draft = draft_of(base)
    filling = Filling(base, now, draft)
    changing = now.rule_set.names.get(draft.changing)
    if changing is None:
        draft.changing = ""  # it was removed meanwhile: what was filled in makes a new one
    st.header(f"Change {changing}" if changing else "Add a rule by hand")
    with st.container(border=True, key="manual"):
        asks = [_condition(base, draft, row) for row in list(draft.rows)]
        st.button(
            "Another condition" if draft.rows else "Add a condition",
            on_click=_more,
            args=(draft,),
            icon=":material/add:",
            key=draft.key("more"),
            type="tertiary",
        )
        rule = _rule(filling, Filled(asks, *_says(draft, now.rule_set)))
        edit = None if rule is None else filling.edit(rule)
        if edit is not None:
            preview(filling, edit)
        with st.container(horizontal=True, gap="small"):
            st.button(
                "Save the change" if changing else "Add the rule",
                on_click=_save,
                args=(base, edit),
                type="primary",
                disabled=edit is None,
                icon=":material/check:",
                key=draft.key("save"),
            )
            st.button(
                "Clear",
                on_click=_clear,
                args=(base,),
                icon=":material/clear:",
                key=draft.key("clear"),
            )


def _save(of: Base, edit: Add | Change) -> None:
    in_force.edit(of, edit)
    if not st.session_state.get("_edit_error"):
        begin(of)
        set_url_choice("rule", edit.rule_id)


def _condition(base: Base, draft: Draft, row: int) -> Ask:
    features = base.rule_set.source.features

    def named(at: int) -> str:
        name, unit = features[at].name, features[at].unit
        return f"{name} ({unit})" if unit else name

    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        feature = st.selectbox(
            "Feature",
            range(len(features)),  # and not names, which a visitor may change meanwhile
            format_func=named,
            key=draft.key("feature", row),
            persist_state="session",
            label_visibility="collapsed",
            width=260,
        )
        ask = _ask(base, draft, row, feature)
        st.button(
            "Remove the condition",
            on_click=_fewer,
            args=(draft, row),
            icon=":material/close:",
            key=draft.key("fewer", row),
            type="tertiary",
        )
    return ask


def _ask(base: Base, draft: Draft, row: int, at: int) -> Ask:
    """What is asked of a feature: a bound; of one that is about words, which it is."""
    feature = base.rule_set.source.features[at]
    if feature.indicator is not None:
        op = st.selectbox(
            "Says",
            list(SIGNS.values()),
            format_func=lambda op: feature.statement(op == ">"),
            key=draft.key("says", row),
            persist_state="session",
            label_visibility="collapsed",
            width=310,
        )
        return Ask(feature.name, op, 0.5)
    sign = st.selectbox(
        "Is",
        list(SIGNS),
        key=draft.key("sign", row),
        persist_state="session",
        label_visibility="collapsed",
        width=110,
    )
    values = edits.basis_of(base).ground.states[:, at]
    least, most = float(values.min()), float(values.max())
    low, high = number_text(least, apart_from=most), number_text(most, apart_from=least)
    threshold = st.number_input(
        "Number",
        value=None,
        step=None,
        format="%.17g",  # every digit, and no more than tell the number from all others
        key=draft.key("at", row),
        persist_state="session",
        label_visibility="collapsed",
        placeholder=f"{low} to {high}",
        width=190,
    )
    return Ask(feature.name, SIGNS[sign], threshold)


def _says(draft: Draft, rule_set: RuleSet) -> tuple[int, Says | None]:
    """The widgets for what the rule says; to forbid is offered among rules that do."""
    dimension = 0
    with st.container(horizontal=True, gap="small"):
        if len(rule_set.actions) > 1:
            dimension = st.selectbox(
                "Of the action",
                range(len(rule_set.actions)),
                format_func=lambda at: rule_set.actions[at].name,
                key=draft.key("dimension"),
                persist_state="session",
                width=260,
            )
        of = rule_set.actions[dimension]
        options: list[Says] = list(range(of.n_labels))
        if rule_set.forbids and of.n_labels > 1:
            several = {
                rule.forbids
                for rule in rule_set.rules
                if rule.dimension == dimension and len(rule.forbids) > 1
            }
            options = [*((label,) for label in range(of.n_labels)), *sorted(several), *options]
        action = st.selectbox(
            "Then",
            options,
            index=None,
            format_func=lambda says: _says_text(says, of),
            key=draft.key("action"),
            persist_state="session",
            placeholder="choose what the rule says",
            width=310,
        )
    return dimension, action


def _says_text(says: Says, dimension: LabelledDimension) -> str:
    if isinstance(says, int):
        return action_text(says, dimension)
    return f"never {' or '.join(action_text(label, dimension) for label in says)}"


def _rule(filling: Filling, filled: Filled) -> Rule | None:
    """The rule as it is filled in; None, with a sentence, while it is none."""
    asks, rule_set = filled.asks, filling.now.rule_set
    if asks and filled.action is None and all(ask.threshold is None for ask in asks):
        st.caption("Fill in a condition and an action to see here what the rule would change.")
        return None
    try:
        return manual_rule(
            rule_set,
            asks,
            rule_id=filling.draft.changing or next_manual_id(rule_set, edits.history(filling.base)),
            action=filled.action if isinstance(filled.action, int) else None,
            forbids=filled.action if isinstance(filled.action, tuple) else (),
            dimension=filled.dimension,
            demonstrations=edits.demonstrations_for(filling.base.rule_set),
        )
    except SarlError as error:
        st.warning(in_full(str(error)), icon=":material/error:")
        return None


def preview(filling: Filling, edit: Add | Change) -> None:
    """What the rule would change, before it is there."""
    base, now, rule = filling.base, filling.now, edit.rule
    then = edits.verdicts_of(base, (*edits.history(base).edits, edit))
    noun = edits.basis_of(base).noun
    st.markdown(f"**{escaped(sentence(rule, then.rule_set, evidence=False))}**")
    if not rule.conditions:
        st.warning(
            "Without conditions the rule applies always"
            + ("." if rule.forbids else ", and comes before every mined rule of its action."),
            icon=":material/warning:",
        )
    index = next(at for at, one in enumerate(then.rule_set.rules) if one.id == rule.id)
    decides = int(then.decided[index])
    would = "have a say in" if rule.forbids else "decide"
    sentences = [f"It would {would} {decides:,} of {len(then.labels):,} {noun}s."]
    if then.right is not None and decides:
        sentences.append(f"The expert did as it says in {int(then.right[index]):,} of them.")
    sentences.append(
        "Against the set as it is now: "
        + _lower(edits_change_text(change(now, then), now, then, states=noun))
    )
    st.markdown(escaped(" ".join(sentences)))
    own = [one for one in then.conflicts if one.rule == index]
    if own:
        states = sum(one.states for one in own)
        rules = "one rule that says" if len(own) == 1 else f"{len(own):,} rules that say"
        st.markdown(
            f"Conflicts: it takes {states:,} {noun}{'s' if states != 1 else ''} from {rules} "
            "something else.\n"
            + "\n".join(
                f"- {escaped(conflict_text(one, then.rule_set, states=noun))}"
                for one in own[:MOST_CONFLICTS]
            )
        )


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
