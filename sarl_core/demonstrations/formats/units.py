"""Units that stand behind a column's name, as in "wind (m/s)" or "load [t]"."""

from __future__ import annotations

import re
from collections.abc import Sequence

_PREFIXED = "m|g|s|A|K|mol|Hz|N|Pa|J|W|V|F|Ω|ohm|T|bar|l|L|Nm|Wh|eV|B"
_OTHER = (
    "t|h|min|d|°|deg|degrees|rad|°C|°F|degC|degF|C|%|percent|ppm|rpm|psi|mph|kph|kn|knots|ft|in"
    "|lb|lbs|mi|px|dB|g|G|steps|kcal|mmHg|meters?|metres?|seconds|minutes|hours|days|years?"
)
_UNIT = rf"(?:(?:[pnuµμmcdhkMG]?(?:{_PREFIXED})|{_OTHER})(?:\^?-?[1-4²³])?)"
_BEHIND = re.compile(rf"(.*\S)\s*[(\[]\s*({_UNIT}(?:\s?[/*·. ]\s?{_UNIT}|/\d+\s?{_UNIT})*)\s*[)\]]")


def without_units(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Take units off the names that they stand behind.

    Args:
        names: Of columns.

    Returns:
        The names and the units, "" where there is none. What stands in brackets and is no unit
        ("door (left)") belongs to the name; so does a unit that alone tells two columns apart.
    """
    parts = [_BEHIND.fullmatch(name.strip()) for name in names]
    bare = [part[1] if part else name for part, name in zip(parts, names, strict=True)]
    split = [(part[1], part[2]) if part and bare.count(part[1]) == 1 else None for part in parts]
    return (
        tuple(both[0] if both else name for both, name in zip(split, names, strict=True)),
        tuple(both[1] if both else "" for both in split),
    )
