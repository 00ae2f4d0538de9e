"""What a file knows beside its arrays, as JSON under the key `sarl`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from msgspec import Struct
from msgspec.structs import asdict

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.documents import MisfitError, Number, conformed, parse_json
from sarl_core.environments.feature_order import FeatureOrder
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError, quoted

KEY = "sarl"
VERSION = 1


@dataclass(frozen=True)
class Metadata:
    """What a file says about its demonstrations; None, () or "" where it says nothing.

    Attributes:
        env_id: Environment.
        agent: Who demonstrated.
        seed: Seed it was recorded with.
        features: Names and units, d of them.
        derived: What is worked out from them.
        action_names: m names.
        label_names: For each action dimension the names of its labels, () if continuous.
        label_first: The action that label 0 stands for.
        label_codes: The action of each label, () where they count from the first.
        action_low: Lower bounds of continuous actions, m numbers.
        action_high: Upper bounds.
        bounds_from: Where those come from.
        notes: Sentences on how the data was read.
        column_units: Units of a table's columns, as far as they are known.
    """

    env_id: str = ""
    agent: str = ""
    seed: int | None = None
    features: tuple[Feature, ...] = ()
    derived: tuple[DerivedFeature, ...] = ()
    action_names: tuple[str, ...] = ()
    label_names: tuple[tuple[str, ...], ...] = ()
    label_first: tuple[int, ...] = ()
    label_codes: tuple[tuple[int, ...], ...] = ()
    action_low: tuple[float, ...] = ()
    action_high: tuple[float, ...] = ()
    bounds_from: Literal["action space", "demonstrated values"] | None = None
    notes: tuple[str, ...] = ()
    column_units: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_discrete(self) -> bool | None:
        """Whether the actions are labels, None if the file does not say."""
        if any(self.label_names):
            return True
        return False if self.action_low else None

    def with_actions_in(self, order: FeatureOrder) -> Metadata:
        """The same with its action dimensions in another order.

        Args:
            order: Of its action dimensions.

        Returns:
            What was not said stays so.
        """
        return replace(
            self,
            action_names=order.put(self.action_names),
            label_names=order.put(self.label_names),
            label_first=order.put(self.label_first),
            label_codes=order.put(self.label_codes),
            action_low=order.put(self.action_low),
            action_high=order.put(self.action_high),
        )


class _Named(Struct):
    name: str
    unit: str | None = None
    indicator: Indicator | None = None


class _Derived(Struct):
    terms: tuple[tuple[int, Number], tuple[int, Number]] | None = None
    name: str = ""
    unit: str = ""
    formula: str | None = None

    def read(self, features: tuple[Feature, ...]) -> DerivedFeature:
        if (self.terms is None) == (self.formula is None):
            raise MisfitError("has neither terms nor a formula, or both", "derived")
        if self.terms is not None:
            return DerivedFeature(Combination(self.terms))
        names = [feature.name for feature in features]
        formula = Formula.parse(self.formula or "", names)
        return DerivedFeature(formula, self.name or formula.text, self.unit)


class _Said(Struct):
    """The form of `Metadata` in a file, which may say more."""

    env_id: str = ""
    agent: str = ""
    seed: int | None = None
    features: tuple[_Named, ...] = ()
    derived: tuple[_Derived, ...] = ()
    action_names: tuple[str, ...] = ()
    label_names: tuple[tuple[str, ...], ...] = ()
    label_first: tuple[int, ...] = ()
    label_codes: tuple[tuple[int, ...], ...] = ()
    action_low: tuple[Number, ...] = ()
    action_high: tuple[Number, ...] = ()
    bounds_from: Literal["action space", "demonstrated values"] | None = None
    notes: tuple[str, ...] = ()


def encode_metadata(demonstrations: Demonstrations) -> str:
    """The JSON that `decode_metadata` reads."""
    return json.dumps({"version": VERSION} | demonstrations.metadata(), ensure_ascii=False)


def decode_metadata(text: str | bytes) -> Metadata:
    """Read and check metadata.

    Args:
        text: JSON, in UTF-8 if bytes.

    Returns:
        What it says.

    Raises:
        InputError: If it is not JSON, says a thing twice, or says it in another form.
    """
    try:
        raw = parse_json(text, object_pairs_hook=_unique)
    except InputError as error:
        raise InputError(f"its metadata {KEY!r} is too large: {error}") from error
    except ValueError as error:
        raise InputError(
            f"its metadata {KEY!r} is not JSON ({error}); save the file again, or without metadata"
        ) from error
    if not isinstance(raw, dict):
        raise _malformed("is no JSON object")
    version = raw.get("version", VERSION)
    if version != VERSION:
        raise _malformed(f"has version {quoted(version)}, and this program reads version {VERSION}")
    try:
        said = conformed({key: one for key, one in raw.items() if one is not None}, _Said)
    except MisfitError as error:
        raise _malformed(f"is not as it should be: {error}") from error
    if any(abs(first) > 2**31 for first in said.label_first):
        raise _malformed("has a number too large for a label under 'label_first'")
    if len(said.action_low) != len(said.action_high):
        raise _malformed("has more bounds 'action_low' than 'action_high', or fewer")
    if any(abs(code) > 2**31 for codes in said.label_codes for code in codes):
        raise _malformed("has a number too large for a label under 'label_codes'")
    features = tuple(Feature(one.name, one.unit or "", one.indicator) for one in said.features)
    try:
        derived = tuple(one.read(features) for one in said.derived)
    except (MisfitError, InputError) as error:
        raise _malformed(f"derives what cannot be: {error}") from error
    return Metadata(**{**asdict(said), "features": features, "derived": derived})


def _malformed(what: str) -> InputError:
    return InputError(f"its metadata {KEY!r} {what}; save the file again, or without metadata")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        doubled = next(key for key, count in Counter(keys).items() if count > 1)
        raise _malformed(f"gives {quoted(doubled)} twice")
    return dict(pairs)
