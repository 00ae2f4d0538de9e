"""What the entries of an environment's observations and actions are called, as it says itself.

By attributes of the environment or of a wrapper (`feature_names`, `feature_units`, `action_names`,
`label_names`), by what well-known packages keep (highway-env's configuration, the meanings of
actions in the Arcade Learning Environment), and by the keys of its spaces.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sarl_core.environments.feature_order import numbered

_PART = re.compile(r"(?:^| of )part \d+(?: of |$)")


class OwnNames(NamedTuple):
    """The names that an environment gives.

    Attributes:
        features: d names, in the order in which observations are laid flat; () where it gives none.
        units: d units, or ().
        actions: m names of action dimensions, or ().
        labels: For each action dimension the names of its labels, or ().
    """

    features: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    labels: tuple[tuple[str, ...], ...] = ()


def own_names(layers: Sequence[Any], d: int, counts: Sequence[int], m: int) -> OwnNames:
    """The names that an environment gives.

    Args:
        layers: The environment and the wrappers around it whose observations are the same, the
            outermost first.
        d: Number of features.
        counts: Number of labels of each discrete action dimension; () if continuous.
        m: Number of action dimensions.

    Returns:
        Those that fit.
    """
    inner = layers[-1]
    table = _texts(_attempt(lambda: inner.get_wrapper_attr("observation_type").features)) or _texts(
        _attempt(lambda: inner.get_wrapper_attr("config")["observation"]["features"])
    )
    actions = _texts(_attempt(lambda: layers[0].get_wrapper_attr("action_names")))
    return OwnNames(
        _names(layers, "feature_names", d) or key_names(inner.observation_space, table),
        _names(layers, "feature_units", d, empty=True),
        actions if len(actions) == m else (),
        _labels(layers[0], counts),
    )


def _names(
    layers: Sequence[Any], attribute: str, count: int, *, empty: bool = False
) -> tuple[str, ...]:
    """What an attribute says, of the outermost layer that has as many as are needed."""
    for layer in layers:
        names = _texts(_attempt(partial(getattr, layer, attribute, ())), empty=empty)
        if len(names) == count:
            return names
    return ()


def _texts(names: Any, *, empty: bool = False) -> tuple[str, ...]:
    """Names, each another, or, where they may be empty, units; else nothing."""
    if isinstance(names, Mapping):  # as {0: "LANE_LEFT", 1: "IDLE"}
        names = [names.get(index) for index in range(len(names))]
    if not isinstance(names, (list, tuple)):
        return ()
    if not all(isinstance(one, str) and one.isprintable() and one.strip() == one for one in names):
        return ()
    return tuple(names) if empty or (all(names) and len(set(names)) == len(names)) else ()


def _labels(env: Any, counts: Sequence[int]) -> tuple[tuple[str, ...], ...]:
    """Names of the labels of all dimensions in an attribute, or none."""
    names = _attempt(lambda: env.get_wrapper_attr("label_names"))
    each = [names] if _texts(names) else names if isinstance(names, (list, tuple)) else []
    if each and [len(_texts(one)) for one in each] == list(counts):
        return tuple(_texts(one) for one in each)
    return ()


def package_labels(env: Any, counts: Sequence[int]) -> tuple[tuple[str, ...], ...]:
    """Names of actions as highway-env and the Arcade Learning Environment keep them.

    Args:
        env: Wrapped or not.
        counts: Number of labels of each discrete action dimension; () if continuous.

    Returns:
        Of the one dimension; () where there are none, or several dimensions.
    """
    sources: tuple[Callable[[], Any], ...] = (
        lambda: env.get_wrapper_attr("action_type").actions,
        lambda: env.get_wrapper_attr("get_action_meanings")(),
    )
    for source in sources if len(counts) == 1 else ():
        if len(labels := _texts(_attempt(source))) == counts[0]:
            return (labels,)
    return ()


def _attempt(source: Callable[[], Any]) -> Any:
    try:
        return source()
    except Exception:  # other people's code, which may raise anything; then it tells nothing
        return None


def key_names(space: Any, table: Sequence[str] = ()) -> tuple[str, ...]:
    """Names from the structure of an observation space.

    Args:
        space: Of fixed length.
        table: Names of the columns of a table with a row for each vehicle.

    Returns:
        d names; () where the space has no structure, or its names are not one for each.
    """
    names = space_names(space, table)
    return () if names == numbered(len(names)) else _texts(names)


def space_names(space: Any, table: Sequence[str] = (), name: str = "") -> tuple[str, ...]:
    """What the entries of a space are called, in the order of Gymnasium's `flatten`.

    Args:
        space: Any part of an observation space of fixed length.
        table: Names of the columns of a table with a row for each vehicle.
        name: Of the part; "" for the whole.

    Returns:
        As many as `flatdim` says.
    """
    from gymnasium import spaces

    before = f"{name}: " if name else ""
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        parts = space.spaces.items() if isinstance(space, spaces.Dict) else enumerate(space.spaces)
        return tuple(
            entry for key, part in parts for entry in space_names(part, table, part_name(name, key))
        )
    if isinstance(space, spaces.Discrete):
        return _indicators(name or "state", int(space.start), int(space.n))
    if isinstance(space, spaces.MultiDiscrete):
        first = np.asarray(space.start).reshape(-1).tolist()
        return tuple(
            entry
            for index, count in enumerate(space.nvec.reshape(-1).tolist())
            for entry in _indicators(entry_name(name or "state", index), first[index], count)
        )
    shape = tuple(space.shape or ())
    if table and shape[-1:] == (len(table),):
        if len(shape) == 1:
            return tuple(f"{before}{column}" for column in table)
        if len(shape) == 2:
            return tuple(
                f"{before}vehicle {row}: {column}"
                for row in range(1, shape[0] + 1)
                for column in table
            )
    if len(shape) > 2 and table and shape[0] == len(table):
        return tuple(
            f"{before}{table[index[0]]} {_place(index[1:])}" for index in np.ndindex(*shape)
        )
    if len(shape) > 1:
        return tuple(entry_name(name or "entry", _place(index)) for index in np.ndindex(*shape))
    count = int(spaces.utils.flatdim(space))
    if count == 1 and name:
        return (name,)
    return tuple(entry_name(name, index) for index in range(count)) if name else numbered(count)


def part_name(name: str, key: str | int) -> str:
    """What a part of a space is called.

    Args:
        name: Of the space; "" for the whole.
        key: Of the part in a Dict space, or its place in a Tuple space.

    Returns:
        As "arm: speed", "part 0 of arm" or "speed of part 0".
    """
    if isinstance(key, int):
        return f"part {key} of {name}" if name else f"part {key}"
    if not name:
        return key
    return f"{key} of {name}" if _PART.search(name) else f"{name}: {key}"


def entry_name(name: str, place: str | int) -> str:
    """What one number of a part is called.

    Args:
        name: Of the part.
        place: Of the number in it.

    Returns:
        As "lamps 1"; of what has no name of its own as "entry 1 of part 0".
    """
    return f"entry {place} of {name}" if _PART.search(name) else f"{name} {place}"


def _indicators(name: str, first: int, count: int) -> tuple[str, ...]:
    return tuple(f"{name} is {value}" for value in range(first, first + count))


def _place(index: Sequence[int]) -> str:
    """As "2:3" for row 2, column 3."""
    return ":".join(str(one) for one in index)


def picture_in(space: Any, name: str = "") -> str:
    """Whether a part of a space is an image: three colours, or bytes of 16 x 16 and more.

    Args:
        space: Any part of an observation space.
        name: Of the part; "" for the whole.

    Returns:
        The name and the shape of the first such part, "" where there is none.
    """
    from gymnasium import spaces

    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        parts = space.spaces.items() if isinstance(space, spaces.Dict) else enumerate(space.spaces)
        return next((place for key, part in parts if (place := picture_in(part, str(key)))), "")
    if isinstance(space, spaces.Box) and _is_picture(space):
        return f"{f'{name!r} ' if name else ''}of shape {space.shape}"
    return ""


def text_in(space: Any) -> bool:
    """Whether a part of a space is text: flattened it is codes of signs, which mean nothing.

    Args:
        space: An observation space.

    Returns:
        True also where the text is one of several things that may come.
    """
    from gymnasium import spaces

    if isinstance(space, (spaces.Dict, spaces.Tuple, spaces.OneOf)):
        parts = space.spaces.values() if isinstance(space, spaces.Dict) else space.spaces
        return any(text_in(part) for part in parts)
    return isinstance(space, spaces.Text)


def _is_picture(space: Any) -> bool:
    shape = tuple(space.shape)
    in_bytes = space.dtype == np.uint8
    if in_bytes and sum(size >= _WIDE for size in shape) >= 2:
        return True
    if len(shape) < 3:
        return False
    for colours, wide in (
        (shape[-1:], shape[-3:-1]),  # height, width, colours
        (shape[-3:-2], shape[-2:]),  # colours, height, width
    ):
        if not (in_bytes or space.is_bounded()):  # numbers without an end are no brightness
            return False
        least = 4 if in_bytes and colours == (3,) else 8 if in_bytes or colours == (3,) else _WIDE
        if colours[0] in (1, 3, 4) and min(wide) >= least:
            return True
    return False


_WIDE = 16  # from here on a table of bytes is taken for a picture
