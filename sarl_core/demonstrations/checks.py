"""What must hold for demonstrations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.derived import DerivedFeature, Extension
from sarl_core.demonstrations.fields import DemonstrationFields, Indicator, labels_of
from sarl_core.demonstrations.requirements import (
    LARGEST,
    as_numbers,
    coarse_columns,
    column_of_numbers,
    flags,
    frozen,
    require_codes,
    require_finite,
    require_labels,
    require_length,
    require_order,
    require_within,
    whole_numbers,
)
from sarl_core.demonstrations.words import by_name, coded
from sarl_core.errors import InputError, quoted
from sarl_core.limits import MAX_FEATURES

MAX_LABELS = 10_000  # of one action dimension whose space is not known
MAX_ALL_LABELS = 100_000  # of all action dimensions together


def normalise(raw: DemonstrationFields) -> dict[str, Any]:
    """Convert and check the fields of a `Demonstrations`, and fill in what was not given.

    Args:
        raw: The object under construction; its fields hold whatever was passed.

    Returns:
        The final value of every field that is converted or completed.

    Raises:
        InputError: In one sentence, with the column and the first row (from 1).
    """
    observations = _observations(_observed(raw))
    n, d = observations.shape
    feature_names = _names(raw.feature_names, d, "feature")
    units = ("",) * d if raw.feature_units is None else tuple(map(str, raw.feature_units))
    require_length(len(units), d, "feature units", "features")
    require_finite(observations, [f"observation {name!r}" for name in feature_names])
    columns = [f"feature {name!r}" for name in feature_names]
    notes = (*raw.notes, *coarse_columns(_observed(raw), observations, columns))
    given, named = _words_as_labels(raw)
    actions = _actions(raw, given, named, n)
    m = 1 if actions.ndim == 1 else actions.shape[1]
    action_names = _names(raw.action_names, m, "action")
    episodes = whole_numbers(raw.episodes, n, "column 'episode'")
    steps = None if raw.steps is None else whole_numbers(raw.steps, n, "column 'step'")
    require_order(episodes, steps)
    derived = tuple(raw.derived)
    fields: dict[str, Any] = {
        "observations": _extended(observations, derived, feature_names),
        "derived": derived,
        "actions": actions,
        "episodes": episodes,
        "steps": counted_steps(episodes) if steps is None else steps,
        "rewards": None
        if raw.rewards is None
        else frozen(column_of_numbers(raw.rewards, n, "column 'reward'"), np.float64),
        "terminated": None
        if raw.terminated is None
        else flags(raw.terminated, n, "column 'terminated'"),
        "truncated": None
        if raw.truncated is None
        else flags(raw.truncated, n, "column 'truncated'"),
        "times": None if raw.times is None else _times(raw.times, n),
        "feature_names": feature_names,
        "feature_units": units,
        "indicators": _indicators(raw.indicators, observations, feature_names),
        "action_names": action_names,
        "notes": notes,
    }
    if actions.dtype.kind == "i":
        return fields | _labels(raw, named, actions.reshape(n, m), action_names)
    return fields | _bounds(raw, actions, action_names)


def _observed(raw: DemonstrationFields) -> Any:
    """The observations without derived features, which are worked out again."""
    given = raw.observations
    if not raw.derived or raw.feature_names is None:
        return given
    d = len(tuple(raw.feature_names))
    if getattr(given, "ndim", 0) == 2 and given.shape[1] == d + len(raw.derived):
        return given[:, :d]
    return given


def _extended(
    observations: NDArray[np.float32],
    derived: tuple[DerivedFeature, ...],
    feature_names: tuple[str, ...],
) -> NDArray[np.float32]:
    """Observations with the values of derived features, of which each has one."""
    if not derived:
        return observations
    d = len(feature_names)
    if d + len(derived) > MAX_FEATURES:
        raise InputError(
            f"there are {d + len(derived):,} features with those that are derived, more than the "
            f"{MAX_FEATURES:,} that rules a person reads could use; derive fewer"
        )
    for one in derived:
        if any(not 0 <= place < d for place in one.definition.features):
            raise InputError(
                f"a derived feature is of feature {max(one.definition.features)}, and there are "
                f"{d}, counted from 0; derive it from those"
            )
    named = [one.name for one in derived if one.name]
    doubled = next((name for name in named if [*feature_names, *named].count(name) > 1), None)
    if doubled is not None:
        raise InputError(f"the feature name {quoted(doubled)} stands twice; give each its own name")
    extended = Extension(d, [one.definition for one in derived]).many(observations)
    for one, values in zip(derived, extended[:, d:].T, strict=True):
        none = np.isnan(values)
        count = int(none.sum())
        if count:
            raise InputError(
                f"the formula of {quoted(one.name)} has no value in {count:,} "
                f"step{'s'[: count > 1]}, first in row {int(np.argmax(none)) + 1} (0/0 is none); "
                "write it so that it has one in every demonstrated state, as with max(speed, 0.1) "
                "for speed"
            )
    return extended


def _observations(given: Any) -> NDArray[np.float32]:
    observations = as_numbers(given, "observations")
    if observations.ndim > 2:
        shape = "x".join(str(size) for size in observations.shape[1:])
        raise InputError(
            f"observations of shape {shape} look like images, which rules cannot read; "
            "give one vector of features a step"
        )
    if observations.ndim != 2:
        raise InputError(
            "observations must be a table with one row a step and one column a feature, not of "
            f"shape {observations.shape}"
        )
    n, d = observations.shape
    if n == 0:
        raise InputError("there are no steps; give at least two observations with their actions")
    if d == 0:
        raise InputError("there are no features; give at least one observation column")
    if n == 1:
        raise InputError(
            "there is one observation only, from which no rule can be learned; give more steps"
        )
    if d > MAX_FEATURES:
        raise InputError(
            f"there are {d:,} features, more than the {MAX_FEATURES:,} that rules a person "
            "reads could use; choose fewer columns"
        )
    return frozen(observations, np.float32)


def _times(given: Any, n: int) -> NDArray[np.float64] | None:
    """Seconds, NaN where not known; None where that is so everywhere."""
    times = as_numbers(given, "times").astype(np.float64)
    if times.shape != (n,):
        raise InputError(f"times must be one number a step, not of shape {times.shape}")
    times[~np.isfinite(times)] = np.nan
    return None if np.isnan(times).all() else times


def _indicators(
    given: Iterable[Indicator | None] | None,
    observations: NDArray[np.float32],
    feature_names: tuple[str, ...],
) -> tuple[Indicator | None, ...] | None:
    """What features say of words; each such feature is 1 or 0."""
    indicators = () if given is None else tuple(given)
    if not any(indicators):
        return None
    require_length(len(indicators), len(feature_names), "indicators", "features")
    for index, indicator in enumerate(indicators):
        if indicator is None:
            continue
        other = ~np.isin(observations[:, index], (0, 1))
        if other.any():
            row = int(np.argmax(other))
            raise InputError(
                f"feature {feature_names[index]!r} is {observations[row, index]} in row {row + 1}; "
                "a feature that says which word a column holds is 1 or 0"
            )
    return indicators


def _words_as_labels(raw: DemonstrationFields) -> tuple[Any, tuple[tuple[str, ...], ...] | None]:
    """Actions as numbers, and the names of their labels as far as they are known."""
    named = (
        None
        if raw.label_names is None
        else tuple(tuple(map(str, labels)) for labels in raw.label_names)
    )
    single = coded(raw.actions)
    columns: list[Any]
    if single is not None:
        columns = [single]
    else:
        try:
            array = np.asarray(raw.actions)
        except ValueError:
            return raw.actions, named  # refused as what has no one length
        if array.ndim != 2 or array.dtype.kind not in "bUO":
            return raw.actions, named
        columns = [coded(column) or np.array(column.tolist()) for column in array.T]
    known = named or ((),) * len(columns)
    require_length(len(known), len(columns), "lists of label names", "action dimensions")
    names: list[tuple[str, ...]] = []
    for index, (column, labels) in enumerate(zip(columns, known, strict=True)):
        if isinstance(column, np.ndarray):
            names.append(labels)
            continue
        codes, words = column
        if (codes < 0).any():
            raise InputError(
                f"{np.count_nonzero(codes < 0):,} of {len(codes):,} actions have no value, the "
                f"first in row {int(np.argmax(codes < 0)) + 1}; leave those steps out"
            )
        first = 0 if raw.label_first is None else raw.label_first[index]
        columns[index] = by_name(words, labels, "actions")[codes] + first if labels else codes
        names.append(labels or words)
    return (columns[0] if single is not None else np.stack(columns, axis=1)), tuple(names)


def _actions(
    raw: DemonstrationFields, given: Any, named: tuple[tuple[str, ...], ...] | None, n: int
) -> NDArray[Any]:
    """Discrete: (n,) or (n, m) int64. Continuous: (n, m) float32."""
    actions = as_numbers(given, "actions")
    if actions.ndim not in (1, 2):
        raise InputError(
            f"actions must be one number or one vector a step, not of shape {actions.shape[1:]}"
        )
    require_length(len(actions), n, "actions", "observations")
    if actions.size == 0:
        raise InputError("there are no action columns; give at least one")
    labelled = any(named or ())
    if actions.dtype.kind in "iu" and (labelled or raw.action_low is None):
        if actions.dtype.kind == "u" and int(actions.max()) > np.iinfo(np.int64).max:
            raise InputError(f"an action is {int(actions.max())}, too large for a label")
        return frozen(actions, np.int64)
    if labelled:
        raise InputError(
            f"actions with labels must be whole numbers of an integer type, not {actions.dtype}"
        )
    continuous = frozen(actions.reshape(n, -1), np.float32)
    names = _names(raw.action_names, continuous.shape[1], "action")
    require_finite(continuous, [f"action {name!r}" for name in names])
    return continuous


def _names(given: Iterable[Any] | None, count: int, what: str) -> tuple[str, ...]:
    if given is None:
        if what == "action" and count == 1:
            return ("action",)
        return tuple(f"{what} {index}" for index in range(count))
    names = tuple(map(str, given))
    require_length(len(names), count, f"{what} names", f"{what}s")
    if "" in names:
        raise InputError(f"{what} {names.index('')} has an empty name; give it one")
    if len(set(names)) < len(names):
        doubled = next(name for name, times in Counter(names).items() if times > 1)
        raise InputError(f"the {what} name {quoted(doubled)} stands twice; give each its own name")
    return names


def counted_steps(episodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Steps from 0 within each episode."""
    n = len(episodes)
    starts = np.concatenate([[0], np.flatnonzero(episodes[1:] != episodes[:-1]) + 1])
    first: NDArray[np.int64] = np.repeat(starts, np.diff(np.append(starts, n)))
    return np.arange(n, dtype=np.int64) - first


