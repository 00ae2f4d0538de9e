"""The combinations that may be asked about: pairs of features, and a grid of ratios for each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import LARGEST_RATIO, Combination
from sarl_core.environments.feature_order import compared_names, shortened
from sarl_core.errors import InputError, quoted

RATIOS = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)
"""How much the second feature of a combination weighs, where both are measured by their spread."""

_FEWEST_VALUES = 3  # of a feature that is combined: fewer say yes or no, and are no amount

Pair = tuple[int, int]


def pairs_of_like_kind(demonstrations: Demonstrations) -> tuple[Pair, ...]:
    """The pairs of features that are amounts: neither words, nor flags, nor always the same.

    Args:
        demonstrations: N states of d features that were observed.

    Returns:
        Each pair once, the feature that comes first before the other.
    """
    amounts = [
        place
        for place, (feature, values) in enumerate(
            zip(demonstrations.observed, demonstrations.raw_observations.T, strict=True)
        )
        if feature.indicator is None and len(np.unique(values)) >= _FEWEST_VALUES
    ]
    return tuple(combinations(amounts, 2))


def pairs_by_name(demonstrations: Demonstrations, texts: Sequence[str]) -> tuple[Pair, ...]:
    """The pairs that a person names.

    Args:
        demonstrations: N states.
        texts: Each of two or more names, separated by commas, of which every two are a pair.

    Returns:
        Each pair once, in the order in which they were named.

    Raises:
        InputError: If a name is unknown or of words, or there are not two.
    """
    return tuple(
        dict.fromkeys(
            pair for text in texts for pair in combinations(_named(demonstrations, text), 2)
        )
    )


def _named(demonstrations: Demonstrations, text: str) -> list[int]:
    """Indices of the features that a list names."""
    places: list[int] = []
    for name in text.split(","):
        place = amount_named(demonstrations, name)
        if place in places:
            raise InputError(
                f"{quoted(name.strip())} is combined with itself; name two different features"
            )
        places.append(place)
    if len(places) < 2:
        raise InputError(
            f"{quoted(text)} names one feature, and a combination is of two; name another one "
            "behind a comma"
        )
    return places


def amount_named(demonstrations: Demonstrations, name: str) -> int:
    """The index of a feature that a person names to combine it.

    Args:
        demonstrations: N states.
        name: Whatever its capitals, with spaces or underscores, where no other one reads the same.

    Returns:
        Of a feature that is a number.

    Raises:
        InputError: If there is none of that name, or it says which word a column holds.
    """
    names = [feature.name for feature in demonstrations.observed]
    known, (wanted,) = compared_names(names, (name if name in names else name.strip(),))
    if wanted not in known:
        raise InputError(
            f"{quoted(name.strip())} is no feature that could be combined; the features are "
            f"{shortened(names)}"
        )
    place = known.index(wanted)
    if demonstrations.observed[place].indicator is not None:
        raise InputError(
            f"{quoted(names[place])} says which word a column holds and is no amount; combine "
            "features that are numbers"
        )
    return place


def candidates(demonstrations: Demonstrations, pairs: Sequence[Pair]) -> tuple[Combination, ...]:
    """The combinations of pairs, each with a few ratios.

    Args:
        demonstrations: N states, which tell how widely each feature is spread.
        pairs: Of features that were observed.

    Returns:
        For each pair as many as there are `RATIOS`, rounded to two significant digits, which is
        what is used and what is read; none of a feature that never changes.
    """
    spread = demonstrations.raw_observations.std(axis=0, dtype=np.float64)
    result = []
    for first, second in pairs:
        if not (spread[first] > 0.0 and spread[second] > 0.0):
            continue
        ratios = {rounded_ratio(weight * spread[first] / spread[second]) for weight in RATIOS}
        result += [
            Combination(((first, 1.0), (second, ratio)))
            for ratio in sorted(ratios)
            if 0.0 < abs(ratio) <= LARGEST_RATIO
        ]
    return tuple(result)


def rounded_ratio(ratio: float) -> float:
    """A ratio with two significant digits, which is what is used and what is read."""
    return float(f"{ratio:.1e}")
