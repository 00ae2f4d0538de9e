"""Which column of a table is what: given by a person, or guessed from the columns' names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sarl_core.errors import InputError

_ROLES = {
    "episode": (
        "episode",
        "episodes",
        "ep",
        "episode_id",
        "episode_index",
        "episode_number",
        "eps_id",
        "traj",
        "traj_id",
        "trajectory",
        "trajectory_id",
    ),
    "step": ("step", "steps", "t", "timestep", "time_step", "step_index", "step_id"),
    "reward": ("reward", "rewards", "rew", "rews", "r"),
    "terminated": (
        "terminated",
        "terminateds",
        "terminal",
        "terminals",
        "termination",
        "terminations",
        "done",
        "dones",
    ),
    "truncated": ("truncated", "truncateds", "truncation", "truncations", "timeout", "timeouts"),
}
_OBSERVATIONS = "obs|observations?|states?|features?"
_ACTIONS = "actions?|acts?"
_SINGLE_ACTION = ("action", "actions", "act", "acts", "a")
# Row numbers that a data frame wrote along; never an observation.
_ROW_NUMBERS = re.compile(r"|index|Unnamed: \d+|__index_level_\d+__")
_DUBIOUS = re.compile(r"next[ _]|info|time|seed|id$|.*_id$|return|log_?prob|value|advantage", re.I)
_NUMBERED = re.compile(r"([^\d]*?)[ _.\-\[(]?(\d{1,9})[\])]?")


@dataclass(frozen=True)
class ColumnMap:
    """Which columns of a table hold what.

    Attributes:
        observations: Columns of the d features, in the order of the observation vector.
        actions: Columns of the m action dimensions.
        episode: Column with the episode's number, None if there is none.
        step: Column with the step's number within its episode.
        reward: Column with the reward.
        terminated: Column that says whether the environment ended the episode at this step.
        truncated: Column that says whether a limit ended it.
        feature_names: d names to use in place of the columns' own.
        action_names: m names, likewise.
    """

    observations: tuple[str, ...]
    actions: tuple[str, ...]
    episode: str | None = None
    step: str | None = None
    reward: str | None = None
    terminated: str | None = None
    truncated: str | None = None
    feature_names: tuple[str, ...] | None = None
    action_names: tuple[str, ...] | None = None

    @property
    def used(self) -> tuple[str, ...]:
        """Every column that is named, observations first."""
        singles = (self.episode, self.step, self.reward, self.terminated, self.truncated)
        return (*self.observations, *self.actions, *(name for name in singles if name is not None))


def guess_columns(names: Sequence[str]) -> ColumnMap:
    """The likeliest roles of a table's columns, to fill in a form with.

    Args:
        names: The columns.

    Returns:
        A map in which observations or actions may be empty where nothing looks like them.
    """
    roles = {role: _first_alias(names, aliases) for role, aliases in _ROLES.items()}
    singles = {name for name in roles.values() if name is not None}
    actions = _first_alias(names, _SINGLE_ACTION)
    action_columns = (
        (actions,)
        if actions is not None
        else tuple(name for name in names if stripped(name, _ACTIONS) is not None)
        or tuple(name for name in names if re.fullmatch(r"a[ _]?\d+", name.strip(), re.I))
    )
    observations = tuple(name for name in names if stripped(name, _OBSERVATIONS) is not None)
    if not observations:
        observations = tuple(
            name
            for name in names
            if name not in singles
            and name not in action_columns
            and not _ROW_NUMBERS.fullmatch(name)
            and not _DUBIOUS.match(name)
            and stripped(name, _ACTIONS) is None
        )
    return ColumnMap(
        _by_number(observations, _OBSERVATIONS),
        _by_number(action_columns, _ACTIONS),
        episode=roles["episode"],
        step=roles["step"],
        reward=roles["reward"],
        terminated=roles["terminated"],
        truncated=roles["truncated"],
    )


def choose_columns(names: Sequence[str]) -> tuple[ColumnMap, tuple[str, ...]]:
    """The roles of a table's columns, where their names leave no doubt.

    Args:
        names: The columns.

    Returns:
        The map, and notes on columns that are not used or are used on a guess.

    Raises:
        InputError: If it is unclear what the observations or the actions are.
    """
    guess = guess_columns(names)
    if not guess.actions:
        raise InputError(
            f"there is no action column among {listed(names)}; name it 'action', or map the columns"
        )
    left = [name for name in names if name not in guess.used and not _ROW_NUMBERS.fullmatch(name)]
    if not guess.observations:
        raise InputError(
            f"there is no observation column among {listed(names)}; call them 'obs_' and a name, "
            "or map the columns"
        )
    prefixed = stripped(guess.observations[0], _OBSERVATIONS) is not None
    if left and not prefixed:
        raise InputError(
            f"it is unclear which columns are observations among {listed(names)}; call those "
            "'obs_' and a name, or map the columns"
        )
    if prefixed:
        _refuse_gap(guess.observations, _OBSERVATIONS)
    _refuse_gap(guess.actions, _ACTIONS)
    notes = []
    if not prefixed:
        notes.append(f"the columns {listed(guess.observations)} were taken as observations")
    if left:
        one = len(left) == 1
        notes.append(
            f"the column{'' if one else 's'} {listed(left)} {'was' if one else 'were'} not used"
        )
    return guess, tuple(notes)


def feature_names(columns: Sequence[str]) -> tuple[str, ...] | None:
    """What columns say the features are called; None where they only count them."""
    names = [_own_name(column, _OBSERVATIONS) for column in columns]
    return None if all(name.isdecimal() for name in names) else tuple(names)


def action_names(columns: Sequence[str]) -> tuple[str, ...] | None:
    """What columns say the action dimensions are called; None where they only count them."""
    if len(columns) == 1 and columns[0].strip().lower() in _SINGLE_ACTION:
        return None
    names = [_own_name(column, _ACTIONS) for column in columns]
    return None if all(name.isdecimal() for name in names) else tuple(names)


def only_counted(names: Sequence[str]) -> bool:
    """Whether names say no more than a number, as x0, x1, x2."""
    matches = [_NUMBERED.fullmatch(name) for name in names]
    return all(match is not None and len(match[1]) <= len("column") for match in matches)


def check_map(columns: ColumnMap, names: Sequence[str]) -> None:
    """Refuse a map that names a column twice or one that does not exist."""
    used = columns.used
    missing = next((name for name in used if name not in names), None)
    if missing is not None:
        raise InputError(f"there is no column {missing!r} among {listed(names)}; choose from those")
    doubled = next((name for index, name in enumerate(used) if name in used[:index]), None)
    if doubled is not None:
        raise InputError(f"the column {doubled!r} is mapped twice; give each column one meaning")
    if not columns.observations or not columns.actions:
        raise InputError(
            "the column map names no observations or no actions; choose at least one "
            f"of each from {listed(names)}"
        )


def refuse_doubled(names: Sequence[str]) -> None:
    """Refuse a table in which two columns have one name."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"the column {name!r} stands twice; give each column its own name")
        seen.add(name)


