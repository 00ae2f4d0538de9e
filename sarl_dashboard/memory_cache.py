"""A cache of results, bounded in number and in bytes."""

from __future__ import annotations

import dataclasses
import sys
from collections import OrderedDict
from collections.abc import Iterable
from threading import Lock
from typing import Generic, NamedTuple, TypeVar, cast

import numpy as np
import pandas as pd

from sarl_core.environments.formulas import Formula

Value = TypeVar("Value")

MOST_BYTES = 64 * 2**20
_LEAST = 1_000  # bytes that an entry takes, whatever is in it
_BYTES_PER_SIGN = 80  # of a formula
_FEW_HOLDERS = 12  # of a value; to look at it takes five or so by itself
_LOOKED_AT = 64  # of a long sequence: what its entries take follows from so many


class _Entry(NamedTuple):
    value: object
    size: int
    owner: str


class BoundedCache(Generic[Value]):
    """The latest results, shared between sessions; what was not used for longest goes first.

    The latest of all stays, however large it is.

    Attributes:
        most: How many are kept; None for no such bound.
        most_bytes: How much they take together, as far as `size_of` knows.
    """

    def __init__(self, most: int | None, most_bytes: int = MOST_BYTES) -> None:
        self.most, self.most_bytes = most, most_bytes
        self._lock = Lock()
        self._entries: OrderedDict[object, _Entry] = OrderedDict()
        self._bytes = 0

    @property
    def size(self) -> int:
        """What is kept at present, in bytes."""
        return self._bytes

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, key: object) -> bool:
        return key in self._entries

    def get(self, key: object) -> Value | None:
        """A result, if it is still kept."""
        with self._lock:
            entry = self._entries.get(key)
            if entry is None:
                return None
            self._entries.move_to_end(key)
            return cast(Value, entry.value)

    def put(self, key: object, result: Value, *, owner: str = "") -> None:
        """Keep a result, and let go of others where there is no room.

        Args:
            key: What tells it from others.
            result: To be kept.
            owner: Whose it is, for `drop`.
        """
        entry = _Entry(result, max(size_of(result), _LEAST), owner)
        with self._lock:
            self._remove(key)
            self._entries[key] = entry
            self._bytes += entry.size
            while len(self._entries) > 1 and (
                self._bytes > self.most_bytes
                or (self.most is not None and len(self._entries) > self.most)
            ):
                self._remove(next(iter(self._entries)))

    def drop(self, owner: str) -> None:
        """Let go of everything that is somebody's."""
        with self._lock:
            for key in [key for key, entry in self._entries.items() if entry.owner == owner]:
                self._remove(key)

    def clear(self) -> None:
        """Let go of everything."""
        with self._lock:
            self._entries.clear()
            self._bytes = 0

    def _remove(self, key: object) -> None:
        entry = self._entries.pop(key, None)
        if entry is not None:
            self._bytes -= entry.size


def size_of(value: object) -> int:
    """About how many bytes something takes.

    Args:
        value: Arrays, tables, text, and sequences, mappings and dataclasses of them.

    Returns:
        Of a long sequence, worked out from some of its entries.
    """
    return _size(value, set())


def _size(value: object, visited: set[int]) -> int:
    if value is None or isinstance(value, (bool, int, float, np.generic, type)):
        return 32
    if id(value) in visited:
        return 0
    visited.add(id(value))
    if isinstance(value, np.ndarray):
        return value.nbytes if value.base is None else max(value.nbytes, _size(value.base, visited))
    if isinstance(value, (pd.DataFrame, pd.Series)):
        return int(np.sum(value.memory_usage(deep=False)))
    if isinstance(value, (str, bytes, bytearray)):
        return sys.getsizeof(value)
    if isinstance(value, memoryview):
        return value.nbytes
    if isinstance(value, Formula):  # which may be nested deeper than Python likes to look
        return _BYTES_PER_SIGN * len(value.text)
    if isinstance(value, dict):
        return (
            sys.getsizeof(value)
            + _size_of_all(value.keys(), visited)
            + _size_of_all(value.values(), visited)
        )
    if isinstance(value, (tuple, list, set, frozenset)):
        return sys.getsizeof(value) + _size_of_all(value, visited)
    if dataclasses.is_dataclass(value) or hasattr(value, "__dict__"):
        # With what it has worked out and keeps, too.
        return 64 + _size_of_all(list(vars(value).values()), visited)
    return sys.getsizeof(value)


def _size_of_all(values: Iterable[object], visited: set[int]) -> int:
    entries = list(values)
    step = max(len(entries) // _LOOKED_AT, 1)
    looked_at = entries[::step]
    return (
        sum(_part(entry, visited) for entry in looked_at) * len(entries) // max(len(looked_at), 1)
    )


def _part(entry: object, visited: set[int]) -> int:
    """What an entry of a sequence takes; what many hold is a part of each.

    The paths to rules share their beginnings: a hundred thousand of them take a tenth of what each
    of them holds, added up.
    """
    holders = sys.getrefcount(entry) if isinstance(entry, tuple) else 1
    return _size(entry, visited) // (holders if holders > _FEW_HOLDERS else 1)
