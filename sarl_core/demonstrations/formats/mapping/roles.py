"""What a person says of columns: on the command line, in a file, on the page or in Python."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast, get_args

from msgspec import Struct

from sarl_core.decimals import decimal_text
from sarl_core.documents import MisfitError, Number, conformed, read_object
from sarl_core.errors import InputError, quoted
from sarl_core.files import whole_file

RoleName = Literal[
    "feature",
    "action",
    "episode",
    "step",
    "reward",
    "terminated",
    "truncated",
    "first",
    "last",
    "time",
    "ignore",
]
ROLE_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "feature": "feature",
        "action": "action",
        "episode": "episode number",
        "step": "step number",
        "reward": "reward",
        "terminated": "end of an episode (by itself)",
        "truncated": "end of an episode (by a limit)",
        "first": "beginning of an episode",
        "last": "end of an episode",
        "time": "time",
        "ignore": "not used",
    }
)
SECONDS: Mapping[str, float] = MappingProxyType(
    {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
)
"""How long the units of times are."""
ActionKind = Literal["labels", "continuous"]
UNCLEAR = "unclear"
"""What stands in a suggestion where two readings are possible."""
TOGETHER = "+"
"""Between columns that are one action together."""
_CALLED = " as "
"""Between what a column is and what it is to be called."""
_GRAMMAR = (
    "write NAME=ROLE with one of the roles "
    f"{', '.join(get_args(RoleName))}; a feature may have a unit (speed=feature:m/s), and a time "
    "(t=time:ms), and an action may be labels or continuous with or without bounds "
    "(throttle=action:continuous:0:100); what rules call it may stand behind it (v=feature as own "
    "speed)"
)
_MOST_OFFERED = 3  # columns of which a sentence says what to do
_FORMAT, _VERSION = "sarl-columns", 1


@dataclass(frozen=True)
class ColumnRole:
    """What one column is.

    Attributes:
        role: What it holds; what is to be ignored is not read.
        unit: Of a feature, or what a time is counted in; "" where there is none.
        kind: Whether an action is labels or an amount; None to go by its values.
        low: Lower bound of a continuous action; None to go by its values.
        high: Upper bound, likewise.
        name: Of the feature or the action; "" for the column's own.

    Raises:
        InputError: If that does not go together.
    """

    role: RoleName
    unit: str = ""
    kind: ActionKind | None = None
    low: float | None = None
    high: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if self.name and self.role not in ("feature", "action"):
            raise InputError(
                f"a column that is {self.role!r} has no other name here; only a feature and an "
                "action do, so leave the name out"
            )
        if self.unit and self.role not in ("feature", "time"):
            raise InputError(f"a column that is {self.role!r} has no unit here; leave the unit out")
        if self.unit and self.role == "time" and self.unit not in SECONDS:
            raise InputError(
                f"{quoted(self.unit)} is no unit of a time here; write one of {', '.join(SECONDS)}"
            )
        if (self.kind is not None or self.low is not None) and self.role != "action":
            raise InputError(
                f"a column that is {self.role!r} is neither labels nor continuous; only an action "
                "is, so leave that out"
            )
        if (self.low is None) != (self.high is None):
            raise InputError("an action has one bound; give both, the least and the greatest")
        if self.low is None or self.high is None:
            return
        if self.kind != "continuous":
            raise InputError("only a continuous action has bounds; write continuous before them")
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"the bounds of an action must be two numbers, the lower one first, not "
                f"{self.low:g} and {self.high:g}"
            )

    def __str__(self) -> str:
        """As it is written after ``--column NAME=``."""
        bounds = [decimal_text(one) for one in (self.low, self.high) if one is not None]
        text = ":".join([self.role, *filter(None, (self.unit, self.kind)), *bounds])
        return f"{text}{_CALLED}{self.name}" if self.name else text


Roles = Mapping[str, ColumnRole]


def role_from_text(text: str) -> ColumnRole:
    """Read what ``--column NAME=`` is followed by.

    Args:
        text: As "episode", "feature:m/s", "action:labels", "action:continuous:0:100",
            "feature:m/s as own speed".

    Returns:
        The role.

    Raises:
        InputError: If it is none.
    """
    said, _, name = text.strip().partition(_CALLED)
    name = name.strip()
    role, *more = said.split(":")
    role = role.strip().lower()
    if role not in ROLE_WORDS:
        raise InputError(f"{quoted(role)} is no role of a column; {_GRAMMAR}")
    if role in ("feature", "time"):
        return ColumnRole(cast("RoleName", role), unit=":".join(more).strip(), name=name)
    fits = not more or (role == "action" and len(more) in (1, 3))
    kind = more[0].strip().lower() if more else None
    if not fits or kind not in (None, *get_args(ActionKind)):
        raise InputError(f"{quoted(text)} is no role of a column; {_GRAMMAR}")
    try:
        bounds = [float(bound) for bound in more[1:]]
    except ValueError:
        raise InputError(f"{quoted(text)} has bounds that are no numbers; {_GRAMMAR}") from None
    low, high = bounds or (None, None)
    return ColumnRole(cast("RoleName", role), "", cast("ActionKind | None", kind), low, high, name)


def roles_from_options(options: Iterable[str]) -> dict[str, ColumnRole]:
    """Read the options ``--column``.

    Args:
        options: Each as "NAME=ROLE".

    Returns:
        What is said of each column.

    Raises:
        InputError: If one is something else, or two speak of one column.
    """
    roles: dict[str, ColumnRole] = {}
    for option in options:
        name, sign, text = option.rpartition("=")
        if not sign or not name:
            raise InputError(f"--column {quoted(option)} has no name or no role; {_GRAMMAR}")
        if name in roles:
            raise InputError(f"--column says twice what {quoted(name)} is; say it once")
        roles[name] = role_from_text(text)
    return roles


def names_in(roles: Roles) -> dict[str, str]:
    """What features and actions are to be called, by their columns; only those that were named."""
    return {column: role.name for column, role in roles.items() if role.name}


def as_options(roles: Roles) -> list[str]:
    """Roles as ``--column`` takes them."""
    return [f"{name}={role}" for name, role in roles.items()]


def as_roles(given: Mapping[str, ColumnRole | str]) -> dict[str, ColumnRole]:
    """Roles of which some may be written as after ``--column NAME=``.

    Args:
        given: For each column its role.

    Returns:
        The same as roles.

    Raises:
        InputError: If one is none.
    """
    return {
        name: role_from_text(role) if isinstance(role, str) else role
        for name, role in given.items()
    }


class _Role(Struct, forbid_unknown_fields=True):
    role: Literal[RoleName, "unclear"]
    unit: str = ""
    kind: ActionKind | None = None
    low: Number | None = None
    high: Number | None = None
    name: str = ""
    why: str = ""


class _File(Struct, forbid_unknown_fields=True):
    format: Literal["sarl-columns"]
    version: Literal[1]
    columns: dict[str, Any]


def load_roles(path: Path) -> dict[str, ColumnRole]:
    """Read a file that says what columns are.

    Args:
        path: JSON, as `save_roles` writes it.

    Returns:
        What is said of each column.

    Raises:
        InputError: If it is no such file, or leaves open what a column is.
    """
    advice = "write one with `check FILE --suggest-columns COLUMNS.json` and edit it"
    document = read_object(path, advice)
    roles: dict[str, ColumnRole] = {}
    try:
        for name, value in conformed(document, _File).columns.items():
            try:
                if isinstance(value, str) and value != UNCLEAR:
                    roles[name] = role_from_text(value)
                    continue
                said = conformed({"role": value} if value == UNCLEAR else value, _Role)
                if said.role == UNCLEAR:
                    raise InputError(
                        "it is left open what it is; write one of the roles "
                        f"{', '.join(get_args(RoleName))}"
                    )
                roles[name] = ColumnRole(
                    cast("RoleName", said.role),
                    said.unit,
                    said.kind,
                    said.low,
                    said.high,
                    said.name.strip(),
                )
            except MisfitError as error:
                raise MisfitError(f"of the column {quoted(name)} {error}") from error
            except InputError as error:
                raise InputError(f"of the column {quoted(name)}: {error}") from error
    except MisfitError as error:
        raise InputError(f"{path}: {error}; {advice}") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return roles


def save_roles(
    path: Path, roles: Mapping[str, ColumnRole | None], reasons: Mapping[str, str]
) -> None:
    """Write a file that says what columns are, for a person to edit.

    Args:
        path: Where to.
        roles: For each column of a table, None where two readings are possible.
        reasons: Why, in words; nobody reads them again.

    Raises:
        InputError: If it cannot be written.
    """
    with whole_file(path) as unfinished:
        unfinished.write_text(roles_document(roles, reasons), encoding="utf-8")


def roles_document(roles: Mapping[str, ColumnRole | None], reasons: Mapping[str, str]) -> str:
    """What `load_roles` reads; arguments as of `save_roles`."""
    columns = {
        name: {"role": UNCLEAR}
        if role is None
        else {key: value for key, value in vars(role).items() if value not in (None, "")}
        for name, role in roles.items()
    }
    for name, entry in columns.items():
        if reasons.get(name):
            entry["why"] = reasons[name]
    document = {"format": _FORMAT, "version": _VERSION, "columns": columns}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def require_known(roles: Roles, names: Sequence[str]) -> None:
    """Refuse what is said of a column that a table does not have, or twice of one role or name.

    Args:
        roles: What was said.
        names: The columns of the table.

    Raises:
        InputError: With the name.
    """
    missing = next((name for name in roles if name not in names), None)
    if missing is not None:
        listed = ", ".join(map(quoted, names[:12])) + (", …" if len(names) > 12 else "")
        raise InputError(f"there is no column {quoted(missing)} among {listed}; name one of those")
    single: dict[str, str] = {}
    named: dict[tuple[str, str], str] = {}
    for name, one in roles.items():
        if one.name:
            if (one.role, one.name) in named:
                raise InputError(
                    f"{quoted(named[one.role, one.name])} and {quoted(name)} are both said to be "
                    f"the {one.role} {quoted(one.name)}; choose one"
                )
            named[one.role, one.name] = name
            if one.name in names and one.name not in roles:
                raise InputError(
                    f"{quoted(name)} is said to be the {one.role} {quoted(one.name)}, and there is "
                    f"a column of that name; say what that one is, as with --column "
                    f"{shlex.quote(f'{one.name}=ignore')}"
                )
        if one.role in ("feature", "action", "time", "ignore"):
            continue
        if one.role in single:
            raise InputError(
                f"{quoted(single[one.role])} and {quoted(name)} are both said to be the "
                f"{ROLE_WORDS[one.role]}; choose one"
            )
        single[one.role] = name


def settled_by(columns: str | Sequence[str], *roles: str) -> str:
    """What to do where it is unclear what a column is.

    Args:
        columns: The column, or several of which each may have the role.
        roles: That it may have.

    Returns:
        The end of a sentence.
    """
    names = [columns] if isinstance(columns, str) else columns[:_MOST_OFFERED]
    options = " or ".join(
        f"--column {shlex.quote(f'{name}={role}')}" for name in names for role in roles
    )
    return f"say which with {options} (on the page Demonstrations: in the form)"
