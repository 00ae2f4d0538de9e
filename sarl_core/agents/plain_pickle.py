"""Pickles read as data: nothing that they name is imported, and nothing is called.

A pickle is a program for a small stack machine. Here its instructions are read one by one with
`pickletools`, which runs none. Numbers, texts and containers are built up; where the machine
would import a name, or call what it imported, a note of the name and of its arguments is kept
instead. So no file can make anything happen, whatever it holds.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from sarl_core.errors import InputError, quoted

MAX_BYTES = 16 * 2**20
_MAX_INSTRUCTIONS = 100_000  # statistics of observations take some hundred
_LONGEST_NAME = 90

_VALUES = frozenset(
    {
        *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
        *("STRING", "BINSTRING", "SHORT_BINSTRING"),
        *("BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
        *("UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"),
    }
)
_CONSTANTS: dict[str, Callable[[], Any]] = {
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_TUPLE": tuple,
    "EMPTY_LIST": list,
    "EMPTY_DICT": dict,
}
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


@dataclass(frozen=True)
class Name:
    """What a pickle would have imported.

    Attributes:
        text: Module and name, joined by a dot.
    """

    text: str


@dataclass(eq=False)
class Made:
    """What a pickle would have made by a call.

    Attributes:
        maker: Name of what it would have called.
        arguments: Of the call.
        state: What it would have put into it afterwards, or None.
    """

    maker: str
    arguments: tuple[Any, ...]
    state: Any = None


def read_pickle(data: bytes, known: Collection[str]) -> Any:
    """Read a pickle without running it.

    Args:
        data: Its bytes.
        known: The names that it may hold, as ``numpy.dtype``.

    Returns:
        Numbers, texts, bytes, tuples, lists and dicts; `Name` for a name, `Made` for a call.

    Raises:
        InputError: If it holds another name, an instruction that statistics have no need of, is
            too long, or is no pickle.
    """
    if len(data) > MAX_BYTES:
        raise InputError(
            f"it has {len(data) / 2**20:.0f} MB, more than any statistics; give another file"
        )
    machine = _Machine(known)
    try:
        for count, (instruction, argument, _) in enumerate(pickletools.genops(data)):
            if count > _MAX_INSTRUCTIONS:
                raise InputError("it holds more than any statistics; give another file")
            if instruction.name == "STOP":
                return machine.stack.pop()
            machine.step(instruction.name, argument)
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise InputError("it is no whole pickle; save the statistics again") from error
    raise InputError("it is no whole pickle; save the statistics again")


def named(text: str) -> str:
    """A name from a file, fit for a message: in quotes, and not too long.

    Args:
        text: The name.

    Returns:
        At most some hundred characters.
    """
    return quoted(text, _LONGEST_NAME)


class _Machine:
    """The stack machine, with notes in the place of imports and calls."""

    def __init__(self, known: Collection[str]) -> None:
        self.known = known
        self.stack: list[Any] = []
        self.marks: list[list[Any]] = []
        self.memory: dict[int, Any] = {}

    def step(self, instruction: str, argument: Any) -> None:
        """Follow one instruction."""
        if instruction in _VALUES:
            self.stack.append(argument)
        elif instruction in _CONSTANTS:
            self.stack.append(_CONSTANTS[instruction]())
        elif instruction in _TUPLES:
            self.stack.append(tuple(self._popped(_TUPLES[instruction])))
        else:
            follow = getattr(self, f"_{instruction.lower()}", None)
            if follow is None:
                raise InputError(
                    f"it holds the instruction {instruction}, which statistics have no need of, "
                    "and is not opened; save the statistics again"
                )
            follow(argument)

    def _popped(self, count: int) -> list[Any]:
        if len(self.stack) < count:
            raise IndexError
        popped = self.stack[-count:]
        del self.stack[-count:]  # in place: who called may be about to append to it
        return popped

    def _since_mark(self) -> list[Any]:
        items, self.stack = self.stack, self.marks.pop()
        return items

    def _proto(self, argument: int) -> None: ...

    def _frame(self, argument: int) -> None: ...

    def _mark(self, _: None) -> None:
        self.marks.append(self.stack)
        self.stack = []

    def _pop(self, _: None) -> None:
        self.stack.pop()

    def _tuple(self, _: None) -> None:
        items = tuple(self._since_mark())
        self.stack.append(items)

    def _list(self, _: None) -> None:
        items = self._since_mark()
        self.stack.append(items)

    def _append(self, _: None) -> None:
        value = self.stack.pop()
        self._container(list).append(value)

    def _appends(self, _: None) -> None:
        values = self._since_mark()
        self._container(list).extend(values)

    def _dict(self, _: None) -> None:
        values = self._since_mark()
        self.stack.append({})
        self._fill(values)

    def _setitem(self, _: None) -> None:
        self._fill(self._popped(2))

    def _setitems(self, _: None) -> None:
        self._fill(self._since_mark())

    def _fill(self, values: list[Any]) -> None:
        # Plain keys only: the hash of tuples within tuples may take for ever.
        if not all(isinstance(key, (str, int)) for key in values[::2]):
            raise TypeError
        self._container(dict).update(zip(values[::2], values[1::2], strict=True))

    def _container(self, kind: type) -> Any:
        if not isinstance(self.stack[-1], kind):
            raise TypeError
        return self.stack[-1]

    def _memoize(self, _: None) -> None:
        self.memory[len(self.memory)] = self.stack[-1]

    def _put(self, argument: int) -> None:
        self.memory[argument] = self.stack[-1]

    def _get(self, argument: int) -> None:
        self.stack.append(self.memory[argument])

    _binput = _long_binput = _put
    _binget = _long_binget = _get

    def _global(self, argument: str) -> None:
        self._name(*argument.split(" ", 1))

    def _stack_global(self, _: None) -> None:
        self._name(*self._popped(2))

    def _name(self, module: str, name: str) -> None:
        text = f"{module}.{name}"
        if text not in self.known:
            raise InputError(
                f"it names {named(text)}, which statistics of observations have no need of, and "
                "is not opened; give the .pkl that VecNormalize.save() wrote"
            )
        self.stack.append(Name(text))

    def _reduce(self, _: None) -> None:
        maker, arguments = self._popped(2)
        if not isinstance(arguments, tuple):
            raise TypeError
        self.stack.append(Made(maker.text, arguments))

    _newobj = _reduce

    def _build(self, _: None) -> None:
        state = self.stack.pop()
        if not isinstance(self.stack[-1], Made):
            raise TypeError
        self.stack[-1].state = state
