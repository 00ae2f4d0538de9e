"""What was observed and what was proposed, as numbers that rules can be held against.

A state or an action may come in any container and of any kind of number. What is no state of the
rules' features, or no action of the space, is told here, before any rule is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import observed_features
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.mining.labels import LabelledDimension
    from sarl_core.mining.rule_set import RuleSet

Faults = dict[int, str]
"""Why a row of a batch cannot be read, for those rows only."""

_FLOAT32 = np.dtype(np.float32)
_NUMBERS = "biuf"  # NumPy's kinds of real numbers
_DEEPEST = 4  # lists in lists that are searched for what is masked
_LONGEST = 60  # signs of a name, in a sentence


class UnreadableError(Exception):
    """What was given is no state, or no action of the space; its text says why."""


@dataclass(frozen=True)
class ActionForm:
    """What an action looks like that can be executed.

    Attributes:
        dtype: Of its values; the environment's.
        shape: Of one action; None where any will do that holds m values.
        labels: Of each discrete action dimension the first action and how many there are; ()
            where actions are continuous.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...] | None = None
    labels: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of_rules(cls, rule_set: RuleSet) -> ActionForm:
        """The form that follows from rules alone: int64 for labels, float32 for what is continuous.

        Args:
            rule_set: Knows the actions.

        Returns:
            A form without a shape.
        """
        actions = rule_set.actions
        if actions[0].is_interval:
            return cls(_FLOAT32)
        return cls(np.dtype(np.int64), None, tuple(a.reach for a in actions))

    @classmethod
    def of_space(cls, space: Any) -> ActionForm:
        """The form of an environment's actions.

        Args:
            space: Discrete, MultiDiscrete, MultiBinary or Box.

        Returns:
            With the space's dtype and shape.
        """
        from gymnasium import spaces

        labels: tuple[tuple[int, int], ...] = ()
        if isinstance(space, spaces.Discrete):
            labels = ((int(space.start), int(space.n)),)
        elif isinstance(space, spaces.MultiDiscrete):
            starts = np.asarray(space.start).reshape(-1).tolist()
            labels = tuple(zip(starts, space.nvec.reshape(-1).tolist(), strict=True))
        elif isinstance(space, spaces.MultiBinary):
            labels = ((0, 2),) * int(np.prod(space.shape))
        return cls(np.dtype(space.dtype), tuple(space.shape or ()), labels)


class StateReader:
    """Reads observations of d features as float32."""

    def __init__(self, rule_set: RuleSet) -> None:
        """Know the features.

        Args:
            rule_set: Asks about them.
        """
        features = rule_set.source.features
        self._names = [feature.name for feature in observed_features(features)]
        self._whole = len(features)
        self._env_id = rule_set.source.env_id or "another environment"

    def one(self, observation: Any) -> NDArray[np.float32]:
        """Read one observation.

        Args:
            observation: d numbers; what derived features are given behind them is left out.

        Returns:
            Shape (d,), finite.

        Raises:
            UnreadableError: If it is anything else.
        """
        numbers = numbers_in(observation, "observation")
        wide = len(self._names)
        if numbers.shape == (self._whole,):
            numbers = numbers[:wide]
        if numbers.shape != (wide,):
            shape = f"has the shape {numbers.shape}" if numbers.ndim != 1 else f"has {len(numbers)}"
            raise UnreadableError(
                f"the rules ask about {wide} features (of {_short(self._env_id)}) and the "
                f"observation {shape}"
            )
        state = _as_floats(numbers, _FLOAT32)
        finite = np.isfinite(state)
        if not finite.all():
            raise UnreadableError(self._fault(state))
        return np.ascontiguousarray(state)

    def many(self, observations: Any) -> tuple[NDArray[np.float32], Faults]:
        """Read many observations, each as `one` does.

        Args:
            observations: B of them.

        Returns:
            Shape (B, d), contiguous, where they can be read; and why the others cannot.

        Raises:
            InputError: If they are not one behind the other.
        """
        rows = _rows(observations, "observations")
        wide = len(self._names)
        if isinstance(rows, np.ndarray) and rows.ndim == 2 and rows.shape[1] == self._whole:
            rows = rows[:, :wide]
        if isinstance(rows, np.ndarray) and rows.ndim == 2 and rows.shape[1] == wide:
            states = np.ascontiguousarray(_as_floats(rows, _FLOAT32))
            finite = np.isfinite(states)
            if finite.all():
                return states, {}
            bad = np.flatnonzero(~finite.all(axis=1)).tolist()
            return states, {row: self._fault(states[row]) for row in bad}
        states, faults = np.zeros((len(rows), wide), dtype=np.float32), {}
        for row, observation in enumerate(rows):
            try:
                states[row] = self.one(observation)
            except UnreadableError as error:
                faults[row] = str(error)
        return states, faults

    def _fault(self, state: NDArray[np.float32]) -> str:
        if len(state) > 1 and np.isnan(state).all():
            return "none of the observation's values is a number"
        feature = int(np.flatnonzero(~np.isfinite(state))[0])
        what = "not a number" if np.isnan(state[feature]) else "infinite"
        return f"the observation's {_short(self._names[feature])!r} is {what}"