def _labels(
    raw: DemonstrationFields,
    named: tuple[tuple[str, ...], ...] | None,
    columns: NDArray[np.int64],
    action_names: tuple[str, ...],
) -> dict[str, Any]:
    m = columns.shape[1]
    names = named or ((),) * m
    first = (0,) * m if raw.label_first is None else tuple(map(int, raw.label_first))
    codes = (
        ((),) * m
        if raw.label_codes is None
        else tuple(tuple(map(int, one)) for one in raw.label_codes)
    )
    require_length(len(names), m, "lists of label names", "action dimensions")
    require_length(len(first), m, "first labels", "action dimensions")
    require_length(len(codes), m, "lists of label codes", "action dimensions")
    _require_few_labels(m, sum(map(len, names)))
    labels = [
        _named_labels(*known) if known[0] else _occurring_labels(*known[3:])
        for known in zip(names, first, codes, columns.T, action_names, strict=True)
    ]
    _require_few_labels(m, sum(len(one[0]) for one in labels))
    return {
        "label_names": tuple(one[0] for one in labels),
        "label_first": tuple(one[1] for one in labels),
        "label_codes": tuple(one[2] for one in labels) if any(one[2] for one in labels) else None,
        "action_low": None,
        "action_high": None,
        "bounds_from": None,
    }


