"""From what a file holds to `Demonstrations`: one way for every format."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.checks import counted_steps
from sarl_core.demonstrations.dataset import Demonstrations, derived_over
from sarl_core.demonstrations.fields import ColumnUse, Indicator
from sarl_core.demonstrations.formats.columns import only_counted
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.missing import (
    Holes,
    Missing,
    StepGaps,
    complete_rows,
    gaps_of,
)
from sarl_core.demonstrations.requirements import (
    EXACT,
    FEW_VALUES,
    as_numbers,
    coarse_columns,
    column_of_numbers,
    flags,
    is_whole,
    require_codes,
    require_finite,
    require_labels,
    require_length,
    require_order,
    require_whole_labels,
    require_within,
    whole_numbers,
    whole_numbers_note,
    without_fraction,
)
from sarl_core.demonstrations.words import by_name, numbered_episodes
from sarl_core.environments.description import EnvironmentDescription, describe_environment
from sarl_core.environments.feature_order import NamedFeatures, line_up, numbered, only_counts
from sarl_core.errors import InputError, quoted


@dataclass(frozen=True)
class Recording:
    """What a file holds, its format forgotten.

    Attributes:
        observations: Shape (N, d), or (N + episodes, d) with one more at each episode's end.
        actions: Shape (N,) or (N, m), numbers of any type; what is not a number is missing, as
            among the observations and rewards.
        missing_actions: Where actions are missing whose type has no other way to say so, (N, m),
            or None.
        observation_columns: What the d columns are called in messages.
        action_columns: What the m columns are called in messages.
        feature_names: d names, None where the file has none.
        feature_units: d units, None where the file has none.
        indicators: What each of the d says of a column of words, or None; () where none does.
        action_words: What the numbers of each of the m stand for, () where they are numbers.
        action_names: m names, None where the file has none.
        episodes: Shape (N,), None where the file has none.
        steps: Shape (N,), likewise.
        rewards: Shape (N,), likewise.
        terminated: Shape (N,), likewise.
        truncated: Shape (N,), likewise.
        times: Seconds, shape (N,), likewise; NaN where not known.
        rows: Shape (N,), the rows the steps had in the file, from 0; None if they are those.
        guess_labels: Whether one column of floats that are whole numbers may be labels.
        names: What "episode", "step", "reward", "terminated" and "truncated" are called in
            messages.
        metadata: What the file says besides.
        notes: Sentences on how it was read.
        columns: What each column was taken for, where there are columns.
    """

    observations: NDArray[Any]
    actions: NDArray[Any]
    observation_columns: tuple[str, ...]
    action_columns: tuple[str, ...]
    feature_names: tuple[str, ...] | None = None
    feature_units: tuple[str, ...] | None = None
    action_names: tuple[str, ...] | None = None
    indicators: tuple[Indicator | None, ...] = ()
    action_words: tuple[tuple[str, ...], ...] = ()
    missing_actions: NDArray[np.bool_] | None = None
    episodes: NDArray[Any] | None = None
    steps: NDArray[Any] | None = None
    rewards: NDArray[Any] | None = None
    terminated: NDArray[Any] | None = None
    truncated: NDArray[Any] | None = None
    times: NDArray[Any] | None = None
    rows: NDArray[np.int64] | None = None
    guess_labels: bool = True
    names: Mapping[str, str] = field(default_factory=dict)
    metadata: Metadata = field(default_factory=Metadata)
    notes: tuple[str, ...] = ()
    columns: tuple[ColumnUse, ...] = ()


def to_demonstrations(
    recording: Recording,
    description: EnvironmentDescription | None,
    missing: Missing = "refuse",
    episode_names: Mapping[int, str] | None = None,
) -> Demonstrations:
    """Complete what a file holds and check it.

    Args:
        recording: What it holds.
        description: The environment to take from what the file does not say, or None.
        missing: What becomes of steps without one of their values.
        episode_names: What numbers of episodes stand for; None where they are those of the file.

    Returns:
        The demonstrations.

    Raises:
        InputError: In one sentence with the column, as the file calls it, and the first row.
    """
    if missing not in get_args(Missing):
        raise InputError(f"missing is {quoted(missing)}; give 'refuse' or 'drop'")
    recording = replace(recording, actions=as_numbers(recording.actions, "actions"))
    metadata = recording.metadata
    described = description or _described(metadata)
    if recording.observations.size == 0 or recording.actions.size == 0:
        raise InputError("there are no steps; give at least two observations with their actions")
    if described is not None:
        recording = _fit(recording, described)
    observations = _owned(recording.observations, np.float32)
    coarse = coarse_columns(recording.observations, observations, recording.observation_columns)
    recording = replace(recording, observations=observations)
    recording = _without_last_observations(_checked(recording, episode_names))
    recording = _complete(recording, missing)
    require_finite(recording.observations, recording.observation_columns, recording.rows)
    discrete, note = _is_discrete(recording, described)
    notes = (*recording.notes, *coarse, *((note,) if note is not None else ()))
    features = _features(recording, described)
    fields: dict[str, Any] = features | {
        "action_names": _action_names(recording, described),
        "env_id": metadata.env_id or (described.env_id if described is not None else ""),
        "agent": metadata.agent,
        "seed": metadata.seed,
        "notes": (*metadata.notes, *notes),
        "columns": recording.columns,
    }
    actions, space = (_labels if discrete else _values)(recording, described)
    return Demonstrations(
        recording.observations,
        actions,
        _some(recording.episodes),
        recording.rewards,
        terminated=recording.terminated,
        truncated=recording.truncated,
        steps=recording.steps,
        times=recording.times,
        **fields,
        **space,
    )


def _some(episodes: NDArray[Any] | None) -> NDArray[Any]:
    assert episodes is not None  # _in_episodes has numbered them
    return episodes


def _described(metadata: Metadata) -> EnvironmentDescription | None:
    """The environment that a file names, where the file leaves something out."""
    complete = metadata.features and metadata.action_names and metadata.is_discrete is not None
    # "module:Id" would import a module that a stranger's file chose.
    if complete or not metadata.env_id or ":" in metadata.env_id:
        return None
    try:
        return describe_environment(metadata.env_id)
    except InputError:
        return None  # the file can be read without it


def _fit(recording: Recording, described: EnvironmentDescription) -> Recording:
    """Refuse a file whose width is not the environment's; bring its columns into that order."""
    d, m = recording.observations.shape[1], len(recording.action_columns)
    wanted_d, wanted_m = len(described.feature_names), len(described.action_names)
    if d != wanted_d:
        raise InputError(
            f"there are {d} observation columns, but {described.env_id} has {wanted_d} features; "
            "choose the environment it was recorded in, or map the columns"
        )
    if m != wanted_m:
        raise InputError(
            f"there are {m} action columns, but {described.env_id} has {wanted_m} action "
            "dimensions; choose the environment it was recorded in, or map the columns"
        )
    for name, indicator in zip(recording.observation_columns, recording.indicators, strict=False):
        if indicator is not None and not indicator.is_truth:
            raise InputError(
                f"{name} holds words, as {quoted(indicator.value)}, and the observations of "
                f"{described.env_id} are numbers; give the numbers that it gives, or leave the "
                "environment out"
            )
    metadata = recording.metadata
    says = metadata.is_discrete
    if says is None and any(recording.action_words):
        says = True
    if says is not None and says != described.is_discrete:
        kinds = ("continuous", "discrete")
        raise InputError(
            f"its actions are {kinds[says]}, but those of {described.env_id} are "
            f"{kinds[described.is_discrete]}; choose the environment it was recorded in"
        )
    recording = _in_order(recording, described)
    metadata = recording.metadata
    counts = [len(labels) for labels in described.label_names]
    if metadata.is_discrete and [len(labels) for labels in metadata.label_names] != counts:
        raise InputError(
            f"its actions have other labels than those of {described.env_id}; choose the "
            "environment it was recorded in"
        )
    return recording


