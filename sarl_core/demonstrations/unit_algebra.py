"""Units multiplied, divided and compared, as far as they are written in the usual way."""

from __future__ import annotations

import re
from collections import Counter

_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FACTOR = re.compile(r"(?P<name>[^\W\d_]+|[°%Ω]\w?)\^?(?P<power>-?\d)?")

Powers = dict[str, int]
"""The power of each unit, as {"m": 1, "s": -2}; {} of a plain number."""


def powers_of(unit: str) -> Powers | None:
    """A unit taken apart.

    Args:
        unit: As "m/s²", "rad / s" or "1/min".

    Returns:
        None where there is none, or it is written in another way.
    """
    powers: Counter[str] = Counter()
    for place, part in enumerate(unit.split("/")):
        factors = re.split(r"[·*\s]+", part.strip().translate(_POWERS))
        for factor in factors:
            if factor == "1" and place == 0 and len(factors) == 1:
                continue
            match = _FACTOR.fullmatch(factor)
            if match is None:
                return None
            powers[match["name"]] += int(match["power"] or 1) * (-1 if place else 1)
    return {name: power for name, power in powers.items() if power}


def times(one: Powers, other: Powers, power: int = 1) -> Powers:
    """The unit of a product.

    Args:
        one: A unit.
        other: Another.
        power: Of the other: -1 for a quotient.

    Returns:
        Units that cancel out are left out.
    """
    names = dict.fromkeys((*one, *other))
    product = {name: one.get(name, 0) + power * other.get(name, 0) for name in names}
    return {name: value for name, value in product.items() if value}


def unit_text(powers: Powers) -> str:
    """A unit as people write it.

    Args:
        powers: Of any units.

    Returns:
        As "m/s²"; "" of a plain number.
    """
    above = [_raised(name, power) for name, power in powers.items() if power > 0]
    below = [_raised(name, -power) for name, power in powers.items() if power < 0]
    if not below:
        return "·".join(above)
    return "/".join(["·".join(above) or "1", *below])


def quotient(one: str, other: str) -> str | None:
    """The unit of a quotient.

    Args:
        one: Unit of what is divided.
        other: Of what it is divided by.

    Returns:
        As "s" of "m" and "m/s", "" of two that are the same; None where one is not known.
    """
    first, second = powers_of(one), powers_of(other)
    return None if first is None or second is None else unit_text(times(first, second, -1))


def _raised(name: str, power: int) -> str:
    return name if power == 1 else f"{name}{str(power).translate(_RAISED)}"
