"""Reading JSON with care: not more than fits, no number that is none, and one kind of error."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import inspect

from sarl_core.errors import InputError, quoted
from sarl_core.limits import limited_bytes, require_memory

LARGEST_WHOLE = 2**53  # whole numbers up to here are exact in floating point too
_LARGEST = sys.float_info.max

Number = Annotated[float, msgspec.Meta(ge=-_LARGEST, le=_LARGEST)]
NotNegative = Annotated[float, msgspec.Meta(ge=0, le=_LARGEST)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=0, le=LARGEST_WHOLE)]

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)

# What the signs of a text may come to as objects of Python, in bytes: about half of the worst.
_COSTS = {"{": 100, "[": 40, ":": 20, ",": 20, '"': 15}

# What may be half of a sign that is written as two: no file can be written with it again.
_PERHAPS_HALF = re.compile("\\\\u[dD]|[\ud800-\udfff]")


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
        if not isinstance(text, str):  # as `json.loads` does, which lets halves of pairs through
            text = str(text, json.detect_encoding(text))
        document = json.loads(
            text,
            object_pairs_hook=object_pairs_hook,
            parse_constant=_refuse_constant if finite else None,
            parse_float=_finite if finite else None,
            parse_int=_whole,
        )
        if _PERHAPS_HALF.search(text):
            json.dumps(document, ensure_ascii=False).encode()
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    except UnicodeDecodeError as error:
        raise ValueError("it is not UTF-8") from error
    except UnicodeEncodeError as error:
        raise ValueError("it holds half of a surrogate pair, which is no text") from error
    return document


def read_object(path: Path, advice: str) -> dict[str, Any]:
    """Read a file that holds a JSON object.

    Args:
        path: The file.
        advice: What to do if it is none, as "write it again".

    Returns:
        The object.

    Raises:
        InputError: If it is none.
    """
    try:
        document = parse_json(limited_bytes(path))
    except (OSError, ValueError, InputError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(f"{path} cannot be read ({reason}); {advice}") from error
    if not isinstance(document, dict):
        raise InputError(f"{path} holds no JSON object; {advice}")
    return document


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


class MisfitError(ValueError):
    """A part of a document is not what it should be.

    Args:
        what: Is wrong, as "'samples' is missing".
        place: Of the part, from the outside inwards, as "rules 4", "held_out".
    """

    def __init__(self, what: str, *place: str) -> None:
        super().__init__(" in ".join(filter(None, (what, " ".join(place)))))
        self.what, self.place = what, place


def conformed(value: Any, kind: type[T], *, strict: bool = True) -> T:
    """What was parsed, as a type that says what may stand there.

    Args:
        value: Of dicts, lists, texts, numbers, true, false and null.
        kind: As msgspec takes it; booleans are no numbers.
        strict: Whether a text is no number, as one of a CSV file is.

    Returns:
        One of that type.

    Raises:
        MisfitError: If anything in it is something else, is missing, or is not known.
    """
    try:
        return msgspec.convert(value, kind, strict=strict)
    except msgspec.ValidationError as error:
        raise _in_words(value, kind, str(error)) from error


def fitting(value: Any, kind: type[S]) -> S:
    """What of a document is as a type says; its defaults stand for what is not.

    Args:
        value: As of `conformed`.
        kind: A struct in which everything has a default.

    Returns:
        One of that type.
    """
    parts: dict[str, Any] = {}
    for field in msgspec.structs.fields(kind):
        with suppress(LookupError, TypeError, MisfitError):
            parts[field.name] = conformed(value[field.encode_name], field.type)
    return kind(**parts)


def _in_words(value: Any, kind: Any, text: str) -> MisfitError:
    """What msgspec says, as "Expected `int` >= 0 - at `$.rules[3].samples`", in our words."""
    path = text.rpartition(" - at `$")[2] if " - at `$" in text else ""
    types, place, is_key = _either(inspect.type_info(kind)), list[str](), False
    for name, index in re.findall(r"\.(\w+)|\[(\d{1,9})\]", path):
        is_key = bool(name)
        step = name if is_key else int(index)
        if is_key:
            place.append(name)
        else:
            place[-1:] = [f"{''.join(place[-1:])} {int(index) + 1}"]
        try:
            value = value[step]
        except (LookupError, TypeError):
            value = ...
        types = [inner for one in types for inner in _within(one, step)]
    named = re.match(r"Object (missing|contains).*? field `(.*?)(?:`$|` - at `)", text, re.DOTALL)
    if named:
        what = "missing" if named[1] == "missing" else "not known to this version"
        return MisfitError(f"{quoted(named[2])} is {what}", *place)
    if not is_key and text.startswith("Expected `object`"):
        return MisfitError(f"{' '.join(place) or 'it'} is not an object")
    key = place.pop() if place else "it"
    if value is ...:
        return MisfitError(f"{key!r} holds something of the wrong kind", *place)
    choices = [repr(choice) for one in types for choice in getattr(one, "values", ())]
    if choices and isinstance(value, str):
        noun = {"op": "operator"}.get(key, key)
        return MisfitError(f"the {noun} {quoted(value)} is neither {' nor '.join(choices)}", *place)
    wrong = "of the wrong kind"
    for one in types:
        if isinstance(value, bool) or getattr(one, "ge", None) is None:
            continue
        if isinstance(one, inspect.IntType) and isinstance(value, int):
            wrong = f"not a whole number from {one.ge} to {one.le}"
        elif isinstance(one, inspect.FloatType) and isinstance(value, int | float):
            wrong = f"not a number from {one.ge:g} to {one.le:g}"
    return MisfitError(f"{repr(key) if is_key else key} is {quoted(value)}, {wrong}", *place)


def _either(kind: inspect.Type) -> list[Any]:
    """The types of which one may stand in a place."""
    return list(kind.types) if isinstance(kind, inspect.UnionType) else [kind]


def _within(kind: inspect.Type, step: str | int) -> list[Any]:
    """The types of what stands there under a key or in a place."""
    if isinstance(kind, inspect.StructType | inspect.DataclassType):
        types: list[inspect.Type] = [
            field.type for field in kind.fields if field.encode_name == step
        ]
        if isinstance(kind, inspect.StructType) and kind.tag_field == step:
            types.append(inspect.LiteralType((kind.tag,)))
    elif isinstance(kind, inspect.TupleType):
        types = [kind.item_types[int(step)]]
    else:
        types = [kind.item_type] if isinstance(kind, inspect.CollectionType) else []
    return [one for inner in types for one in _either(inner)]


def plain(value: Any) -> Any:
    """A document with null in place of NaN and infinity, which JSON does not have.

    Args:
        value: Mappings, sequences, text, numbers.

    Returns:
        The same, in dicts and lists.
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return value
