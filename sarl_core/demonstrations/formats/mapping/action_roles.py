"""What a person said of actions, done to the columns that hold them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.mapping.roles import Roles
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.requirements import without_fraction
from sarl_core.errors import InputError, quoted

if TYPE_CHECKING:
    from sarl_core.demonstrations.formats.opened_table import TableColumn


def stated_actions(
    read: Mapping[str, TableColumn],
    names: Sequence[str],
    roles: Roles,
    rows: NDArray[np.int64] | None = None,
) -> Mapping[str, TableColumn]:
    """The columns of actions as labels (whole numbers) or as amounts, where a person said which.

    Args:
        read: The columns of a table by name.
        names: Those of the actions.
        roles: What was said.
        rows: Shape (N,), the rows they had in the file, from 0; None if they are those.

    Returns:
        `read` itself where nothing was said; else the columns of the actions, as floats where they
        are amounts and as integers where they are labels.

    Raises:
        InputError: If amounts stand beside labels, or labels are no whole numbers.
    """
    kinds = {name: roles[name].kind if name in roles else None for name in names}
    said = {kind: name for name, kind in kinds.items() if kind is not None}
    if not said:
        return read
    if len(said) == 2:
        raise InputError(
            f"the action {quoted(said['continuous'])} is continuous and {quoted(said['labels'])} "
            "is labels; take both as the one or the other, or leave one out"
        )
    (kind,) = said
    columns = {}
    for name in names:
        values = read[name].values
        if read[name].words or values.dtype.kind == "b":
            if kind == "continuous":
                raise InputError(
                    f"column {quoted(name)} holds words or true and false, which are no amounts; "
                    "leave out that it is continuous"
                )
            columns[name] = read[name]
            continue
        gaps = np.isnan(values) if values.dtype.kind == "f" else np.zeros(len(values), np.bool_)
        broken = ~(without_fraction(values) | gaps)
        if kind == "labels" and broken.any():
            row = int(np.argmax(broken))
            raise InputError(
                f"column {quoted(name)} is {values[row]} in row "
                f"{(row if rows is None else int(rows[row])) + 1}, which is no label; map it as "
                "continuous, or mend that row"
            )
        if kind == "continuous":
            columns[name] = replace(read[name], values=read[name].with_gaps.astype(np.float64))
            continue
        missing = read[name].missing
        columns[name] = replace(
            read[name],
            values=np.where(gaps, 0, values).astype(np.int64),
            missing=(gaps if missing is None else gaps | missing) if gaps.any() else missing,
        )
    return columns


def with_stated_actions(metadata: Metadata, names: Sequence[str], roles: Roles) -> Metadata:
    """What a file says of its actions, less what a person said otherwise, with the bounds.

    Args:
        metadata: Of the file.
        names: The columns of the actions.
        roles: What was said.

    Returns:
        The same where nothing was said.

    Raises:
        InputError: If only some of several actions have bounds.
    """
    said = [roles[name] for name in names if name in roles and roles[name].kind is not None]
    if not said:
        return metadata
    metadata = replace(
        metadata,
        label_names=(),
        label_first=(),
        label_codes=(),
        action_low=(),
        action_high=(),
        bounds_from=None,
    )
    bounded = [name for name in names if name in roles and roles[name].low is not None]
    if not bounded:
        return metadata
    if len(bounded) < len(names):
        other = next(name for name in names if name not in bounded)
        raise InputError(
            f"the action {quoted(bounded[0])} has bounds and {quoted(other)} has none; give bounds "
            "to each, or to none"
        )
    return replace(
        metadata,
        action_low=tuple(float(roles[name].low or 0) for name in names),
        action_high=tuple(float(roles[name].high or 0) for name in names),
        bounds_from="action space",
    )
