"""What the page What if says of a state, in HTML."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import extended_state
from sarl_core.explaining.html.table import Column, table_html
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.what_if import (
    condition_views,
    executed_text,
    feature_change_text,
    float32_text,
    near_miss_text,
    outside_texts,
    with_unit,
)
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import counted, number_text, sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.neighbourhood import DecisionChange, FeatureChange, NearMiss
from sarl_core.shielding.sampling import Span
from sarl_core.shielding.shield import Decision, Outside

PLACED = "A person gave this rule its place: it is asked before the tree is."
_MOST_OUTSIDE = 3  # features beyond the data that are named

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
    *,
    left: str = "",
) -> Markup:
    """What is executed, and the rule behind it.

    Args:
        decision: In the state.
        rule: In force there in the action dimension that is looked at, or None.
        state: Shape (d,).
        rule_set: The shield's.
        outside: What the shield does outside the data of a rule.
        left: What never-rules forbid there and leave, as a sentence.

    Returns:
        HTML: how the rules met the agent's action, the action executed, the rule
        as a sentence, its conditions beside the state's values, and whether the state lies
        within its data.
    """
    if decision.intervened:
        badges = [("Changed by the rules", "changed")]
    elif decision.outside and outside == "abstain":
        badges = [("Rule abstains", "plain")]
    elif any(one is not None for one in decision.rules):
        badges = [("Allowed by the rules", "allowed")]
    else:
        badges = [("No rule applies", "plain")]
    if decision.outside:
        badges.append(("Outside the data", "beyond"))
    wanted, done = (
        np.asarray(values, dtype=float).reshape(-1).tolist()
        for values in (decision.proposed, decision.executed)
    )
    proposed = executed_text(wanted, rule_set.actions, beside=done)
    executed = executed_text(done, rule_set.actions, beside=wanted)
    outcome = (
        f"The agent wants {proposed}; executed is {executed}"
        if decision.intervened
        else f"{executed[:1].upper()}{executed[1:]} is executed, as the agent wants"
    )
    if rule is None:
        which = "No rule applies to this state"
        if len(rule_set.actions) > 1:
            which = "No rule for this action dimension applies to this state"
        note = f"{which}: the agent's action is passed on as it is."
        return render(
            "states/decision", badges=badges, outcome=outcome, rule="", outside="", note=note
        )
    values = tuple(extended_state(state.tolist(), rule_set.source.features))
    rows = [(one.condition, one.value, one.room) for one in condition_views(rule, values, rule_set)]
    caption = "The rule's conditions and the state's values"
    beyond = outside_texts(rule, values, rule_set.source.features)
    others = len(beyond) - _MOST_OUTSIDE
    more = f"; and {counted(others, 'feature')} more" if others > 0 else ""
    return render(
        "states/decision",
        badges=badges,
        outcome=outcome,
        rule=rule_set.name_of(rule),
        sentence=sentence(rule, rule_set, state=values),
        left=left,
        conditions=table_html(_CONDITIONS, rows, caption) if rows else "",
        outside=f"{'; '.join(beyond[:_MOST_OUTSIDE])}{more}",
        note="The state lies inside this rule's data: every feature is between the least and the "
        "largest value seen where it applies."
        if rule.box is not None
        else "It is not kept where the data of this rule lay.",
    )


def changes_html(
    changes: Sequence[DecisionChange], spans: Sequence[Span], rule_set: RuleSet
) -> Markup:
    """The least change of each feature that makes the shield execute another action.

    Args:
        changes: The least first.
        spans: Of all d features.
        rule_set: The shield's.

    Returns:
        HTML: the first as a sentence, and all in a table.
    """
    rows = [_change_row(change, spans, rule_set) for change in changes]
    return render(
        "states/least_changes",
        first=rows[0] if rows else None,
        table=table_html(_CHANGES, rows, "The least changes that change the decision"),
    )


def _change_row(
    change: DecisionChange, spans: Sequence[Span], rule_set: RuleSet
) -> tuple[str, ...]:
    moved = change.change
    feature, span = rule_set.source.features[moved.feature], spans[moved.feature]
    rules = [rule_set.name_of(rule_set.rules[rule]) for rule in change.rules.tolist() if rule >= 0]
    return (
        feature_change_text(moved, feature),
        executed_text(tuple(change.executed.astype(float).tolist()), rule_set.actions),
        ", ".join(rules) or "none",
        number_text(change.distance),
        _exactly(moved, feature),
        _yes(span.low <= moved.after <= span.high),
    )


def _exactly(change: FeatureChange, feature: Feature) -> str:
    """The number from which it is so; none of what is said in words."""
    if feature.indicator is not None:
        return "–"
    return with_unit(float32_text(change.after), feature)


def misses_html(misses: Sequence[NearMiss], rule_set: RuleSet) -> Markup:
    """The rules that nearly apply.

    Args:
        misses: In the order in which they are shown.
        rule_set: The shield's.

    Returns:
        HTML, in a table.
    """
    rows = [_miss_row(miss, rule_set) for miss in misses]
    table = table_html(_MISSES, rows, "Rules that nearly apply") if rows else ""
    return render("states/near_misses", table=table)


def _miss_row(miss: NearMiss, rule_set: RuleSet) -> tuple[str, ...]:
    rule = rule_set.rules[miss.rule]
    features = rule_set.source.features
    return (
        rule_set.name_of(rule),
        says_text(rule, rule_set.actions[rule.dimension]),
        near_miss_text(miss.changes, features),
        number_text(miss.distance),
        _yes(miss.in_force),
        ", ".join(_exactly(change, features[change.feature]) for change in miss.changes),
    )


def way_html(table: Markup, rule: Rule | None) -> Markup:
    """The way of the state through rules that are not of the tree on screen.

    Args:
        table: Of its queries, as HTML.
        rule: That it ends at, or None.

    Returns:
        HTML.
    """
    placed = PLACED if rule is not None and rule.placed else ""
    return render("states/way", placed=placed, table=table)


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"
