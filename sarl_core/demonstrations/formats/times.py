"""When each step was: dates, times of day and numbers of a column as seconds."""

from __future__ import annotations

import re
import shlex
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.columns import Guess
from sarl_core.demonstrations.formats.mapping.roles import SECONDS
from sarl_core.demonstrations.formats.opened_table import TableColumn
from sarl_core.demonstrations.formats.units import without_units
from sarl_core.errors import InputError, quoted

_ENDING = re.compile(r"(?:^|.*[_ ])(s|secs?|seconds|ms|us|ns|min|minutes|h|hours)", re.I)
_MEANT = {"sec": "s", "secs": "s", "seconds": "s", "µs": "us", "minutes": "min", "hours": "h"}
_SINCE_1970 = (1e9, 3e9)  # seconds, from 2001 to 2065
_DAY_FIRST = re.compile(r"\d{1,2}\.")
_CLOCK = re.compile(r"\d{1,2}:\d{2}.*")


def as_clock(guess: Guess, name: str) -> Guess:
    """A guess in which a column that turned out to be a time says when each step was."""
    unused = {column: why for column, why in guess.unused.items() if column != name}
    return replace(
        guess,
        columns=replace(guess.columns, time=name),
        reasons={**guess.reasons, name: guess.unused[name]},
        unused=unused,
    )


def of_words(column: TableColumn) -> TableColumn:
    """Dates and times of day that are written as words.

    Args:
        column: Of words.

    Returns:
        Times of NumPy, none where the column is empty; or the first word that is no time, in its
        row, and nothing else.
    """
    times = _parsed(column.words)
    wrong = np.isnat(times)
    if wrong.any():
        misfits = np.append(wrong, False)[column.values]
        codes = np.full(len(column.values), -1, dtype=np.int64)
        codes[np.argmax(misfits)] = 0
        word = column.words[column.values[np.argmax(misfits)]]
        return TableColumn(codes, codes < 0, (word,))
    return TableColumn(np.append(times, np.datetime64("NaT"))[column.values])


def _parsed(words: tuple[str, ...]) -> NDArray[np.datetime64]:
    """Each word's time; none where it is not one of the form that the first one has."""
    import pandas as pd

    texts = list(words)
    if _CLOCK.fullmatch(texts[0]):
        since = pd.to_timedelta(pd.Series(texts), errors="coerce")
        return np.asarray((pd.Timestamp(0) + since).to_numpy("datetime64[us]"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of words that are no times
        times = pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")
        if times.isna().any():
            day_first = _DAY_FIRST.match(texts[0]) is not None
            times = pd.to_datetime(texts, dayfirst=day_first, utc=True, errors="coerce")
    return np.asarray(times.tz_localize(None).to_numpy("datetime64[us]"))


def with_seconds(
    guess: Guess,
    read: Mapping[str, TableColumn],
    units: Mapping[str, str],
    rows: NDArray[np.int64] | None = None,
    *,
    certain: bool = False,
) -> tuple[Guess, dict[str, TableColumn]]:
    """The column of times in seconds.

    Args:
        guess: What the columns are.
        read: The columns that it uses, by name.
        units: Of columns, as far as the file says them.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.
        certain: Whether nothing was guessed.

    Returns:
        The guess, without a column of times that holds something else, and the columns.

    Raises:
        InputError: If somebody said that it is the time, and it is not.
    """
    name = guess.columns.time
    if name is None:
        return guess, dict(read)
    column = read[name]
    if not column.words:
        said = guess.roles[name].unit if name in guess.roles else ""
        return guess, {**read, name: TableColumn(_seconds(column, said or _unit(name, units)))}
    row = int(np.argmax(column.values >= 0))
    number = 1 + (row if rows is None else int(rows[row]))
    holds = f"holds {quoted(column.words[0])} in row {number}, which is no time"
    if certain or name in guess.roles:
        raise InputError(
            f"column {quoted(name)} {holds}; write seconds, or times as 2026-03-02 07:00:02, or "
            f"leave it out with --column {shlex.quote(f'{name}=ignore')}"
        )
    columns = replace(guess.columns, time=None)
    reasons = {column: why for column, why in guess.reasons.items() if column != name}
    return replace(
        guess, columns=columns, reasons=reasons, unused={**guess.unused, name: f"it {holds}"}
    ), {one: held for one, held in read.items() if one != name}


def _unit(name: str, units: Mapping[str, str]) -> str:
    """What numbers of a column are counted in, as far as the file or its name says it."""
    ((bare,), (behind,)) = without_units((name,))
    ending = _ENDING.fullmatch(bare)
    unit = units.get(name) or behind or (ending[1].lower() if ending else "")
    return _MEANT.get(unit, unit)


def _seconds(column: TableColumn, unit: str) -> NDArray[np.float64]:
    """Seconds, not a number where they are not known, (N,)."""
    values: NDArray[Any] = column.values
    if values.dtype.kind == "M":
        times = values.astype("datetime64[us]")
        seconds = times.astype(np.int64) / 1e6
        seconds[np.isnat(times)] = np.nan
        return np.asarray(seconds)
    numbers = column.with_gaps.astype(np.float64)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers * SECONDS.get(unit, _since_1970(numbers))


def _since_1970(numbers: NDArray[np.float64]) -> float:
    """How long one is, where numbers without a unit may be those of a clock since 1970."""
    low, high = _SINCE_1970
    known = numbers[~np.isnan(numbers)]
    least = known.min() if len(known) else 0.0
    return next((one for one in SECONDS.values() if one < 1 and low < least * one < high), 1.0)