def _in_order(recording: Recording, described: EnvironmentDescription) -> Recording:
    """Bring the columns into the environment's order, by their names."""
    metadata = recording.metadata
    named = NamedFeatures("the file", (), metadata.env_id)
    wanted = NamedFeatures(described.env_id, described.feature_names, described.env_id)
    names = tuple(feature.name for feature in metadata.features) or recording.feature_names
    features = line_up(named._replace(names=names or numbered(len(wanted.names))), wanted)
    orders = [features]
    if features.how == "permuted":
        recording = replace(
            recording,
            observations=recording.observations[:, features.places],
            observation_columns=features.put(recording.observation_columns),
            feature_names=described.feature_names,
            feature_units=recording.feature_units and features.put(recording.feature_units),
            indicators=features.put(recording.indicators),
            metadata=replace(
                metadata,
                features=features.put(metadata.features),
                derived=derived_over(
                    metadata.derived,
                    features.inverse,
                    features.put(tuple(one.name for one in metadata.features)),
                ),
            ),
        )
    if len(described.action_names) > 1:  # a single one needs no name
        wanted = wanted._replace(names=described.action_names)
        names = metadata.action_names or recording.action_names or numbered(len(wanted.names))
        actions = line_up(named._replace(names=names), wanted, what="action dimensions")
        orders.append(actions)
        if actions.how == "permuted":
            recording = replace(
                recording,
                actions=recording.actions[:, actions.places],
                action_columns=actions.put(recording.action_columns),
                action_names=described.action_names,
                action_words=actions.put(recording.action_words),
                missing_actions=None
                if recording.missing_actions is None
                else recording.missing_actions[:, actions.places],
                metadata=recording.metadata.with_actions_in(actions),
            )
    notes = tuple(order.note for order in orders if order.note)
    return replace(recording, notes=(*recording.notes, *notes))


