"""Which environment is meant: its id, what it is made with, and what is put around it."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

from sarl_core.documents import parse_json
from sarl_core.errors import InputError, quoted, require

_EXAMPLE = "'{\"g\": 3.7}'"


@dataclass(frozen=True)
class Environment:
    """An environment with its arguments and wrappers; where an id alone is meant, a text does.

    It names code to import, so it comes from a command line, from Python, or from the list of
    whoever runs a server, and never from a file or a link. It is small and goes to other
    processes as it is. Its text is its id:

    >>> moon = Environment("Pendulum-v1", '{"g": 1.6}', ("gymnasium.wrappers:FlattenObservation",))
    >>> str(moon)
    'Pendulum-v1'

    Attributes:
        id: What ``gymnasium.make`` takes, ``module:Id`` included.
        arguments: What it is made with besides, as the JSON text of an object; given in any form,
            it is kept in one.
        wrappers: What is put around it, the innermost first, each ``module:name`` of a
            ``gymnasium.Wrapper`` class or of a function that takes an environment and gives one.
        failure: What a failure is in it; "" for what is known of it.
        cost: What its steps cost; "" for what it says itself.
    """

    id: str
    arguments: str = "{}"
    wrappers: tuple[str, ...] = ()
    failure: str = ""
    cost: str = ""

    def __post_init__(self) -> None:
        """Bring the arguments into one form.

        Raises:
            InputError: If they are no JSON object, or a wrapper is no text.
        """
        require(self.id, str, "the environment must be text", "give its id, as 'CartPole-v1'")
        require(self.arguments, str, "the arguments must be JSON text", f"write {_EXAMPLE}")
        object.__setattr__(self, "arguments", _canonical(self.arguments))
        object.__setattr__(self, "wrappers", tuple(self.wrappers))
        for wrapper in self.wrappers:
            require(wrapper, str, "a wrapper must be text", "give module:name")

    def __str__(self) -> str:
        """Its id."""
        return self.id

    @property
    def key(self) -> str:
        """A text that tells it from all others; of one that is nothing but an id, that id."""
        others = [getattr(self, part.name) for part in fields(self)[1:]]
        return self.id if self == Environment(self.id) else json.dumps([self.id, *others])

    @property
    def options(self) -> dict[str, str | tuple[str, ...] | None]:
        """What a command line says of it; None where nothing has to be said."""
        return {
            "--env": self.id,
            "--env-args": self.arguments if self.arguments != "{}" else None,
            "--wrapper": self.wrappers or None,
            "--failure": self.failure or None,
            "--cost": self.cost or None,
        }

    @property
    def words(self) -> tuple[str, ...]:
        """The same, word by word."""
        words: list[str] = []
        for name, value in self.options.items():
            for one in [value] if isinstance(value, str) else value or ():
                words += [name, one]
        return tuple(words)

    @property
    def keywords(self) -> dict[str, Any]:
        """The arguments, as ``gymnasium.make`` takes them."""
        return dict(parse_json(self.arguments))


EnvironmentOrId: TypeAlias = str | Environment
"""Whatever makes, describes or plays an environment takes one; a text means just that id."""


def as_environment(environment: EnvironmentOrId) -> Environment:
    """An environment by its id, or as it is.

    Args:
        environment: Either.

    Returns:
        The environment.

    Raises:
        InputError: If it is neither.
    """
    return environment if isinstance(environment, Environment) else Environment(environment)


def with_time_limit(environment: EnvironmentOrId, steps: int) -> Environment:
    """The same environment, whose episodes end after other many steps.

    Args:
        environment: Of any time limit, or none.
        steps: Its new one.

    Returns:
        The environment.
    """
    environment = as_environment(environment)
    arguments = environment.keywords | {"max_episode_steps": steps}
    return replace(environment, arguments=json.dumps(arguments))


def _canonical(arguments: str) -> str:
    try:
        document = parse_json(arguments)
    except ValueError as error:
        raise InputError(
            f"the arguments of the environment, {quoted(arguments)}, are no JSON ({error}); "
            f"write an object, as {_EXAMPLE}"
        ) from error
    if not isinstance(document, dict):
        raise InputError(
            f"the arguments of the environment, {quoted(arguments)}, are JSON but no object; "
            f"write names and values, as {_EXAMPLE}"
        )
    return json.dumps(document, sort_keys=True)
