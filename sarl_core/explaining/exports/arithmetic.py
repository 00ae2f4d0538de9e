"""Derived features as single operations, one after the other, that every language knows.

Each is done in 64 bits and in the order in which it stands; the last one is rounded to 32 bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import Combination, Definition
from sarl_core.environments.formulas import Constant, FeatureValue, Node
from sarl_core.mining.language import one_line


class Operand(NamedTuple):
    """What an operation is done with.

    Attributes:
        kind: A feature of the state, a number, or what came out of an earlier operation.
        value: Its index, the number, or the place of that operation.
    """

    kind: Literal["feature", "number", "earlier"]
    value: float


class Calculation(NamedTuple):
    """One operation.

    Attributes:
        name: One of + - * / min max of two operands, or - and abs of one.
        operands: One or two.
    """

    name: str
    operands: tuple[Operand, ...]


def calculations(definition: Definition) -> list[Calculation]:
    """What has to be done for the value of a derived feature.

    Args:
        definition: Of it.

    Returns:
        At least one operation; the last one gives the value.
    """
    steps: list[Calculation] = []
    if isinstance(definition, Combination):
        (first, _), (second, ratio) = definition.terms
        product = (Operand("number", ratio), Operand("feature", second))
        steps.append(Calculation("*", product))
        steps.append(Calculation("+", (Operand("feature", first), Operand("earlier", 0))))
        return steps
    last = _worked_out(definition.root, steps)
    if not steps or last != Operand("earlier", len(steps) - 1):
        # A formula that is one number or one feature: twice negated it is the same.
        steps.append(Calculation("-", (last,)))
        steps.append(Calculation("-", (Operand("earlier", len(steps) - 1),)))
    return steps


def _worked_out(node: Node, steps: list[Calculation]) -> Operand:
    """What stands for a part, whose operations are put behind the others."""
    if isinstance(node, Constant):
        return Operand("number", node.value)
    if isinstance(node, FeatureValue):
        return Operand("feature", node.index)
    first, *others = (_worked_out(one, steps) for one in node.operands)
    for other in others:
        steps.append(Calculation(node.name, (first, other)))
        first = Operand("earlier", len(steps) - 1)
    if not others:
        steps.append(Calculation(node.name, (first,)))
        first = Operand("earlier", len(steps) - 1)
    return first


def assignments(
    definition: Definition,
    feature: Callable[[int], str],
    number: Callable[[float], str],
    functions: dict[str, str],
) -> list[str]:
    """The operations as right sides of assignments to t0, t1 and so on.

    Args:
        definition: Of a derived feature.
        feature: How a feature of the state is written.
        number: How a number is.
        functions: What the operations are called that are no infix ones.

    Returns:
        One expression an operation.
    """

    def text(operand: Operand) -> str:
        if operand.kind == "number":
            return number(operand.value)
        return f"t{operand.value}" if operand.kind == "earlier" else feature(int(operand.value))

    lines = []
    for name, operands in calculations(definition):
        parts = list(map(text, operands))
        if name in functions:
            lines.append(f"{functions[name]}({', '.join(parts)})")
        else:
            lines.append(f" {name} ".join(parts) if len(parts) > 1 else f"-{parts[0]}")
    return lines


def used_operations(features: Sequence[Feature]) -> set[str]:
    """Which operations the derived ones among features need."""
    return {
        step.name
        for feature in features
        if feature.derived is not None
        for step in calculations(feature.derived)
    }


def derived_lines(features: Sequence[Feature]) -> list[str]:
    """What derived features are, for a comment.

    Args:
        features: Observed ones, and derived ones behind them.

    Returns:
        As "  8  gap minus 0.5 s of own speed (m)" and "  9  rate (1/s) = own speed / gap".
    """
    return [
        f"{index:>3}  {one_line(feature.name)}"
        + (f" ({one_line(feature.unit)})" if feature.unit else "")
        + (
            ""
            if isinstance(feature.derived, Combination)
            else f" = {one_line(str(feature.derived))}"
        )
        for index, feature in enumerate(features)
        if feature.derived is not None
    ]
