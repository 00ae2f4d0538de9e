"""The Demonstrations type: what an expert did, step by step, as immutable arrays."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations import checks
from sarl_core.demonstrations.derived import (
    Combination,
    Definition,
    DerivedFeature,
    combination_name,
    in_places,
)
from sarl_core.demonstrations.fields import (
    TRUTH,
    Actions,
    DemonstrationFields,
    Indicator,
    Whole,
    labels_of,
)
from sarl_core.demonstrations.splits import Splits
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError, quoted, require

_NAMED = re.compile(r"(?P<name>[^\[\]<>]+?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_LONGEST_NAME = 100


@dataclass(frozen=True)
class Feature:
    """One entry of the observation vector.

    Attributes:
        name: In words, as "pole angle".
        unit: As "rad", or "" where there is none.
        indicator: What it says of a column of words, where it is 1 or 0 for that; else None.
        derived: How it is worked out from the features that are observed; None for one of those.
        splits: The thresholds that trees or rules ask of it, with the demonstrated values around
            them, so that whoever writes one knows how many digits it takes; None where nothing is
            known of them. It is no part of what the feature is.
    """

    name: str
    unit: str = ""
    indicator: Indicator | None = None
    derived: Definition | None = None
    splits: Splits | None = field(default=None, compare=False, repr=False)

    def statement(self, holds: bool) -> str:
        """What an indicator says of the column of words.

        Args:
            holds: Whether it is 1.

        Returns:
            As "mode is heavy" or "mode is not heavy"; of two words as "mode is light"; of true and
            false as "brake is true" or "brake is false". A feature that was renamed says its name.
        """
        assert self.indicator is not None
        column, value, otherwise = astuple(self.indicator)
        if self.name == self.indicator.name:
            if holds:
                return f"{column} is {value}"
            return f"{column} is {otherwise or f'not {value}'}"
        before, is_, after = self.name.partition(" is ")
        if not is_:
            return f"{self.name} is {TRUTH[holds]}"
        return self.name if holds else f"{before} is not {after}"


def with_derived(
    features: tuple[Feature, ...], derived: Sequence[DerivedFeature]
) -> tuple[Feature, ...]:
    """Derived features behind those that are observed.

    Args:
        features: Observed, d of them.
        derived: Over these, k of them.

    Returns:
        Shape (d + k,).
    """
    return features + tuple(
        Feature(
            combination_name(one.definition, features),
            features[one.definition.features[0]].unit,
            derived=one.definition,
        )
        if isinstance(one.definition, Combination)
        else Feature(one.name, one.unit, derived=one.definition)
        for one in derived
    )


def observed_features(features: Sequence[Feature]) -> tuple[Feature, ...]:
    """Those that are no derived ones; they stand before all others."""
    return tuple(one for one in features if one.derived is None)


def derived_features(features: Sequence[Feature]) -> tuple[DerivedFeature, ...]:
    """The others, as they are derived."""
    return tuple(
        DerivedFeature(one.derived)
        if isinstance(one.derived, Combination)
        else DerivedFeature(one.derived, one.name, one.unit)
        for one in features
        if one.derived is not None
    )


def derived_over(
    derived: Sequence[DerivedFeature], places: Sequence[int], names: Sequence[str]
) -> tuple[DerivedFeature, ...]:
    """Derived features over others, in another order or under other names.

    Args:
        derived: Over d features.
        places: For each of the d its index among the others.
        names: Of the others.

    Returns:
        As many.
    """
    return tuple(
        replace(one, definition=in_places(one.definition, places, names)) for one in derived
    )


def formula_feature(text: str, features: Sequence[Feature]) -> DerivedFeature:
    """A derived feature that a person wrote.

    Args:
        text: As "time to collision [s] = gap / (own_speed - lead_speed)"; the unit may be left
            out.
        features: Observed, which it may name: as they are called, with spaces or underscores, in
            quotation marks where a name has other signs.

    Returns:
        The feature.

    Raises:
        InputError: If it has no name, or what stands behind the sign of equality is no formula.
    """
    require(text, str, "a feature must be text", "write one, as 'rate [1/s] = speed / gap'")
    name, equals, formula = text.partition("=")
    match = _NAMED.fullmatch(name.strip())
    if not equals or match is None:
        raise InputError(
            f"{quoted(text)} is no feature; write its name (without < and >), its unit in brackets "
            "and its formula, as 'time to collision [s] = gap / (own_speed - lead_speed)'"
        )
    if len(match["name"]) > _LONGEST_NAME:
        raise InputError(
            f"the name {quoted(match['name'])} has more than {_LONGEST_NAME} signs; shorten it"
        )
    parsed = Formula.parse(formula.strip(), [one.name for one in features])
    return DerivedFeature(parsed, " ".join(match["name"].split()), (match["unit"] or "").strip())


@dataclass(frozen=True)
class ActionDimension:
    """One component of the action.

    Attributes:
        name: In words, as "main engine".
        kind: Whether its values are labels or come from an interval.
        labels: Names of the labels of a discrete dimension, label 0 first.
        first: The action that label 0 stands for, where labels count from it.
        codes: The action of each label, ascending, where they do not count.
        low: Lower bound of an interval dimension.
        high: Upper bound of an interval dimension.
        bounds_from: Where the bounds come from.
    """

    name: str
    kind: Literal["discrete", "interval"]
    labels: tuple[str, ...] = ()
    first: int = 0
    codes: tuple[int, ...] = ()
    low: float = 0.0
    high: float = 0.0
    bounds_from: Literal["action space", "demonstrated values"] = "action space"

    def labels_of(self, actions: NDArray[Any]) -> NDArray[np.int64]:
        """The labels of discrete actions, as `fields.labels_of`."""
        return labels_of(actions, self.first, self.codes)

    @property
    def actions(self) -> tuple[int, ...]:
        """The action of each label."""
        return self.codes or tuple(range(self.first, self.first + len(self.labels)))


@dataclass(frozen=True)
class Summary:
    """What a set of demonstrations contains, in numbers.

    Attributes:
        steps: Number of state-action pairs.
        episodes: Number of episodes.
        features: Length of the observation vector.
        action_dimensions: Number of action dimensions.
        length_mean: Steps an episode, on average.
        return_mean: Mean return over the finished episodes (all, where none is marked as
            finished), None without rewards.
        return_std: Its standard deviation (n - 1), None with fewer than two such episodes.
        label_shares: For each discrete dimension the share of each label; empty for others.
    """

    steps: int
    episodes: int
    features: int
    action_dimensions: int
    length_mean: float
    return_mean: float | None
    return_std: float | None
    label_shares: tuple[tuple[float, ...], ...]


def derived_document(derived: DerivedFeature) -> dict[str, Any]:
    """A derived feature for JSON.

    Args:
        derived: Any.

    Returns:
        The `terms` of a combination; of a formula `name`, `unit` and `formula`.
    """
    definition = derived.definition
    if isinstance(definition, Combination):
        return {"terms": [list(term) for term in definition.terms]}
    return {"name": derived.name, "unit": derived.unit, "formula": definition.text}


@dataclass(frozen=True, eq=False, repr=False)
class Demonstrations(DemonstrationFields):
    """N state-action pairs of an expert, in episodes.

    Arrays are copied where needed, converted and made read-only; whatever is inconsistent is
    refused with one sentence that names the column and the first row (rows count from 1).

    Attributes:
        observations: Shape (N, d), float32; behind the d that were observed the k derived ones,
            which are always worked out here, whatever was given in their place: (N, d + k).
        actions: Discrete: (N,) or (N, m) int64. Continuous: (N, m) float32. Words, true and false,
            and categories are given as they are and become labels: in the order of an ordered
            category, else sorted.
        episodes: Index of the episode of each step, shape (N,) int64; equal ones stand together.
        rewards: Shape (N,) float64, or None.
        terminated: Whether the environment ended the episode at this step, (N,) bool, or None.
        truncated: Whether a limit ended it, (N,) bool, or None.
        steps: Index of each step within its episode, (N,) int64; counted where not given.
        times: When each step was, in seconds from any beginning, (N,) float64; NaN where that is
            not known. None where it is known of no step.
        feature_names: d names; "feature 0"... where not given.
        feature_units: d units, "" where there is none.
        indicators: For each feature what it says of a column of words, or None; None where none
            does.
        derived: What is worked out from the d features, k of them.
        action_names: m names, one an action dimension.
        label_names: For each action dimension the names of its labels, () if continuous.
        label_first: For each dimension the action that label 0 stands for (`Discrete.start`).
        label_codes: For each dimension the action of each label, ascending, where they do not
            count up from the first; else (). Where no labels are named, they are the whole numbers
            that were demonstrated.
        action_low: Lower bounds of continuous dimensions, m numbers; the least demonstrated
            value where not given.
        action_high: Upper bounds, likewise.
        bounds_from: Whether those come from the action space or from the demonstrated values.
        env_id: Environment, "" where unknown.
        agent: Who demonstrated, "" where unknown.
        seed: Seed it was recorded with, or None.
        notes: Sentences on how the data was read (as "one episode, for want of a column").
        columns: What each column of the file was taken for; () where there was no table. It is
            no part of the digest.
        sample_of: All steps, where these are some of them and the rest is elsewhere; else None.

    Raises:
        InputError: If anything above does not hold.
    """

    def __post_init__(self) -> None:
        """Convert, complete and check every field."""
        for name, value in checks.normalise(self).items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Number of steps N."""
        return len(self.observations)

    def __repr__(self) -> str:
        """Shapes and dtypes, as `Demonstrations(env_id='CartPole-v1', observations=...)`."""
        arrays = ("observations", "actions", "episodes", "rewards", "terminated", "truncated")
        fields = [
            f"{name}={value.dtype}{list(value.shape)}"
            for name in arrays
            if (value := getattr(self, name)) is not None
        ]
        return (
            f"Demonstrations(env_id={self.env_id!r}, {', '.join(fields)}, "
            f"n_episodes={self.n_episodes}, digest='{self.digest[:12]}')"
        )

    @property
    def is_discrete(self) -> bool:
        """Whether the actions are labels."""
        return bool(self.actions.dtype.kind == "i")

    @cached_property
    def action_columns(self) -> Actions:
        """The actions with one column a dimension, shape (N, m), whatever their own shape."""
        return cast(Actions, self.actions.reshape(len(self), -1))

    @property
    def n_episodes(self) -> int:
        """Number of episodes."""
        return len(self.episode_starts)

    @cached_property
    def episode_starts(self) -> NDArray[np.int64]:
        """Row at which each episode starts, shape (episodes,)."""
        changes = np.flatnonzero(np.diff(self.episodes)) + 1
        return np.concatenate([[0], changes]).astype(np.int64)

    @cached_property
    def episode_lengths(self) -> NDArray[np.int64]:
        """Steps of each episode, shape (episodes,)."""
        return np.diff(np.append(self.episode_starts, len(self)))

    @cached_property
    def episode_returns(self) -> NDArray[np.float64] | None:
        """Sum of rewards of each episode, shape (episodes,), or None without rewards."""
        if self.rewards is None:
            return None
        return np.add.reduceat(self.rewards, self.episode_starts)

    @cached_property
    def episode_finished(self) -> NDArray[np.bool_] | None:
        """Whether each episode ended by itself or by its limit; None where it is not recorded.

        A recording that stops after a number of steps leaves its last episode unfinished.
        """
        if self.terminated is None and self.truncated is None:
            return None
        last = self.episode_starts + self.episode_lengths - 1
        ended = np.zeros(len(last), dtype=np.bool_)
        for flags in (self.terminated, self.truncated):
            if flags is not None:
                ended |= flags[last]
        return ended

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """Names and units of the d features that were observed, and of the k derived ones."""
        return with_derived(self.observed, self.derived)

    @cached_property
    def observed(self) -> tuple[Feature, ...]:
        """Names and units of the d features that were observed."""
        assert self.feature_names is not None
        assert self.feature_units is not None
        indicators = self.indicators or (None,) * len(self.feature_names)
        return tuple(
            Feature(*known)
            for known in zip(self.feature_names, self.feature_units, indicators, strict=True)
        )

    @property
    def raw_observations(self) -> NDArray[np.float32]:
        """The features that were observed alone, (N, d)."""
        return self.observations[:, : len(self.observed)] if self.derived else self.observations

    @cached_property
    def action_dimensions(self) -> tuple[ActionDimension, ...]:
        """What each component of the action is."""
        assert self.action_names is not None
        if self.is_discrete:
            assert self.label_names is not None
            assert self.label_first is not None
            return tuple(
                ActionDimension(name, "discrete", labels=labels, first=first, codes=codes)
                for name, labels, first, codes in zip(
                    self.action_names,
                    self.label_names,
                    self.label_first,
                    self.label_codes or ((),) * len(self.action_names),
                    strict=True,
                )
            )
        assert self.action_low is not None
        assert self.action_high is not None
        return tuple(
            ActionDimension(
                name,
                "interval",
                low=low,
                high=high,
                bounds_from=self.bounds_from or "demonstrated values",
            )
            for name, low, high in zip(
                self.action_names, self.action_low, self.action_high, strict=True
            )
        )

    def metadata(self) -> dict[str, Any]:
        """Everything but the arrays, ready for JSON."""
        return {
            "env_id": self.env_id,
            "agent": self.agent,
            "seed": self.seed,
            "features": [
                {"name": one.name, "unit": one.unit}
                | ({} if one.indicator is None else {"indicator": asdict(one.indicator)})
                for one in self.observed
            ],
            **({"derived": list(map(derived_document, self.derived))} if self.derived else {}),
            "action_names": list(self.action_names or ()),
            "label_names": [list(names) for names in self.label_names or ()],
            "label_first": list(self.label_first or ()),
            **({"label_codes": self.label_codes} if any(self.label_codes or ()) else {}),
            "action_low": list(self.action_low or ()),
            "action_high": list(self.action_high or ()),
            "bounds_from": self.bounds_from,
            "notes": list(self.notes),
        }

    @cached_property
    def digest(self) -> str:
        """Fingerprint (blake2b, 32 hex digits) of the arrays and of what is known about them."""
        return self._fingerprint(self.metadata())

    @cached_property
    def pairs_digest(self) -> str:
        """The same whatever features, units, actions and labels are called."""
        nameless = {
            "features": len(self.features),
            "action_names": len(self.action_names or ()),
            "label_names": list(map(len, self.label_names or ())),
        }
        return self._fingerprint(self.metadata() | nameless)

    def _fingerprint(self, metadata: dict[str, Any]) -> str:
        digest = hashlib.blake2b(digest_size=16)
        for name in (
            "observations",
            "actions",
            "episodes",
            "steps",
            "rewards",
            "terminated",
            "truncated",
            "times",
        ):
            value = getattr(self, name)
            if value is not None:
                digest.update(f"{name}{value.dtype}{value.shape}".encode())
                digest.update(np.ascontiguousarray(value).data)
        if self.sample_of is not None:
            metadata = metadata | {"sample_of": asdict(self.sample_of)}
        digest.update(json.dumps(metadata, sort_keys=True).encode())
        return digest.hexdigest()

    @property
    def whole(self) -> Whole:
        """All steps: what these are a sample of, or these themselves."""
        return self.sample_of or Whole(self.digest, len(self), self.n_episodes)

    def select(self, episodes: Sequence[int] | NDArray[np.int64]) -> Demonstrations:
        """Keep whole episodes.

        Args:
            episodes: Indices as they stand in `episodes`.

        Returns:
            The steps of these episodes, in their present order.

        Raises:
            InputError: If an episode does not exist, or none is named.
        """
        wanted = np.asarray(episodes, dtype=np.int64).reshape(-1)
        missing = np.setdiff1d(wanted, self.episodes)
        if len(wanted) == 0 or len(missing):
            which = f"there is no episode {missing[0]}" if len(missing) else "no episode is named"
            raise InputError(f"{which}; choose from the {self.n_episodes} episodes there are")
        rows = np.isin(self.episodes, wanted)

        def chosen(value: ArrayLike | None) -> Any:
            return None if value is None else np.asarray(value)[rows]

        return replace(
            self,
            observations=chosen(self.observations),
            actions=chosen(self.actions),
            episodes=chosen(self.episodes),
            rewards=chosen(self.rewards),
            terminated=chosen(self.terminated),
            truncated=chosen(self.truncated),
            steps=chosen(self.steps),
            times=chosen(self.times),
        )

    def deriving(self, derived: Sequence[DerivedFeature]) -> Demonstrations:
        """The same steps with other derived features.

        Args:
            derived: Over the features that were observed, in place of those that there are.

        Returns:
            With the values of these.

        Raises:
            InputError: If one has no value in a step, or two share a name.
        """
        return replace(self, observations=self.raw_observations, derived=tuple(derived))

    def summary(self) -> Summary:
        """What these demonstrations contain, in numbers."""
        returns, finished = self.episode_returns, self.episode_finished
        if returns is not None and finished is not None and finished.any():
            returns = returns[finished]
        shares: list[tuple[float, ...]] = []
        for column, dimension in enumerate(self.action_dimensions):
            if dimension.kind == "discrete":
                labels = dimension.labels_of(self.action_columns[:, column])
                counts = np.bincount(labels, minlength=len(dimension.labels))
                shares.append(tuple(float(count) / len(self) for count in counts))
            else:
                shares.append(())
        several = returns is not None and len(returns) > 1
        return Summary(
            steps=len(self),
            episodes=self.n_episodes,
            features=self.observations.shape[1],
            action_dimensions=len(self.action_dimensions),
            length_mean=float(self.episode_lengths.mean()),
            return_mean=None if returns is None else float(returns.mean()),
            return_std=float(returns.std(ddof=1)) if several and returns is not None else None,
            label_shares=tuple(shares),
        )


