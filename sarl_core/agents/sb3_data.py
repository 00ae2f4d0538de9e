"""What a Stable-Baselines3 model tells of itself and of its training, in its entry `data`.

Its plain text, and of its pickles those of the spaces and of the last observations, read as data.
"""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.sb3_statistics import read_array, read_box
from sarl_core.documents import parse_json
from sarl_core.errors import InputError

Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]

_CLASS_OF_METHOD = re.compile(r"<function (\w+)\.")


@dataclass(frozen=True)
class TrainingRecord:
    """What a model tells.

    Attributes:
        policy_class: Module and name, or None.
        arguments: Of the policy.
        observations: Bounds of its observations, where they are a box that can be read.
        actions: Likewise.
        last: The last observations that it met, shape (environments, d), or None.
        originals: Whether it keeps observations as they were before a VecNormalize.
        original: Those, or None: of an off-policy learner the last ones, or without a
            VecNormalize those of a step before.
    """

    policy_class: str | None
    arguments: dict[str, object]
    observations: Bounds | None
    actions: Bounds | None
    last: NDArray[np.float64] | None
    originals: bool
    original: NDArray[np.float64] | None


def read_data(text: bytes) -> TrainingRecord:
    """Read the entry.

    Stable-Baselines3 writes each object twice: pickled, and as text for people, as in
    ``"policy_kwargs": {"activation_fn": "<class 'torch...activation.ReLU'>"}``.

    Args:
        text: Its bytes.

    Returns:
        What it tells.

    Raises:
        InputError: If it is no such text.
    """
    try:
        data = parse_json(text, finite=False)
    except ValueError as error:
        raise InputError("its entry 'data' is no JSON; give what model.save() wrote") from error
    if not isinstance(data, dict):
        raise InputError("its entry 'data' holds no settings; give what model.save() wrote")
    arguments = data.get("policy_kwargs")
    if not isinstance(arguments, dict):
        arguments = {}
    return TrainingRecord(
        policy_class=_class_name(data.get("policy_class")),
        arguments={k: v for k, v in arguments.items() if k not in (":type:", ":serialized:")},
        observations=read_box(_pickled(data.get("observation_space"))),
        actions=read_box(_pickled(data.get("action_space"))),
        last=read_array(_pickled(data.get("_last_obs"))),
        originals=data.get("_last_original_obs") is not None,
        original=read_array(_pickled(data.get("_last_original_obs"))),
    )


def _class_name(written: object) -> str | None:
    """Module and name of a class; its methods tell the name."""
    if written is None:
        return None
    if not isinstance(written, dict) or not isinstance(written.get("__module__"), str):
        return str(written.get(":type:", "")) if isinstance(written, dict) else str(written)
    methods = (written.get("__init__"), *written.values())
    matches = (_CLASS_OF_METHOD.match(text) for text in methods if isinstance(text, str))
    name = next((match[1] for match in matches if match), "")
    return f"{written['__module__']}.{name}".removesuffix(".")


def _pickled(written: object) -> bytes:
    """The pickle of an object; nothing where it is not there."""
    serialised = written.get(":serialized:") if isinstance(written, dict) else None
    try:
        return base64.b64decode(serialised) if isinstance(serialised, str) else b""
    except ValueError:
        return b""


def check_actions(trained: Bounds | None, given: Bounds, env_id: str) -> None:
    """Refuse actions of another range, as behind a wrapper that scales them.

    Args:
        trained: Bounds of the actions in training, where they are known.
        given: Those of the environment.
        env_id: Its id.

    Raises:
        InputError: If they differ.
    """
    if trained is None or trained[0].size != given[0].size:
        return
    i = _first_difference(trained, given)
    if i is not None:
        raise InputError(
            f"its actions lay between {_range(trained, i)} in training, and {env_id} takes "
            f"{_range(given, i)}; give an --env with the wrapper that it was trained behind"
        )


def odd_observations(training: TrainingRecord, space: Any, env_id: str) -> str:
    """Say in what the observations of a training look unlike the environment's.

    Args:
        training: What the model tells.
        space: The environment's observations.
        env_id: Its id.

    Returns:
        A sentence; "" where nothing is odd.
    """
    from gymnasium.spaces import Box

    if not isinstance(space, Box):
        return ""
    advice = (
        "; if a wrapper changed them (NormalizeObservation, say), it acts wrongly here: give an "
        "--env with that wrapper"
    )
    given = (space.low, space.high)
    if training.observations is not None and training.observations[0].shape == space.shape:
        i = _first_difference(training.observations, given)
        if i is not None:
            return (
                f"its observations lay between {_range(training.observations, i)} in training "
                f"(feature {i}), and those of {env_id} lie between {_range(given, i)}{advice}"
            )
    # What a VecNormalize made of them is another matter.
    place = None if training.originals else outside(training.last, space)
    if place is not None and training.last is not None:
        i = place[1]
        return (
            f"the last observation of its training had {training.last[place]:g} for feature {i}, "
            f"which in {env_id} lies between {_range(given, i)}{advice}"
        )
    return ""


def outside(rows: NDArray[np.float64] | None, space: Any) -> tuple[int, int] | None:
    """Find a value that is not in a box; a hair beside it is in it.

    Args:
        rows: Shape (n, d), or None.
        space: The box; nothing lies outside another space.

    Returns:
        Row and feature of the first, or None.
    """
    from gymnasium.spaces import Box

    if rows is None or not isinstance(space, Box) or rows.shape[1:] != space.shape:
        return None
    slack = 1e-4 * (1.0 + np.abs(rows))
    places = np.argwhere((rows < space.low - slack) | (rows > space.high + slack))
    return (int(places[0][0]), int(places[0][1])) if len(places) else None


def _first_difference(one: Bounds, other: Bounds) -> int | None:
    """The first dimension in which bounds differ; a hair is none."""
    same = [
        np.isclose(a.reshape(-1), b.reshape(-1), rtol=1e-4, atol=1e-6)
        for a, b in zip(one, other, strict=True)
    ]
    differing = np.flatnonzero(~(same[0] & same[1]))
    return int(differing[0]) if len(differing) else None


def _range(bounds: Bounds, i: int) -> str:
    low, high = (float(side.reshape(-1)[i]) for side in bounds)
    return f"{low:.6g} and {high:.6g}"
