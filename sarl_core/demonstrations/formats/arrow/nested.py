"""Columns of Arrow that hold a list or an object in each row: each number in them is a column.

A list `obs` of three numbers is the columns `obs_0`, `obs_1` and `obs_2`, and an object `car` with
`speed` in it the column `car.speed`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sarl_core.errors import InputError, quoted
from sarl_core.limits import MAX_FEATURES

_DEEPEST = 6  # objects and lists within one another


@dataclass(frozen=True)
class Leaf:
    """Where a column of single values stands in a table.

    Attributes:
        column: Which column of the table it is, or is in.
        path: The keys of objects and places in lists that lead to it; () if it is that column.
        widths: For each of these the length of the list, 0 for an object.
    """

    column: str
    path: tuple[str | int, ...] = ()
    widths: tuple[int, ...] = ()


@dataclass(frozen=True)
class TableOfLeaves:
    """A table of Arrow, whose columns always have names.

    Attributes:
        leaves: Where each column stands in it: itself, or in a list or an object in one.
    """

    leaves: Mapping[str, Leaf]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.leaves)

    @property
    def named(self) -> bool:
        """Always."""
        return True


def leaves_of(column: str, kind: Any, first: Any = None) -> dict[str, Leaf]:
    """The columns of single values in a column.

    Args:
        column: Its name.
        kind: Its Arrow type.
        first: The Arrow scalar of its first row, which has the lengths of lists; None if unknown.

    Returns:
        Them by their names, in their order; the column itself where it cannot be taken apart.
    """
    leaves: dict[str, Leaf] = {}
    for name, leaf in _within(column, Leaf(column), kind, first):
        leaves[name] = leaf
        if len(leaves) > MAX_FEATURES:
            return {column: Leaf(column)}
    return leaves


def leaf_type(leaf: Leaf, kind: Any) -> Any:
    """The Arrow type of a leaf in a column of some type."""
    for step in leaf.path:
        kind = kind.field(step).type if isinstance(step, str) else kind.value_type
    return kind


def few_leaves(leaves: Mapping[str, Leaf]) -> dict[str, Leaf]:
    """Leaves that are not too many between them: else columns that have several stay whole."""
    if len(leaves) <= MAX_FEATURES:
        return dict(leaves)
    few: dict[str, Leaf] = {}
    for name, leaf in leaves.items():
        few |= {leaf.column: Leaf(leaf.column)} if leaf.path else {name: leaf}
    return few


def has_lists(kind: Any) -> bool:
    """Whether lists whose length is not part of the type are in it."""
    import pyarrow as pa

    if pa.types.is_struct(kind):
        return any(has_lists(kind.field(index).type) for index in range(kind.num_fields))
    return _is_list(kind) and (not pa.types.is_fixed_size_list(kind) or has_lists(kind.value_type))


def values_in(leaf: Leaf, array: Any, start: int = 0) -> Any:
    """The values of a leaf.

    Args:
        leaf: Of a column.
        array: The column, or a part of it.
        start: Row of the first value of the part, from 0.

    Returns:
        An Arrow array of as many values.

    Raises:
        InputError: If a list has another length than that of the first row, with the row.
    """
    import pyarrow.compute as pc

    for step, width in zip(leaf.path, leaf.widths, strict=True):
        if isinstance(step, str):
            array = pc.struct_field(array, step)
            continue
        lengths = pc.list_value_length(array)
        other = pc.index(pc.fill_null(pc.not_equal(lengths, width), False), True).as_py()
        if other >= 0:
            raise InputError(
                f"column {quoted(leaf.column)} holds a list of {lengths[other].as_py():,} in row "
                f"{start + other + 1}, and one of {width:,} in the first; give each row as many"
            )
        array = pc.list_element(array, step)
    return array


def _within(name: str, leaf: Leaf, kind: Any, first: Any) -> Iterator[tuple[str, Leaf]]:
    import pyarrow as pa

    known = first is not None and first.is_valid
    if len(leaf.path) >= _DEEPEST:
        yield name, Leaf(leaf.column)
    elif pa.types.is_struct(kind) and kind.num_fields:
        for index in range(kind.num_fields):
            field = kind.field(index)
            deeper = Leaf(leaf.column, (*leaf.path, field.name), (*leaf.widths, 0))
            value = first[index] if known else None
            yield from _within(f"{name}.{field.name}", deeper, field.type, value)
    elif _is_list(kind) and (width := _width(kind, first if known else None)):
        for index in range(min(width, MAX_FEATURES + 1)):
            deeper = Leaf(leaf.column, (*leaf.path, index), (*leaf.widths, width))
            value = first[index] if known else None
            yield from _within(f"{name}_{index}", deeper, kind.value_type, value)
    else:
        yield name, leaf


def _width(kind: Any, first: Any) -> int:
    import pyarrow as pa

    if pa.types.is_fixed_size_list(kind):
        return int(kind.list_size)
    return 0 if first is None else len(first)


def _is_list(kind: Any) -> bool:
    """Whether it is a list of numbers, or of lists of them."""
    import pyarrow as pa

    if not (
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    ):
        return False
    inner = kind.value_type
    return _is_list(inner) or bool(
        pa.types.is_integer(inner)
        or pa.types.is_floating(inner)
        or pa.types.is_boolean(inner)
        or pa.types.is_decimal(inner)
    )


def refuse_nested(name: str, kind: Any) -> None:
    """Refuse a column that could not be taken apart.

    Args:
        name: Of the column.
        kind: Its Arrow type.

    Raises:
        InputError: If it holds several values in each row.
    """
    import pyarrow as pa

    if pa.types.is_nested(kind) or isinstance(kind, pa.BaseExtensionType):
        raise InputError(
            f"column {quoted(name)} holds a {str(kind).split('<')[0]} in each row that cannot be "
            "taken apart; give each number a column of its own"
        )