def _checked(recording: Recording, episode_names: Mapping[int, str] | None) -> Recording:
    """Number the episodes and check what else there is, under the file's own names."""
    n = len(recording.actions)
    recording = _with_short_numbers(recording)
    columns: dict[str, Any] = {}
    for attribute, role, check in (
        ("episodes", "episode", whole_numbers),
        ("steps", "step", whole_numbers),
        ("terminated", "terminated", flags),
        ("truncated", "truncated", flags),
    ):
        values = getattr(recording, attribute)
        if values is not None:
            columns[attribute] = check(values, n, _called(recording, role), recording.rows)
    recording = _in_episodes(replace(recording, **columns))
    called = (_called(recording, "episode"), _called(recording, "step"))
    require_order(_some(recording.episodes), recording.steps, called, recording.rows, episode_names)
    return recording


def _with_short_numbers(recording: Recording) -> Recording:
    """Number the episodes from 0 where their own are as long as ids are."""
    episodes = recording.episodes
    if episodes is None or episodes.dtype.kind not in "iu" or episodes.ndim != 1:
        return recording
    if not episodes.size or -EXACT <= int(episodes.min()) <= int(episodes.max()) <= EXACT:
        return recording
    numbers, note = numbered_episodes(episodes, _called(recording, "episode"), str(episodes[0]))
    return replace(recording, episodes=numbers, notes=(*recording.notes, note))


def gaps_in(recording: Recording, missing: Missing) -> StepGaps:
    """How many steps of a table lack one of their values, before it is completed.

    Args:
        recording: What the table holds, a row a step.
        missing: What becomes of such steps.

    Returns:
        Those that `to_demonstrations` would leave out.
    """
    return gaps_of(*_holes(recording, missing), len(recording.actions))


def _holes(recording: Recording, missing: Missing) -> tuple[Holes, Holes]:
    """Where columns have no value, and where they have an infinite one."""
    holes = _marked(recording, np.isnan)
    if recording.missing_actions is not None:
        without = zip(recording.action_columns, recording.missing_actions.T, strict=True)
        holes |= {name: hole for name, hole in without if hole.any()}
    # A state with an infinite value is none either; it is refused by its own name.
    return holes, _marked(recording, np.isinf) if missing == "drop" else {}


def _complete(recording: Recording, missing: Missing) -> Recording:
    """Refuse or leave out steps without one of their values, and check the rewards."""
    holes, infinite = _holes(recording, missing)
    if holes or infinite:
        episodes, steps = _some(recording.episodes), recording.steps
        left, note = complete_rows(holes, infinite, recording.rows, missing)

        def of_left(values: NDArray[Any] | None) -> Any:
            return None if values is None else values[left]

        recording = replace(
            recording,
            observations=_owned(recording.observations[left], np.float32),
            actions=recording.actions[left],
            missing_actions=None,
            episodes=episodes[left],
            steps=(counted_steps(episodes) if steps is None else steps)[left],
            rewards=of_left(recording.rewards),
            terminated=of_left(recording.terminated),
            truncated=of_left(recording.truncated),
            times=of_left(recording.times),
            rows=left if recording.rows is None else recording.rows[left],
            notes=(
                *recording.notes,
                note if recording.rewards is None else f"{note}, and returns lack their rewards",
            ),
        )
    if recording.rewards is None:
        return recording
    n, called = len(recording.actions), _called(recording, "reward")
    return replace(
        recording, rewards=column_of_numbers(recording.rewards, n, called, recording.rows)
    )


