"""States in tables: each number has a column, and each column of words one that says the word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.words import columns_of_words

_IS = " is "
_NO_WORD = "–"


class StateColumn(NamedTuple):
    """A column of a table of states.

    Attributes:
        title: Of a feature its name, of a column of words that.
        features: The feature, or those that say which word the column holds.
        places: Where they stand among all features.
    """

    title: str
    features: tuple[Feature, ...]
    places: tuple[int, ...]

    @property
    def unit(self) -> str:
        """Of a feature."""
        return self.features[0].unit

    @property
    def of_words(self) -> bool:
        """Whether it holds words."""
        return self.features[0].indicator is not None

    def words(self, observations: NDArray[np.float32]) -> list[str]:
        """The word of each state.

        Args:
            observations: Shape (N, d).

        Returns:
            N words, a dash where a state says none.
        """
        holds = observations[:, self.places] > 0.5
        yes = [_word(one, holds=True) for one in self.features]
        if len(yes) > 1:
            codes = np.where(holds.any(axis=1), holds.argmax(axis=1), len(yes))
            return [[*yes, _NO_WORD][code] for code in codes.tolist()]
        no = _word(self.features[0], holds=False)
        return [yes[0] if one else no for one in holds[:, 0].tolist()]


def state_columns(features: Sequence[Feature]) -> tuple[StateColumn, ...]:
    """The columns of a table of states.

    Args:
        features: All d features.

    Returns:
        In their order; a column of words at the place of its first feature.
    """
    several = {
        places[0]: tuple(places)
        for places in columns_of_words([one.indicator for one in features]).values()
        if len({_title(features[at]) for at in places}) == 1  # else they were renamed apart
    }
    within = {at for places in several.values() for at in places[1:]}
    columns = (several.get(at, (at,)) for at in range(len(features)) if at not in within)
    return tuple(
        StateColumn(_title(features[places[0]]), tuple(features[at] for at in places), places)
        for places in columns
    )


def word_shares(demonstrations: Demonstrations) -> dict[str, dict[str, float]]:
    """How often each column of words holds which word.

    Args:
        demonstrations: N pairs.

    Returns:
        For each column the share of each word, the most frequent first.
    """
    shares: dict[str, dict[str, float]] = {}
    for column in state_columns(demonstrations.features):
        if column.of_words:
            words, counts = np.unique(column.words(demonstrations.observations), return_counts=True)
            order = np.argsort(-counts, kind="stable")
            shares[column.title] = {
                str(words[at]): float(counts[at] / len(demonstrations)) for at in order
            }
    return shares


def _title(feature: Feature) -> str:
    if feature.indicator is None:
        return feature.name
    return feature.statement(True).partition(_IS)[0]


def _word(feature: Feature, *, holds: bool) -> str:
    return feature.statement(holds).partition(_IS)[2]
