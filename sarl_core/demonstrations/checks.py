"""What must hold for demonstrations (errors) and what is merely odd (warnings)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.demonstrations.dataset import Demonstrations

MAX_FEATURES = 4096
_NEAREST_INTEGER = 0.0  # a discrete action is an integer, exactly


def normalise(raw: Demonstrations) -> dict[str, Any]:
    """Convert and check the fields of a `Demonstrations`, and fill in what was not given.

    Args:
        raw: The object under construction; its fields hold whatever was passed.

    Returns:
        The final value of every field that is converted or completed.

    Raises:
        InputError: In one sentence, with the column and the first row (from 1).
    """
    observations = _observations(raw)
    d = observations.shape[1]
    n = len(observations)
    names = _names(raw.feature_names, d, "feature")
    units = ("",) * d if raw.feature_units is None else tuple(map(str, raw.feature_units))
    _length(len(units), d, "feature units", "features")
    _finite(observations, [f"observation {name!r}" for name in names])
    actions = _actions(raw)
    _length(len(actions), n, "actions", "observations")
    m = 1 if actions.ndim == 1 else actions.shape[1]
    action_names = (
        ("action",) if raw.action_names is None and m == 1
        else _names(raw.action_names, m, "action")
    )
    fields: dict[str, Any] = {
        "observations": observations, "actions": actions,
        "feature_names": names, "feature_units": units, "action_names": action_names,
        "episodes": _integers(raw.episodes, n, "episode"),
        "rewards": _column(raw.rewards, n, "reward", np.float64),
        "terminated": _column(raw.terminated, n, "terminated", np.bool_),
        "truncated": _column(raw.truncated, n, "truncated", np.bool_),
    }
    fields["steps"] = _steps(raw, fields["episodes"])
    if actions.dtype.kind == "i":
        fields |= _labels(raw, actions, action_names)
    else:
        _finite(actions, [f"action {name!r}" for name in action_names])
        fields |= _bounds(raw, actions, action_names)
    return fields


def find_warnings(demonstrations: Demonstrations) -> tuple[str, ...]:
    """What is odd about demonstrations and yet no error.

    Args:
        demonstrations: To look at.

    Returns:
        One sentence each: notes from reading, constant or doubled features, labels that never
        occur, a single action.
    """
    found = list(demonstrations.notes)
    observations = demonstrations.observations
    names = [feature.name for feature in demonstrations.features]
    constant = np.all(observations == observations[0], axis=0)
    found += [
        f"feature {name!r} has the same value in every step, so no rule can use it"
        for name, same in zip(names, constant, strict=True) if same
    ]
    seen: dict[bytes, str] = {}
    for column, name in enumerate(names):
        key = np.ascontiguousarray(observations[:, column]).tobytes()
        if key in seen and not constant[column]:
            found.append(f"feature {name!r} repeats feature {seen[key]!r} in every step")
        seen.setdefault(key, name)
    for column, dimension in enumerate(demonstrations.action_dimensions):
        values = demonstrations.action_columns[:, column]
        if np.all(values == values[0]):
            found.append(
                f"{dimension.name!r} is the same in every step, so there is one rule: always so"
            )
        elif dimension.kind == "discrete":
            present = set(np.unique(values).tolist())
            found += [
                f"label {label!r} of {dimension.name!r} never occurs"
                for number, label in enumerate(dimension.labels)
                if number + dimension.first not in present
            ]
    return tuple(found)


def _observations(raw: Demonstrations) -> NDArray[np.float32]:
    observations = np.asarray(raw.observations)
    if observations.ndim > 2:
        shape = "x".join(str(size) for size in observations.shape[1:])
        raise InputError(
            f"observations of shape {shape} look like images, which rules cannot read; "
            "give one vector of features a step"
        )
    if observations.ndim != 2 or observations.dtype.kind not in "biuf":
        raise InputError(
            f"observations must be numbers in {observations.ndim and 'a table of'} steps x "
            f"features, not {observations.dtype} of shape {observations.shape}"
        )
    n, d = observations.shape
    if n == 0 or d == 0:
        raise InputError("there are no steps; give at least two observations with their actions"
                         if n == 0 else "there are no features; give at least one observation "
                         "column")
    if n == 1:
        raise InputError("there is one observation only, from which no rule can be learned; "
                         "give more steps")
    if d > MAX_FEATURES:
        raise InputError(
            f"there are {d:,} features, more than the {MAX_FEATURES:,} that rules a person "
            "reads could use; choose fewer columns"
        )
    with np.errstate(over="ignore"):
        return _frozen_copy(observations, np.float32)


def _frozen_copy(array: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The array itself if nobody can change it, else a copy."""
    same = array.dtype == dtype and array.flags.c_contiguous and not array.flags.writeable
    return array if same and array.base is None else np.array(array, dtype=dtype, order="C")


