"""Small pieces of C: names, numbers and comments."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sarl_core.explaining.exports.program import Program, Replacement
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import one_line
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule


def comment(text: str) -> str:
    """Text from outside for a C comment.

    Args:
        text: Any.

    Returns:
        One line that cannot end the comment, begin another or be taken for a trigraph.
    """
    line = one_line(text)
    # Twice for question marks: of three, the first pass leaves two side by side.
    for signs, harmless in (("\\", "|"), ("*/", "* /"), ("/*", "/ *"), *[("??", "? ?")] * 2):
        line = line.replace(signs, harmless)
    return line


def kind_of(program: Program) -> str:
    """The type of an action."""
    return "float" if program.continuous else "int64_t"


def finder_name(index: int, label: int | None = None) -> str:
    """The function that finds the rule of an action dimension, or the one that forbids a label."""
    return f"shield_rule_of_{index}" if label is None else f"shield_never_{index}_{label}"


def number(value: float) -> str:
    """A number that C reads back as the same double."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def floats(outcome: Replacement) -> list[str]:
    """What an action becomes, where that is one value, and the ends of what is left."""
    values = [one for one in outcome[:3] if one is not None]
    return [f"(float){number(value)}" for value in values]


def listed(values: Iterable[object]) -> str:
    """Values of an array or a structure."""
    return f"{{{', '.join(map(str, values))}}}"


def rule_comment(rule: Rule, rule_set: RuleSet) -> str:
    """A rule's name and what it says, for a comment."""
    action = says_text(rule, rule_set.actions[rule.dimension])
    return comment(f"{rule_set.name_of(rule)}: {action}")