def listed(names: Iterable[str], limit: int = 12) -> str:
    """Names for a sentence, the first few of them."""
    names = list(names)
    shown = ", ".join(map(repr, names[:limit]))
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit:,} more"


def stripped(column: str, prefixes: str) -> str | None:
    """What follows a prefix: "x" of "obs_x", "0" of "obs[0]" and "obs0"; None if nothing does."""
    bare = re.fullmatch(rf"(?:{prefixes})(\d*)", column.strip(), re.I)
    if bare is not None:
        return bare[1] or "0"
    match = re.match(rf"(?:{prefixes})([ _.\-/\[(])", column, re.I)
    if match is None:
        return None
    rest = column[match.end() :]
    return rest[:-1] if match[1] in "[(" and rest[-1:] in ("]", ")") else rest


def _own_name(column: str, prefixes: str) -> str:
    rest = stripped(column, prefixes)
    return column if rest is None else rest


def _first_alias(names: Sequence[str], aliases: Sequence[str]) -> str | None:
    by_name = {name.strip().lower().replace(" ", "_"): name for name in reversed(names)}
    return next((by_name[alias] for alias in aliases if alias in by_name), None)


def _by_number(columns: tuple[str, ...], prefixes: str) -> tuple[str, ...]:
    """Numbered columns in the order of their numbers: obs_2 stands before obs_10."""
    numbers = _numbers(columns, prefixes)
    if numbers is None:
        return columns
    return tuple(column for _, column in sorted(zip(numbers, columns, strict=True)))


def _refuse_gap(columns: tuple[str, ...], prefixes: str) -> None:
    """Refuse numbered columns of which one is missing."""
    numbers = _numbers(columns, prefixes)
    if numbers is None or numbers[0] > 1:
        return
    for before, after, column in zip(numbers, numbers[1:], columns[1:], strict=False):
        if after > before + 1:
            missing = re.sub(r"\d+(?=\D*$)", str(before + 1), column)
            raise InputError(
                f"the column {missing!r} is missing before {column!r}; add it, or number the "
                "columns without a gap"
            )


def _numbers(columns: tuple[str, ...], prefixes: str) -> list[int] | None:
    """The numbers of columns that are only counted, as obs_0 or x0; None if they have names."""
    rests = [stripped(column, prefixes) for column in columns]
    if any(rest is not None for rest in rests):
        counted = [rest for rest in rests if rest is not None and rest.isdecimal()]
        return [int(rest) for rest in counted] if len(counted) == len(columns) else None
    matches = [_NUMBERED.fullmatch(column) for column in columns]
    found = [match for match in matches if match is not None]
    if len(found) < len(columns) or len({match[1] for match in found}) != 1:
        return None
    return [int(match[2]) for match in found]