def _actions(raw: Demonstrations) -> NDArray[Any]:
    actions = np.asarray(raw.actions)
    if actions.dtype.kind not in "biuf" or actions.ndim not in (1, 2):
        raise InputError(
            f"actions must be numbers, one or one vector a step, not {actions.dtype} of shape "
            f"{actions.shape}"
        )
    if actions.dtype.kind == "f":
        return _frozen_copy(actions.reshape(len(actions), -1), np.float32)
    return _frozen_copy(actions, np.int64)


def _names(given: Any, count: int, what: str) -> tuple[str, ...]:
    names = (
        tuple(f"{what} {index}" for index in range(count)) if given is None
        else tuple(map(str, given))
    )
    _length(len(names), count, f"{what} names", f"{what}s")
    doubled = next((name for name in names if names.count(name) > 1), None) if len(
        set(names)) < len(names) else None
    if doubled is not None:
        raise InputError(f"the {what} name {doubled!r} stands twice; give each its own name")
    return names


def _length(got: int, wanted: int, what: str, other: str) -> None:
    if got != wanted:
        raise InputError(f"there are {got:,} {what} for {wanted:,} {other}; give one for each")


def _finite(values: NDArray[Any], columns: list[str]) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        row = int(np.flatnonzero(bad.any(axis=1))[0])
        column = int(np.flatnonzero(bad[row])[0])
        kind = "not a number" if np.isnan(values[row, column]) else "infinite"
        raise InputError(f"{columns[column]} is {kind} in row {row + 1}; "
                         "mend or remove that row")


def _column(given: Any, n: int, name: str, dtype: Any) -> NDArray[Any] | None:
    if given is None:
        return None
    values = np.asarray(given)
    if values.ndim != 1 or values.dtype.kind not in "biuf":
        raise InputError(f"column {name!r} must hold one number a step")
    _length(len(values), n, f"values of {name!r}", "observations")
    if values.dtype.kind == "f":
        _finite(values[:, None], [f"column {name!r}"])
    return _frozen_copy(values, dtype)


def _integers(given: Any, n: int, name: str) -> NDArray[np.int64]:
    values = np.asarray(_column(given, n, name, np.float64 if np.asarray(
        given).dtype.kind == "f" else np.int64))
    whole = values == np.floor(values)
    if not whole.all():
        row = int(np.flatnonzero(~whole)[0])
        raise InputError(f"column {name!r} is {values[row]:g} in row {row + 1}, which is no whole "
                         "number; number them 0, 1, 2, ...")
    return _frozen_copy(values, np.int64)


