"""An agent of the caller's own: a function, a scripted expert, a model with a memory.

It may remember, hold a connection, or be no thing that travels to other processes. So it plays in
this process, one episode after the other and one state at a time: what it does cannot depend on
what runs beside it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.agents.spaces import Actions
from sarl_core.environments.description import EnvironmentDescription, describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.imports import named_object, reason
from sarl_core.errors import InputError
from sarl_core.mining.language import counted

_ADVICE = (
    "give a function that takes observations (B, d) and gives B actions, an object with predict, "
    "or a class or function without arguments that makes one"
)


class AgentFaultError(InputError):
    """An agent of the caller's own failed, or gave what is no action."""


class OwnAgent:
    """A function from states to actions, or an object with `predict`, as an `Agent`.

    An object with `reset` is reset when an episode begins. One with ``predict(observation, state,
    episode_start)``, as a RecurrentPPO of sb3-contrib has, is handed the state that it gave before.

    Attributes:
        name: What it is called on screen.
        n_uniforms: 0: whatever chance it needs is its own.
        remembers: Whether what it does may hang on the states before.
    """

    n_uniforms = 0

    def __init__(
        self, name: str, chooser: Any, env_id: EnvironmentOrId, *, stochastic: bool = False
    ) -> None:
        """Know how it is asked, and what it may answer.

        Args:
            name: What it is called on screen.
            chooser: The function or object.
            env_id: Where it acts.
            stochastic: Whether an object that can be sampled is.

        Raises:
            InputError: If it is neither, or is to be sampled and cannot be.
        """
        self.name = name
        self._predict: Callable[..., Any] | None = getattr(chooser, "predict", None)
        if not callable(self._predict) and not callable(chooser):
            raise InputError(
                f"the agent {name} is of type {type(chooser).__name__}, which chooses no actions; "
                f"{_ADVICE}"
            )
        self._chooser, self._described = chooser, describe_environment(env_id)
        self._reset: Callable[[], Any] | None = getattr(chooser, "reset", None)
        self._space = getattr(chooser, "observation_space", None)
        self.remembers = self._predict is not None or self._reset is not None
        self._takes = frozenset() if self._predict is None else _parameters(self._predict)
        if stochastic and "deterministic" not in self._takes:
            raise InputError(
                f"the agent {name} has no predict(..., deterministic), so it cannot be told to "
                "sample; leave out --stochastic"
            )
        self._stochastic = stochastic
        self._state: Any = None
        self._begins = True

    def begin_episode(self, seed: int) -> None:
        """Forget what was before.

        Args:
            seed: Of the episode: one that is sampled draws by it, where it can be told to.

        Raises:
            AgentFaultError: If its `reset` fails.
        """
        self._state, self._begins = None, True
        if self._stochastic and hasattr(self._chooser, "set_random_seed"):
            self._chooser.set_random_seed(seed)
        if self._reset is not None:
            self._called(self._reset)

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """See `Agent.act`; one that remembers takes the states of one episode, in their order.

        Raises:
            AgentFaultError: If it fails, or gives what is no action of the environment.
        """
        if self.remembers and len(observations) > 1:
            return np.concatenate([self.act(row[None], uniforms) for row in observations])
        handed = observations.copy()  # what it does to it stays its own
        if self._predict is None:
            chosen = self._called(self._chooser, handed)
        else:
            ways = {
                "state": self._state,
                "episode_start": np.array([self._begins]),
                "deterministic": not self._stochastic,
            }
            chosen = self._called(
                self._predict,
                _in_space(self._space, handed),
                **{name: value for name, value in ways.items() if name in self._takes},
            )
            if isinstance(chosen, tuple) and len(chosen) == 2:
                chosen, self._state = chosen
        self._begins = False
        return _columns(chosen, len(observations), self._described, self.name)

    def _called(self, function: Callable[..., Any], *values: Any, **named: Any) -> Any:
        try:
            return function(*values, **named)
        except (Exception, SystemExit) as error:  # the caller's own code, which may raise anything
            raise AgentFaultError(
                f"the agent {self.name} raised {reason(error)}; mend it"
            ) from error


def is_own(spec: str) -> bool:
    """Whether a text is `module:name`, both of them as Python writes names.

    Args:
        spec: Of the caller's own command line.

    Returns:
        False of a path, a Windows drive among them, and of what the library keeps (`library:ID`).
    """
    module, colon, name = spec.partition(":")
    return (
        bool(colon)
        and module != "library"
        and all(part.isidentifier() for part in (*module.split("."), *name.split(".")))
    )


