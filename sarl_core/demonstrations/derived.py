"""Derived features: combinations of two features, and formulas that a person wrote.

Their values are worked out in float64 from float32 observations, left to right and without fused
multiply-add, and rounded to float32: here, in the shield and in everything that is exported.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.unit_algebra import quotient
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError, quoted

_FEW = 4_096  # states whose combinations are worked out all at once: a call costs more than they do

LARGEST_RATIO = 1e30  # times a float32 number it is still a float64 one


@dataclass(frozen=True)
class Combination:
    """One feature plus another one a number of times: ``x_i + r * x_j``.

    Attributes:
        terms: Index and coefficient of each; the first coefficient is 1.
    """

    terms: tuple[tuple[int, float], tuple[int, float]]

    def __post_init__(self) -> None:
        """Refuse what is no combination.

        Raises:
            InputError: If it is of a feature with itself, or a coefficient is none.
        """
        (first, one), (second, ratio) = self.terms
        if first == second:
            raise InputError(
                f"feature {first} is combined with itself; combine two different features"
            )
        if one != 1.0:
            raise InputError(
                f"the first coefficient of a combination is {decimal_text(one)}; it must be 1, "
                "divide both by it"
            )
        if not (isfinite(ratio) and 0.0 < abs(ratio) <= LARGEST_RATIO):
            raise InputError(
                f"the ratio of a combination is {quoted(ratio)}, and not a number other than 0 "
                f"from -{LARGEST_RATIO:.0e} to {LARGEST_RATIO:.0e}; give one"
            )

    @property
    def features(self) -> tuple[int, int]:
        """Indices of the two features."""
        return self.terms[0][0], self.terms[1][0]

    @property
    def ratio(self) -> float:
        """How many times the second feature counts."""
        return self.terms[1][1]

    def values(self, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """Work it out.

        Args:
            observations: N states of d or more features, (N, d).

        Returns:
            Shape (N,), finite if the states are.
        """
        first, second = self.features
        # Two operations of NumPy, which are never fused into one.
        product = np.float64(self.ratio) * observations[:, second].astype(np.float64)
        return np.asarray(observations[:, first].astype(np.float64) + product)

    def value(self, state: Sequence[float]) -> float:
        """The same of one state, d or more numbers."""
        first, second = self.features
        return state[first] + self.ratio * state[second]


Definition = Combination | Formula
"""What a derived feature is over the features that are observed."""


@dataclass(frozen=True)
class DerivedFeature:
    """A derived feature of demonstrations.

    Attributes:
        definition: What it is over their d observed features.
        name: Of a formula, as a person gave it; a combination is called by what it is.
        unit: Of a formula, likewise.
    """

    definition: Definition
    name: str = ""
    unit: str = ""


def formula_text(derived: DerivedFeature) -> str:
    """A formula as a person writes it, with its name and unit.

    Args:
        derived: A formula, no combination.

    Returns:
        As "time to collision [s] = gap / (own_speed - lead_speed)".
    """
    unit = f" [{derived.unit}]" if derived.unit else ""
    return f"{derived.name}{unit} = {derived.definition}"


def formula_texts(derived: Sequence[DerivedFeature]) -> tuple[str, ...]:
    """The formulas among derived features, as `formula_text`."""
    return tuple(formula_text(one) for one in derived if isinstance(one.definition, Formula))


class _Called(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...


class _Defined(Protocol):
    @property
    def derived(self) -> Definition | None: ...


def combination_name(combination: Combination, features: Sequence[_Called]) -> str:
    """What a combination is called.

    Args:
        combination: Of two of the features.
        features: Observed, d of them.

    Returns:
        As "horizontal position plus 0.52 s of horizontal velocity", or "speed minus 2 times the
        lead speed" where the two have one unit or none.
    """
    one, other = (features[index] for index in combination.features)
    ratio = combination.ratio
    sign, amount = ("plus", ratio) if ratio > 0 else ("minus", -ratio)
    unit = quotient(one.unit, other.unit) if one.unit and other.unit else ""
    if one.unit and other.unit and unit is None and one.unit != other.unit:
        unit = f"{one.unit}/({other.unit})"
    if unit:
        return f"{one.name} {sign} {decimal_text(amount)} {unit} of {other.name}"
    if amount == 1.0:
        return f"{one.name} {sign} the {other.name}"
    return f"{one.name} {sign} {decimal_text(amount)} times the {other.name}"


def definitions_of(features: Sequence[_Defined]) -> tuple[Definition, ...]:
    """What the derived ones among features are, in their order."""
    return tuple(one.derived for one in features if one.derived is not None)


def in_places(definition: Definition, places: Sequence[int], names: Sequence[str]) -> Definition:
    """The same of features in another order, or under other names.

    Args:
        definition: Over some features.
        places: For each of those its index among the others.
        names: Of the others.

    Returns:
        Over the others.

    Raises:
        InputError: If a formula would be too long.
    """
    if isinstance(definition, Combination):
        (first, one), (second, ratio) = definition.terms
        return Combination(((places[first], one), (places[second], ratio)))
    if definition.feature_names == tuple(names):
        return definition
    return definition.over(places, names)


class Extension:
    """Derived features, ready to be put behind those that are observed.

    Attributes:
        width: Number d of observed features.
        definitions: Of the k derived ones.
    """

    def __init__(self, width: int, definitions: Sequence[Definition]) -> None:
        """Take in what is to be worked out.

        Args:
            width: Number of observed features.
            definitions: Over them.
        """
        self.width, self.definitions = width, tuple(definitions)
        pairs = [one for one in self.definitions if isinstance(one, Combination)]
        # For single states bare numbers where there is nothing else, as there mostly is not.
        self._pairs = [(one.terms[0][0], one.terms[1][0], one.ratio) for one in pairs]
        self._pairs_alone = len(pairs) == len(self.definitions)
        # For a few states together arrays of the same.
        self._firsts = np.array([first for first, _, _ in self._pairs], dtype=np.int64)
        self._seconds = np.array([second for _, second, _ in self._pairs], dtype=np.int64)
        self._ratios = np.array([ratio for _, _, ratio in self._pairs])

    @classmethod
    def of(cls, features: Sequence[_Defined]) -> Extension:
        """What features, the derived ones behind the others, ask to be worked out."""
        definitions = definitions_of(features)
        return cls(len(features) - len(definitions), definitions)

    def many(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """States with the values of the derived features.

        Args:
            observations: Shape (B, d); what stands behind the d is worked out again.

        Returns:
            Shape (B, d + k), contiguous; the same object where nothing is derived.
        """
        if not self.definitions:
            return observations
        raw = observations[:, : self.width]
        states = np.empty((len(raw), self.width + len(self.definitions)), dtype=np.float32)
        states[:, : self.width] = raw
        with np.errstate(all="ignore"):
            if self._pairs_alone and len(raw) <= _FEW:
                exact = raw.astype(np.float64)
                states[:, self.width :] = (
                    exact[:, self._firsts] + self._ratios * exact[:, self._seconds]
                )
                return states
            for place, definition in enumerate(self.definitions, start=self.width):
                states[:, place] = definition.values(raw)
        return states

    def one(self, state: list[float]) -> list[float]:
        """The same of one state.

        Args:
            state: d float32 numbers, finite.

        Returns:
            d + k of them.
        """
        if self._pairs_alone:
            values = [state[first] + ratio * state[second] for first, second, ratio in self._pairs]
        else:
            values = [definition.value(state) for definition in self.definitions]
        # An array of floats rounds as a cast does, to infinity too.
        return state + array("f", values).tolist()


def extended_state(state: Sequence[float], features: Sequence[_Defined]) -> Sequence[float]:
    """One state with the values of derived features.

    Args:
        state: d numbers; or d + k, which stays as it is.
        features: d observed and k derived ones.

    Returns:
        d + k numbers; the same object where nothing is to be done.
    """
    extension = Extension.of(features)
    if len(state) != extension.width or not extension.definitions:
        return state
    return extension.one([float(value) for value in state])


def extend(observations: NDArray[np.float32], features: Sequence[_Defined]) -> NDArray[np.float32]:
    """Put the values of derived features behind those that are observed.

    Args:
        observations: Shape (B, d), or (B, d + k), of which the last k are worked out again.
        features: d observed and k derived ones.

    Returns:
        Shape (B, d + k); the same object where nothing is derived.

    Raises:
        InputError: If the observations have another number of features.
    """
    extension = Extension.of(features)
    if observations.ndim != 2 or observations.shape[1] not in (extension.width, len(features)):
        raise InputError(
            f"there are {extension.width} features and the states have the shape "
            f"{observations.shape}; give (B, {extension.width})"
        )
    return extension.many(observations)