_Labels = tuple[tuple[str, ...], int, tuple[int, ...]]  # names, first, codes


def _named_labels(
    names: tuple[str, ...],
    first: int,
    codes: tuple[int, ...],
    column: NDArray[np.int64],
    action: str,
) -> _Labels:
    """Labels of which all are known, demonstrated or not."""
    if not codes:
        require_labels(column[:, None], (first,), (len(names),), (f"action {action!r}",))
        return names, first, codes
    require_length(len(codes), len(names), "label codes", "labels")
    if not (np.diff(codes) > 0).all():
        raise InputError(f"the label codes of action {action!r} must ascend, each once; sort them")
    missing = labels_of(column, 0, codes) < 0
    if missing.any():
        row = int(np.argmax(missing))
        raise InputError(
            f"action {action!r} is {column[row]} in row {row + 1}, which is none of its "
            f"{len(codes)} labels; mend that row"
        )
    return names, 0, codes


def _occurring_labels(column: NDArray[np.int64], action: str) -> _Labels:
    """Labels of which nothing is known but what was demonstrated: each is one by its number."""
    require_codes(column[:, None], (f"action {action!r}",))
    codes: tuple[int, ...] = tuple(np.unique(column).tolist())
    if len(codes) > MAX_LABELS:
        raise InputError(
            f"action {action!r} holds {len(codes):,} different whole numbers, more than the "
            f"{MAX_LABELS:,} labels that rules a person reads could use; write amounts with a "
            "decimal point"
        )
    # A number between others was merely never shown, where most of them are there.
    reach = codes[-1] - codes[0] + 1
    if reach == len(codes) or (codes[0] >= 0 and reach < 2 * len(codes)):
        return tuple(map(str, range(codes[0], codes[-1] + 1))), codes[0], ()
    return tuple(map(str, codes)), 0, codes


