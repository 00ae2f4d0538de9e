"""What the values of columns say of a guess by their names: counters, next states, letters."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats import vocabulary
from sarl_core.demonstrations.formats.columns import (
    IS_TIME,
    Guess,
    UnclearColumnsError,
    listed,
    unclear_columns,
)
from sarl_core.demonstrations.formats.mapping.roles import settled_by
from sarl_core.demonstrations.formats.times import as_clock
from sarl_core.demonstrations.formats.vocabulary import plain
from sarl_core.demonstrations.requirements import (
    FEW_VALUES,
    counts_steps,
    counts_up,
    is_whole,
    rises_steadily,
)
from sarl_core.errors import InputError

Values = Mapping[str, NDArray[Any]]

_LEAST_ROWS = 10  # fewer count up by chance
_INFINITE = np.errstate(invalid="ignore", over="ignore")  # such values are refused afterwards
_YEAR_2001, _YEAR_2065 = 1e9, 3e9  # seconds since 1970
_LEAST_CHANGES = 5  # of a column, before another one may be called its next value


@_INFINITE
def settle(guess: Guess, values: Values, words: Collection[str] = ()) -> Guess:
    """Correct a guess by what the columns hold.

    Args:
        guess: By the columns' names.
        values: Of every column that it uses, each of shape (N,).
        words: The columns whose values stand for words, which count nothing.

    Returns:
        The guess without features that are none.

    Raises:
        InputError: If it is unclear what a column is; the sentence names it.
    """
    guess = _doubtful_roles(guess, values)
    together = same_episode(guess, values)
    _require_action(guess, values)
    if not guess.prefixed:
        numbers = {name: held for name, held in values.items() if name not in words}
        guess = guess.without(_counters(guess, numbers, together))
    guess = guess.without(_next_states(guess, values, together))
    if not guess.columns.observations:
        raise InputError(
            f"there is no observation column beside {listed(guess.unused)}, which are none; "
            f"{settled_by(next(iter(guess.unused)), 'feature')}"
        )
    return guess


@_INFINITE
def resolved(guess: Guess, values: Values, names: Sequence[str]) -> Guess:
    """A guess whose unclear columns turned out to number the rows.

    Args:
        guess: With unclear columns.
        values: Of these.
        names: All columns.

    Returns:
        The guess without them.

    Raises:
        InputError: If one of them holds something else.
    """
    counted = counters(values)
    unclear = tuple(name for name in guess.unclear if name not in counted)
    if unclear:
        raise unclear_columns(unclear, names)
    return replace(guess, unclear=(), unused={**guess.unused, **counted})


@_INFINITE
def counters(values: Values) -> dict[str, str]:
    """Columns that number the rows.

    Args:
        values: Of some columns, each of shape (N,).

    Returns:
        Why each of them is no feature and no action.
    """
    return (
        {
            name: "it never falls and holds numbers as those of seconds since 1970"
            for name, held in values.items()
            if len(held) >= _LEAST_ROWS and _rises_since_1970(held)
        }
        | {
            name: "it rises by the same amount in every row, as a counter or a clock does"
            for name, held in values.items()
            if len(held) >= _LEAST_ROWS and rises_steadily(held)
        }
        | {
            name: "it counts the rows"
            for name, held in values.items()
            if _counts(held, None) or _counts(held[::-1], None)
        }
    )


def numbers_episodes(values: NDArray[Any]) -> bool:
    """Whether a column holds what a number of the episode does: it stays, and goes on by one.

    Args:
        values: Shape (N,).

    Returns:
        False also where there are too few rows to tell.
    """
    if len(values) < _LEAST_ROWS or values.dtype.kind == "b" or not is_whole(values):
        return False
    rises = np.diff(values.astype(np.float64))
    begun = np.count_nonzero(rises)
    return bool(np.all((rises == 0) | (rises == 1)) and 2 <= begun <= len(values) // 3)


@_INFINITE
def same_column(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two columns hold the same, and change too often for that to be chance."""
    enough = len(one) >= _LEAST_ROWS and np.count_nonzero(np.diff(one)) >= _LEAST_CHANGES
    return bool(enough and np.array_equal(one.astype(np.float32), other.astype(np.float32)))


def same_episode(guess: Guess, values: Values) -> NDArray[np.bool_]:
    """Whether a row and the next one belong to one episode, (N - 1,), as far as columns say."""
    columns = guess.columns
    if columns.episode is not None:
        episodes = values[columns.episode]
        return np.asarray(episodes[1:] == episodes[:-1])
    if columns.first is not None:
        return np.asarray(values[columns.first][1:] == 0)
    ends = [values[name] for name in (columns.last, columns.terminated, columns.truncated) if name]
    if ends:
        return np.asarray(np.logical_and.reduce([end[:-1] == 0 for end in ends]))
    if columns.step is not None:
        steps = values[columns.step]
        return np.asarray(steps[1:] > steps[:-1])
    return np.ones(max(len(next(iter(values.values()))) - 1, 0), dtype=np.bool_)