def _marked(
    recording: Recording, test: Callable[[NDArray[Any]], NDArray[np.bool_]]
) -> dict[str, NDArray[np.bool_]]:
    """For each column of numbers of which a test is true where it is, (N,)."""
    n = len(recording.actions)
    actions = recording.actions.reshape(n, -1)
    blocks: list[tuple[Sequence[str], NDArray[Any]]] = [
        (recording.observation_columns, recording.observations),
        (recording.action_columns, actions),
    ]
    if recording.rewards is not None:
        rewards = as_numbers(recording.rewards, _called(recording, "reward"))
        if rewards.shape == (n,):
            blocks.append(((_called(recording, "reward"),), rewards[:, None]))
    marked = {
        name: test(column)
        for names, block in blocks
        if block.dtype.kind == "f" and block.size and not _is_finite(block)
        for name, column in zip(names, block.T, strict=True)
    }
    return {name: places for name, places in marked.items() if places.any()}


def _is_finite(block: NDArray[Any]) -> bool:
    """Whether every number is one; without an array of their size."""
    return bool(np.isfinite([block.min(), block.max()]).all())


def _called(recording: Recording, role: str) -> str:
    return recording.names.get(role, f"column {role!r}")


def _in_episodes(recording: Recording) -> Recording:
    """Number the episodes where the file does not, and say how."""
    if recording.episodes is not None:
        return recording
    n = len(recording.actions)
    ends = np.zeros(n, dtype=np.bool_)
    how = ""
    if recording.terminated is not None or recording.truncated is not None:
        for last in (recording.terminated, recording.truncated):
            if last is not None:
                ends |= last
        how = "an episode ends where a step is marked as its last"
    elif recording.steps is not None:
        ends[:-1] = recording.steps[1:] == recording.steps[0]
        how = "an episode begins where the step number begins again"
    episodes = np.concatenate([[0], np.cumsum(ends)[:-1]]).astype(np.int64)
    note = (
        f"there is no episode column, so {how}"
        if episodes[-1]
        else "there is no episode column, so every step belongs to one episode"
    )
    return replace(recording, episodes=episodes, notes=(*recording.notes, note))


def _without_last_observations(recording: Recording) -> Recording:
    """Drop the observation after the last action of each episode, where it was recorded."""
    n, rows = len(recording.actions), len(recording.observations)
    if rows == n:
        return recording
    episodes = _some(recording.episodes)
    last = np.flatnonzero(np.append(episodes[1:] != episodes[:-1], True))
    if rows != n + len(last):
        require_length(n, rows, "actions", "observations")
    # The row after the k-th last action (k from 0) lies k rows further on.
    surplus = last + 1 + np.arange(len(last))
    return replace(
        recording,
        observations=_owned(np.delete(recording.observations, surplus, axis=0), np.float32),
        notes=(
            *recording.notes,
            "the observation after each episode's last action was dropped, "
            "as nothing was done in it",
        ),
    )


def _is_discrete(
    recording: Recording, described: EnvironmentDescription | None
) -> tuple[bool, str | None]:
    """Whether the actions are labels, and a note if that is a guess."""
    says = recording.metadata.is_discrete
    if says is not None:
        return says, None
    if described is not None:
        return described.is_discrete, None
    if any(recording.action_words):
        return True, None
    actions = recording.actions
    columns = actions.reshape(len(actions), -1).T
    if actions.dtype.kind != "f":
        return True, _many_labels_note(columns, recording.action_columns)
    single = recording.guess_labels and len(columns) == 1
    if single and is_whole(columns[0]) and len(np.unique(columns[0])) <= FEW_VALUES:
        return True, (
            "the actions are whole numbers with a decimal point and were taken as labels; name the "
            "environment if they are continuous"
        )
    notes = (
        whole_numbers_note(column, name, recording.rows)
        for name, column in zip(recording.action_columns, columns, strict=True)
        if single or not without_fraction(column).all()
    )
    return False, next((note for note in notes if note is not None), None)


def _many_labels_note(columns: NDArray[Any], names: Sequence[str]) -> str | None:
    """A sentence on labels that are so many that they may be amounts."""
    for name, column in zip(names, columns, strict=True):
        different = len(np.unique(column))
        if different > FEW_VALUES:
            say = "write it with a decimal point (26.0), or map it as a continuous action"
            return (
                f"{name} holds {different:,} different whole numbers and was taken as so many "
                f"labels; if it is an amount, as a percentage, {say}"
            )
    return None


