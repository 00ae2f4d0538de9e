"""Words: as actions they become labels under their own names, as features indicators, 1 or 0.

The words of a column stand in one order everywhere: that of an ordered category, else sorted.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.fields import TRUTH, Indicator
from sarl_core.errors import InputError, quoted

MOST_WORDS = 30
"""Of a feature: each is one more that a person has to tell apart in every rule."""
_LISTED = 12
_BEGINS_AS_NUMBER = re.compile(r"[+-]?[.,]?\d")


class Coded(NamedTuple):
    """A column of words.

    Attributes:
        codes: Which word stands in each row, (N,) int64; -1 where there is none.
        words: Each once, in their order.
    """

    codes: NDArray[np.int64]
    words: tuple[str, ...]


def in_order(codes: NDArray[Any], texts: Sequence[str], *, ordered: bool = False) -> Coded:
    """A column of words without those that do not occur.

    Args:
        codes: Which text stands in each row, (N,); below 0 where there is none.
        texts: In any order; what is white space alone is none.
        ordered: Whether that is an order of their own; else they are sorted.

    Returns:
        The words without the white space around them.
    """
    used, places = np.unique(codes, return_inverse=True)
    bare = [texts[code].strip() if code >= 0 else "" for code in used.tolist()]
    words = dict.fromkeys(word for word in bare if word)
    known = list(words) if ordered else sorted(words)
    numbers = {word: number for number, word in enumerate(known)}
    renumbered = np.array([numbers.get(word, -1) for word in bare], dtype=np.int64)
    return Coded(renumbered[places.reshape(-1)], tuple(known))


def coded(values: Any) -> Coded | None:
    """Words that somebody hands over in Python.

    Args:
        values: Texts, truth values, or a category of either, (N,).

    Returns:
        None if they are neither.
    """
    dtype = getattr(values, "dtype", None)
    categories = getattr(dtype, "categories", None)
    if categories is not None:
        if not all(isinstance(one, (str, bool, np.bool_)) for one in categories):
            return None
        texts = [TRUTH[bool(one)] if not isinstance(one, str) else one for one in categories]
        codes = np.asarray(getattr(values, "cat", values).codes)
        return in_order(codes, texts, ordered=bool(getattr(dtype, "ordered", False)))
    array = np.asarray(values)
    if array.ndim != 1:
        return None
    if array.dtype.kind == "b":
        return in_order(array.astype(np.int64), TRUTH)
    if array.dtype.kind == "U":
        different, codes = np.unique(array, return_inverse=True)
        return in_order(codes.reshape(-1), different.tolist())
    if array.dtype.kind != "O":
        return None
    missing = [one is None or one != one for one in array]
    given = {one for one, none in zip(array, missing, strict=True) if not none}
    if not given or not all(isinstance(one, (str, bool, np.bool_)) for one in given):
        return None
    texts = [TRUTH[bool(one)] if not isinstance(one, str) else one for one in given]
    numbers = dict(zip(given, range(len(given)), strict=True))
    rows = zip(array, missing, strict=True)
    codes = np.array([-1 if none else numbers[one] for one, none in rows], dtype=np.int64)
    return in_order(codes, texts)


def counted_as_they_come(values: NDArray[Any]) -> NDArray[np.int64]:
    """Numbers from 0 for what numbers are too long for, or what is none, as ids and texts.

    Args:
        values: Shape (N,).

    Returns:
        Which of the different values each is, in the order in which they come, (N,).
    """
    _, first, places = np.unique(values, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[places.reshape(-1)]


def numbered_episodes(
    values: NDArray[Any], column: str, first: str
) -> tuple[NDArray[np.int64], str]:
    """Episodes that are numbered as they come.

    Args:
        values: What their column has, (N,).
        column: As of `numbered_note`.
        first: Likewise.

    Returns:
        Their numbers, (N,), and the note.
    """
    return counted_as_they_come(values), numbered_note(column, first)


def numbered_note(column: str, first: str) -> str:
    """That episodes got other numbers than their column has.

    Args:
        column: As messages call it.
        first: What the first of them is called there.

    Returns:
        The note.
    """
    return f"the episodes of {column} are numbered from 0, {first} first"


def indicators_of(column: str, words: Sequence[str]) -> tuple[Indicator, ...]:
    """The features that say which word a column holds.

    Args:
        column: What it is called, as "mode".
        words: That it holds, in their order.

    Returns:
        One a word; of two words one, which says as much, as the other is its opposite: of false
        and true "true", else the first.

    Raises:
        InputError: If there are too many words.
    """
    if len(words) > MOST_WORDS and begin_as_numbers(words):
        raise InputError(
            f"{quoted(column)} holds {len(words):,} different texts that begin as numbers do, "
            f"{_listed(words[:3])}; write plain numbers, without units, signs or commas between "
            "thousands, or leave the column out"
        )
    if len(words) > MOST_WORDS:
        raise InputError(
            f"{quoted(column)} holds {len(words):,} different words, {_listed(words)}, more than "
            f"the {MOST_WORDS} that rules a person reads could tell apart; write fewer words, or "
            "leave the column out"
        )
    if len(words) == 2:
        value, otherwise = words[::-1] if tuple(words) == TRUTH else words
        return (Indicator(column, value, otherwise),)
    return tuple(Indicator(column, word) for word in words)


def begin_as_numbers(words: Sequence[str]) -> bool:
    """Whether words may be amounts that something stands around: "10 %", "1,200", "3 m/s"."""
    return all(map(_BEGINS_AS_NUMBER.match, words))


def indicated(coded: Coded, indicators: Sequence[Indicator]) -> NDArray[np.float32]:
    """The values of indicators.

    Args:
        coded: The column.
        indicators: Of it, k of them.

    Returns:
        Shape (N, k), 1 or 0; NaN where the column holds no word.
    """
    numbers = {word: number for number, word in enumerate(coded.words)}
    places = np.array([numbers.get(one.value, -2) for one in indicators])
    values: NDArray[np.float32] = (coded.codes[:, None] == places).astype(np.float32)
    values[coded.codes < 0] = np.nan
    return values


def columns_of_words(indicators: Sequence[Indicator | None]) -> dict[str, list[int]]:
    """Where the indicators of each column of words stand among the features."""
    places: dict[str, list[int]] = {}
    for at, one in enumerate(indicators):
        if one is not None:
            places.setdefault(one.column, []).append(at)
    return places


def words_of(indicators: Sequence[Indicator]) -> tuple[str, ...]:
    """The words that the indicators of one column know, as `indicators_of` was given them."""
    if len(indicators) == 1 and indicators[0].otherwise:
        one = indicators[0]
        return (one.otherwise, one.value) if one.is_truth else (one.value, one.otherwise)
    return tuple(one.value for one in indicators)


def spelled(values: NDArray[np.float32], indicators: Sequence[Indicator]) -> Coded:
    """The column that indicators were made of.

    Args:
        values: Of all the indicators of one column, (N, k).
        indicators: Those.

    Returns:
        Its words; -1 where no indicator says which.
    """
    words = words_of(indicators)
    if len(indicators) == 1 and indicators[0].otherwise:
        one = indicators[0]
        places = np.where(values[:, 0] > 0.5, words.index(one.value), words.index(one.otherwise))
        return Coded(places.astype(np.int64), words)
    codes = np.where((values > 0.5).any(axis=1), values.argmax(axis=1), -1)
    return Coded(codes.astype(np.int64), words)


def by_name(
    words: Sequence[str], names: Sequence[str], what: str, *, whose: str = "the action space"
) -> NDArray[np.int64]:
    """Which label each word names.

    Args:
        words: That stand for actions.
        names: Of all labels.
        what: Holds them, for the message.
        whose: The labels are, likewise.

    Returns:
        One place a word; a difference of capitals does not matter where only that is one, and false
        and true name the first and the second of two.

    Raises:
        InputError: If a word names none.
    """
    exact = {name: place for place, name in enumerate(names)}
    folded = {name.casefold(): place for place, name in enumerate(names)}
    if len(folded) < len(names):
        folded = {}
    places = [exact.get(word, folded.get(word.casefold(), -1)) for word in words]
    if -1 in places and len(names) == len(TRUTH) and {*map(str.casefold, words)} <= {*TRUTH}:
        places = [TRUTH.index(word.casefold()) for word in words]
    if -1 in places:
        raise InputError(
            f"{what} holds {quoted(words[places.index(-1)])}, which is none of the actions of "
            f"{whose}, {_listed(names)}; write those names, or their numbers"
        )
    return np.array(places, dtype=np.int64)


def _listed(names: Sequence[str]) -> str:
    first = ", ".join(map(quoted, names[:_LISTED]))
    return first if len(names) <= _LISTED else f"{first} and {len(names) - _LISTED:,} more"