def own_agent(spec: str, env_id: EnvironmentOrId, *, stochastic: bool = False) -> Agent:
    """Make the agent that the caller named as `module:name`; this imports the module.

    Args:
        spec: Of the caller's own command line or of the server owner's list, and of nowhere else.
        env_id: Where it acts.
        stochastic: Whether an object that can be sampled is.

    Returns:
        The agent; its name is `spec`.

    Raises:
        InputError: If it cannot be imported or made, or is nothing that chooses actions.
    """
    thing = named_object(spec, "the agent")
    if inspect.isclass(thing) or (callable(thing) and _makes(thing)):
        try:
            thing = thing()
        except (Exception, SystemExit) as error:  # the caller's own code, which may raise anything
            raise InputError(
                f"the agent {spec} cannot be made ({reason(error)}); mend it, or name what "
                "needs no arguments"
            ) from error
    if isinstance(thing, Agent):
        return thing
    return OwnAgent(spec, thing, env_id, stochastic=stochastic)


def _makes(thing: Callable[..., Any]) -> bool:
    """Whether it takes nothing, so that it makes an agent and is none."""
    if hasattr(thing, "predict") or hasattr(thing, "reset"):
        return False
    try:
        parameters = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):  # of what is written in C, nothing is known
        return False
    return all(
        one.default is not one.empty or one.kind in (one.KEYWORD_ONLY, one.VAR_KEYWORD)
        for one in parameters
    )


def _parameters(predict: Callable[..., Any]) -> frozenset[str]:
    """Which of the ways to ask it knows."""
    ways = frozenset(("state", "episode_start", "deterministic"))
    try:
        parameters = inspect.signature(predict).parameters.values()
    except (TypeError, ValueError):
        return ways
    if any(one.kind is one.VAR_KEYWORD for one in parameters):
        return ways
    return ways & {one.name for one in parameters}


def _in_space(space: Any, rows: NDArray[np.float32]) -> Any:
    """One flat state in the form that a model was trained on, as a batch of one."""
    from gymnasium import spaces

    if not isinstance(space, spaces.Space) or space.shape == rows.shape[1:]:
        return rows
    if spaces.utils.flatdim(space) != rows.shape[1]:
        return rows  # the model says what it wants
    one = spaces.utils.unflatten(space, rows[0])
    if isinstance(one, dict):
        return {name: np.asarray(value)[None] for name, value in one.items()}
    return np.asarray(one)[None]


def _columns(
    chosen: Any, count: int, environment: EnvironmentDescription, name: str
) -> NDArray[np.int64] | NDArray[np.float32]:
    """Actions with one column a dimension, or an error of one sentence."""
    m = len(environment.action_names)
    wanted = (count,) if environment.action_shape == () else (count, *environment.action_shape)
    advice = f"give numbers of shape {wanted}, one action for {counted(count, 'state')}"
    try:
        actions = np.asarray(chosen)
    except Exception as error:
        raise AgentFaultError(
            f"the agent {name} gives what is no array of numbers ({reason(error)}); {advice}"
        ) from error
    if actions.dtype.kind not in "biuf":
        kind = "texts" if actions.dtype.kind in "US" else type(chosen).__name__
        raise AgentFaultError(f"the agent {name} gives {kind} and no numbers; {advice}")
    if actions.shape not in (wanted, (count, m)) and not (m == 1 and actions.shape == (count,)):
        raise AgentFaultError(f"the agent {name} gives actions of shape {actions.shape}; {advice}")
    columns = actions.reshape(count, m)
    if not np.isfinite(columns).all():
        raise AgentFaultError(f"the agent {name} gives an action that is not finite; {advice}")
    if not environment.is_discrete:
        # As Stable-Baselines3 does before an action reaches the environment.
        low, high = environment.action_low, environment.action_high
        return np.clip(columns.astype(np.float32), *np.array((low, high), dtype=np.float32))
    first = np.array(environment.label_first)
    last = first + [len(names) - 1 for names in environment.label_names]
    wrong = (columns != np.floor(columns)) | (columns < first) | (columns > last)
    if wrong.any():
        row, column = np.argwhere(wrong)[0].tolist()
        raise AgentFaultError(
            f"the agent {name} gives the {environment.action_names[column]!r} action "
            f"{columns[row, column]}, and {environment.env_id} takes whole numbers from "
            f"{first[column]} to {last[column]}; give one of those"
        )
    return columns.astype(np.int64)
