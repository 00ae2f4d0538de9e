"""What a person has made of a rule set, counted in words."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.mining.rules import Rule


def is_plain(rules: Sequence[Rule]) -> bool:
    """Whether the rules of a set are as a tree gives them: they never overlap, counts add up.

    Args:
        rules: Of a set.

    Returns:
        True if every rule is switched on and none was written or put in its place by hand; a part
        of the tree may have been regrown.
    """
    return all(rule.enabled and not rule.placed for rule in rules)


def edits_counted(rules: Sequence[Rule]) -> str:
    """How a rule set was edited.

    Args:
        rules: Of a set.

    Returns:
        As "edited by hand: 1 off, 0 pinned, 2 added"; with ", 3 regrown" where some are of a
        part of the tree that was.
    """
    off, pinned, added, regrown = edit_counts(rules)
    text = f"edited by hand: {off:,} off, {pinned:,} pinned, {added:,} added"
    return f"{text}, {regrown:,} regrown" if regrown else text


def regrown_text(rules: Sequence[Rule]) -> str:
    """How many rules are of a part of the tree that was regrown.

    Args:
        rules: Of a set.

    Returns:
        As "; regrown by hand: 2 rules", to stand behind other counts; "" where there are none.
    """
    regrown = edit_counts(rules)[-1]
    return f"; regrown by hand: {regrown:,} rule{'' if regrown == 1 else 's'}" if regrown else ""


def edit_counts(rules: Sequence[Rule]) -> tuple[int, int, int, int]:
    """How many rules were switched off, pinned, written by hand, and regrown.

    Args:
        rules: Of a set.

    Returns:
        The four numbers; one that was written by hand does not count as pinned.
    """
    return (
        sum(not rule.enabled for rule in rules),
        sum(rule.pinned and rule.origin != "manual" for rule in rules),
        sum(rule.origin == "manual" for rule in rules),
        sum(rule.regrown for rule in rules),
    )


def edits_sentence(rules: Sequence[Rule]) -> str:
    """What was done to the rules after they were mined or built.

    Args:
        rules: Of a set.

    Returns:
        As "2 rules were then switched off, 1 written by hand."; "" for a plain set.
    """
    done = ("switched off", "pinned", "written by hand", "regrown with a part of the tree")
    counts = edit_counts(rules)
    parts = [f"{count:,} {what}" for count, what in zip(counts, done, strict=True) if count]
    if not parts:
        return ""
    count, rest = parts[0].split(" ", maxsplit=1)
    verb = "rule was" if count == "1" else "rules were"
    return f"{', '.join([f'{count} {verb} then {rest}', *parts[1:]])}."


def reading_order(rules: Sequence[Rule]) -> list[Rule]:
    """Rules as people read them.

    Args:
        rules: Of one action dimension.

    Returns:
        Those that a person placed, in their order, then the others, the most general first.
    """
    return sorted(rules, key=lambda rule: (not rule.placed, 0 if rule.placed else -rule.samples))
