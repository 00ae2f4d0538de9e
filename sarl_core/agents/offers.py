"""What whoever runs a dashboard offers its visitors: environments and agents of their own.

They name code to import. So they come from the owner's command line or settings file alone, and go
to the server's process in one of its environment variables.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import msgspec

from sarl_core.documents import MisfitError, conformed, parse_json
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError
from sarl_core.limits import limited_bytes

VARIABLE = "SARL_APP_OFFERS"
"""The environment variable of the server's process."""

_TAKEN = ("novice", "untrained", "expert", "own file", "shipped", "nobody", "")
_ADVICE = "write environments with an id each, and agents by name, as the guide shows"


@dataclass(frozen=True)
class Offers:
    """Environments and agents that visitors may use besides those that are shipped.

    Attributes:
        environments: Each of another id.
        agents: A name on screen and ``module:name``, for each.
    """

    environments: tuple[Environment, ...] = ()
    agents: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        """Refuse what could not be told apart.

        Raises:
            InputError: If two have the same id or name.
        """
        names = [environment.id for environment in self.environments]
        for what, several in (("environment", names), ("agent", [one for one, _ in self.agents])):
            twice = next((name for name in several if several.count(name) > 1), None)
            if twice is not None:
                raise InputError(f"the {what} {twice!r} is offered twice; leave one out")
        taken = next((name for name, _ in self.agents if name in _TAKEN), None)
        if taken is not None:
            raise InputError(f"there is an agent {taken!r} already; give yours another name")

    def environment(self, env_id: str) -> Environment | None:
        """The offered environment of an id, with or without the module that registers it.

        Args:
            env_id: From a visitor: typed, in a link, or in a file.

        Returns:
            None where it is not offered.
        """
        exact = [one for one in self.environments if one.id == env_id]
        alike = [one for one in self.environments if one.id.rsplit(":", 1)[-1] == env_id]
        return next(iter(exact or (alike if len(alike) == 1 else [])), None)

    def to_text(self) -> str:
        """What `from_text` reads."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> Offers:
        """Read what `to_text` wrote; nothing is offered by an empty text."""
        return conformed(parse_json(text), cls) if text else cls()

    @classmethod
    def of_process(cls) -> Offers:
        """What this process, a dashboard's, was started with."""
        return cls.from_text(os.environ.get(VARIABLE, ""))


class _Environment(msgspec.Struct, forbid_unknown_fields=True):
    id: str
    arguments: dict[str, Any] = {}
    wrappers: list[str] = []
    failure: str = ""
    cost: str = ""


class _Settings(msgspec.Struct, forbid_unknown_fields=True):
    environments: list[_Environment] = []
    agents: dict[str, str] = {}


def read_offers(path: Path) -> Offers:
    """Read a settings file.

    Args:
        path: A ``.toml`` or ``.json`` file with `environments`, a list of tables (`id`, and if
            needed `arguments`, `wrappers`, `failure`, `cost`), and `agents`, a table of names and
            ``module:name``.

    Returns:
        What it offers.

    Raises:
        InputError: If it cannot be read, or holds something else.
    """
    try:
        content = limited_bytes(path)
        document: Any
        if path.suffix.lower() == ".toml":
            document = tomllib.loads(content.decode())
        else:
            document = parse_json(content)
        settings = conformed(document, _Settings)
    except MisfitError as error:
        raise InputError(f"{path}: {error}; {_ADVICE}") from error
    except (OSError, ValueError, InputError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(f"the settings {path} cannot be read ({reason}); {_ADVICE}") from error
    return Offers(
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


def named_agents(texts: Sequence[str]) -> Mapping[str, str]:
    """Agents as a command line names them.

    Args:
        texts: Each ``NAME=module:name``.

    Returns:
        ``module:name`` by name.

    Raises:
        InputError: If one is not of that form, or two have one name.
    """
    agents: dict[str, str] = {}
    for text in texts:
        name, sign, spec = (part.strip() for part in text.partition("="))
        if not (name and sign and ":" in spec):
            raise InputError(f"the agent {text!r} must be NAME=module:name; write it so")
        if name in agents:
            raise InputError(f"the agent {name!r} is offered twice; leave one out")
        agents[name] = spec
    return agents
