"""A cache of results, bounded in number and in bytes."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter, OrderedDict
from collections.abc import Iterable
from threading import Lock
from typing import Any, Generic, NamedTuple, TypeVar, cast

import numpy as np
import pandas as pd

from sarl_core.environments.formulas import Formula

Value = TypeVar("Value")

MOST_BYTES = 64 * 2**20
_LEAST = 1_000  # bytes that an entry takes, whatever is in it
_BYTES_PER_SIGN = 80  # of a formula
_LOOKING = 5  # holders of a value by that alone that it is looked at
_LARGE = 2**20  # bytes of a part that may be held by several entries
_BARE = (dict, tuple, list, set, frozenset)  # made anew for each of those, with the same in them
_BUFFERS = (np.ndarray, memoryview, bytearray, bytes)
_LOOKED_AT = 64  # of a long sequence: what its entries take follows from so many


class _Entry(NamedTuple):
    value: object
    size: int
    parts: dict[int, int]
    owner: str


class BoundedCache(Generic[Value]):
    """The latest results, shared between sessions; what was not used for longest goes first.

    The latest of all stays, however large it is. What several of them hold counts once: all that is
    made from a large rule set holds it.

    Attributes:
        most: How many are kept; None for no such bound.
        most_bytes: How much they take together, as far as `size_of` knows.
    """

    def __init__(self, most: int | None, most_bytes: int = MOST_BYTES) -> None:
        self.most, self.most_bytes = most, most_bytes
        self._lock = Lock()
        self._entries: OrderedDict[object, _Entry] = OrderedDict()
        self._bytes = 0
        self._holders: Counter[int] = Counter()  # how many entries hold a large part

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
        size, parts = _measured(result)
        entry = _Entry(result, max(size, _LEAST), parts, owner)
        with self._lock:
            self._remove(key)
            self._entries[key] = entry
            self._bytes += entry.size
            for part, part_size in entry.parts.items():
                self._bytes += part_size * (not self._holders[part])
                self._holders[part] += 1
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
            self._holders.clear()
            self._bytes = 0

    def _remove(self, key: object) -> None:
        entry = self._entries.pop(key, None)
        if entry is None:
            return
        self._bytes -= entry.size
        for part, part_size in entry.parts.items():
            self._holders[part] -= 1
            if not self._holders[part]:
                self._bytes -= part_size
                del self._holders[part]


def size_of(value: object) -> int:
    """About how many bytes something takes.

    Args:
        value: Arrays, tables, text, and sequences, mappings and dataclasses of them.

    Returns:
        Of a long sequence, worked out from some of its entries.
    """
    size, parts = _measured(value)
    return size + sum(parts.values())


def _measured(value: object) -> tuple[int, dict[int, int]]:
    """What something takes beside its large parts, and what each of those does, by identity."""
    scale = _Scale()
    return scale.size(value), scale.parts


class _Scale:
    """Weighs the parts of one thing, each once.

    Attributes:
        parts: Bytes of each large part, by its identity; of what lies in it too.
    """

    def __init__(self) -> None:
        self.parts: dict[int, int] = {}
        self._visited: set[int] = set()

    def size(self, value: object) -> int:
        """Bytes of a value without its large parts."""
        if value is None or isinstance(value, (bool, int, float, np.generic, type)):
            return 32
        if id(value) in self._visited:
            return 0
        self._visited.add(id(value))
        size = self._size(value)
        if size < _LARGE or isinstance(value, _BARE):
            return size
        self.parts[id(value)] = size
        return 0

    def _size(self, value: object) -> int:
        if isinstance(value, np.ndarray):
            if value.base is None:
                return int(value.nbytes)
            base: Any = value.base
            # What another process sent is a view of a view of what came.
            while isinstance(base, np.ndarray) and isinstance(base.base, _BUFFERS):
                base = base.base
            below = self.size(base)
            return 0 if id(base) in self.parts else max(value.nbytes, below)
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
                + self._size_of_all(value.keys())
                + self._size_of_all(value.values())
            )
        if isinstance(value, (tuple, list, set, frozenset)):
            return sys.getsizeof(value) + self._size_of_all(value)
        if dataclasses.is_dataclass(value) or hasattr(value, "__dict__"):
            # With what it has worked out and keeps, too.
            return 64 + self._size_of_all(vars(value).values())
        return sys.getsizeof(value)

    def _size_of_all(self, values: Iterable[object]) -> int:
        entries = list(values)
        step = max(len(entries) // _LOOKED_AT, 1)
        looked_at = entries[::step]
        return sum(map(self._part, looked_at)) * len(entries) // max(len(looked_at), 1)

    def _part(self, entry: object) -> int:
        """What an entry of a sequence takes; what many hold is a part of each.

        The paths to rules share their beginnings, rules the intervals that they ask for, and an
        edited set has nearly all rules of the set before: a hundred thousand of them take a tenth
        of what each of them holds, added up.
        """
        return self.size(entry) // max(sys.getrefcount(entry) - _LOOKING, 1)
