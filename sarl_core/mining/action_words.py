"""Actions in words: what a rule says to do, and what was done."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.decimals import decimal_text
from sarl_core.mining.digits import amount_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Rule

# Labels that say nothing without the action that they are of.
_NO_ACTIONS = {"true", "false", "yes", "no", "on", "off", "none", "t", "f", "y", "n"}


def action_text(label: int, dimension: LabelledDimension) -> str:
    """What a rule says to do.

    Args:
        label: The label.
        dimension: Whose label it is.

    Returns:
        As "push right", "action 2", "brake true", or "torque from -2 to 0".
    """
    if dimension.is_interval:
        from_ = "" if dimension.edges[label] == dimension.edges[label + 1] else "from "
        return f"{dimension.name} {from_}{dimension.label_names[label]}"
    name = dimension.label_names[label]
    bare = name.lstrip("+-").replace(".", "", 1).isdigit() or name.lower() in _NO_ACTIONS
    return f"{dimension.name} {name}" if bare else name


def label_text(label: int, dimension: LabelledDimension) -> str:
    """A label where its dimension is known: in tables and legends.

    Args:
        label: The label.
        dimension: Whose label it is.

    Returns:
        As "push right" or "-2 to 0".
    """
    return dimension.label_names[label]


def says_text(rule: Rule, dimension: LabelledDimension) -> str:
    """What a rule says to do, or never to do.

    Args:
        rule: Any.
        dimension: Of which it speaks.

    Returns:
        As "push right", or "never push right or push left".
    """
    if not rule.forbids:
        return action_text(rule.action, dimension)
    return f"never {' or '.join(action_text(label, dimension) for label in rule.forbids)}"


def says_label(rule: Rule, dimension: LabelledDimension) -> str:
    """The same where its dimension is known.

    Args:
        rule: Any.
        dimension: Of which it speaks.

    Returns:
        As "push right", "-2 to 0" or "never -2 to 0".
    """
    if not rule.forbids:
        return label_text(rule.action, dimension)
    return f"never {' or '.join(label_text(label, dimension) for label in rule.forbids)}"


def done_text(value: float, dimension: LabelledDimension, *, beside: Sequence[float] = ()) -> str:
    """What was proposed or executed in one action dimension.

    Args:
        value: The action.
        dimension: Whose it is.
        beside: Other actions of the dimension that are shown with it.

    Returns:
        As "push right" or "torque -1.2"; two continuous actions that differ do not read the same.
    """
    if dimension.is_interval:
        return f"{dimension.name} {amount_text(value, dimension, beside=beside)}"
    label = dimension.label_of(value)
    if not 0 <= label < dimension.n_labels:
        return f"{dimension.name} {decimal_text(value)}"
    return action_text(label, dimension)
