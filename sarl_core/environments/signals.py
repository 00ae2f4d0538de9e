"""What each step says of failure and of cost, by what the caller of an environment calls so.

Both are named by a key of ``info``, by a condition (a cost also by a formula) on the observation,
or as ``module:name``, a function of (observation, action, reward, terminated, info): the
observation after the step as rules see it, (d,) float32, the executed action, and what ``env.step``
gave. An episode has failed if one of its steps is a failure; its cost is the sum of its steps'.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import Environment, EnvironmentOrId, as_environment
from sarl_core.environments.failures import ends_tell, failed, info_key
from sarl_core.environments.feature_order import shortened
from sarl_core.environments.formulas import StateCondition, parse
from sarl_core.environments.imports import named_object, reason
from sarl_core.errors import InputError, quoted

COST = "cost"  # the key by which Safety-Gymnasium and its kin tell what a step cost

_FUNCTION = re.compile(r"[\w.]+:[\w.]+")
_COMPARES = re.compile(r"[<>]")
_WORKS_OUT = re.compile(r"[-+*/<>()'\"]")


def check_signals(environment: EnvironmentOrId) -> None:
    """Read what is called a failure and a cost, without playing.

    Args:
        environment: In which it is called so.

    Raises:
        InputError: If one of them cannot be read or imported.
    """
    SignalTally(environment, 1, str)


class StepOutcomes(NamedTuple):
    """What B steps brought.

    Attributes:
        observations: After the steps, (B, d) float32.
        actions: That were executed, B of them as the environment takes them.
        rewards: Shape (B,).
        terminated: Whether the environment ended the episode, (B,) bool.
        infos: B of them.
    """

    observations: NDArray[np.float32]
    actions: Sequence[Any]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    infos: Sequence[Mapping[str, Any]]


_Where = Callable[[int], str]  # a step by its index among B, as "at step 3 of the episode ..."


@dataclass(frozen=True)
class _Signal:
    """What tells one number a step.

    Attributes:
        values: Called with B steps and what names them; gives (B,) float64, of a failure 1 or 0;
            NaN where a step says nothing.
        key: Of ``info``, if it reads one: a step without it is none, and costs nothing.
        named: Whether the caller named it, and so is to be told when it never appears.
    """

    values: Callable[[StepOutcomes, _Where], NDArray[np.float64]]
    key: str = ""
    named: bool = True


class SignalTally:
    """Failures and costs of E episodes, while they are played.

    Attributes:
        failures: 1 for an episode that has failed, 0 for one that has not, NaN where that cannot
            be said, (E,).
        costs: Of each so far, (E,); NaN where it is not known.
        notes: Sentences on costs that the environment told and that could not be read.
    """

    def __init__(self, environment: EnvironmentOrId, count: int, name: Callable[[int], str]):
        """Begin.

        Args:
            environment: Whose episodes they are, with what is called a failure and a cost in it.
            count: How many episodes E.
            name: Of an episode by its number, as "of the episode with seed 7".

        Raises:
            InputError: If a failure or a cost cannot be read or imported.
        """
        environment = as_environment(environment)
        self._failure, self._cost = _failure_signal(environment), _cost_signal(environment)
        self._name, self._features = name, describe_environment(environment).feature_names
        self._by_end = not environment.failure and ends_tell(environment.id)
        self.failures, self.costs = np.zeros(count), np.full(count, np.nan)
        self._unpriced = np.zeros(count, dtype=np.bool_)
        self._missing: dict[tuple[int, str], dict[str, None]] = {}
        self.notes: tuple[str, ...] = ()

    @property
    def signals(self) -> NDArray[np.float64] | None:
        """The failures; None where the ends of the episodes tell them too, or nothing does."""
        return None if self._failure is None or self._by_end else self.failures

    def add(
        self, episodes: NDArray[np.int64], steps: NDArray[np.int64], outcomes: StepOutcomes
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Take in one step of each of B episodes.

        Args:
            episodes: Their numbers, each once, (B,).
            steps: Index of the step within its episode, (B,).
            outcomes: What the steps brought.

        Returns:
            Whether each step is a failure, (B,), and what it costs, (B,); NaN where nothing says.

        Raises:
            InputError: If what is to tell them gives no number, or an infinite cost, or raises.
        """

        def where(index: int) -> str:
            return f"at step {steps[index]} {self._name(int(episodes[index]))}"

        for signal in (self._failure, self._cost):
            if signal is not None and signal.key and (signal.named or signal is self._failure):
                self._look_for(signal.key, episodes, steps, outcomes.infos)
        fails = np.zeros(len(episodes), dtype=np.bool_)
        if self._failure is not None:
            values = self._failure.values(outcomes, where)
            fails = values == 1.0
            if self._failure.key:
                values = np.nan_to_num(values)
            # Once failed, always; what cannot be said of one step stays open until one fails.
            ever = fails | (self.failures[episodes] == 1.0)
            self.failures[episodes] = np.where(ever, 1.0, self.failures[episodes] + values)
        costs = self._cost.values(outcomes, where)
        priced = ~np.isnan(costs)
        if not self._cost.key:
            self._unpriced[episodes] |= ~priced
        elif not self._cost.named:
            self._note_unread(self._cost.key, episodes, ~priced, outcomes.infos)
        if priced.any():
            so_far = np.nan_to_num(self.costs[episodes]) + np.nan_to_num(costs)
            self.costs[episodes] = np.where(priced, so_far, self.costs[episodes])
        return fails, costs

    def end(self, episode: int) -> None:
        """Take note that an episode is over.

        Args:
            episode: Its number.

        Raises:
            InputError: If a key of ``info`` that the caller named did not appear in it.
        """
        if self._unpriced[episode]:
            self.costs[episode] = np.nan
        for signal in (self._failure, self._cost):
            if signal is None:
                continue
            keys = self._missing.pop((episode, signal.key), None)
            if keys is not None and signal.named:
                holds = f"holds {shortened(sorted(keys))}" if keys else "is empty"
                advice = "name one of its keys, a condition as 'gap < 1', or module:name"
                if signal.key in self._features:
                    advice = f"if the feature is meant, write it in parentheses: ({signal.key})"
                raise InputError(
                    f"no step {self._name(episode)} has {quoted(signal.key)} in its info, which "
                    f"{holds}; {advice}"
                )
            if keys is not None and signal is self._failure:
                self.failures[episode] = np.nan

    def restart(self, episode: int) -> None:
        """Begin an episode anew under the same number.

        Args:
            episode: Its number.
        """
        self.failures[episode], self.costs[episode] = 0.0, np.nan
        self._unpriced[episode] = False

    def _note_unread(
        self,
        key: str,
        episodes: NDArray[np.int64],
        unpriced: NDArray[np.bool_],
        infos: Sequence[Mapping[str, Any]],
    ) -> None:
        """Take note of steps that have a cost which is no number: it is not known what they cost.

        Which step that was is not said, so that many episodes have one sentence.
        """
        for index in np.flatnonzero(unpriced).tolist():
            if key in infos[index]:
                self._unpriced[episodes[index]] = True
                what = _kind_of(infos[index][key])
                note = (
                    f"the cost that the environment tells (info[{key!r}]) is {what} and could not "
                    "be read, so it is not known what such an episode costs"
                )
                self.notes = tuple(dict.fromkeys((*self.notes, note)))

    def _look_for(
        self,
        key: str,
        episodes: NDArray[np.int64],
        steps: NDArray[np.int64],
        infos: Sequence[Mapping[str, Any]],
    ) -> None:
        """Keep which keys there are in an episode, for as long as this one has not appeared."""
        for episode, step, info in zip(episodes.tolist(), steps.tolist(), infos, strict=True):
            if step == 0:
                self._missing[episode, key] = {}
            if key in info:
                self._missing.pop((episode, key), None)
            elif (keys := self._missing.get((episode, key))) is not None:
                keys.update(dict.fromkeys(map(str, info)))


