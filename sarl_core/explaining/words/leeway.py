"""What rules that forbid leave in one state, in words."""

from __future__ import annotations

from sarl_core.mining.action_words import label_text
from sarl_core.mining.language import share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.leeway import LabelsLeft


def left_text(left: LabelsLeft, rule_set: RuleSet, dimension: int) -> str:
    """What is forbidden in a state, by which rules, and what is left.

    Args:
        left: In one action dimension.
        rule_set: The shield's.
        dimension: Its index.

    Returns:
        As "Forbidden here: do nothing (R1). Left: fire left engine, fire right engine. Freedom
        63 %."; every action may be forbidden, and then one is left all the same.
    """
    action = rule_set.actions[dimension]
    forbidden = [
        f"{label_text(label, action)} ({rule_set.name_of(rule_set.rules[rule])})"
        for label, rule in left.forbidden
    ]
    allowed = ", ".join(label_text(label, action) for label in left.left)
    return (
        f"Forbidden here: {', '.join(forbidden) or 'nothing'}. Left: {allowed}. "
        f"Freedom {share_text(left.freedom)}."
    )