def _doubtful_roles(guess: Guess, values: Values) -> Guess:
    """Take back a role that a doubtful name suggested and that the values contradict."""
    columns = guess.columns
    for role in ("episode", "step"):
        name = getattr(columns, role)
        if name is None or name in guess.roles:
            continue
        if not vocabulary.DOUBTFUL_ROLES.fullmatch(plain(name)):
            continue
        held = values[name]
        if role == "episode":
            if not is_whole(held) or 1 + np.count_nonzero(np.diff(held)) != len(np.unique(held)):
                what = "whether it numbers the episodes"
                raise unclear_columns((name,), tuple(values), what, ("episode", "feature"))
            continue
        others = replace(columns, step=None)
        together = same_episode(replace(guess, columns=others), values)
        rises = np.diff(held.astype(np.float64))[together] >= 0
        if columns.episode is None and is_whole(held):
            rises |= (held[1:] == held[0])[together]  # it begins again
        rising = bool(rises.mean() >= 0.9) if len(rises) else True
        if guess.prefixed and is_whole(held):
            continue
        if not rising:
            what = "whether it counts the steps"
            raise unclear_columns((name,), tuple(values), what, ("step", "feature"))
        if not is_whole(held):
            guess = replace(
                guess,
                columns=replace(columns, step=None),
                unused={**guess.unused, name: IS_TIME},
            )
            if columns.time is None:
                guess = as_clock(guess, name)
    return guess


def _require_action(guess: Guess, values: Values) -> None:
    """Refuse "a" as the action where it may be an acceleration."""
    columns = guess.columns
    if [plain(name) for name in columns.actions] != ["a"] or guess.prefixed:
        return
    (letter,) = columns.actions
    if letter in guess.roles:
        return
    labels = _few_labels(values[letter])
    rivals = [
        name
        for name in columns.observations
        if vocabulary.CONTROLS.fullmatch(plain(name))
        or (not labels and _few_labels(values[name]) and len(np.unique(values[name])) > 1)
    ]
    if rivals:
        raise UnclearColumnsError(
            (letter, *rivals),
            f"it is unclear which column is the action, {letter!r} or {listed(rivals)}; "
            f"{settled_by((letter, *rivals), 'action')}",
        )
    roles = columns.reward or columns.terminated or columns.truncated or columns.last
    if not (labels or roles or all(map(vocabulary.is_state_word, columns.observations))):
        raise UnclearColumnsError(
            (letter,),
            f"it is unclear whether the column {letter!r} is the action or a feature; "
            f"{settled_by(letter, 'action', 'feature')}",
        )


def _counters(guess: Guess, values: Values, together: NDArray[np.bool_]) -> dict[str, str]:
    """Features that count the rows, or are the clock."""
    features = [name for name in guess.columns.observations if name in values]
    steps = {
        name: "it counts the steps"
        for name in features
        if counts_steps(values[name], together, least=_LEAST_ROWS)
        or (plain(name) in _COUNTER_WORDS and _counts(values[name], together))
    }
    return steps | counters({name: values[name] for name in features})


_COUNTER_WORDS = frozenset(
    {"row", "rows", "line", "n", "i", "j", "k", "t", "no", "nr", "num", "number", "count"}
    | {"counter", "seq", "sequence", "sample", "record", "obs_no", "obs_nr", "sample_index"}
    | {"sample_no", "sample_nr", "sample_number", "record_no", "record_index", "tick", "frame"}
)


def _next_states(guess: Guess, values: Values, together: NDArray[np.bool_]) -> dict[str, str]:
    """Features that hold what another one holds a step later."""
    features = guess.columns.observations
    follows = _followers(features, values, together)
    reasons: dict[str, str] = {}
    if guess.prefixed:
        named = vocabulary.next_states(features)
        return {
            name: f"it holds the next {base!r}"
            for name, base in named.items()
            if follows.get(name) == base
        }
    lettered = vocabulary.perhaps_next_states(features, numbered=False)
    bases = set(lettered.values())
    # "ns0" and "ns1" beside "s0" and "s1" and nothing else: as textbooks write it.
    complete = set(features) == bases | set(lettered) and not bases & set(lettered)
    written = complete and (len(bases) > 1 or all(map(vocabulary.is_state_word, bases)))
    for name, base in vocabulary.perhaps_next_states(features, numbered=True).items():
        if written or follows.get(name) == base:
            reasons[name] = f"it holds the next {base!r}"
    for name, base in follows.items():
        if name in guess.roles or base in guess.roles:
            continue
        if name in reasons or base in reasons or vocabulary.says_before(base):
            continue
        if vocabulary.says_before(name) or name in vocabulary.next_states(features):
            continue
        raise UnclearColumnsError(
            (name,),
            f"the column {name!r} holds in each row what {base!r} holds in the next one, and a "
            f"state does not know the next; {settled_by(name, 'ignore', 'feature')}",
        )
    return reasons


def _followers(
    features: Sequence[str], values: Values, together: NDArray[np.bool_]
) -> dict[str, str]:
    """For each feature the other one whose next value it holds in every row."""
    if np.count_nonzero(together) < _LEAST_ROWS:
        return {}
    later = {_fingerprint(values[name][1:][together]): name for name in features}
    followed = {}
    for name in features:
        held = values[name][:-1][together]
        base = later.get(_fingerprint(held))
        if base is not None and base != name and np.count_nonzero(np.diff(held)) >= _LEAST_CHANGES:
            followed[name] = base
    return followed


def _fingerprint(values: NDArray[Any]) -> bytes:
    # The values themselves, of all features, would be in memory once more.
    return hashlib.blake2b(values.tobytes()).digest()


def _rises_since_1970(values: NDArray[Any]) -> bool:
    """Whether a column may be a clock's: seconds, milli-, micro- or nanoseconds of our years."""
    first, last = float(values[0]), float(values[-1])
    known = any(
        _YEAR_2001 * unit < first <= last < _YEAR_2065 * unit for unit in (1, 1e3, 1e6, 1e9)
    )
    return known and bool(np.all(np.diff(values.astype(np.float64)) >= 0))


def _counts(values: NDArray[Any], together: NDArray[np.bool_] | None) -> bool:
    return len(values) >= _LEAST_ROWS and counts_up(values, together)


def _few_labels(values: NDArray[Any]) -> bool:
    return is_whole(values) and len(np.unique(values)) <= FEW_VALUES
