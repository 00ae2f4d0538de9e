"""What whoever runs a dashboard offers its visitors: environments and agents of their own.

They name code to import. So they come from the owner's command line or settings file alone, and go
to the server's process in one of its environment variables.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from sarl_core.documents import conformed, parse_json
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError

VARIABLE = "SARL_APP_OFFERS"
"""The environment variable of the server's process."""

_TAKEN = ("novice", "untrained", "expert", "own file", "shipped", "nobody", "")


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
