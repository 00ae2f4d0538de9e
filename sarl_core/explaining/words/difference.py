"""The difference of two rule sets, in words and as a document."""

from __future__ import annotations

from typing import Any

from sarl_core.mining.action_words import label_text, says_text
from sarl_core.mining.editing.difference import RuleChange
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import (
    conditions_text,
    counted,
    exact_condition,
    sentence,
    share_text,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.disagreement import Choices, Disagreement

NO_RULE_TEXT = "no rule"
_MOST_IN_TEXT = 10  # rules of each kind in the text for a terminal


def said_text(label: int, dimension: LabelledDimension, choices: Choices = ()) -> str:
    """What a rule set says of a state.

    Args:
        label: A label, a choice behind the last label, or none of these (-1, or one past the last)
            for no rule.
        dimension: Whose label it is.
        choices: Labels that rules which forbid leave, where several are.

    Returns:
        As "push right", "never push right or push left" or "no rule".
    """
    if 0 <= label < dimension.n_labels:
        return label_text(label, dimension)
    if not 0 <= label - dimension.n_labels < len(choices):
        return NO_RULE_TEXT
    left = choices[label - dimension.n_labels]
    forbidden = [one for one in range(dimension.n_labels) if one not in left]
    return f"never {' or '.join(label_text(one, dimension) for one in forbidden)}"


def what_text(change: RuleChange, difference: Disagreement, *, beside: bool = False) -> str:
    """What changed of a rule.

    Args:
        change: One of the difference.
        difference: Knows the names.
        beside: Whether the rule as it is now stands beside this, so that what was is enough.

    Returns:
        As "angle > 0.1 instead of angle > 0.2; switched off"; beside the rule "was angle > 0.2;
        switched off".
    """
    before, after, what = change
    parts = []
    if "conditions" in what:
        was = conditions_text(before, difference.first)
        now = conditions_text(after, difference.second)
        if was == now:  # they differ beyond what is shown
            was, now = (
                exact_rule_text(before, difference.first),
                exact_rule_text(after, difference.second),
            )
        parts.append(f"was {was}" if beside else f"{now} instead of {was}")
    if "action" in what:
        dimension = difference.first.actions[before.dimension]
        earlier = says_text(before, dimension)
        says = says_text(after, difference.second.actions[after.dimension])
        parts.append(f"said {earlier}" if beside else f"{says} instead of {earlier}")
    if "switched" in what:
        parts.append(f"switched {'on' if after.enabled else 'off'}")
    if "place" in what:
        if after.pinned == before.pinned:
            parts.append("another place in the order")
        else:
            parts.append("pinned" if after.pinned else "no longer pinned")
    if "origin" in what:
        parts.append(f"{after.origin} instead of {before.origin}")
    return "; ".join(parts)


def exact_rule_text(rule: Rule, rule_set: RuleSet) -> str:
    """The conditions of a rule at full precision.

    Args:
        rule: One of the set.
        rule_set: Knows the names.

    Returns:
        As "angle > 0.1000000001"; "always" without conditions.
    """
    features = rule_set.source.features
    return " and ".join(exact_condition(one, features) for one in rule.conditions) or "always"


def rows_text(disagreement: Disagreement) -> str:
    """How the rules of two sets differ, in a sentence.

    Args:
        disagreement: The comparison.

    Returns:
        As "2 rules added, 1 rule removed, none changed, 12 rules the same."
    """
    difference = disagreement.difference
    counts = (
        (len(difference.added), "added"),
        (len(difference.removed), "removed"),
        (len(difference.changed), "changed"),
        (difference.same, "the same"),
    )
    text = ", ".join(
        f"{counted(count, 'rule') if count else 'none'} {what}" for count, what in counts
    )
    return f"{text[:1].upper()}{text[1:]}."


def decided_text(disagreement: Disagreement, *, states: str) -> str:
    """On how many states two sets decide differently, in a sentence.

    Args:
        disagreement: The comparison.
        states: What the states are, as "demonstrated state".

    Returns:
        As "The two decide 12 of 500 demonstrated states (2.4 %) differently."
    """
    of_all = f"of {counted(disagreement.states, states)}"
    if not disagreement.different:
        return f"The two decide none {of_all} differently."
    share = share_text(disagreement.share)
    return f"The two decide {disagreement.different:,} {of_all} ({share}) differently."


def kinds_text(disagreement: Disagreement, dimension: int, names: tuple[str, str]) -> str:
    """In what way they do, in one action dimension.

    Args:
        disagreement: The comparison.
        dimension: Which one.
        names: What the two sets are called.

    Returns:
        As "3 where both have a rule, 5 where only the first has one".
    """
    contradicting, only_first, only_second = disagreement.kinds(dimension)
    parts = [
        f"{count:,} where {where}"
        for count, where in (
            (contradicting, "both have a rule and they say different things"),
            (only_first, f"only {names[0]} has a rule"),
            (only_second, f"only {names[1]} has a rule"),
        )
        if count
    ]
    return ", ".join(parts) or "none"


def difference_document(
    disagreement: Disagreement, *, names: tuple[str, str], states_from: str
) -> dict[str, Any]:
    """Everything that differs, for JSON.

    Args:
        disagreement: The comparison.
        names: What the two sets are called, as their files.
        states_from: Where the states are from.

    Returns:
        A document; labels are numbers with their names beside them.
    """
    difference = disagreement.difference
    return {
        "first": names[0],
        "second": names[1],
        "added": [_rule(rule, disagreement.second) for rule in difference.added],
        "removed": [_rule(rule, disagreement.first) for rule in difference.removed],
        "changed": [
            {
                "what": list(change.what),
                "text": what_text(change, disagreement),
                "before": _rule(change.before, disagreement.first),
                "after": _rule(change.after, disagreement.second),
            }
            for change in difference.changed
        ],
        "same": difference.same,
        "states": {
            "from": states_from,
            "count": disagreement.states,
            "different": disagreement.different,
            "share": disagreement.share,
        },
        "dimensions": [
            {
                "name": action.name,
                "different": int(disagreement.differs[:, at].sum()),
                **disagreement.kinds(at)._asdict(),
                "says": [
                    *(
                        said_text(one, action, disagreement.choices[at])
                        for one in range(action.n_labels + len(disagreement.choices[at]))
                    ),
                    None,
                ],
                "confusion": disagreement.confusion(at).tolist(),
            }
            for at, action in enumerate(disagreement.first.actions)
        ],
    }


def _rule(rule: Rule, rule_set: RuleSet) -> dict[str, Any]:
    return {
        "id": rule.id,
        "dimension": rule.dimension,
        "conditions": [condition._asdict() for condition in rule.conditions],
        "action": rule.action,
        **({"forbids": list(rule.forbids)} if rule.forbids else {}),
        "enabled": rule.enabled,
        "pinned": rule.pinned,
        "origin": rule.origin,
        "text": sentence(rule, rule_set, evidence=False),
    }


def difference_lines(
    disagreement: Disagreement, *, names: tuple[str, str], states_from: str
) -> list[str]:
    """The same for reading.

    Args:
        disagreement: The comparison.
        names: What the two sets are called, as their files.
        states_from: Where the states are from, as a sentence.

    Returns:
        Lines; of each kind the first few rules.
    """
    difference = disagreement.difference
    lines = [
        f"From {names[0]} ({counted(len(disagreement.first), 'rule')}) to {names[1]} "
        f"({counted(len(disagreement.second), 'rule')}): {_lower(rows_text(disagreement))}",
        decided_text(disagreement, states="state"),
        states_from,
    ]
    if disagreement.different:
        several = len(disagreement.first.actions) > 1
        for at, action in enumerate(disagreement.first.actions):
            text = kinds_text(disagreement, at, ("the first", "the second"))
            lines.append(f"  {action.name}: {text}" if several else f"  {text}")
    for title, rules, rule_set in (
        ("Added", difference.added, disagreement.second),
        ("Removed", difference.removed, disagreement.first),
    ):
        if rules:
            often = sorted(rules, key=lambda rule: -rule.samples)
            sentences = [f"{rule_set.name_of(rule)}: {sentence(rule, rule_set)}" for rule in often]
            lines += ["", f"{title}:", *_first_few(sentences)]
    if difference.changed:
        changes = [
            f"{before if before == after else f'{before} (now {after})'}: "
            f"{what_text(change, disagreement)}"
            for change in difference.changed
            for before in (disagreement.first.name_of(change.before),)
            for after in (disagreement.second.name_of(change.after),)
        ]
        lines += ["", "Changed:", *_first_few(changes)]
    return lines


def _first_few(lines: list[str]) -> list[str]:
    first = [f"  {line}" for line in lines[:_MOST_IN_TEXT]]
    if len(lines) > _MOST_IN_TEXT:
        first.append(f"  and {len(lines) - _MOST_IN_TEXT:,} more; --json lists them all")
    return first


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