def _steps(raw: Demonstrations, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
    starts = np.concatenate([[0], np.flatnonzero(np.diff(episodes)) + 1])
    if len(np.unique(episodes[starts])) < len(starts):
        seen: set[int] = set()
        for start in starts.tolist():
            if int(episodes[start]) in seen:
                raise InputError(
                    f"column 'episode' comes back to {episodes[start]} in row {start + 1} after "
                    "another episode; keep the steps of an episode together"
                )
            seen.add(int(episodes[start]))
    lengths = np.diff(np.append(starts, len(episodes)))
    if raw.steps is None:
        return np.arange(len(episodes), dtype=np.int64) - np.repeat(starts, lengths)
    steps = _integers(raw.steps, len(episodes), "step")
    backwards = (np.diff(steps) <= 0) & (np.diff(episodes) == 0)
    if backwards.any():
        row = int(np.flatnonzero(backwards)[0]) + 1
        raise InputError(
            f"column 'step' goes from {steps[row - 1]} to {steps[row]} in row {row + 1} within "
            f"episode {episodes[row]}; sort the steps of each episode"
        )
    return steps


def _labels(
    raw: Demonstrations, actions: NDArray[np.int64], action_names: tuple[str, ...]
) -> dict[str, Any]:
    columns = actions.reshape(len(actions), -1)
    m = columns.shape[1]
    first = raw.label_first
    if first is None:
        first = (0,) * m
    names = raw.label_names
    if names is None:
        names = tuple(
            tuple(str(label) for label in range(low, max(int(columns[:, i].max()), low) + 1))
            if int(columns[:, i].max()) - low < 10_000 else ()
            for i, low in enumerate(first)
        )
    names = tuple(tuple(map(str, labels)) for labels in names)
    _length(len(names), m, "lists of label names", "action dimensions")
    _length(len(first), m, "first labels", "action dimensions")
    for i, labels in enumerate(names):
        outside = (columns[:, i] < first[i]) | (columns[:, i] >= first[i] + len(labels))
        if outside.any():
            row = int(np.flatnonzero(outside)[0])
            allowed = (f"the {len(labels)} labels {first[i]} to {first[i] + len(labels) - 1}"
                       if labels else f"whole numbers from {first[i]} to 9999")
            raise InputError(
                f"action {action_names[i]!r} is {columns[row, i]} in row {row + 1}, outside "
                f"{allowed}; mend that row"
            )
    return {"label_names": names, "label_first": tuple(int(value) for value in first),
            "action_low": None, "action_high": None, "bounds_from": None}


def _bounds(
    raw: Demonstrations, actions: NDArray[np.float32], action_names: tuple[str, ...]
) -> dict[str, Any]:
    m = actions.shape[1]
    source = raw.bounds_from
    if raw.action_low is None or raw.action_high is None:
        low, high = actions.min(axis=0), actions.max(axis=0)
        source = "demonstrated values"
    else:
        low = np.asarray(raw.action_low, dtype=np.float64).reshape(-1)
        high = np.asarray(raw.action_high, dtype=np.float64).reshape(-1)
        source = source or "action space"
    _length(len(low), m, "lower bounds", "action dimensions")
    _length(len(high), m, "upper bounds", "action dimensions")
    # An action space that is not bounded has nothing to divide: what was shown is divided.
    unbounded = ~(np.isfinite(low) & np.isfinite(high))
    if unbounded.any():
        low = np.where(unbounded, actions.min(axis=0), low)
        high = np.where(unbounded, actions.max(axis=0), high)
        source = "demonstrated values"
    if source == "action space":
        outside = (actions < low.astype(np.float32)) | (actions > high.astype(np.float32))
        if outside.any():
            row = int(np.flatnonzero(outside.any(axis=1))[0])
            i = int(np.flatnonzero(outside[row])[0])
            raise InputError(
                f"action {action_names[i]!r} is {actions[row, i]:g} in row {row + 1}, outside "
                f"the action space [{low[i]:g}, {high[i]:g}]; mend that row"
            )
    return {"action_low": tuple(float(v) for v in low), "bounds_from": source,
            "action_high": tuple(float(v) for v in high), "label_names": ((),) * m,
            "label_first": (0,) * m}
