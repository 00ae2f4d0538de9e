"""Spaces as Minari writes them, and their values as one vector, as `gymnasium.flatten` has it."""

from __future__ import annotations

import math
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from sarl_core.documents import LARGEST_WHOLE, Count, MisfitError, conformed, parse_json
from sarl_core.environments.naming import part_name, picture_in, space_names
from sarl_core.errors import InputError, quoted
from sarl_core.limits import MAX_FEATURES

_DEEPEST = 8  # spaces within one another


class _Space(msgspec.Struct, tag_field="type"):
    """What all spaces have in common: nothing but their kind."""


class BoxSpace(_Space, tag="Box"):
    """Numbers of a shape, between bounds."""

    shape: tuple[Count, ...]
    low: Any = None
    high: Any = None
    dtype: str = "float32"


class DiscreteSpace(_Space, tag="Discrete"):
    """One of n whole numbers."""

    n: Count
    start: Annotated[int, msgspec.Meta(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)] = 0


class MultiDiscreteSpace(_Space, tag="MultiDiscrete"):
    """Several of those."""

    nvec: Any
    start: Any = None


class MultiBinarySpace(_Space, tag="MultiBinary"):
    """Numbers that are 0 or 1."""

    n: Count | tuple[Count, ...]


class TextSpace(_Space, tag="Text"):
    """Texts, which are no numbers."""


class DictSpace(_Space, tag="Dict"):
    """Spaces by their keys."""

    subspaces: dict[str, Space]


class TupleSpace(_Space, tag="Tuple"):
    """Spaces in a row."""

    subspaces: tuple[Space, ...]


Space = (
    BoxSpace
    | DiscreteSpace
    | MultiDiscreteSpace
    | MultiBinarySpace
    | TextSpace
    | DictSpace
    | TupleSpace
)


class _OneSpace(msgspec.Struct):
    """What a text of JSON holds."""

    space: Space


Simple = BoxSpace | DiscreteSpace | MultiDiscreteSpace | MultiBinarySpace