def _failure_signal(environment: Environment) -> _Signal | None:
    text, env_id = environment.failure.strip(), environment.id
    if not text:
        if key := info_key(env_id):
            return _key_signal(key, "failure", named=False)
        if not ends_tell(env_id):
            return None
        return _Signal(
            lambda steps, _: failed(env_id, steps.terminated, steps.rewards).astype(np.float64)
        )
    if _FUNCTION.fullmatch(text):
        return _function_signal(text, "failure")
    if _COMPARES.search(text):
        condition = StateCondition.parse(text, describe_environment(environment).feature_names)
        return _Signal(lambda steps, _: condition.values(steps.observations))
    return _key_signal(text, "failure")


def _cost_signal(environment: Environment) -> _Signal:
    text = environment.cost.strip()
    if not text:
        return _key_signal(COST, "cost", named=False)
    if _FUNCTION.fullmatch(text):
        return _function_signal(text, "cost")
    if not _WORKS_OUT.search(text):
        return _key_signal(text, "cost")
    formula = parse(text, describe_environment(environment).feature_names)

    def values(steps: StepOutcomes, where: _Where) -> NDArray[np.float64]:
        costs = formula.values(steps.observations)
        for index in np.flatnonzero(np.isinf(costs)).tolist():
            raise _infinite(text, where(index))
        return costs

    return _Signal(values)


