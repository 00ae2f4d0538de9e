"""Reading JSON with care: not more than fits, no number that is none, and one kind of error."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from sarl_core.limits import read_limit

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
        ValueError: If it is anything else, or would take too much memory; the message is a
            reason in a few words, without anything of the text.
    """
    # One character beyond the usual ones makes all of them four bytes wide.
    width = 1 if text.isascii() else 4
    needed = (1 + 2 * width) * len(text) + sum(
        cost * (text.count(sign) if isinstance(text, str) else text.count(sign.encode()))
        for sign, cost in _COSTS.items()
    )
    if needed > read_limit():
        raise ValueError(f"it holds more than {read_limit() / 2**30:g} GiB have room for")
    try:
        return json.loads(
            text,
            object_pairs_hook=object_pairs_hook,
            parse_constant=_refuse_constant if finite else None,
            parse_float=_finite if finite else None,
        )
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    except UnicodeDecodeError as error:
        raise ValueError("it is not UTF-8") from error


def _refuse_constant(constant: str) -> Any:
    raise ValueError(f"it holds {constant}, which is no number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError("it holds a number that is too large")
    return number