@dataclass(frozen=True)
class SpacePart:
    """A space without others in it, and where it is.

    Attributes:
        path: Keys of Dict spaces and places in Tuple spaces that lead to it.
        space: The space.
        width: How many numbers its values have.
    """

    path: tuple[str | int, ...]
    space: Simple
    width: int

    @property
    def name(self) -> str:
        """The keys that lead to it, "" where it is alone."""
        return reduce(part_name, self.path, "")

    @property
    def counts(self) -> tuple[int, ...]:
        """How many values each of its numbers can have, () if they are not labels."""
        if isinstance(self.space, DiscreteSpace):
            return (self.space.n,)
        if isinstance(self.space, MultiDiscreteSpace):
            return tuple(int(n) for n in np.ravel(self.space.nvec))
        return () if isinstance(self.space, BoxSpace) else (2,) * self.width

    @property
    def starts(self) -> tuple[int, ...]:
        """The least value of each of its numbers, where they are labels."""
        if isinstance(self.space, DiscreteSpace):
            return (self.space.start,)
        if isinstance(self.space, MultiDiscreteSpace) and self.space.start is not None:
            return tuple(int(start) for start in np.ravel(self.space.start))
        return (0,) * self.width

    @property
    def flat_width(self) -> int:
        """How many features its values are: labels take one each."""
        whole = isinstance(self.space, (DiscreteSpace, MultiDiscreteSpace))
        return sum(self.counts) if whole else self.width

    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lower and upper bounds of its numbers, infinite where it says none."""
        assert isinstance(self.space, BoxSpace)
        both = []
        for given, none in ((self.space.low, -math.inf), (self.space.high, math.inf)):
            try:
                values = np.ravel(none if given is None else given).astype(np.float64)
                both.append(tuple(np.broadcast_to(values, (self.width,)).tolist()))
            except (ValueError, TypeError, OverflowError) as error:
                raise _malformed("actions") from error
        return both[0], both[1]

    def flattened(self, values: NDArray[Any]) -> NDArray[Any]:
        """Its values as features.

        Args:
            values: Shape (T, ...), of one number or more.

        Returns:
            Shape (T, flat_width).

        Raises:
            InputError: If a value is none of the space.
        """
        rows = values.reshape(len(values), -1)
        if rows.shape[1] != self.width:
            raise InputError(
                f"{self.name or 'an observation'} has {rows.shape[1]:,} numbers, and its space "
                f"{self.width:,}; save the data set again"
            )
        if not isinstance(self.space, (DiscreteSpace, MultiDiscreteSpace)):
            return rows
        labels = rows.astype(np.int64) - np.array(self.starts)
        if not np.all((labels >= 0) & (labels < np.array(self.counts))):
            raise InputError(
                f"{self.name or 'an observation'} has a value outside of its space; save the data "
                "set again"
            )
        ends = np.cumsum((0, *self.counts[:-1]))
        flat = np.zeros((len(rows), self.flat_width), dtype=np.float32)
        np.put_along_axis(flat, labels + ends, 1.0, axis=1)
        return flat


def parsed_space(text: Any, what: str) -> Space:
    """A space as it stands in a file.

    Args:
        text: JSON.
        what: Whose it is, for messages.

    Returns:
        The space.

    Raises:
        InputError: If it is none that is known.
    """
    try:
        if not isinstance(text, str):
            raise ValueError("it is no text")
        return conformed({"space": parse_json(text, finite=False)}, _OneSpace).space
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        reason = str(error) if isinstance(error, MisfitError) else "it cannot be read"
        raise InputError(
            f"its space of {what} is none that is known ({reason}); save the data set again"
        ) from error


def parts_of(space: Space, what: str) -> tuple[SpacePart, ...]:
    """The spaces without others in them, in the order of `gymnasium.flatten`.

    Args:
        space: Any.
        what: "observations", whose labels take a number each, or "actions".

    Returns:
        At least one.

    Raises:
        InputError: If one is of images or texts, or they have far too many numbers.
    """
    parts = []
    numbers = 0
    for path, one in _simple(space, ()):
        part = SpacePart(path, one, _width(one, what, path))
        parts.append(part)
        numbers += part.flat_width if what == "observations" else part.width
        if numbers > MAX_FEATURES:
            if isinstance(one, BoxSpace) and len(one.shape) > 1:
                raise _images(f"{_placed(path)} is of shape {one.shape}")
            raise InputError(
                f"its {what} have more than {MAX_FEATURES:,} numbers, more than rules a person "
                "reads could use; choose a data set with fewer"
            )
    if not numbers:
        raise InputError(f"its space of {what} has nothing in it; save the data set again")
    return tuple(parts)


def _simple(
    space: Space, path: tuple[str | int, ...]
) -> Iterator[tuple[tuple[str | int, ...], Simple]]:
    if len(path) > _DEEPEST:
        raise InputError("its spaces are nested too deeply; save the data set with simpler ones")
    if isinstance(space, DictSpace):
        for key, inner in space.subspaces.items():
            yield from _simple(inner, (*path, key))
    elif isinstance(space, TupleSpace):
        for place, inner in enumerate(space.subspaces):
            yield from _simple(inner, (*path, place))
    elif isinstance(space, TextSpace):
        raise InputError(
            f"{_placed(path)} is text, which rules cannot read; choose a data set of numbers"
        )
    else:
        yield path, space


def _width(space: Simple, what: str, path: tuple[str | int, ...]) -> int:
    if isinstance(space, DiscreteSpace):
        shape: tuple[int, ...] = ()
        counts = [space.n]
    elif isinstance(space, MultiDiscreteSpace):
        try:
            sizes = np.asarray(space.nvec, dtype=np.int64)
            starts = sizes if space.start is None else np.asarray(space.start, dtype=np.int64)
        except (ValueError, TypeError, OverflowError) as error:
            raise _malformed(what) from error
        if starts.shape != sizes.shape:
            raise _malformed(what)
        shape, counts = sizes.shape, sizes.ravel()[: MAX_FEATURES + 1].tolist()
    elif isinstance(space, MultiBinarySpace):
        shape, counts = (space.n,) if isinstance(space.n, int) else space.n, []
    else:
        shape, counts = space.shape, []
    if any(n < 1 for n in counts):
        raise _malformed(what)
    return math.prod(shape)


def names_of(space: Space) -> tuple[str, ...]:
    """What the features of a space of observations are called.

    Args:
        space: Of which `parts_of` has been asked, so that it is not too large.

    Returns:
        A name for each; numbered ones where the space has no structure.

    Raises:
        InputError: If a part of it is an image, or it is not as it should be.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of bounds that a narrow type cannot hold
            whole = _made(space)
    except (ValueError, TypeError, AssertionError, OverflowError) as error:
        raise _malformed("observations") from error
    picture = picture_in(whole)
    if picture:
        raise _images(
            f"each of its observations {'is' if picture[:3] == 'of ' else 'has'} {picture}"
        )
    return space_names(whole)


def _made(space: Space) -> Any:
    """The same space of Gymnasium's."""
    from gymnasium import spaces

    if isinstance(space, DictSpace):  # in their order, which a plain dictionary would lose
        parts = ((key, _made(inner)) for key, inner in space.subspaces.items())
        return spaces.Dict(OrderedDict(parts))
    if isinstance(space, TupleSpace):
        return spaces.Tuple([_made(inner) for inner in space.subspaces])
    if isinstance(space, DiscreteSpace):
        return spaces.Discrete(space.n, start=space.start)
    if isinstance(space, MultiDiscreteSpace):
        return spaces.MultiDiscrete(np.asarray(space.nvec, np.int64), start=space.start)
    if isinstance(space, MultiBinarySpace):
        return spaces.MultiBinary(space.n if isinstance(space.n, int) else list(space.n))
    assert isinstance(space, BoxSpace)
    dtype = np.dtype(space.dtype)
    low = -np.inf if space.low is None else np.asarray(space.low, dtype)
    high = np.inf if space.high is None else np.asarray(space.high, dtype)
    return spaces.Box(low, high, space.shape, dtype.type)


def _images(what: str) -> InputError:
    return InputError(
        f"{what}, as images are, which rules cannot read; choose a data set with a vector of "
        "features"
    )


def _placed(path: tuple[str | int, ...]) -> str:
    return f"its entry {quoted('/'.join(map(str, path)))}" if path else "each of its observations"


def _malformed(what: str) -> InputError:
    return InputError(f"its space of {what} is not as it should be; save the data set again")
