"""Which column of a table is what: given by a person, or guessed from the columns' names."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate

from sarl_core.demonstrations.fields import ColumnUse
from sarl_core.demonstrations.formats import vocabulary
from sarl_core.demonstrations.formats.mapping.roles import (
    ROLE_WORDS,
    ColumnRole,
    Roles,
    as_roles,
    require_known,
    settled_by,
)
from sarl_core.demonstrations.formats.vocabulary import (
    ACTIONS,
    OBSERVATIONS,
    PLAIN_OBSERVATIONS,
    SINGLE_ACTION,
    plain,
    stripped,
)
from sarl_core.errors import InputError, quoted, require

SINGLES = ("episode", "step", "reward", "terminated", "truncated", "first", "last", "time")
IS_TIME = "it is a time"
"""Why a column is no feature."""
_BY_NAME = "its name says so"
_BY_PERSON = "as it was mapped"
NO_OBSERVATION = "the features' names begin with a word for observations, and its own does not"
_LONGEST_LIST = 200  # characters of the names that a sentence lists
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
        first: Column that says whether an episode begins with this step.
        last: Column that says whether one ends with it, for whatever reason.
        time: Column that says when the step was.
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
    first: str | None = None
    last: str | None = None
    time: str | None = None
    feature_names: tuple[str, ...] | None = None
    action_names: tuple[str, ...] | None = None

    @classmethod
    def of_roles(
        cls, observations: Sequence[str], actions: Sequence[str], singles: Mapping[str, str]
    ) -> ColumnMap:
        """A map from the columns of each kind.

        Args:
            observations: Columns of the features.
            actions: Columns of the action dimensions.
            singles: The other columns, by what they hold.

        Returns:
            The map.
        """
        return cls(
            tuple(observations),
            tuple(actions),
            episode=singles.get("episode"),
            step=singles.get("step"),
            reward=singles.get("reward"),
            terminated=singles.get("terminated"),
            truncated=singles.get("truncated"),
            first=singles.get("first"),
            last=singles.get("last"),
            time=singles.get("time"),
        )

    def only(self, names: Collection[str]) -> ColumnMap:
        """The same map of fewer columns.

        Args:
            names: The columns that stay, as far as they are used.

        Returns:
            A map in which observations or actions may be empty.
        """
        return ColumnMap.of_roles(
            [name for name in self.observations if name in names],
            [name for name in self.actions if name in names],
            {role: name for role, name in self.singles.items() if name in names},
        )

    @property
    def singles(self) -> dict[str, str]:
        """The columns that are neither observations nor actions, by what they hold."""
        named = {role: getattr(self, role) for role in SINGLES}
        return {role: name for role, name in named.items() if name is not None}

    @property
    def used(self) -> tuple[str, ...]:
        """Every column that is named, observations first."""
        return (*self.observations, *self.actions, *self.singles.values())


class UnclearColumnsError(InputError):
    """Two readings of some columns are possible.

    Args:
        columns: Which.
        message: The sentence.
    """

    def __init__(self, columns: Sequence[str], message: str) -> None:
        super().__init__(message)
        self.columns = tuple(columns)


Columns = ColumnMap | Mapping[str, ColumnRole | str]
"""What a person says of columns: a map of all that are read, or the roles of some."""


def stated(columns: Columns | None) -> ColumnMap | Roles | None:
    """What a person says of columns, checked.

    Args:
        columns: As it was given.

    Returns:
        The map, or what the columns' roles are; None where nothing is said.

    Raises:
        InputError: If it is neither, or a role is none.
    """
    if columns is None or isinstance(columns, ColumnMap):
        return columns
    must = "the map of columns must be a ColumnMap or a dict of roles"
    advice = "give one, as {'brake': 'action', 'speed': 'feature:m/s'}"
    require(columns, Mapping, must, advice)
    for name, role in columns.items():
        require(name, str, must, advice)
        require(role, (str, ColumnRole), must, advice)
    return as_roles(columns) or None


@dataclass(frozen=True)
class Guess:
    """What a table's columns are by their names.

    Attributes:
        columns: The likeliest roles; observations or actions may be empty.
        reasons: Why each of these columns was taken for what it was.
        unused: Columns that are nothing of these, and why.
        unclear: Columns that may be features or something else.
        prefixed: Whether the features' names begin with a word for observations.
        roles: What a person said of some of the columns, which no value proves wrong.
    """

    columns: ColumnMap
    reasons: Mapping[str, str]
    unused: Mapping[str, str]
    unclear: tuple[str, ...] = ()
    prefixed: bool = False
    roles: Roles = field(default_factory=dict)

    def uses(self, names: Sequence[str]) -> tuple[ColumnUse, ...]:
        """What each of a table's columns was taken for.

        Args:
            names: The columns, in the order of the table.

        Returns:
            One entry a column.
        """
        roles = {name: role for role, name in self.columns.singles.items()}
        roles |= dict.fromkeys(self.columns.observations, "feature")
        roles |= dict.fromkeys(self.columns.actions, "action")
        return tuple(
            ColumnUse(
                name,
                ROLE_WORDS[roles.get(name, "ignore")],
                self.reasons.get(name) or self.unused.get(name, ""),
            )
            for name in names
        )

    def as_actions(self, counted: Mapping[str, str]) -> Guess:
        """The same guess of a table that holds actions and no observations.

        Args:
            counted: Why each column that only counts is none.

        Returns:
            The new guess.
        """
        columns = self.columns
        others = (*columns.observations, *self.unclear)
        actions = columns.actions or tuple(name for name in others if name not in counted)
        why = dict.fromkeys(actions, "the file is there for the actions")
        return replace(
            self,
            columns=replace(columns, observations=(), actions=actions),
            reasons={
                **why,
                **{
                    name: self.reasons[name]
                    for name in (*columns.actions, *columns.singles.values())
                },
            },
            unused={**self.unused, **counted},
            unclear=(),
        )

    def without(self, dropped: Mapping[str, str]) -> Guess:
        """The same guess with features that turned out to be none.

        Args:
            dropped: Why each of them is none.

        Returns:
            The new guess.
        """
        dropped = {name: why for name, why in dropped.items() if name not in self.roles}
        seen, names = self.columns.observations, self.columns.feature_names
        left = [place for place, name in enumerate(seen) if name not in dropped]
        columns = replace(self.columns, observations=tuple(seen[place] for place in left))
        if names is not None:
            columns = replace(columns, feature_names=tuple(names[place] for place in left))
        reasons = {name: why for name, why in self.reasons.items() if name not in dropped}
        return replace(self, columns=columns, reasons=reasons, unused={**self.unused, **dropped})


def guess_columns(names: Sequence[str]) -> ColumnMap:
    """The likeliest roles of a table's columns, to fill in a form with.

    Args:
        names: The columns.

    Returns:
        A map in which observations or actions may be empty where nothing looks like them.
    """
    return guess_roles(names).columns


def guess_roles(names: Sequence[str], roles: Roles | None = None) -> Guess:
    """The likeliest roles of a table's columns, and why.

    Args:
        names: The columns.
        roles: What a person said of some of them; the others are guessed.

    Returns:
        The guess; what the columns hold may prove it wrong.

    Raises:
        InputError: If what was said does not fit the table.
    """
    roles = roles or {}
    require_known(roles, names)
    said = {role: [name for name, one in roles.items() if one.role == role] for role in ROLE_WORDS}
    free = [name for name in names if name not in roles]
    actions = tuple(said["action"]) or _actions(free)
    reasons = dict.fromkeys(actions, _BY_NAME)
    singles = {role: said[role][0] for role in SINGLES if said[role]}
    singles |= _singles([name for name in free if name not in actions], singles)
    reasons |= dict.fromkeys(singles.values(), _BY_NAME)
    taken = {*actions, *singles.values(), *roles}
    unused = {
        name: why
        for name in names
        if name not in taken and (why := _why_unused(name, names)) is not None
    }
    left = [name for name in names if name not in taken and name not in unused]
    worded = prefixed(left)
    if worded:
        reasons |= dict.fromkeys(worded, "its name begins with a word for observations")
        unused |= {name: NO_OBSERVATION for name in left if name not in worded}
        unclear = []
    else:
        unclear = [name for name in left if _unclear(name)]
        reasons |= dict.fromkeys(
            (name for name in left if name not in unclear), "no other use fits its name"
        )
    guessed = [name for name in worded or left if name not in unclear]
    features = tuple(name for name in names if name in said["feature"] or name in guessed)
    columns = ColumnMap.of_roles(
        # Where a person says of each that it is one, so do they stand.
        _by_number(features, OBSERVATIONS) if guessed else tuple(said["feature"]),
        tuple(said["action"]) or _by_number(actions, ACTIONS),
        singles,
    )
    reasons |= dict.fromkeys(roles, _BY_PERSON)
    unused |= dict.fromkeys((*said["ignore"], *said["time"][1:]), _BY_PERSON)
    return Guess(columns, reasons, unused, tuple(unclear), bool(worded), roles)


def prefixed(names: Sequence[str]) -> list[str]:
    """The columns that a word for observations tells from the others; none if none does."""
    plainly = [name for name in names if stripped(name, PLAIN_OBSERVATIONS) is not None]
    if plainly != [name for name in plainly if _bare(name)]:
        return plainly
    # "state" beside "pressure" is a feature, and no word that all features begin with.
    common = [name for name in names if stripped(name, OBSERVATIONS) is not None]
    alone = len(common) == 1 and plainly == [] and not _bare(common[0])
    return common if len(common) == len(names) and not alone else []


def require_clear(guess: Guess, names: Sequence[str], *, actions: bool = True) -> None:
    """Refuse a guess that leaves in doubt what a column is.

    Args:
        guess: By the names.
        names: The columns.
        actions: Whether there must be actions.

    Raises:
        InputError: With the columns that are unclear, and what to do.
    """
    columns = guess.columns
    if actions and not columns.actions:
        raise InputError(
            f"there is no action column among {listed(names)}; "
            f"{settled_by(_likeliest_action(guess, names), 'action')}"
        )
    if not columns.observations and not guess.unclear:
        unused = next((name for name in names if name in guess.unused), None)
        cure = settled_by(unused, "feature") if unused is not None else "add what was observed"
        raise InputError(f"there is no observation column among {listed(names)}; {cure}")
    if guess.unclear:
        raise unclear_columns(guess.unclear, names)
    reward = columns.reward
    lettered = reward is not None and plain(reward) == "r" and reward not in guess.roles
    if reward is not None and lettered and not _textbook(guess):
        raise InputError(
            f"it is unclear whether the column {reward!r} is the reward or a feature; "
            f"{settled_by(reward, 'reward', 'feature')}"
        )
    if guess.prefixed:
        _refuse_gap(columns.observations, OBSERVATIONS)
    _refuse_gap(columns.actions, ACTIONS)


def unclear_columns(
    columns: Sequence[str],
    names: Sequence[str],
    what: str = "whether it is a feature",
    roles: Sequence[str] = (),
) -> UnclearColumnsError:
    """The error for columns that may be features or not.

    Args:
        columns: One or more.
        names: All columns.
        what: Is unclear of one.
        roles: That it may have; () for what its name suggests.

    Returns:
        An error that names them and says what to do.
    """
    sentence = (
        f"it is unclear of the column {columns[0]!r} {what}"
        if len(columns) == 1
        else f"it is unclear whether the columns {listed(columns)} are features"
    )
    acted = vocabulary.ends_as_action(columns[0]) or stripped(columns[0], ACTIONS) is not None
    cure = settled_by(columns[0], *(roles or (("feature", "ignore"), ("action", "feature"))[acted]))
    return UnclearColumnsError(columns, f"{sentence}, among {listed(names)}; {cure}")


def guess_notes(guess: Guess) -> tuple[str, ...]:
    """Sentences on what was guessed.

    Args:
        guess: As it was settled.

    Returns:
        On features without a word for observations, an action called by a letter, and columns that
        are not used.
    """
    notes = []
    columns = guess.columns
    guessed = [name for name in columns.observations if name not in guess.roles]
    if guessed and not guess.prefixed:
        one = len(guessed) == 1
        notes.append(
            f"the column{'' if one else 's'} {listed(guessed)} "
            f"{'was' if one else 'were'} taken as observations"
        )
    letters = [name for name in (*columns.actions, columns.reward) if name and len(name) == 1]
    for name in letters:
        if name in guess.roles:
            continue
        what = "reward" if name == columns.reward else "action"
        notes.append(f"the column {name!r} was taken as the {what}")
    by_reason: dict[str, list[str]] = {}
    for name, why in guess.unused.items():
        if name not in guess.roles and not vocabulary.numbers_rows(name):
            by_reason.setdefault(why, []).append(name)
    for why, left in by_reason.items():
        one = len(left) == 1
        note = f"the column{'' if one else 's'} {listed(left)} {'was' if one else 'were'} not used"
        notes.append(note if why == NO_OBSERVATION else f"{note}: {why}")
    return tuple(notes)


def feature_names(columns: Sequence[str]) -> tuple[str, ...] | None:
    """What columns say the features are called; None where they only count them."""
    names = [_own_name(column, OBSERVATIONS) for column in columns]
    return None if all(name.isdecimal() for name in names) else tuple(names)


def action_names(columns: Sequence[str]) -> tuple[str, ...] | None:
    """What columns say the action dimensions are called; None where they only count them."""
    if len(columns) == 1 and columns[0].strip().lower() in SINGLE_ACTION:
        return None
    names = [_own_name(column, ACTIONS) for column in columns]
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
    every = list(map(quoted, names))
    lengths = accumulate(map(len, every))
    first = every[: max(1, min(limit, sum(length <= _LONGEST_LIST for length in lengths)))]
    left = len(every) - len(first)
    return ", ".join(first) + (f" and {left:,} more" if left else "")


def _actions(names: Sequence[str]) -> tuple[str, ...]:
    by_name = {plain(name): name for name in reversed(names)}
    elsewhere = [word for word in by_name if vocabulary.ACTION_ELSEWHERE.fullmatch(word)]
    single = (*SINGLE_ACTION[:-1], *elsewhere, *SINGLE_ACTION[-1:])
    alone = next((by_name[word] for word in single if word in by_name), None)
    letter = alone is not None and plain(alone) == "a"
    if alone is not None and not letter:
        return (alone,)
    several = tuple(name for name in names if stripped(name, ACTIONS) is not None) or tuple(
        name for name in names if re.fullmatch(r"a[ _]?\d+", name.strip(), re.I)
    )
    named = tuple(name for name in names if vocabulary.ends_as_action(name))
    if several or (named and len(named) == 1):
        return several or named
    return (alone,) if alone is not None and not named else ()


def _singles(names: Sequence[str], said: Mapping[str, str]) -> dict[str, str]:
    """The first column for each role of which nothing was said; another one is no second."""
    by_role: dict[str, str] = {}
    for role, patterns in vocabulary.ROLES.items():
        if role in said:
            continue
        free = [name for name in names if name not in by_role.values()]
        name = vocabulary.first_of(free, patterns)
        if name is not None:
            by_role[role] = name
    return by_role


def _why_unused(name: str, names: Sequence[str]) -> str | None:
    """Why a column whose name says so is nothing that is read."""
    word = plain(name)
    if vocabulary.ROW_NUMBERS.fullmatch(word):
        return "it has no name" if vocabulary.UNNAMED.fullmatch(word) else "it numbers the rows"
    if vocabulary.TIMES.fullmatch(word):
        return IS_TIME
    if vocabulary.BOOKKEEPING.fullmatch(word):
        return "it is no part of a state"
    roles = (
        role
        for role, all_of in vocabulary.ROLES.items()
        for one in all_of
        if re.fullmatch(one, word)
    )
    role = next(roles, None)
    if role is not None and len(word) > 1:
        return f"another column is the {ROLE_WORDS[role]}"
    follows = vocabulary.next_states(names).get(name)
    if follows is not None and stripped(name, PLAIN_OBSERVATIONS) is None:
        return f"it holds the next {follows!r}"
    return None


def _likeliest_action(guess: Guess, names: Sequence[str]) -> str:
    """The column to name in a sentence where no name says that it is the action."""
    others = [name for name in names if name not in guess.columns.singles.values()]
    return (vocabulary.likely_actions(others) or others or list(names))[-1]


def _unclear(name: str) -> bool:
    """Whether a column may be something else than a feature."""
    return (
        vocabulary.UNCLEAR.fullmatch(plain(name)) is not None
        or stripped(name, ACTIONS) is not None
        or vocabulary.ends_as_action(name)
        or vocabulary.only_next(name)
    )


def _bare(name: str) -> bool:
    """Whether a name is a word for observations and nothing more."""
    return re.fullmatch(OBSERVATIONS, name.strip(), re.I) is not None


def _textbook(guess: Guess) -> bool:
    """Whether other columns speak of the same notation as "r" and "a" do."""
    columns = guess.columns
    ends = (columns.terminated, columns.truncated, columns.first, columns.last)
    states = map(vocabulary.is_state_word, columns.observations)
    return guess.prefixed or any(ends) or only_counted(columns.observations) or all(states)


def _own_name(column: str, prefixes: str) -> str:
    rest = stripped(column, prefixes)
    return column if rest is None else rest


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
        counted = [rest for rest in rests if rest is not None and re.fullmatch(r"\d{1,9}", rest)]
        return [int(rest) for rest in counted] if len(counted) == len(columns) else None
    matches = [_NUMBERED.fullmatch(column) for column in columns]
    numbered = [match for match in matches if match is not None]
    if len(numbered) < len(columns) or len({match[1] for match in numbered}) != 1:
        return None
    return [int(match[2]) for match in numbered]
