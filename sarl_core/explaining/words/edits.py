"""Edits and what they change, in words."""

from __future__ import annotations

from sarl_core.mining.action_words import says_label, says_text
from sarl_core.mining.editing.edits import Add, Edit, Move, Pin, Regrow, Remove, Switch, Unpin
from sarl_core.mining.language import conditions_text, counted, query_text, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule
from sarl_core.shielding.effects import Conflict, EditEffect, Verdicts


def edit_text(edit: Edit, rule_set: RuleSet) -> str:
    """What an edit does, as the end of "undo: ...".

    Args:
        edit: Any.
        rule_set: Knows what features, actions and rules are called.

    Returns:
        As "switch off R12" or "add a rule (always push right)".
    """
    if isinstance(edit, Regrow):
        query = Condition(edit.feature, "<=", edit.threshold)
        return f"regrow a part ({query_text(query, rule_set.source.features)})"
    rule = rule_set.names.get(edit.rule_id, "a rule")
    if isinstance(edit, Switch):
        return f"switch {'on' if edit.on else 'off'} {rule}"
    if isinstance(edit, Pin):
        return f"pin {rule}"
    if isinstance(edit, Unpin):
        return f"unpin {rule}"
    if isinstance(edit, Move):
        return f"move {rule} {'up' if edit.up else 'down'}"
    if isinstance(edit, Remove):
        return f"remove {rule}"
    text = sentence(edit.rule, rule_set, evidence=False).rstrip(".")
    text = text[:1].lower() + text[1:]
    return f"add a rule ({text})" if isinstance(edit, Add) else f"change {rule} ({text})"


def state_text(rule: Rule) -> str:
    """What a person made of a rule, for tables.

    Args:
        rule: Any.

    Returns:
        As "mined", "probed", "regrown", "pinned", "manual"; with ", off" where it is switched off.
    """
    kind = "pinned" if rule.pinned else "regrown" if rule.regrown else "mined"
    kind = kind if rule.origin == "mined" else rule.origin
    return kind if rule.enabled else f"{kind}, off"


def edits_change_text(effect: EditEffect, before: Verdicts, after: Verdicts, *, states: str) -> str:
    """What edits change at once, as a sentence.

    Args:
        effect: Of the two verdicts.
        before: Of the set without them.
        after: Of the set with them.
        states: What the states are, as "demonstrated state".

    Returns:
        As "3 of 15,000 demonstrated states are decided differently: ...".
    """
    of_all = f"of {counted(effect.states, states)}"
    if not effect.different:
        return f"None {of_all} is decided differently."
    verb = "is" if effect.different == 1 else "are"
    text = f"{effect.different:,} {of_all} {verb} decided differently"
    parts = []
    if effect.newly_covered:
        parts.append(f"{effect.newly_covered:,} had no rule and now have one")
    if effect.newly_uncovered:
        parts.append(f"{effect.newly_uncovered:,} had a rule and now have none")
    if len(effect.by_dimension) > 1:
        names = [
            f"{action.name} {count:,}"
            for action, count in zip(after.rule_set.actions, effect.by_dimension, strict=True)
            if count
        ]
        parts.append(f"by action: {', '.join(names)}")
    text += f" ({'; '.join(parts)})." if parts else "."
    moved = [
        f"{name} {verb} {_from_to(old, new)}"
        for name, old, new in (
            ("Coverage", before.coverage, after.coverage),
            ("fidelity", before.fidelity, after.fidelity),
            *([("freedom", before.freedom, after.freedom)] if after.rule_set.forbids else []),
        )
        if old != new and old == old and new == new  # NaN equals nothing
        for verb in ["rises" if new > old else "falls"]
    ]
    if moved:
        numbers = " and ".join(filter(None, (", ".join(moved[:-1]), moved[-1])))
        text += f" {numbers[:1].upper()}{numbers[1:]}."
    return text


def _from_to(old: float, new: float) -> str:
    """From where to where a share went that has changed, with as many digits as show it."""
    for decimals in (None, 1, 2):
        before, after = share_text(old, decimals=decimals), share_text(new, decimals=decimals)
        if before != after:
            return f"from {before} to {after}"
    return f"by less than 0.01 points, from {before}"


def conflict_text(conflict: Conflict, rule_set: RuleSet, *, states: str) -> str:
    """A placed rule that overrules another, as a sentence.

    Args:
        conflict: Of the rule set.
        rule_set: The edited one.
        states: What the states are, as "demonstrated state".

    Returns:
        As "R1 (push right) takes 12 demonstrated states from R5 (push left): ...".
    """
    rule, other = rule_set.rules[conflict.rule], rule_set.rules[conflict.other]
    dimension = rule_set.actions[rule.dimension]
    labels = [says_label(one, dimension) for one in (rule, other)]
    name, other_name = rule_set.name_of(rule), rule_set.name_of(other)
    text = (
        f"{name} ({labels[0]}) takes {counted(conflict.states, states)} from "
        f"{other_name} ({labels[1]})"
    )
    if conflict.right is None or conflict.other_right is None:
        return f"{text}."
    return (
        f"{text}; the expert did as {name} says in {conflict.right:,} of them, as {other_name} "
        f"says in {conflict.other_right:,}."
    )


def rule_name(rule: Rule, rule_set: RuleSet) -> str:
    """A rule in one line, where there is little room.

    Args:
        rule: One of the set.
        rule_set: Knows the names.

    Returns:
        As "R12: pole angle > 0.02 rad → push right".
    """
    does = says_text(rule, rule_set.actions[rule.dimension])
    return f"{rule_set.name_of(rule)}: {conditions_text(rule, rule_set)} → {does}"
