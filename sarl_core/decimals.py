"""Decimal numbers that stand for a binary one: as short as may be, and true."""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

_UNSEEN = 0.005  # of a scale: nobody sees a number that is off by less

MOST_DIGITS = 17
"""Tell every double from every other."""

_AROUND = {
    digits: tuple(Context(prec=digits, rounding=way) for way in (ROUND_FLOOR, ROUND_CEILING))
    for digits in range(1, MOST_DIGITS + 1)
}
_FEWEST = 4


@lru_cache(maxsize=65536)
def short_decimal(exact: float, least: float, most: float, *, fewest: int = 1) -> float | None:
    """The decimal number of the fewest digits that lies between two numbers.

    Args:
        exact: What it stands for.
        least: It is not below this.
        most: It is below this.
        fewest: Number of significant digits to begin with; zeros at the end do not count.

    Returns:
        Of those with as many digits, the nearest to `exact`, and of two the lower; None if `exact`
        itself is needed, and is not between the two.
    """
    number = Decimal(exact)
    for digits in range(fewest, MOST_DIGITS + 1):
        candidates = {float(context.plus(number)) for context in _AROUND[digits]}
        fitting = [value for value in candidates if least <= value < most]
        if fitting:
            return min(fitting, key=lambda value: (abs(value - exact), value))
    return None


def decimal_within(value: float, error: float) -> float:
    """A decimal number near a value.

    Args:
        value: Any finite number.
        error: How far it may be away; 0 for not at all.

    Returns:
        Of the numbers with as few digits, the nearest.
    """
    most = float(np.nextafter(value + error, math.inf))
    decimal = short_decimal(value, value - error, most, fewest=3)
    return value if decimal is None else decimal


def float32_decimal(value: float) -> float:
    """The shortest decimal number that is the same in 32 bits.

    Args:
        value: A number of 32 bits, or one near it.

    Returns:
        As 0.1, of 0.10000000149011612.
    """
    return float(str(np.float32(value)))


def decimal_on_scale(value: float, low: float, high: float) -> float:
    """A decimal number near a value on a scale.

    Args:
        value: Any finite number.
        low: Where the scale begins.
        high: Where it ends; not below `low`.

    Returns:
        With three significant digits, or with more where the scale is narrow for those.
    """
    width = high - low
    return decimal_within(value, _UNSEEN * width if width > 0 else _UNSEEN * abs(value))


def digits_telling(step: float, largest: float) -> int:
    """How many significant digits numbers need for a step between them to be seen.

    Args:
        step: Above 0.
        largest: Of the numbers, by size.

    Returns:
        At most `MOST_DIGITS`.
    """
    if not 0.0 < step < largest < math.inf:
        return _FEWEST
    return min(max(math.floor(math.log10(largest)) - math.floor(math.log10(step)) + 1, _FEWEST), 17)


def digits_across(values: NDArray[Any]) -> int:
    """How many significant digits the numbers of a column need.

    Args:
        values: Any shape; what is not finite does not count.

    Returns:
        So many that a thousandth of their range is seen.
    """
    finite = np.asarray(values, dtype=np.float64)[np.isfinite(values)]
    if not finite.size:
        return digits_telling(0.0, 0.0)
    return digits_telling(float(np.ptp(finite)) / 1000, float(np.abs(finite).max()))


def decimal_text(value: float) -> str:
    """A number with every digit it has, and without an exponent unless it needs many zeros.

    Args:
        value: A number.

    Returns:
        As "293.42", "1700000012" or "1.2e-09", which reads back as the same number; words for what
        is infinite, as a formula may be, or no number.
    """
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else f"{'-' if value < 0 else ''}infinite"
    if value == 0:
        return "0"
    if 1e-4 <= abs(value) < 1e15:
        return np.format_float_positional(value, trim="-")
    return repr(float(value))


def rounded_text(value: float, decimals: int = 0) -> str:
    """A number for sentences, pictures and tables, with a true minus sign, and none before zero.

    Args:
        value: Any; NaN or infinite where there is none.
        decimals: After the point.

    Returns:
        As "1,213", "−191" or "−1.20"; "–" where there is none.
    """
    if not math.isfinite(value):
        return "–"
    text = f"{abs(value):,.{decimals}f}"
    return f"−{text}" if value < 0 and any(digit in text for digit in "123456789") else text


def telling_text(value: float) -> str:
    """A return or a cost for sentences and tables: as many decimals as tell something.

    Args:
        value: Any; NaN or infinite where there is none.

    Returns:
        As "1,213", "21.3" or "−1.20"; "0" for zero; "–" where there is none.
    """
    size = abs(value)
    return rounded_text(value, 0 if size >= 100 or value == 0 else 1 if size >= 10 else 2)


def float32_around(value: float) -> tuple[float, float]:
    """The 32-bit numbers on either side of a number: no other pair is parted by it.

    Args:
        value: A finite number.

    Returns:
        The largest that is at most the number, and the one after it; infinite where there is none.
    """
    with np.errstate(over="ignore", under="ignore"):
        near = np.float32(value)
        if float(near) > value:
            return float(np.nextafter(near, np.float32(-math.inf))), float(near)
        return float(near), float(np.nextafter(near, np.float32(math.inf)))