def _require_few_labels(m: int, labels: int) -> None:
    if labels > MAX_ALL_LABELS:
        raise InputError(
            f"the {m:,} action dimension{'s have' if m > 1 else ' has'} {labels:,} labels, more "
            f"than the {MAX_ALL_LABELS:,} that rules a person reads could use; number those of "
            "each from 0, or choose fewer"
        )


def _bounds(
    raw: DemonstrationFields, actions: NDArray[np.float32], action_names: tuple[str, ...]
) -> dict[str, Any]:
    m = actions.shape[1]
    least, most = actions.min(axis=0).astype(np.float64), actions.max(axis=0).astype(np.float64)
    source = raw.bounds_from or "action space"
    if (raw.action_low is None) != (raw.action_high is None):
        raise InputError("there is one bound of the actions only; give the lower and the upper")
    if raw.action_low is None or raw.action_high is None:
        low, high, source = least, most, "demonstrated values"
    else:
        low = np.asarray(raw.action_low, dtype=np.float64).reshape(-1)
        high = np.asarray(raw.action_high, dtype=np.float64).reshape(-1)
    require_length(len(low), m, "lower bounds", "action dimensions")
    require_length(len(high), m, "upper bounds", "action dimensions")
    if not (low <= high).all():
        i = int(np.argmin(low <= high))
        raise InputError(
            f"the bounds of action {action_names[i]!r}, {decimal_text(low[i])} and "
            f"{decimal_text(high[i])}, are no interval; give the lower one first"
        )
    if source == "action space":
        require_within(
            actions, low.tolist(), high.tolist(), [f"action {name!r}" for name in action_names]
        )
    # A space that is not bounded has nothing to divide: what was shown is divided.
    unbounded = ~((low >= -LARGEST) & (high <= LARGEST))
    if unbounded.any():
        low, high = np.where(unbounded, least, low), np.where(unbounded, most, high)
        source = "demonstrated values"
    return {
        "action_low": tuple(low.tolist()),
        "action_high": tuple(high.tolist()),
        "bounds_from": source,
        "label_names": ((),) * m,
        "label_first": (0,) * m,
        "label_codes": None,
    }
