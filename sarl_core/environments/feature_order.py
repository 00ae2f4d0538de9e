"""How the features of two things that meet line up: by their names, or as they come.

Rules and an environment, rules and demonstrations, a file and the environment it was recorded in:
each numbers its features in an order of its own, and only names tell which is which.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeVar

from sarl_core.errors import InputError

_T = TypeVar("_T")

How = Literal["same", "permuted", "trusted"]

_COUNTED = re.compile(r"(\D*?)[ _.\-\[(]?(\d{1,9})[\])]?")
_SEVERAL = re.compile(r"the (\w+ )?(rules|demonstrations|states)")
_SHORT = 7  # as "feature": a longer word before a number says what is counted
_OBSERVATION = ("observation", "observations")
_MOST_CHARACTERS = 110  # of a list in a message


class NamedFeatures(NamedTuple):
    """One of two things that meet.

    Attributes:
        owner: What it is in a sentence, as "the rules" or "CartPole-v1".
        names: Of its features, in its own order.
        env_id: Environment it is of, "" where unknown.
    """

    owner: str
    names: tuple[str, ...]
    env_id: str = ""


class FeatureOrder(NamedTuple):
    """How the features of one thing line up with another's.

    Attributes:
        how: Whether both have the same order, the first has to be permuted, or nothing but the
            order says which is which.
        places: For each feature of the second, its place in the first.
        note: What a person should know, as a clause; "" where the order is the same.
    """

    how: How
    places: tuple[int, ...]
    note: str = ""

    @property
    def inverse(self) -> tuple[int, ...]:
        """For each feature of the first, its place in the second."""
        return tuple(sorted(range(len(self.places)), key=self.places.__getitem__))

    def put(self, entries: tuple[_T, ...]) -> tuple[_T, ...]:
        """What the first has, one entry a feature, in the second's order; nothing stays nothing."""
        return tuple(entries[place] for place in self.places) if entries else entries


def line_up(first: NamedFeatures, second: NamedFeatures, *, what: str = "features") -> FeatureOrder:
    """Say which feature of one thing is which of another; the one place that decides it.

    Names are the same where `compared_names` has it so. Names that only count (``feature 0``,
    ``obs_1``) say nothing. Of one environment a feature may have been renamed by a person: its
    place then says what it is, as long as no name of the other stands elsewhere.

    Args:
        first: One of them.
        second: The other, whose order is wanted.
        what: What is named, in the plural.

    Returns:
        The order.

    Raises:
        InputError: If there are not as many, or their names are of different things.
    """
    if len(first.names) != len(second.names):
        several = [is_several(side.owner) for side in (first, second)]
        asks = "ask about" if several[0] else "asks about"
        if what != "features":
            asks = "are for" if several[0] else "is for"
        raise InputError(
            f"{first.owner} {asks} {len(first.names)} {what} and {second.owner} "
            f"{'have' if several[1] else 'has'} {len(second.names)}; give two of the same "
            "environment"
        )
    as_they_are = tuple(range(len(first.names)))
    one, other = compared_names(first.names, second.names)
    known = first.env_id != "" and _bare(first.env_id) == _bare(second.env_id)
    nameless = [only_counts(side.names) for side in (first, second)]
    if one == other and (known or not all(nameless)):
        return FeatureOrder("same", as_they_are)
    if sorted(one) == sorted(other) and len(set(one)) == len(one) and not all(nameless):
        places = tuple(one.index(name) for name in other)
        return FeatureOrder(
            "permuted",
            places,
            f"the {what} of {first.owner} were put into the order of "
            f"{second.owner}, by their names",
        )
    if any(nameless):
        who = " and ".join(
            side.owner for side, empty in zip((first, second), nameless, strict=True) if empty
        )
        return FeatureOrder(
            "trusted",
            as_they_are,
            f"the {what} of {who} have no names, so they were trusted to be in the order of "
            f"{'each other' if all(nameless) else first.owner if nameless[1] else second.owner}",
        )
    stands = {name: place for place, name in enumerate(one)}
    if known and all(stands.get(name, place) == place for place, name in enumerate(other)):
        renamed = [
            f"{mine!r} for {theirs!r}"
            for mine, theirs, *plain in zip(first.names, second.names, one, other, strict=True)
            if plain[0] != plain[1]
        ]
        return FeatureOrder(
            "trusted",
            as_they_are,
            f"some {what} have other names in {first.owner} than in {second.owner} "
            f"({shortened(renamed)}); both are of {_bare(first.env_id)}, so their order was "
            "trusted",
        )
    at = next(place for place, name in enumerate(one) if name != other[place])
    mine, theirs = (shortened(side.names[at : at + 1]) for side in (first, second))
    raise InputError(
        f"{first.owner} and {second.owner} have different {what}: number {at + 1} is {mine!r} in "
        f"{first.owner} and {theirs!r} in {second.owner} ({shortened(first.names)}; "
        f"{shortened(second.names)}); give two of the same environment, or name them alike"
    )


def is_several(owner: str) -> bool:
    """Whether who is called so has, or have, something.

    Args:
        owner: As in `NamedFeatures`.
    """
    return _SEVERAL.fullmatch(owner) is not None


def only_counts(names: Sequence[str]) -> bool:
    """Whether names say no more than their place, as x0, x1, x2 or feature 1, feature 2.

    Args:
        names: Any number.

    Returns:
        True also of no names at all.
    """
    if not names:
        return True
    matches = [_COUNTED.fullmatch(name.strip()) for name in names]
    counted = [match for match in matches if match is not None]
    if len(counted) < len(names) or len({match[1].casefold() for match in counted}) > 1:
        return False
    word = counted[0][1].strip().casefold()
    numbers = [int(match[2]) for match in counted]
    return (
        (len(word) <= _SHORT or word in _OBSERVATION)
        and numbers[0] in (0, 1)
        and numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    )


def numbered(count: int) -> tuple[str, ...]:
    """Names for features that have none.

    Args:
        count: How many.

    Returns:
        As "feature 0".
    """
    return tuple(f"feature {index}" for index in range(count))


def shortened(names: Sequence[str]) -> str:
    """A list for a message: as many names as a line takes, and how many more there are.

    Args:
        names: Any number.

    Returns:
        At most about a line.
    """
    texts: list[str] = []
    length = 0
    for name in names:
        text = name if len(name) <= 40 else f"{name[:37]}..."
        length += len(text) + 2
        if texts and length > _MOST_CHARACTERS:
            break
        texts.append(text)
    rest = len(names) - len(texts)
    return ", ".join(texts) + (f" and {rest} more" if rest else "")


def _bare(env_id: str) -> str:
    """An id without the module that registers it."""
    return env_id.rsplit(":", 1)[-1]


def plain_names(names: Sequence[str]) -> list[str]:
    """Names as they are compared: whatever their capitals, and however words are parted.

    Args:
        names: Any number.

    Returns:
        One each.
    """
    return [" ".join(re.split(r"[\s_\-]+", name.casefold().strip())) for name in names]


def compared_names(*several: Sequence[str]) -> list[list[str]]:
    """Names of things that meet, as they are compared with each other.

    Args:
        *several: The names of each thing.

    Returns:
        As many for each: plain ones (`plain_names`), but for those that one thing uses for two,
        as x and X, which stay as they are written.
    """
    plain = [dict(zip(names, plain_names(names), strict=True)) for names in several]
    doubled = {
        name for each in plain for name, count in Counter(each.values()).items() if count > 1
    }
    return [
        [name if each[name] in doubled else each[name] for name in names]
        for names, each in zip(several, plain, strict=True)
    ]