def with_formulas(demonstrations: Demonstrations, formulas: Sequence[str]) -> Demonstrations:
    """Demonstrations with formulas that a person wrote as further features.

    Args:
        demonstrations: N steps; what they derive already stays, but for a formula of the same
            name, of which the new one takes the place.
        formulas: Each as "time to collision [s] = gap / (own_speed - lead_speed)": a name, a unit
            in brackets or none, and numbers, names of features, ``+ - * /``, ``min``, ``max``,
            ``abs`` and parentheses.

    Returns:
        The same steps, with the formulas behind their features.

    Raises:
        InputError: If one is no formula, names an unknown feature, has the name of another
            feature, or no value in some step (0/0).
    """
    must = "what formulas are about must be Demonstrations"
    require(demonstrations, Demonstrations, must, "load them: load_demonstrations(path)")
    if isinstance(formulas, str):
        raise InputError("the formulas must be a list of texts; put one into a list: [text]")
    added = [formula_feature(text, demonstrations.observed) for text in formulas]
    known = {one.name for one in demonstrations.derived if isinstance(one.definition, Formula)}
    changed = {one.name: one for one in added if one.name in known}
    # Of two new ones with one name the first is here, too, and refused.
    further = [one for one in added if one is not changed.get(one.name)]
    stayed = [changed.get(one.name, one) for one in demonstrations.derived]
    return demonstrations.deriving([*stayed, *further])
