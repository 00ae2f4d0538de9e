"""Shields on their way to processes: packed once, unpacked once in each process.

A shield with thousands of rules takes longer to pack and to unpack than an episode takes to run,
and to take out one of its rules makes another shield. So many pieces of work share one packed
shield and say which rule is out, and a process keeps what it has unpacked.
"""

from __future__ import annotations

import pickle
from functools import lru_cache
from typing import NamedTuple

from sarl_core.rollouts.rule_use import without_rule
from sarl_core.shielding.shield import Shield

_MOST_SHIELDS = 4  # callers whose work alternates in a process, and rules that are out by turns


class PackedShield(NamedTuple):
    """A shield, or one with a rule taken out, as it is sent to a process.

    Attributes:
        content: The shield with all its rules. It comes with every piece: a new process needs
            nothing that others were given, and copying takes a hundredth of what unpacking does.
        without: Index of the rule that is taken out; None for none.
    """

    content: bytes
    without: int | None = None


def pack(shield: Shield) -> bytes:
    """Pack a shield with all its rules.

    Args:
        shield: Any.

    Returns:
        What `PackedShield` takes as content.
    """
    from loky import wrap_non_picklable_objects

    # As everything else is packed that goes to the processes, whatever script made it.
    return pickle.dumps(wrap_non_picklable_objects(shield, keep_wrapper=False))


def unpack(packed: PackedShield) -> Shield:
    """The shield that was packed by this program; in a process.

    Args:
        packed: By `pack`. Never something that came from a file or a person.

    Returns:
        The shield, without the rule that is taken out; the same object as the last time.
    """
    if packed.without is None:
        return _whole(packed.content)
    return _without(packed.content, packed.without)


@lru_cache(_MOST_SHIELDS)
def _whole(content: bytes) -> Shield:
    shield: Shield = pickle.loads(content)
    return shield


@lru_cache(_MOST_SHIELDS)
def _without(content: bytes, rule: int) -> Shield:
    return without_rule(_whole(content), rule)
