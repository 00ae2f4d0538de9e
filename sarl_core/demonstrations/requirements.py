"""The checks that fields of demonstrations and columns of files share, each with its sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.splits import written_value
from sarl_core.errors import InputError, quoted
from sarl_core.shared_arrays import is_shared

FEW_VALUES = 32  # whole numbers written as 0.0, 1.0 are labels up to so many of them

_FEW_STEPS = 2**12  # of float32 between the least and the largest value of a feature
_STEADY = 1e-3  # by how much the steps of a clock may differ, as a share
_SEVERAL = 3  # episodes that run alike; two may do so by chance
_MOST_BROKEN = 0.1  # of the values of an action that is taken for labels by whoever reads it
_LARGEST_CODE = 2**31  # a label that is larger is a slip
EXACT = 2**53  # up to here every whole number is a float64
# The sum of as many numbers as fit in memory is a float32 yet: scikit-learn sums up all values to
# see whether some are missing, and takes them to be where the sum is no number.
LARGEST = 1e30


def require_length(got: int, wanted: int, what: str, other: str) -> None:
    """Refuse a number of things that differs from what it belongs to."""
    if got != wanted:
        raise InputError(f"there are {got:,} {what} for {wanted:,} {other}; give one for each")


def require_finite(
    values: NDArray[Any], columns: Sequence[str], rows: NDArray[np.int64] | None = None
) -> None:
    """Refuse NaN, infinity, and the huge numbers that devices write where they read nothing.

    Args:
        values: Shape (N, k).
        columns: What the k columns are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and the first row.
    """
    if values.dtype.kind != "f" or not values.size:
        return
    most = np.float32(LARGEST)
    with np.errstate(invalid="ignore"):
        if values.min() >= -most and values.max() <= most:  # of NaN, both are NaN
            return
    row, column = _first(~(np.abs(values) <= most))
    value = values[row, column]
    where = f"in row {_number(row, rows)}"
    if np.isfinite(value):
        count = int((np.abs(values[:, column]) > most).sum())
        which = "" if count == 1 else f"the first of {count:,} "
        said = decimal_text(written_value(float(value), (LARGEST,), fewest=6))
        raise InputError(
            f"{columns[column]} is {said} {where}, {which}beyond {LARGEST:g}, "
            "which cannot be summed up in the 32 bits in which rules are mined; mend or remove "
            "such rows if they stand for no reading, else give the column in a larger unit"
        )
    kind = "not a number (NaN)" if np.isnan(value) else "infinite"
    raise InputError(f"{columns[column]} is {kind} {where}; mend or remove that row")


def require_labels(
    values: NDArray[np.int64],
    first: Sequence[int],
    counts: Sequence[int],
    columns: Sequence[str],
    rows: NDArray[np.int64] | None = None,
) -> None:
    """Refuse discrete actions outside the action space.

    Args:
        values: Shape (N, m).
        first: The least action of each dimension.
        counts: How many actions each dimension has.
        columns: What the m columns are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and the first row.
    """
    low = np.asarray(first, dtype=np.int64)
    high = low + np.asarray(counts, dtype=np.int64) - 1
    outside = (values < low) | (values > high)
    if outside.any():
        row, i = _first(outside)
        raise InputError(
            f"{columns[i]} is {values[row, i]} in row {_number(row, rows)}, outside the action "
            f"space of whole numbers from {low[i]} to {high[i]}; mend that row"
        )


def require_whole_labels(
    values: NDArray[Any], columns: Sequence[str], rows: NDArray[np.int64] | None = None
) -> None:
    """Refuse labels that are no whole numbers, or too large to be made such of 64 bits.

    Args:
        values: Finite, shape (N, m).
        columns: What the m columns are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and the first row.
    """
    if values.dtype.kind not in "fu":
        return
    # Beyond 2**53 a float64 cannot say which whole number is meant.
    most = EXACT if values.dtype.kind == "f" else 2**63 - 1
    for wrong, what in (
        (~without_fraction(values), "but its actions are labels; write whole numbers"),
        (np.abs(values) > most, "which is too large for a label; mend that row"),
    ):
        if wrong.any():
            row, i = _first(wrong)
            where = f"row {_number(row, rows)}"
            raise InputError(f"{columns[i]} is {values[row, i]} in {where}, {what}")


def require_codes(
    values: NDArray[np.int64], columns: Sequence[str], rows: NDArray[np.int64] | None = None
) -> None:
    """Refuse numbers that are too large to be those of labels.

    Args:
        values: Shape (N, m).
        columns: What the m columns are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and the first row.
    """
    large = np.abs(values) > _LARGEST_CODE
    if large.any():
        row, i = _first(large)
        raise InputError(
            f"{columns[i]} is {values[row, i]} in row {_number(row, rows)}, too large for a label; "
            "number the labels from 0, or write amounts with a decimal point"
        )


def require_within(
    values: NDArray[np.float32],
    low: Sequence[float],
    high: Sequence[float],
    columns: Sequence[str],
    rows: NDArray[np.int64] | None = None,
) -> None:
    """Refuse continuous actions outside the action space.

    Args:
        values: Shape (N, m).
        low: Lower bound of each dimension; may be -inf.
        high: Upper bound of each; may be inf.
        columns: What the m columns are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and the first row.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a bound beyond float32 bounds nothing
        # In float32, as the environment compares them.
        least, most = np.asarray(low, dtype=np.float32), np.asarray(high, dtype=np.float32)
    outside = (values < least) | (values > most)
    if outside.any():
        row, i = _first(outside)
        raise InputError(
            f"{columns[i]} is {values[row, i]} in row {_number(row, rows)}, outside the action "
            f"space [{decimal_text(low[i])}, {decimal_text(high[i])}]; mend that row"
        )


