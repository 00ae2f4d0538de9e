"""The features of a table, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.fields import TRUTH, Indicator
from sarl_core.demonstrations.formats.opened_table import TableColumn, side_by_side
from sarl_core.demonstrations.words import Coded, indicated, indicators_of


@dataclass(frozen=True, eq=False)
class ObservationBlock:
    """The features of a table.

    Attributes:
        values: Shape (N, d), float32.
        columns: The column of each; one of words is the column of several.
        names: What they are called; None where the file does not say.
        indicators: For each feature what it says of a column of words, or None.
    """

    values: NDArray[np.float32]
    columns: tuple[str, ...]
    names: tuple[str, ...] | None
    indicators: tuple[Indicator | None, ...]


def observation_block(
    read: Mapping[str, TableColumn], columns: Sequence[str], names: Sequence[str] | None
) -> ObservationBlock:
    """Columns side by side, and in the place of each column of words what says which it holds.

    Args:
        read: The columns by name.
        columns: Those of the features.
        names: What they are called, None where the file does not say.

    Returns:
        The features.

    Raises:
        InputError: If a column holds too many words.
    """
    called = dict(zip(columns, columns if names is None else names, strict=True))
    parts: list[tuple[str, Indicator | None]] = []
    for column in columns:
        of_words = _indicators(read[column], called[column])
        parts += [(column, one) for one in of_words] if of_words else [(column, None)]
    values = side_by_side([read[column].values for column, _ in parts])
    if values is None:
        values = _copied(read, parts)
    unnamed = names is None and not any(indicator for _, indicator in parts)
    return ObservationBlock(
        values,
        tuple(column for column, _ in parts),
        None
        if unnamed
        else tuple(called[column] if one is None else one.name for column, one in parts),
        tuple(indicator for _, indicator in parts),
    )


def _copied(
    read: Mapping[str, TableColumn], parts: Sequence[tuple[str, Indicator | None]]
) -> NDArray[np.float32]:
    """Columns, and what says which word they hold, in a block of their own, (N, parts)."""
    values = np.empty((len(read[parts[0][0]].values), len(parts)), dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
        for index, (column, indicator) in enumerate(parts):
            held = read[column]
            if indicator is None or not held.words:
                values[:, index] = held.with_gaps
            else:
                values[:, index] = indicated(Coded(held.values, held.words), [indicator])[:, 0]
    return values


def _indicators(column: TableColumn, name: str) -> tuple[Indicator, ...]:
    if column.values.dtype.kind == "b":
        return indicators_of(name, TRUTH)
    return indicators_of(name, column.words)