def _key_signal(key: str, kind: str, *, named: bool = True) -> _Signal:
    def value(info: Mapping[str, Any], index: int, where: _Where) -> float:
        try:
            return _number(info[key], kind, f"info[{key!r}]", where, index)
        except InputError:
            if named:
                raise
            return np.nan

    def values(steps: StepOutcomes, where: _Where) -> NDArray[np.float64]:
        said = np.full(len(steps.infos), np.nan)
        for index, info in enumerate(steps.infos):
            if key in info:
                said[index] = value(info, index, where)
        return said

    return _Signal(values, key, named)


def _function_signal(text: str, kind: str) -> _Signal:
    function = named_object(text, f"the {kind}")
    if not callable(function):
        raise InputError(
            f"the {kind} {text!r} is {type(function).__name__} and cannot be called; name a "
            "function of (observation, action, reward, terminated, info)"
        )

    def values(steps: StepOutcomes, where: _Where) -> NDArray[np.float64]:
        said = np.empty(len(steps.infos))
        for index, (observation, action, reward, terminated, info) in enumerate(
            zip(*steps, strict=True)
        ):
            try:
                # A copy: a function that changes it shall not change the record.
                value = function(observation.copy(), action, float(reward), bool(terminated), info)
            except (Exception, SystemExit) as error:  # the caller's code, which may raise anything
                raise InputError(
                    f"the {kind} {text!r} failed {where(index)} ({reason(error)}); it is called "
                    "with (observation, action, reward, terminated, info)"
                ) from error
            said[index] = _number(value, kind, f"the {kind} {text!r}", where, index)
        return said

    return _Signal(values)


def _number(value: Any, kind: str, what: str, where: _Where, index: int) -> float:
    """A number that somebody else's code gave, of a failure 1 or 0."""
    try:
        if isinstance(value, str):
            raise TypeError
        # An array of one number is that number, as environments of several agents give it.
        number = float(value.item() if isinstance(value, np.ndarray) else value)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{what} is {quoted(value)} {where(index)}; a {kind} is "
            f"{'a truth value' if kind == 'failure' else 'a number'}"
        ) from error
    if kind == "failure":
        return number if np.isnan(number) else float(number != 0.0)
    if np.isinf(number):
        raise _infinite(what, where(index))
    return number


def _kind_of(value: Any) -> str:
    """What stands in the place of a finite number."""
    if value is None:
        return "None"
    if isinstance(value, str):
        return "a text"
    return "an array" if isinstance(value, (np.ndarray, list, tuple)) else "no finite number"


def _infinite(what: str, where: str) -> InputError:
    return InputError(
        f"the cost {what} is infinite {where}; give one that stays finite, as 1 / max(gap, 0.1) "
        "does"
    )
