"""A log brought into the order, and to the labels, of the rules that are held against it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import (
    ActionDimension,
    Demonstrations,
    Feature,
    observed_features,
)
from sarl_core.demonstrations.derived import extend
from sarl_core.demonstrations.recoding import recoded
from sarl_core.environments.feature_order import (
    NamedFeatures,
    compared_names,
    is_several,
    line_up,
    only_counts,
    plain_names,
    shortened,
)
from sarl_core.errors import InputError
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet

_CURE = "give a log of what the rules were mined for"


class MatchedLog(NamedTuple):
    """N steps as rules take them.

    Attributes:
        observations: In the rules' order, with what they derive, (N, d + k) float32.
        labels: Of what was done, (N, m).
        actions: What was done, as the rules' own actions, (N,) or (N, m).
        notes: What is to be said of how the two were matched, as clauses.
    """

    observations: NDArray[np.float32]
    labels: NDArray[np.int64]
    actions: NDArray[Any]
    notes: tuple[str, ...]


def matched_log(rule_set: RuleSet, log: Demonstrations, *, called: str = "the log") -> MatchedLog:
    """Bring a log into the order of rules, by the names of features, actions and labels.

    Args:
        rule_set: The rules, over d features and m action dimensions.
        log: N steps of somebody.
        called: What it is called in a message.

    Returns:
        The same steps.

    Raises:
        InputError: If the log lacks a feature or an action that the rules speak of, has it in
            another unit, or holds a label that the rules do not know.
    """
    observations, notes = matched_states(rule_set, log, called=called)
    order, more = _action_places(rule_set, log, called)
    notes += more
    labels = np.empty((len(log), len(rule_set.actions)), dtype=np.int64)
    actions: NDArray[Any] = np.empty(
        labels.shape, dtype=np.float32 if rule_set.actions[0].is_interval else np.int64
    )
    for column, (dimension, place) in enumerate(zip(rule_set.actions, order, strict=True)):
        values = log.action_columns[:, place]
        demonstrated = log.action_dimensions[place]
        if dimension.is_interval:
            actions[:, column] = _amounts(dimension, demonstrated, values, called)
            labels[:, column] = dimension.labels_of(actions[:, column])
        else:
            labels[:, column] = _labels(dimension, demonstrated, values, called)
            actions[:, column] = np.array(dimension.actions)[labels[:, column]]
    single = len(rule_set.actions) == 1 and not rule_set.actions[0].is_interval
    return MatchedLog(observations, labels, actions[:, 0] if single else actions, notes)


def matched_states(
    rule_set: RuleSet, log: Demonstrations, *, called: str = "the log"
) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """The states of a log alone; arguments and errors as of `matched_log`.

    Returns:
        Its `observations`, and notes.
    """
    log = recoded(log, rule_set.source.features, called=called)
    places, notes = _feature_places(rule_set, log, called)
    observations = log.raw_observations
    if places != list(range(observations.shape[1])):
        observations = np.ascontiguousarray(observations[:, places])
    observations = extend(observations, rule_set.source.features)
    _check_units(rule_set, log, places, called)
    return observations, notes


class UnmatchedNames(NamedTuple):
    """What a person has to say of the columns of a log before rules can be held against it.

    Attributes:
        features: Of the rules, that no column is named after; of a column of words its name.
        actions: Dimensions of the rules, likewise.
        matched: Features of the rules that a column is named after.
    """

    features: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    matched: tuple[str, ...] = ()


def unmatched_names(rule_set: RuleSet, log: Demonstrations) -> UnmatchedNames:
    """Say which names of rules a log lacks.

    Args:
        rule_set: The rules.
        log: As it was read.

    Returns:
        Nothing where the log can be brought into order, by its names or as it comes.
    """
    features: list[str] = []
    actions: list[str] = []
    wanted = _columns_of(rule_set.source.features)
    try:
        _feature_places(rule_set, recoded(log, rule_set.source.features, called="the log"))
    except InputError:
        features = _lacking(wanted, _columns_of(log.observed))
    try:
        _action_places(rule_set, log)
    except InputError:
        names = [dimension.name for dimension in log.action_dimensions]
        actions = _lacking([dimension.name for dimension in rule_set.actions], names)
    return UnmatchedNames(tuple(features), tuple(actions), tuple(_lacking(wanted, features)))


def _columns_of(features: Sequence[Feature]) -> list[str]:
    """The columns that features are read from; those of one column of words are one."""
    observed = observed_features(features)
    columns = [one.indicator.column if one.indicator else one.name for one in observed]
    return list(dict.fromkeys(columns))


def _lacking(wanted: Sequence[str], names: Sequence[str]) -> list[str]:
    """Names that are not among others."""
    looked_for, have = compared_names(wanted, names)
    return [name for name, one in zip(wanted, looked_for, strict=True) if one not in have]


def _action_places(
    rule_set: RuleSet, log: Demonstrations, called: str = "the log"
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """For each action dimension of the rules its place in the log; a single one has any name."""
    names = tuple(dimension.name for dimension in log.action_dimensions)
    theirs = tuple(dimension.name for dimension in rule_set.actions)
    if len(names) != len(theirs):
        joined = "or say which of its columns are one action together (--column left+right=action)"
        raise InputError(
            f"{_have(called)} {counted(len(names), 'action')} ({shortened(names)}) and the rules "
            f"have {len(theirs)} ({shortened(theirs)}); {_CURE}"
            + (f", {joined}" if len(names) > len(theirs) else "")
        )
    if len(names) == 1:
        return (0,), ()
    lacking = _lacking(theirs, names)
    try:
        lined = line_up(
            NamedFeatures(called, names, log.env_id),
            NamedFeatures("the rules", theirs, rule_set.source.env_id),
            what="action dimensions",
        )
    except InputError as error:
        if not lacking:
            raise
        raise InputError(
            f"the rules are for {len(theirs)} actions and {_have(called)} no {shortened(lacking)} "
            f"({called}: {shortened(names)}); {_naming('action', lacking)}{_CURE}"
        ) from error
    return lined.places, tuple(filter(None, [lined.note]))


def _feature_places(
    rule_set: RuleSet, log: Demonstrations, called: str = "the log"
) -> tuple[list[int], tuple[str, ...]]:
    """For each feature of the rules its place in the log."""
    theirs = tuple(feature.name for feature in observed_features(rule_set.source.features))
    ours = tuple(feature.name for feature in log.observed)
    missing, further = _lacking(theirs, ours), _lacking(ours, theirs)
    if len(ours) == len(theirs):
        try:
            lined = line_up(
                NamedFeatures(called, ours, log.env_id),
                NamedFeatures("the rules", theirs, rule_set.source.env_id),
            )
            return list(lined.places), tuple(filter(None, [lined.note]))
        except InputError:
            if not missing:
                raise
    have, wanted = compared_names(ours, theirs)
    if missing or only_counts(ours) or only_counts(theirs) or len(set(have)) < len(have):
        lacks = f"no {shortened(missing)}" if missing else str(len(ours))
        columns = _lacking(_columns_of(rule_set.source.features), _columns_of(log.observed))
        raise InputError(
            f"the rules ask about {len(theirs)} features and {_have(called)} {lacks} "
            f"({called}: {shortened(ours)}); {_naming('feature', columns)}{_CURE}"
        )
    note = f"{shortened(further)} of {called} is no feature of the rules and was left out"
    return [have.index(name) for name in wanted], (note,)


def _have(called: str) -> str:
    """What is called so, and the verb."""
    return f"{called} {'have' if is_several(called) else 'has'}"


def _naming(role: Literal["feature", "action"], lacking: Sequence[str]) -> str:
    """What to do where nothing is named after something of the rules, before another way."""
    if not lacking:
        return ""
    option = shlex.quote(f"COLUMN={role} as {lacking[0]}")
    return f"say which column is which with --column {option} (on the page Audit: in the form), or "


def _check_units(rule_set: RuleSet, log: Demonstrations, places: list[int], called: str) -> None:
    for feature, place in zip(observed_features(rule_set.source.features), places, strict=True):
        unit = log.features[place].unit.strip()
        if unit and feature.unit.strip() and unit != feature.unit.strip():
            raise InputError(
                f"{called} gives {feature.name!r} in {unit} and the rules ask about it in "
                f"{feature.unit}; convert it"
            )


def _amounts(
    dimension: LabelledDimension,
    demonstrated: ActionDimension,
    values: NDArray[Any],
    called: str,
) -> NDArray[np.float32]:
    """Amounts of a continuous dimension; whole numbers that were read as labels are some, too."""
    if demonstrated.kind != "interval" and not _is_number(demonstrated):
        raise InputError(
            f"the action {dimension.name!r} is an amount in the rules and a label in {called} "
            f"({shortened(demonstrated.labels)}); {_CURE}"
        )
    return values.astype(np.float32)


def _labels(
    dimension: LabelledDimension,
    demonstrated: ActionDimension,
    values: NDArray[Any],
    called: str,
) -> NDArray[np.int64]:
    """Labels of the rules, by their names; by their numbers where one side has no names."""
    if demonstrated.kind == "interval":
        raise InputError(
            f"the action {dimension.name!r} is a label in the rules "
            f"({shortened(dimension.label_names)}) and an amount in {called}; {_CURE}"
        )
    own = demonstrated.labels_of(values)
    places = _label_places(dimension.label_names, demonstrated.labels)
    numbers = {action: place for place, action in enumerate(dimension.actions)}
    if _is_number(demonstrated) and -1 in places:
        # Numbers without names: the action is the same number.
        translated = np.array([numbers.get(action, -1) for action in demonstrated.actions])
    elif {*places} == {-1} and len(places) == len(numbers) and _numbered(dimension):
        translated = np.arange(len(places))
    else:
        translated = np.array(places)
    labels = translated[own]
    unknown = labels < 0
    if unknown.any():
        row = int(np.argmax(unknown))
        raise InputError(
            f"{called} holds the {dimension.name!r} {demonstrated.labels[own[row]]!r} in row "
            f"{row + 1} ({counted(int(unknown.sum()), 'row')} in all), which the rules do not "
            f"know: they were mined from {shortened(dimension.label_names)}; leave those rows out, "
            "or mine from demonstrations with it"
        )
    return np.asarray(labels, dtype=np.int64)


def _label_places(wanted: Sequence[str], have: Sequence[str]) -> list[int]:
    """For each label of a log its place among those of the rules, or -1; several may have one."""
    plain = plain_names(wanted)
    alike = {name: place for place, name in enumerate(plain) if plain.count(name) == 1}
    exactly = {name: place for place, name in enumerate(wanted)}
    return [
        exactly.get(name, alike.get(plain_name, -1))
        for name, plain_name in zip(have, plain_names(have), strict=True)
    ]


def _is_number(demonstrated: ActionDimension) -> bool:
    """Whether its labels are called by their numbers."""
    return demonstrated.labels == tuple(map(str, demonstrated.actions))


def _numbered(dimension: LabelledDimension) -> bool:
    return dimension.label_names == tuple(map(str, dimension.actions))
