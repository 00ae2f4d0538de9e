"""Demonstrations seen as rules see them: with their indicators of words, and what they derive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sarl_core.demonstrations.dataset import (
    Demonstrations,
    Feature,
    derived_features,
    derived_over,
    observed_features,
)
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.demonstrations.fields import TRUTH
from sarl_core.demonstrations.words import Coded, columns_of_words, indicated, spelled, words_of
from sarl_core.environments.feature_order import compared_names, shortened
from sarl_core.errors import InputError, quoted


def recoded(
    demonstrations: Demonstrations, features: Sequence[Feature], *, called: str
) -> Demonstrations:
    """Demonstrations with the indicators and the derived features of rules.

    Which words occur decides which indicators a column becomes; rules know those of the data that
    they were mined from. What rules derive is worked out from what was observed.

    Args:
        demonstrations: N steps.
        features: Of rules.
        called: What the demonstrations are called in a message.

    Returns:
        The same steps; the same object where nothing is different. Where they lack a feature that
        something is derived from, nothing is: they are refused where features are lined up.

    Raises:
        InputError: If a column holds a word that the rules do not know.
    """
    return _deriving(_indicating(demonstrations, features, called), features)


def _deriving(demonstrations: Demonstrations, features: Sequence[Feature]) -> Demonstrations:
    """The same with other derived features than they have."""
    names = [one.name for one in demonstrations.observed]
    theirs = [one.name for one in observed_features(features)]
    have, wanted = compared_names(names, theirs)
    derived: tuple[DerivedFeature, ...] = ()
    if {*wanted} <= {*have}:
        places = [have.index(name) for name in wanted]
        derived = derived_over(derived_features(features), places, names)
    elif len(names) == len(theirs):  # whether they are the same is told where they are lined up
        derived = derived_over(derived_features(features), range(len(names)), names)
    if [one.definition for one in derived] == [one.definition for one in demonstrations.derived]:
        return demonstrations
    return demonstrations.deriving(derived)


def _indicating(
    demonstrations: Demonstrations, features: Sequence[Feature], called: str
) -> Demonstrations:
    features = observed_features(features)
    observed = demonstrations.observed
    indicators = [one.indicator for one in observed]
    theirs = columns_of_words([one.indicator for one in features])
    ours = columns_of_words(indicators)
    their_names, own_names = compared_names(tuple(theirs), tuple(ours))
    wanted = dict(zip(their_names, theirs.values(), strict=True))
    own = dict(zip(own_names, ours.values(), strict=True))
    if not wanted or [one.indicator for one in features] == indicators:
        return demonstrations
    columns: list[np.ndarray[tuple[int], np.dtype[np.float32]]] = []
    said: list[Feature] = []
    read_from = {at: column for column, places in own.items() for at in places}
    # What is true or false may be written as 1 and 0.
    numbers = [at for at, one in enumerate(indicators) if one is None]
    truths = {
        column: name
        for (column, places), name in zip(theirs.items(), their_names, strict=True)
        if _is_truth(features, places)
    }
    of_numbers, of_truths = compared_names([observed[at].name for at in numbers], tuple(truths))
    flags = dict(zip(of_truths, truths.values(), strict=True))
    read_from |= {
        at: flags[name] for at, name in zip(numbers, of_numbers, strict=True) if name in flags
    }
    for at, feature in enumerate(observed):
        column = read_from.get(at, "")
        together = own.get(column, [at])
        if column not in wanted or at != together[0]:
            if column not in wanted or feature.indicator is None:
                columns.append(demonstrations.observations[:, at])
                said.append(feature)
            continue
        coded = _words(demonstrations, together)
        known = [features[place] for place in wanted[column]]
        if coded is None:  # numbers, which are refused as another feature
            columns.append(demonstrations.observations[:, at])
            said.append(feature)
            continue
        _require_known(coded, known, called)
        columns += list(indicated(coded, [one.indicator for one in known if one.indicator]).T)
        said += known
    return replace(
        demonstrations,
        observations=np.stack(columns, axis=1),
        derived=(),
        feature_names=tuple(one.name for one in said),
        feature_units=tuple(one.unit for one in said),
        indicators=tuple(one.indicator for one in said),
    )


def _is_truth(features: Sequence[Feature], places: Sequence[int]) -> bool:
    said = [features[place].indicator for place in places]
    return all(one is not None and one.is_truth for one in said)


def _words(demonstrations: Demonstrations, places: Sequence[int]) -> Coded | None:
    """The words of a column; of one that holds 1 and 0, true and false."""
    values = demonstrations.observations[:, list(places)]
    indicators = [one for at in places if (one := demonstrations.features[at].indicator)]
    if indicators:
        return spelled(values, indicators)
    if not np.isin(values, (0, 1)).all():
        return None
    return Coded(values[:, 0].astype(np.int64), TRUTH)


def _require_known(coded: Coded, features: Sequence[Feature], called: str) -> None:
    """Refuse a word that the rules do not know."""
    indicators = [one.indicator for one in features if one.indicator is not None]
    words = words_of(indicators)
    unknown = [code for code, word in enumerate(coded.words) if word not in words]
    rows = np.flatnonzero(np.isin(coded.codes, unknown))
    if len(rows):
        word = coded.words[int(coded.codes[rows[0]])]
        raise InputError(
            f"{called} holds the {indicators[0].column} {quoted(word)} in row {rows[0] + 1} "
            f"({len(rows):,} row{'s'[: len(rows) > 1]} in all), which the rules do not know: they "
            f"were mined from {shortened(words)}; leave those rows out, or mine from "
            "demonstrations with it"
        )
