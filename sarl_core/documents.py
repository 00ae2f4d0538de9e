"""Reading JSON with care: not more than fits, no number that is none, and one kind of error."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from typing import Any

from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

LARGEST_WHOLE = 2**53  # whole numbers up to here are exact in floating point too
_LARGEST = sys.float_info.max
# What the signs of a text may come to as objects of Python, in bytes: about half of the worst.
_COSTS = {"{": 100, "[": 40, ":": 20, ",": 20, '"': 15}


def parse_json(
    text: str | bytes,
    *,
    finite: bool = True,
    object_pairs_hook: Callable[[list[tuple[str, Any]]], Any] | None = None,
) -> Any:
    """Read JSON.

    Args:
        text: Of the document; UTF-8 if bytes.
        finite: Whether numbers must be; else the caller looks at each, and can say where it stands.
        object_pairs_hook: As of `json.loads`.

    Returns:
        What it says, of dicts, lists, texts, numbers, true, false and null.

    Raises:
        ValueError: If it is anything else; the message is a reason in a few words, without
            anything of the text.
        InputError: If it would take too much memory.
    """
    # One character beyond the usual ones makes all of them four bytes wide.
    width = 1 if text.isascii() else 4
    require_memory(
        (1 + 2 * width) * len(text)
        + sum(
            cost * (text.count(sign) if isinstance(text, str) else text.count(sign.encode()))
            for sign, cost in _COSTS.items()
        )
    )
    try:
        return json.loads(
            text,
            object_pairs_hook=object_pairs_hook,
            parse_constant=_refuse_constant if finite else None,
            parse_float=_finite if finite else None,
            parse_int=_whole,
        )
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    except UnicodeDecodeError as error:
        raise ValueError("it is not UTF-8") from error


def _refuse_constant(constant: str) -> Any:
    raise ValueError(f"it holds {constant}, which is no number")


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError as error:  # it has thousands of digits, which Python does not convert
        raise ValueError(f"it holds a number of {len(text):,} digits") from error


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError("it holds a number that is too large")
    return number


class DocumentReader:
    """One object of a document: hands out what was asked for and refuses the rest.

    Args:
        value: What was parsed.
        name: Of the file, for errors.
        place: Of the object in it, "" for the whole.
    """

    def __init__(self, value: Any, name: str, place: str) -> None:
        if not isinstance(value, Mapping):
            raise InputError(f"{name}: {place or 'it'} is not an object; write the file again")
        self._value = dict(value)
        self._name, self._place = name, place

    def fail(self, what: str) -> InputError:
        """An error about this object."""
        where = f" in {self._place}" if self._place else ""
        return InputError(f"{self._name}: {what}{where}; mend it or mine the rules again")

    def take(self, key: str, kind: type | tuple[type, ...], default: Any = ...) -> Any:
        """Hand out a value, and refuse another kind; booleans are no numbers."""
        value = self._value.pop(key, default)
        if value is ...:
            raise self.fail(f"{key!r} is missing")
        kinds = kind if isinstance(kind, tuple) else (kind,)
        boolean = isinstance(value, bool) and bool not in kinds
        if value is not default and (boolean or not isinstance(value, kinds)):
            raise self.fail(f"{key!r} is {quoted(value)}, of the wrong kind")
        return value

    def has(self, key: str) -> bool:
        """Whether there is a value that was not handed out yet."""
        return key in self._value

    def number(
        self, key: str, default: Any = ..., *, low: float = -_LARGEST, high: float = _LARGEST
    ) -> float:
        """A number within bounds."""
        value = self.take(key, (int, float), default)
        # Compared before it is converted: an integer may be too large for a float.
        if not low <= value <= high:
            raise self.fail(f"{key!r} is {quoted(value)}, not a number from {low:g} to {high:g}")
        return float(value)

    def count(
        self, key: str, default: Any = ..., *, low: int = 0, high: int = LARGEST_WHOLE
    ) -> int:
        """A whole number within bounds."""
        value: int = self.take(key, int, default)
        if not low <= value <= high:
            raise self.fail(f"{key!r} is {quoted(value)}, not a whole number from {low} to {high}")
        return value

    def limit(self, key: str) -> int | None:
        """A whole number, or None where it is missing or null."""
        if self._value.get(key) is not None:
            return self.count(key)
        self._value.pop(key, None)
        return None

    def share(self, key: str) -> float | None:
        """A number from 0 to 1, or null."""
        if self._value.get(key, ...) is not None:
            return self.number(key, low=0, high=1)
        self.take(key, type(None))
        return None

    def parts(self, key: str) -> list[DocumentReader]:
        """The objects of a list."""
        place = f"{self._place} {key}".strip()
        return [
            DocumentReader(value, self._name, f"{place} {number}")
            for number, value in enumerate(self.take(key, list), start=1)
        ]

    def part(self, key: str) -> DocumentReader:
        """An object."""
        return DocumentReader(self.take(key, dict), self._name, f"{self._place} {key}".strip())

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        values = self.take(key, list)
        if not all(isinstance(value, str) for value in values):
            raise self.fail(f"{key!r} holds something that is no text")
        return tuple(values)

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """A list of so many numbers."""
        values = self.take(key, list)
        if not all(map(is_number, values)) or len(values) != count:
            raise self.fail(f"{key!r} must be {count} numbers")
        return tuple(map(float, values))

    def finish(self) -> None:
        """Refuse what nobody asked for, by name."""
        if self._value:
            raise self.fail(f"{quoted(next(iter(self._value)))} is not known to this version")


def is_number(value: object, largest: float = _LARGEST) -> bool:
    """Whether a value from a file is a number, and not too large."""
    # Compared before it is converted: an integer may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return -largest <= value <= largest
