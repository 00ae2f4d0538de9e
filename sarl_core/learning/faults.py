"""An environment that fails while somebody learns in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium

from sarl_core.environments.imports import reason
from sarl_core.errors import InputError


class EnvironmentFaultError(InputError):
    """An environment raised in the middle of learning.

    Attributes:
        step: Of its episode; None where none could begin.
        reason: What it raised.
    """

    def __init__(self, step: int | None, error: Exception) -> None:
        """Know where it was."""
        self.step, self.reason = step, reason(error)
        super().__init__(f"the environment failed ({self.reason})")

    def sentence(self, env_id: str, episode: int) -> str:
        """What is to be said.

        Args:
            env_id: Environment.
            episode: How many had ended.

        Returns:
            Where it failed, and what becomes of what was learned.
        """
        where = "at its start" if self.step is None else f"at step {self.step}"
        return (
            f"{env_id} failed in episode {episode} while learning, {where} ({self.reason}); mend "
            "the environment or its wrapper, or choose another; what was learned before is kept"
        )


class WatchedEnvironment(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Tells faults of an environment from those of whoever learns in it."""

    def reset(self, **options: Any) -> Any:
        """See `gymnasium.Env.reset`.

        Raises:
            EnvironmentFaultError: If the environment raises.
        """
        self._step = 0
        return self._called(None, self.env.reset, **options)

    def step(self, action: Any) -> Any:
        """See `gymnasium.Env.step`.

        Raises:
            EnvironmentFaultError: If the environment raises.
        """
        outcome = self._called(self._step, self.env.step, action)
        self._step += 1
        return outcome

    def _called(
        self, step: int | None, function: Callable[..., Any], *values: Any, **named: Any
    ) -> Any:
        try:
            return function(*values, **named)
        except InputError:  # says already what is wrong
            raise
        except Exception as error:  # the caller's own code, which may raise anything
            raise EnvironmentFaultError(step, error) from error