def _first(bad: NDArray[np.bool_]) -> tuple[int, int]:
    """Row and column of the first entry that is bad, row by row."""
    row = int(np.argmax(bad.any(axis=1)))
    return row, int(np.argmax(bad[row]))


def _number(row: int, rows: NDArray[np.int64] | None) -> int:
    return (row if rows is None else int(rows[row])) + 1


def is_whole(values: NDArray[Any]) -> bool:
    """Whether all values of a column are whole numbers from 0.

    Args:
        values: Shape (N,).

    Returns:
        False also where one is not finite.
    """
    if values.dtype.kind == "b":
        return True
    return bool(np.all(np.isfinite(values) & (values >= 0) & without_fraction(values)))


def without_fraction(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Which numbers are whole, of the same shape; NaN is not."""
    with np.errstate(invalid="ignore"):  # a NaN of a file may signal
        return np.asarray(values == np.floor(values))


def counts_up(values: NDArray[Any], together: NDArray[np.bool_] | None = None) -> bool:
    """Whether a column counts: each value is by one larger than the one before.

    Args:
        values: Shape (N,).
        together: Shape (N - 1,), whether a row and the next one are to be compared; None for all.

    Returns:
        False where there is nothing to compare.
    """
    if values.dtype.kind == "b":
        return False
    rises = np.diff(values.astype(np.float64))
    if together is not None:
        rises = rises[together]
    return len(rises) > 0 and bool(np.all(rises == 1))


def rises_steadily(
    values: NDArray[Any], together: NDArray[np.bool_] | None = None, *, least: int = 1
) -> bool:
    """Whether a column rises by the same amount from row to row, as a clock does.

    Args:
        values: Shape (N,).
        together: Shape (N - 1,), whether a row and the next one are to be compared; None for all.
        least: How many must be compared.

    Returns:
        False where there are fewer.
    """
    if values.dtype.kind == "b":
        return False
    rises = np.diff(values.astype(np.float64))
    if together is not None:
        rises = rises[together]
    if len(rises) < least or not rises.min() > 0:
        return False
    return bool(rises.max() - rises.min() <= _STEADY * rises.mean())


def counts_steps(values: NDArray[Any], together: NDArray[np.bool_], *, least: int) -> bool:
    """Whether a column numbers the steps of an episode, up or down, from the same number in each.

    Args:
        values: Shape (N,).
        together: Shape (N - 1,), whether a row and the next one belong to one episode.
        least: How many pairs of such rows there must be.

    Returns:
        False also where there are too few episodes to tell a position from a number.
    """
    if values.dtype.kind == "b" or not len(values):
        return False
    starts = values[np.append(True, ~together)]
    changes = np.diff(values.astype(np.float64))[together]
    if len(starts) < _SEVERAL or len(changes) < least or abs(changes[0]) != 1:
        return False
    alike = np.all(starts == starts[0]) and np.all(changes == changes[0])
    return bool(alike and without_fraction(starts[:1])[0])


def crowded(values: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which columns have so few steps of float32 between their least and largest value.

    Args:
        values: Shape (N, d).

    Returns:
        Shape (d,): where it is worth asking whether float32 keeps what was given.
    """
    if not len(values):
        return np.zeros(values.shape[1], dtype=np.bool_)
    # Of what is missing nothing is asked here.
    low, high = (ends.reduce(values, axis=0).astype(np.float64) for ends in (np.fmin, np.fmax))
    with np.errstate(invalid="ignore", over="ignore"):  # what is infinite is refused elsewhere
        step = np.spacing(np.maximum(np.abs(low), np.abs(high)).astype(np.float32))
        return np.asarray(high - low < _FEW_STEPS * step.astype(np.float64))


def coarse_columns(
    given: Any, rounded: NDArray[np.float32], columns: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on columns whose values differ and are equal as float32, as seconds since 1970.

    Args:
        given: Shape (N, d), of any type.
        rounded: The same in float32, in which rules compare.
        columns: What the d columns are called.

    Returns:
        One sentence for each column in which that hides what differs.
    """
    exact = np.asarray(given)
    if exact.dtype == np.float32 or exact.shape != rounded.shape or not exact.size:
        return ()
    notes = []
    for index in np.flatnonzero(crowded(rounded)).tolist():
        different, left = len(np.unique(exact[:, index])), len(np.unique(rounded[:, index]))
        if left < different:
            least = np.fmin.reduce(exact[:, index])
            notes.append(
                f"{columns[index]} has {different:,} different values and rules can tell only "
                f"{left:,} of them apart, as they compare 7 digits (float32); subtract an offset "
                f"from it first, as its least value {least:.17g}"
            )
    return tuple(notes)


def whole_numbers_note(
    values: NDArray[Any], column: str, rows: NDArray[np.int64] | None = None
) -> str | None:
    """A sentence on actions that are labels nearly as well as amounts.

    Args:
        values: Finite actions of one dimension that were taken as amounts, (N,).
        column: What it is called.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Returns:
        None where most are no whole numbers.
    """
    broken = ~without_fraction(values)
    count = int(np.count_nonzero(broken))
    if count > _MOST_BROKEN * len(values):
        return None
    if count:
        row = int(np.argmax(broken))
        return (
            f"{column} was taken as an amount (continuous), because {count:,} of its "
            f"{len(values):,} values {'is' if count == 1 else 'are'} not whole, the first "
            f"{decimal_text(values[row])} in row {_number(row, rows)}; if it holds labels, mend "
            f"{'that row' if count == 1 else 'those rows'}"
        )
    return (
        f"{column} holds whole numbers with a decimal point and was taken as an amount "
        "(continuous); if it holds labels, write them as 0, 1, 2 without a point"
    )


def as_numbers(given: Any, what: str) -> NDArray[Any]:
    """Booleans, integers or floats of 32 bits or more as an array; anything else is refused."""
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise InputError(f"{what} must have the same length in every step") from error
    if array.dtype.kind not in "biuf":
        raise InputError(f"{what} must be numbers, not {array.dtype}")
    # Half precision ends at 65504, before what numbers are compared with here.
    return array.astype(np.float32) if array.dtype == np.float16 else array


def frozen(array: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The array itself if nobody can change it, else a copy."""
    untouchable = (array.base is None or is_shared(array)) and not array.flags.writeable
    if untouchable and array.dtype == dtype and array.flags.c_contiguous:
        return array
    with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
        return np.array(array, dtype=dtype, order="C")


def column_of_numbers(
    given: Any, n: int, column: str, rows: NDArray[np.int64] | None = None
) -> NDArray[Any]:
    """One finite number a step.

    Args:
        given: Anything that NumPy makes an array of.
        n: How many steps there are.
        column: What to call it in the message, as "column 'reward'".
        rows: Shape (n,), the rows they had in the file, from 0; None if they are those.

    Returns:
        Shape (n,), of its own type.

    Raises:
        InputError: With the first row.
    """
    values = as_numbers(given, column)
    if values.ndim != 1:
        raise InputError(f"{column} must hold one number a step")
    require_length(len(values), n, f"values in {column}", "observations")
    if values.dtype.kind == "f":
        require_finite(values[:, None], [column], rows)
    return values


def flags(
    given: Any, n: int, column: str, rows: NDArray[np.int64] | None = None
) -> NDArray[np.bool_]:
    """True or false, or 1 or 0; arguments as of `column_of_numbers`."""
    values = column_of_numbers(given, n, column, rows)
    neither = (values != 0) & (values != 1)
    if neither.any():
        row = int(np.argmax(neither))
        raise InputError(
            f"{column} is {values[row]} in row {_number(row, rows)}; write true or false, or 1 or 0"
        )
    return frozen(values, np.bool_)


def whole_numbers(
    given: Any, n: int, column: str, rows: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """Whole numbers from 0, as of episodes and steps; arguments as of `column_of_numbers`."""
    values = column_of_numbers(given, n, column, rows)
    wrong = (values < 0) | (values > EXACT)
    if values.dtype.kind == "f":
        wrong |= ~without_fraction(values)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{column} is {values[row]} in row {_number(row, rows)}; use whole numbers from 0"
        )
    return frozen(values, np.int64)


def require_order(
    episodes: NDArray[np.int64],
    steps: NDArray[np.int64] | None,
    columns: tuple[str, str] = ("column 'episode'", "column 'step'"),
    rows: NDArray[np.int64] | None = None,
    names: Mapping[int, str] | None = None,
) -> None:
    """Refuse episodes that are scattered and steps that do not rise within an episode.

    Args:
        episodes: Shape (N,).
        steps: Shape (N,), or None.
        columns: What the two are called in the message.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.
        names: What numbers of episodes stand for; None where they are those of the file.

    Raises:
        InputError: With the first row.
    """

    def called(row: int) -> str:
        number = int(episodes[row])
        return quoted(names[number]) if names and number in names else str(number)

    same_episode = episodes[1:] == episodes[:-1]
    starts = np.concatenate([[0], np.flatnonzero(~same_episode) + 1])
    _, first_seen = np.unique(episodes[starts], return_index=True)
    if len(first_seen) < len(starts):
        row = int(starts[np.setdiff1d(np.arange(len(starts)), first_seen)[0]])
        raise InputError(
            f"{columns[0]} comes back to {called(row)} in row {_number(row, rows)} after another "
            "episode; keep the steps of an episode together"
        )
    if steps is None:
        return
    backwards = (steps[1:] <= steps[:-1]) & same_episode
    if backwards.any():
        row = int(np.argmax(backwards)) + 1
        raise InputError(
            f"{columns[1]} goes from {steps[row - 1]} to {steps[row]} in row {_number(row, rows)} "
            f"within episode {called(row)}; sort the steps of each episode"
        )
