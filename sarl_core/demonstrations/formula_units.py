"""Whether the units in formulas fit together: a sum of metres and seconds is none."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.unit_algebra import Powers, powers_of, times, unit_text
from sarl_core.environments.formulas import Constant, FeatureValue, Formula, Node
from sarl_core.errors import quoted

_PLAIN: Powers = {}


def unit_warnings(features: Sequence[Feature]) -> list[str]:
    """What does not fit in the units of formulas.

    Args:
        features: Observed ones, and derived ones behind them.

    Returns:
        One sentence a formula in which units are mixed, or that has another unit than it is said
        to have; what has no unit, or one that is not understood, fits with everything.
    """
    warnings = []
    units = [powers_of(one.unit) if one.unit else None for one in features]
    for feature in features:
        if not isinstance(feature.derived, Formula):
            continue
        mixed: list[str] = []
        unit = _unit(feature.derived.root, units, mixed)
        called = f"the formula of {quoted(feature.name)}"
        said = powers_of(feature.unit) if feature.unit else None
        if mixed:
            warnings.append(
                f"{called} {mixed[0]}, which do not fit; convert one of them, or check the formula"
            )
        elif unit is not None and said is not None and unit != said:
            warnings.append(
                f"{called} is in {unit_text(unit) or 'no unit'} by the units of its features and "
                f"is said to be in {feature.unit}; write the unit that it has"
            )
    return warnings


def _unit(node: Node, units: Sequence[Powers | None], mixed: list[str]) -> Powers | None:
    """The unit of a part, None where it is not known; notes what is mixed in it."""
    if isinstance(node, Constant):
        return None
    if isinstance(node, FeatureValue):
        return units[node.index]
    parts = [_unit(one, units, mixed) for one in node.operands]
    if node.name in ("*", "/"):
        first, second = (
            _PLAIN if part is None and isinstance(one, Constant) else part
            for part, one in zip(parts, node.operands, strict=True)
        )
        power = 1 if node.name == "*" else -1
        return None if first is None or second is None else times(first, second, power)
    known = [part for part in parts if part is not None]
    other = next((part for part in known if part != known[0]), None)
    if other is not None:
        what = {"+": "adds", "-": "subtracts"}.get(node.name, "compares")
        mixed.append(f"{what} {_said(known[0])} and {_said(other)}")
        return None
    return known[0] if known else None


def _said(unit: Powers) -> str:
    return unit_text(unit) or "a plain number"
