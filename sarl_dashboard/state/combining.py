"""Whether rules may ask about combinations of two features: between the data and every page.

Which combinations are worth asking about is chosen from the episodes that rules are mined from;
held-out ones have no say in it.
"""

from __future__ import annotations

from operator import attrgetter
from typing import NamedTuple

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.errors import InputError
from sarl_core.mining.combining.candidates import Pair, pairs_of_like_kind
from sarl_core.mining.combining.choice import with_combinations
from sarl_dashboard.cache import cached
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.thresholds import MIN_DIVIDER, chosen_divider
from sarl_dashboard.state.url import set_url_choice, url_text

_OFF, _EVERY = "off", "every"
_MOST_TEXT = 2_000


class CombinationChoice(NamedTuple):
    """What was chosen.

    Attributes:
        on: Whether rules may ask about combinations.
        features: Indices of those that may be combined, ascending; () for all of like kind.
    """

    on: bool
    features: tuple[int, ...]


class Combined(NamedTuple):
    """What came of a choice.

    Attributes:
        derived: What is derived of the features, the combinations behind the rest.
        problem: Why there are no combinations, in one sentence; "" where there are some.
    """

    derived: tuple[DerivedFeature, ...]
    problem: str


def chosen() -> CombinationChoice:
    """What is in force (URL: combine, as "every" or as "0,2,3")."""
    text = url_text("combine", _OFF, _is_choice)
    return CombinationChoice(text != _OFF, () if text in (_OFF, _EVERY) else _numbers(text))


def _is_choice(text: str) -> bool:
    return text in (_OFF, _EVERY) or len(_numbers(text)) >= 2


def _numbers(text: str) -> tuple[int, ...]:
    """Numbers as "3,7"; () where it is anything else."""
    parts = text[:_MOST_TEXT].split(",")
    if not all(part.isdecimal() and part.isascii() and len(part) < 8 for part in parts):
        return ()
    return tuple(sorted({int(part) for part in parts}))


def choose(choice: CombinationChoice) -> None:
    """Choose; for callbacks. One feature alone is no choice, and means all of like kind."""
    features = ",".join(map(str, sorted(set(choice.features))))
    some = features if len(set(choice.features)) > 1 else _EVERY
    set_url_choice("combine", some if choice.on else _OFF, _OFF)


def choose_all() -> None:
    """Let all features of like kind be combined, if any are: other data have other features."""
    choose(CombinationChoice(chosen().on, ()))


def combinable(demonstrations: Demonstrations) -> tuple[int, ...]:
    """Indices of the features that are amounts, and may be combined."""
    return tuple(sorted({index for pair in _pairs(demonstrations) for index in pair}))


def combined(parts: Parts) -> Parts:
    """Demonstrations with combinations, where they were chosen.

    Args:
        parts: Of the chosen data.

    Returns:
        The same object where they are off, or where there are none.
    """
    choice = chosen()
    if not choice.on or parts.mined.sample_of is not None:
        return parts
    derived = _derived(parts.mined, choice.features)
    return parts if derived.problem else _deriving(parts, derived.derived)


def problem(parts: Parts) -> str:
    """Why there are no combinations though they were chosen, in one sentence; "" else."""
    choice = chosen()
    return _derived(parts.mined, choice.features).problem if choice.on else ""


def pairs(demonstrations: Demonstrations) -> tuple[Pair, ...]:
    """The pairs of features that may be combined; () where they are off."""
    choice = chosen()
    return _among(demonstrations, choice.features) if choice.on else ()


def _among(demonstrations: Demonstrations, features: tuple[int, ...]) -> tuple[Pair, ...]:
    possible = _pairs(demonstrations)
    return tuple(pair for pair in possible if not features or {*pair} <= {*features})


def _derived(mined: Demonstrations, features: tuple[int, ...]) -> Combined:
    divider = MIN_DIVIDER if mined.is_discrete else chosen_divider()
    return _best(mined, features, divider)


@cached(
    show_spinner="Choosing the combinations of two features …",
    hash_funcs={Demonstrations: attrgetter("pairs_digest")},
)
def _best(mined: Demonstrations, features: tuple[int, ...], divider: int) -> Combined:
    try:
        combined = with_combinations(mined, pairs=_among(mined, features), divider=divider)
        return Combined(combined.derived, "")
    except InputError as error:
        return Combined(mined.derived, str(error))


@cached(hash_funcs={Demonstrations: attrgetter("pairs_digest")})
def _pairs(demonstrations: Demonstrations) -> tuple[Pair, ...]:
    return pairs_of_like_kind(demonstrations)


@cached()
def _deriving(parts: Parts, derived: tuple[DerivedFeature, ...]) -> Parts:
    mined, remaining, held_out, why = parts
    ready = mined.deriving(derived)
    return Parts(
        ready,
        ready if remaining is mined else remaining.deriving(derived),
        None if held_out is None else held_out.deriving(derived),
        why,
    )
