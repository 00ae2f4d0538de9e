"""The file that whoever runs a dashboard writes: what visitors may use, and how much of it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from sarl_core.agents.offers import Offers
from sarl_core.documents import MisfitError, conformed, parse_json
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError
from sarl_core.limits import limited_bytes
from sarl_core.serving.limits import ServerLimits

VARIABLE = "SARL_SETTINGS"
"""The environment variable that names the file where the command line does not."""

_ADVICE = "write environments with an id each, agents by name, and limits, as the guide shows"
_TABLE = re.compile(r"\s*(\[\[?)\s*([\w.-]+)\s*\]")


@dataclass(frozen=True)
class ServerSettings:
    """What a settings file says.

    Attributes:
        offers: What visitors may use besides what is shipped.
        limits: How much they may ask for.
        for_many: Whether it names limits, which one person alone does not need.
    """

    offers: Offers = field(default_factory=Offers)
    limits: ServerLimits = field(default_factory=ServerLimits)
    for_many: bool = False


class _Environment(msgspec.Struct, forbid_unknown_fields=True):
    id: str
    arguments: dict[str, Any] = {}
    wrappers: list[str] = []
    failure: str = ""
    cost: str = ""


class _Settings(msgspec.Struct, forbid_unknown_fields=True):
    environments: list[_Environment] = []
    agents: dict[str, str] = {}
    limits: ServerLimits = ServerLimits()


def read_settings(path: Path) -> ServerSettings:
    """Read a settings file.

    Args:
        path: A ``.toml`` or ``.json`` file with `environments`, a list of tables (`id`, and if
            needed `arguments`, `wrappers`, `failure`, `cost`), `agents`, a table of names and
            ``module:name``, and `limits`, a table of what `ServerLimits` has.

    Returns:
        What it says.

    Raises:
        InputError: If it cannot be read, or holds something else; the sentence names the line.
    """
    text = ""
    try:
        content = limited_bytes(path)
        document: Any
        if path.suffix.lower() == ".toml":
            text = content.decode()
            document = tomllib.loads(text)
        else:
            document = parse_json(content)
            text = content.decode()
        settings = conformed(document, _Settings)
        limits = _with_room_for_others(settings.limits, document)
    except MisfitError as error:
        line = _line_of(text, error)
        where = f"{path}, line {line}" if line else f"{path}"
        raise InputError(f"{where}: {error}; {_ADVICE}") from error
    except (OSError, ValueError, InputError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(f"the settings {path} cannot be read ({reason}); {_ADVICE}") from error
    offers = Offers(
        tuple(
            Environment(
                one.id,
                json.dumps(one.arguments, default=str),
                tuple(one.wrappers),
                one.failure,
                one.cost,
            )
            for one in settings.environments
        ),
        tuple(settings.agents.items()),
    )
    return ServerSettings(offers, limits, for_many="limits" in document)


def _with_room_for_others(limits: ServerLimits, document: Mapping[str, Any]) -> ServerLimits:
    """Limits by which one visitor alone cannot hold all there is.

    Where `jobs_each` is not said it is the usual one, or as many as leave a place.
    """
    if limits.jobs_each < limits.jobs or limits.jobs == 1:
        return limits
    if "jobs_each" not in document["limits"]:
        return msgspec.structs.replace(limits, jobs_each=limits.jobs - 1)
    raise MisfitError(
        f"'jobs_each' is {limits.jobs_each} and 'jobs' is {limits.jobs}; so that one visitor "
        "cannot hold all of them, 'jobs_each' has to be less",
        "limits",
    )


def _line_of(text: str, error: MisfitError) -> int:
    """Where in a file that stands which is wrong, counted from 1; 0 where nobody can say."""
    named = re.match(r"['\"]?([\w.-]+)", error.what)
    if named is None:
        return 0
    key = re.compile(rf"""\s*["']?{re.escape(named[1])}["']?\s*[=:]""")
    table, places = "", dict[str, int]()
    wanted = error.place[0] if error.place else ""
    loose = 0
    for number, line in enumerate(text.splitlines(), start=1):
        header = _TABLE.match(line)
        if header is not None:
            name = header[2].split(".")[0]
            if header[1] == "[[":
                places[name] = places.get(name, 0) + 1
            table = f"{name} {places[name]}" if name in places else name
            if not wanted and header[2] == named[1]:
                return number
        elif key.match(line):
            if table == wanted:
                return number
            loose = loose or number
    return loose
