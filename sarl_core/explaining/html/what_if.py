"""What the page What if says of a state, in HTML without script; every name escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.html.badges import BADGE_STYLE, badge
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.table import TABLE_STYLE, Column, table_html
from sarl_core.explaining.words.what_if import (
    change_text,
    condition_views,
    exact_text,
    executed_text,
    near_miss_text,
    outside_texts,
    with_unit,
)
from sarl_core.mining.language import action_text, counted, number_text, sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.near import DecisionChange, NearMiss
from sarl_core.shielding.sampling import Span
from sarl_core.shielding.shield import Decision, Outside

PLACED = "A person gave this rule its place: it is asked before the tree is."
_SHOWN = 3  # features beyond the data that are named

_STYLE = (
    """<style>
.sarl-state { font-size: 1rem; line-height: 1.55; }
.sarl-state h4 { font-size: 1rem; font-weight: 600; line-height: 1.4; margin: 0;
  padding: 0.4rem 0; }
.sarl-state p { margin: 0 0 0.5rem 0; }
.sarl-state p:last-child { margin-bottom: 0; }
.sarl-state .quiet { opacity: 0.65; font-size: 0.875rem; }
</style>"""
    + TABLE_STYLE
    + BADGE_STYLE
)

_WIDTH = "interquartile range, the width of the middle half of its demonstrated values"
_CHANGES = (
    Column("If", "w"),
    Column("Executed", "m"),
    Column("Rule"),
    Column("In spreads", "n", f"The change in units of the feature's {_WIDTH}"),
    Column(
        "From exactly",
        "n",
        "The nearest float32 number at which the decision is another: one step less changes "
        "nothing",
    ),
    Column("Demonstrated", "", "Whether values as far as this were demonstrated"),
)
_MISSES = (
    Column("Rule"),
    Column("Says", "m"),
    Column("Would apply if", "w"),
    Column(
        "In spreads", "n", "The change in units of the features' interquartile ranges, summed up"
    ),
    Column(
        "In force",
        "",
        "Whether it would then decide; else a rule that was given its place before it does",
    ),
    Column("From exactly", "n"),
)
_CONDITIONS = (Column("Condition"), Column("The state has", "n"), Column("Room to move", "n"))


def decision_html(
    decision: Decision,
    rule: Rule | None,
    state: NDArray[np.float32],
    rule_set: RuleSet,
    outside: Outside,
) -> str:
    """What is executed, and the rule behind it.

    Args:
        decision: In the state.
        rule: In force there in the action dimension that is looked at, or None.
        state: Shape (d,).
        rule_set: The shield's.
        outside: What the shield does outside the data of a rule.

    Returns:
        HTML without script: how the rules met the agent's action, the action executed, the rule
        as a sentence, its conditions beside the state's values, and whether the state lies
        within its data.
    """
    if decision.intervened:
        badges = badge("Changed by the rules", "changed")
    elif decision.outside and outside == "abstain":
        badges = badge("Rule abstains")
    elif any(one is not None for one in decision.rules):
        badges = badge("Allowed by the rules", "allowed")
    else:
        badges = badge("No rule applies")
    if decision.outside:
        badges += badge("Outside the data", "beyond")
    wanted, done = (
        np.asarray(values, dtype=float).reshape(-1).tolist()
        for values in (decision.proposed, decision.executed)
    )
    proposed = executed_text(wanted, rule_set.actions, beside=done)
    executed = executed_text(done, rule_set.actions, beside=wanted)
    said = (
        f"The agent wants {proposed}; executed is {executed}"
        if decision.intervened
        else f"{executed[:1].upper()}{executed[1:]} is executed, as the agent wants"
    )
    return _section(
        f"<div>{badges}</div><h4>{escape(said)}</h4>{_rule_html(rule, state, rule_set)}"
    )


def _rule_html(rule: Rule | None, state: NDArray[np.float32], rule_set: RuleSet) -> str:
    if rule is None:
        which = "No rule applies to this state"
        if len(rule_set.actions) > 1:
            which = "No rule for this action dimension applies to this state"
        return _note(f"{which}: the agent's action is passed on as it is.")
    values = tuple(state.astype(np.float64).tolist())
    views = condition_views(rule, values, rule_set)
    table = table_html(
        _CONDITIONS,
        [(view.condition, view.value, view.room) for view in views],
        "The rule's conditions and the state's values",
    )
    told = escape(sentence(rule, rule_set, state=values))
    said = f"<p><b>{rule_set.name_of(rule)}.</b> {told}</p>"
    return f"{said}{table if views else ''}{_data_html(rule, values, rule_set)}"


def _data_html(rule: Rule, values: tuple[float, ...], rule_set: RuleSet) -> str:
    """Whether the state lies within the data of a rule."""
    if rule.box is None:
        return _note("It is not kept where the data of this rule lay.")
    texts = outside_texts(rule, values, rule_set.source.features)
    if not texts:
        return _note(
            "The state lies inside this rule's data: every feature is between the least and the "
            "largest value seen where it applies."
        )
    shown = escape("; ".join(texts[:_SHOWN]))
    others = len(texts) - _SHOWN
    more = f"; and {counted(others, 'feature')} more" if others > 0 else ""
    return f"<p><b>Outside this rule's data:</b> {shown}{more}.</p>"


def changes_html(
    changes: Sequence[DecisionChange], spans: Sequence[Span], rule_set: RuleSet
) -> str:
    """The least change of each feature that makes the shield execute another action.

    Args:
        changes: The least first.
        spans: Of all d features.
        rule_set: The shield's.

    Returns:
        HTML without script: the first as a sentence, and all in a table.
    """
    title = heading("The least change that changes the decision")
    if not changes:
        none = "No change of a single feature changes what is executed."
        return _section(f"{title}<p>{none}</p>")
    rows = [_change_row(change, spans, rule_set) for change in changes]
    condition, does, *_ = rows[0]
    said = f"<p>Executed would be <b>{escape(does)}</b> if {escape(condition)}.</p>"
    return _section(
        f"{title}{said}{table_html(_CHANGES, rows, 'The least changes that change the decision')}"
    )


def _change_row(
    change: DecisionChange, spans: Sequence[Span], rule_set: RuleSet
) -> tuple[str, ...]:
    moved = change.change
    feature, span = rule_set.source.features[moved.feature], spans[moved.feature]
    rules = [rule_set.name_of(rule_set.rules[rule]) for rule in change.rules.tolist() if rule >= 0]
    return (
        change_text(moved, feature),
        executed_text(tuple(change.executed.astype(float).tolist()), rule_set.actions),
        ", ".join(rules) or "none",
        number_text(change.distance),
        with_unit(exact_text(moved.after), feature),
        _yes(span.low <= moved.after <= span.high),
    )


def misses_html(misses: Sequence[NearMiss], rule_set: RuleSet) -> str:
    """The rules that nearly apply.

    Args:
        misses: In the order in which they are shown.
        rule_set: The shield's.

    Returns:
        HTML without script, in a table.
    """
    title = heading("Rules that nearly apply")
    if not misses:
        none = "No rule would apply if one or two features were different."
        return _section(f"{title}<p>{none}</p>")
    note = _note(
        "First those that lack one feature, then those that lack two; each with the least change "
        "that lets it apply."
    )
    rows = [_miss_row(miss, rule_set) for miss in misses]
    return _section(f"{title}{table_html(_MISSES, rows, 'Rules that nearly apply')}{note}")


def _miss_row(miss: NearMiss, rule_set: RuleSet) -> tuple[str, ...]:
    rule = rule_set.rules[miss.rule]
    features = rule_set.source.features
    return (
        rule_set.name_of(rule),
        action_text(rule.action, rule_set.actions[rule.dimension]),
        near_miss_text(miss.changes, features),
        number_text(miss.distance),
        _yes(miss.in_force),
        ", ".join(
            with_unit(exact_text(change.after), features[change.feature]) for change in miss.changes
        ),
    )


def way_html(table: str, rule: Rule | None) -> str:
    """The way of the state through rules that are not of the tree on screen.

    Args:
        table: Of its queries, as HTML.
        rule: That it ends at, or None.

    Returns:
        HTML without script.
    """
    placed = _note(PLACED) if rule is not None and rule.placed else ""
    note = _note(
        "These rules were not cut from the tree of the chosen demonstrations, so it is not drawn."
    )
    return _section(f"{heading('Its way through the rules')}{placed}{table}{note}")


# --- the parts ---------------------------------------------------------------------------------


def _section(inner: str) -> str:
    return f'{_STYLE}<div class="sarl-state">{inner}</div>'


def _note(text: str) -> str:
    return f'<p class="quiet">{escape(text)}</p>'


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"