def _features(recording: Recording, described: EnvironmentDescription | None) -> dict[str, Any]:
    metadata, names = recording.metadata, recording.feature_names
    if metadata.features:
        return {
            "feature_names": tuple(feature.name for feature in metadata.features),
            "feature_units": tuple(feature.unit for feature in metadata.features),
            "indicators": tuple(feature.indicator for feature in metadata.features),
            "derived": metadata.derived,
        }
    indicators = recording.indicators or None
    if described is not None and (names is None or only_counts(names)):
        names = described.feature_names
    units = recording.feature_units
    if described is not None and names == described.feature_names:
        own = units or ("",) * len(described.feature_units)
        units = tuple(one or two for one, two in zip(own, described.feature_units, strict=True))
    return {"feature_names": names, "feature_units": units, "indicators": indicators}


def _action_names(
    recording: Recording, described: EnvironmentDescription | None
) -> tuple[str, ...] | None:
    names = recording.metadata.action_names or recording.action_names
    if described is not None and (names is None or only_counted(names)):
        return described.action_names
    return names


def _labels(
    recording: Recording, described: EnvironmentDescription | None
) -> tuple[NDArray[Any], dict[str, Any]]:
    """Discrete actions and what is known about their space."""
    actions, metadata = recording.actions, recording.metadata
    names, first, codes = metadata.label_names, metadata.label_first, metadata.label_codes
    if described is not None and not names:
        names, first, codes = described.label_names, described.label_first, ()
    columns = actions.reshape(len(actions), -1)
    require_finite(columns, recording.action_columns, recording.rows)
    require_whole_labels(columns, recording.action_columns, recording.rows)
    whole = columns.astype(np.int64)
    m = whole.shape[1]
    if names:
        require_length(len(names), m, "lists of label names", "action dimensions")
        require_length(len(first or names), m, "first labels", "action dimensions")
        require_length(len(codes or names), m, "lists of label codes", "action dimensions")
        whole = _by_name(recording, whole, names, first or (0,) * m, described)
    else:
        require_codes(whole, recording.action_columns, recording.rows)
    if names and not any(codes):
        counts = [len(labels) for labels in names]
        require_labels(whole, first or (0,) * m, counts, recording.action_columns, recording.rows)
    flat = actions.ndim == 1 if described is None else described.action_shape == ()
    return _owned(whole.reshape(-1) if flat and m == 1 else whole, np.int64), {
        "label_names": names or recording.action_words or None,
        "label_first": first or None,
        "label_codes": codes or None,
    }


def _by_name(
    recording: Recording,
    columns: NDArray[np.int64],
    names: tuple[tuple[str, ...], ...],
    first: tuple[int, ...],
    described: EnvironmentDescription | None,
) -> NDArray[np.int64]:
    """Actions that are words as the actions of the labels that they name, (N, m)."""
    whose = described.env_id if described is not None else "the file's own metadata"
    columns = columns.copy()
    for index, words in enumerate(recording.action_words):
        if words:
            places = by_name(words, names[index], recording.action_columns[index], whose=whose)
            columns[:, index] = places[columns[:, index]] + first[index]
    return columns


def _values(
    recording: Recording, described: EnvironmentDescription | None
) -> tuple[NDArray[Any], dict[str, Any]]:
    """Continuous actions and what is known about their space."""
    metadata = recording.metadata
    low: tuple[float, ...] | None = metadata.action_low or None
    high: tuple[float, ...] | None = metadata.action_high or None
    source = metadata.bounds_from
    if described is not None and low is None:
        low, high, source = described.action_low, described.action_high, "action space"
    columns = _owned(recording.actions.reshape(len(recording.actions), -1), np.float32)
    require_finite(columns, recording.action_columns, recording.rows)
    if low is not None and high is not None and source != "demonstrated values":
        require_length(len(low), columns.shape[1], "bounds", "action dimensions")
        require_within(columns, low, high, recording.action_columns, recording.rows)
    return columns, {"action_low": low, "action_high": high, "bounds_from": source}


def _owned(array: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """An array that nobody else can change, so that it need not be copied once more."""
    with np.errstate(over="ignore", invalid="ignore"):
        owned = np.array(array, dtype=dtype, order="C", copy=None)
    if owned.base is not None:
        owned = owned.copy()
    owned.flags.writeable = False
    return owned
