"""Which rules of a set have the words of a search; of very many only those are then written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.language import Wording
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached

if TYPE_CHECKING:
    import pyarrow as pa


@cached(show_spinner="Writing the rules in plain language …")
def searched_texts(rule_set: RuleSet) -> pa.Array:
    """What a search looks through beside the names, a text a rule in small letters.

    Of very many rules it takes seconds, so it is made when somebody searches.
    """
    import pyarrow as pa

    wording = Wording(rule_set)
    return pa.array(
        (f"{wording.conditions(rule)} {wording.action(rule)}".lower() for rule in rule_set.rules),
        pa.large_string(),  # together they may be longer than offsets of 32 bits reach
    )


@cached()
def _names(rule_set: RuleSet) -> pa.Array:
    """What rules are called, in small letters."""
    import pyarrow as pa

    return pa.array([rule_set.name_of(rule).lower() for rule in rule_set.rules])


def have_word(rule_set: RuleSet, word: str) -> NDArray[np.bool_]:
    """Whether what each rule asks and says has a word in it, (R,).

    Args:
        rule_set: R rules.
        word: In small letters.
    """
    import pyarrow.compute as pc

    return np.asarray(pc.match_substring(searched_texts(rule_set), word))


def names_have_word(rule_set: RuleSet, word: str) -> NDArray[np.bool_]:
    """Whether the name of each rule has a word in it, (R,)."""
    import pyarrow.compute as pc

    return np.asarray(pc.match_substring(_names(rule_set), word))
