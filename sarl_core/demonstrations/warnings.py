"""What is merely odd about demonstrations."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formula_units import unit_warnings
from sarl_core.demonstrations.giveaways import find_giveaways
from sarl_core.demonstrations.requirements import FEW_VALUES
from sarl_core.demonstrations.words import begin_as_numbers, columns_of_words, words_of

_MOST_WARNINGS = 5  # of one kind; the rest is counted
_OF_IDS = 0.5  # of the steps; actions are done again and again


def find_warnings(demonstrations: Demonstrations) -> tuple[str, ...]:
    """What is odd about demonstrations and yet no error.

    Args:
        demonstrations: To look at.

    Returns:
        One sentence each: notes from reading, constant or doubled features, formulas that mix
        units, features that give the action or the time, labels that never occur, are written in
        two ways or are nearly as many as the steps, a single action.
    """
    return (
        *demonstrations.notes,
        *_feature_warnings(demonstrations),
        *_shortened(unit_warnings(demonstrations.features), "formulas mix units"),
        *_shortened(_amounts(demonstrations), "columns of words may hold amounts"),
        *_shortened(find_giveaways(demonstrations), "features tell what they should not"),
        *_action_warnings(demonstrations),
    )


def constant_warnings(name: str, values: NDArray[np.float32]) -> tuple[str, ...]:
    """What is to be said of a feature that never changes.

    Args:
        name: Of the feature.
        values: In every step, (N,).

    Returns:
        One sentence; none where it changes.
    """
    if not np.all(values == values[0]):
        return ()
    return (f"feature {name!r} has the same value in every step, so no rule can use it",)


def _feature_warnings(demonstrations: Demonstrations) -> list[str]:
    constant: list[str] = []
    doubled: list[str] = []
    seen: dict[bytes, str] = {}
    for name, column in zip(
        (feature.name for feature in demonstrations.features),
        demonstrations.observations.T,
        strict=True,
    ):
        if never := constant_warnings(name, column):
            constant += never
            continue
        key = hashlib.blake2b(np.ascontiguousarray(column).data, digest_size=16).digest()
        if key in seen:
            doubled.append(f"feature {name!r} repeats feature {seen[key]!r} in every step")
        seen.setdefault(key, name)
    return [
        *_shortened(constant, "features never change"),
        *_shortened(doubled, "features repeat another one"),
    ]


def _amounts(demonstrations: Demonstrations) -> list[str]:
    """Columns of words that a person may have meant as numbers."""
    indicators = demonstrations.indicators or ()
    columns = {
        column: words_of([one for place in places if (one := indicators[place]) is not None])
        for column, places in columns_of_words(indicators).items()
    }
    return [
        f"the words of {column!r} begin as numbers do, as {words[0]!r}; if they are amounts, write "
        "plain numbers, without units and signs"
        for column, words in columns.items()
        if begin_as_numbers(words)
    ]


def _action_warnings(demonstrations: Demonstrations) -> list[str]:
    warnings: list[str] = []
    columns = demonstrations.action_columns.T
    for dimension, column in zip(demonstrations.action_dimensions, columns, strict=True):
        if np.all(column == column[0]):
            warnings.append(
                f"action {dimension.name!r} is {decimal_text(column[0])} in every step, so the "
                "only rule is to do that always"
            )
        elif dimension.kind == "discrete":
            warnings += _shortened(
                _alike(dimension.name, dimension.labels),
                f"labels of action {dimension.name!r} differ from another one only in capitals",
            )
            counts = np.bincount(dimension.labels_of(column), minlength=len(dimension.labels))
            different = int(np.count_nonzero(counts))
            if different > FEW_VALUES and different >= _OF_IDS * len(column):
                warnings.append(
                    f"action {dimension.name!r} has {different:,} different labels in "
                    f"{len(column):,} steps, as an identifier or a free text has, from which "
                    "hardly any rule can be learned; take another column as the action, or write "
                    "few labels"
                )
            warnings += _shortened(
                [
                    f"label {label!r} of action {dimension.name!r} never occurs"
                    for label, count in zip(dimension.labels, counts, strict=True)
                    if count == 0
                ],
                f"labels of action {dimension.name!r} never occur",
            )
    return warnings


def _alike(action: str, labels: Sequence[str]) -> list[str]:
    """Labels that a person would take for one another: rules tell them apart."""
    first: dict[str, str] = {}
    alike: list[str] = []
    for label in labels:
        known = first.setdefault(label.casefold(), label)
        if known != label:
            alike.append(
                f"labels {known!r} and {label!r} of action {action!r} differ only in capitals; if "
                "they are one action, write them alike"
            )
    return alike


def _shortened(sentences: list[str], rest: str) -> list[str]:
    """The first few sentences, and the number of the others."""
    more = len(sentences) - _MOST_WARNINGS
    if more <= 1:
        return sentences
    return [*sentences[:_MOST_WARNINGS], f"{more:,} more {rest}"]