class ActionReader:
    """Reads actions of m dimensions in the form that they can be executed in."""

    def __init__(self, dimensions: Sequence[LabelledDimension], form: ActionForm) -> None:
        """Know the actions.

        Args:
            dimensions: The m action dimensions of the rules.
            form: Of the environment's actions.
        """
        self.form = form
        self._names = [dimension.name for dimension in dimensions]

    def one(self, action: Any) -> tuple[NDArray[Any], tuple[int, ...]]:
        """Read one action.

        Args:
            action: m numbers, in any shape.

        Returns:
            Its values as they would be executed, (m,), and its shape as it was given.

        Raises:
            UnreadableError: If it is none of the space.
        """
        numbers = numbers_in(action, "action")
        self._check_size(numbers.size)
        values, wrong = self._read(numbers.reshape(1, -1))
        if wrong.any():
            raise UnreadableError(self._fault(numbers.reshape(-1), wrong[0]))
        return values[0], numbers.shape

    def many(self, actions: Any) -> tuple[NDArray[Any], NDArray[Any], tuple[int, ...], Faults]:
        """Read many actions, each as `one` does.

        Args:
            actions: B of them.

        Returns:
            The actions as they were given, as an array with B rows; their values as they would be
            executed, (B, m); the shape of one as it was given; and why some are none.

        Raises:
            InputError: If they are not one behind the other.
        """
        rows = _rows(actions, "actions")
        count, size = len(rows), len(self._names)
        if isinstance(rows, np.ndarray) and rows.size == count * size:
            flat = rows.reshape(count, size)
            values, wrong = self._read(flat)
            if not wrong.any():
                return rows, values, rows.shape[1:], {}
            bad = np.flatnonzero(wrong.any(axis=1)).tolist()
            faults = {row: self._fault(flat[row], wrong[row]) for row in bad}
            return rows, values, rows.shape[1:], faults
        values, faults = np.zeros((count, size), dtype=self.form.dtype), {}
        shapes: set[tuple[int, ...]] = set()
        given = np.empty(count, dtype=object)
        for row, action in enumerate(rows):
            given[row] = action
            try:
                values[row], shape = self.one(action)
                shapes.add(shape)
            except UnreadableError as error:
                faults[row] = str(error)
        if len(shapes) != 1:
            return given, values, (() if size == 1 else (size,)), faults
        return (given if faults else np.asarray(list(rows))), values, shapes.pop(), faults

    def _check_size(self, given: int) -> None:
        size = len(self._names)
        if given != size:
            raise UnreadableError(
                f"the action has {given} value{'' if given == 1 else 's'} and the rules are for "
                f"{size} action dimension{'' if size == 1 else 's'}"
            )

    def _read(self, numbers: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Values as they would be executed, and which are none of the space; both (B, m)."""
        dtype = self.form.dtype
        if self.form.labels:
            return self._read_labels(numbers)
        if dtype.kind == "f":
            values = _as_floats(numbers, dtype)
            return values, ~np.isfinite(values)
        # Steps of a whole number: as a cast does, but within what the numbers reach.
        floats = _as_floats(numbers, np.dtype(np.float64))
        wrong = ~np.isfinite(floats)
        reach = np.iinfo(dtype)
        inside = np.clip(np.where(wrong, 0.0, floats), float(reach.min), float(reach.max))
        return inside.astype(dtype), wrong

    def _read_labels(self, numbers: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        wrong = np.zeros(numbers.shape, dtype=np.bool_)
        if numbers.dtype.kind == "b":
            numbers = numbers.astype(np.uint8)
        elif numbers.dtype.kind == "f":
            numbers = numbers.astype(np.float64, copy=False)
            wrong = ~np.isfinite(numbers) | (numbers != np.floor(numbers))
        for column, (first, count) in enumerate(self.form.labels):
            # Compared before they are cast: -4 is no 252.
            wrong[:, column] |= ~(
                (numbers[:, column] >= first) & (numbers[:, column] <= first + count - 1)
            )
        if not wrong.any():
            return numbers.astype(self.form.dtype, copy=False), wrong
        values = np.zeros(numbers.shape, dtype=self.form.dtype)
        values[~wrong] = numbers[~wrong].astype(self.form.dtype)
        return values, wrong

    def _fault(self, numbers: NDArray[Any], wrong: NDArray[np.bool_]) -> str:
        dimension = int(np.flatnonzero(wrong)[0])
        value = numbers[dimension]
        subject = "the action"
        if len(self._names) > 1:
            subject = f"the action's {_short(self._names[dimension])!r}"
        if np.isnan(value):
            return f"{subject} is not a number"
        if not self.form.labels:
            return f"{subject} is infinite"
        first, count = self.form.labels[dimension]
        number, last = decimal_text(float(value)), first + count - 1
        return f"{subject} is {number}, which is none of {first} to {last}"


def numbers_in(value: Any, name: str) -> NDArray[Any]:
    """The numbers in a container of any kind.

    Args:
        value: A number, an array or whatever NumPy makes one of.
        name: What it is, for a sentence.

    Returns:
        An array of real numbers, in its own shape.

    Raises:
        UnreadableError: If something in it is masked or no number.
    """
    if _is_masked(value):
        raise UnreadableError(f"the {name} is masked, in whole or in part")
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and all(isinstance(x, (Real, np.bool_)) for x in array.flat):
            array = _numbers_of_objects(array)
    except (TypeError, ValueError, RuntimeError):  # ragged, or what refuses to be an array
        raise UnreadableError(f"the {name} is no list of numbers") from None
    if array.dtype.kind not in _NUMBERS:
        raise UnreadableError(f"the {name} holds something that is no number")
    return array


def _numbers_of_objects(array: NDArray[Any]) -> NDArray[Any]:
    plain = np.asarray(array.tolist())
    if plain.dtype.kind in _NUMBERS and plain.shape == array.shape:
        return plain
    return np.array([_float(x) for x in array.flat], dtype=np.float64).reshape(array.shape)


def _float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:  # a whole number beyond all that computers calculate with
        return float("inf") if number > 0 else float("-inf")


def state_vector(observation: Any, space: Any = None) -> Any:
    """An environment's observation as a vector that nobody else writes to.

    Args:
        observation: As the environment gives it.
        space: Of the observations, by which they are flattened; None where they are vectors.

    Returns:
        Its numbers as float32, whether or not they are finite and as many as they should be;
        what came, where it holds something else.
    """
    if space is None and type(observation) is np.ndarray and observation.dtype == _FLOAT32:
        return observation.copy()
    if _is_masked(observation):
        return observation
    try:
        if space is not None:
            from gymnasium.spaces.utils import flatten

            with np.errstate(over="ignore", invalid="ignore"):
                observation = flatten(space, observation)
        return np.array(_as_floats(numbers_in(observation, "observation"), _FLOAT32))
    # Other spaces refuse what is none of theirs in one of these ways.
    except (UnreadableError, TypeError, ValueError, KeyError, IndexError, AttributeError):
        return observation


def _is_masked(value: Any, depth: int = 0) -> bool:
    if isinstance(value, np.ma.MaskedArray):
        return bool(np.ma.is_masked(value))
    if isinstance(value, dict):
        value = list(value.values())
    return (
        isinstance(value, (list, tuple))
        and depth < _DEEPEST
        and any(_is_masked(entry, depth + 1) for entry in value)
    )


def _rows(values: Any, name: str) -> NDArray[Any] | list[Any]:
    """A batch as an array of numbers where it is one, else as a list of its rows.

    Where the rows are of several kinds, NumPy would make one kind of all: text of every number.
    """
    if isinstance(values, (list, tuple)):
        return list(values)
    masked = _is_masked(values)
    try:
        array = values if masked else np.asarray(values)
    except (TypeError, ValueError, RuntimeError):  # what refuses to be an array
        array = np.empty(())
    if array.ndim == 0:
        raise InputError(f"the {name} are no list; give one for each state")
    return list(array) if masked or array.dtype.kind not in _NUMBERS else array


def _as_floats(numbers: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Floats of a kind; what is too large for it becomes infinite."""
    if numbers.dtype == dtype:
        return numbers
    # By way of float64, so that a number reads the same alone and beside others.
    with np.errstate(over="ignore", invalid="ignore"):
        return numbers.astype(np.float64, copy=False).astype(dtype, copy=False)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[:_LONGEST]}..."
