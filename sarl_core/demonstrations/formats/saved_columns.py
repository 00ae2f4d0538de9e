"""The columns in which demonstrations are saved."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.words import Coded, columns_of_words, spelled


def columns_of(demonstrations: Demonstrations) -> dict[str, NDArray[Any]]:
    """The columns in which demonstrations are saved, in order, all of them numbers."""
    assert demonstrations.steps is not None
    columns: dict[str, NDArray[Any]] = {
        "episode": demonstrations.episodes,
        "step": demonstrations.steps,
    }
    # What is derived from them is worked out again where they are read.
    observed = zip(demonstrations.observed, demonstrations.raw_observations.T, strict=True)
    for feature, values in observed:
        columns[f"obs_{feature.name}"] = np.ascontiguousarray(values)
    if demonstrations.actions.ndim == 1:
        columns["action"] = demonstrations.actions
    else:
        for dimension, values in zip(
            demonstrations.action_dimensions, demonstrations.action_columns.T, strict=True
        ):
            columns[f"action_{dimension.name}"] = np.ascontiguousarray(values)
    singles = {
        "reward": demonstrations.rewards,
        "terminated": demonstrations.terminated,
        "truncated": demonstrations.truncated,
        "time": demonstrations.times,
    }
    return columns | {name: values for name, values in singles.items() if values is not None}


def columns_in_words(demonstrations: Demonstrations) -> dict[str, Any]:
    """The same for a file that has no place to say what numbers stand for.

    Args:
        demonstrations: To save.

    Returns:
        Texts in the place of what indicators say of a column, and of actions that are words. Where
        an environment knows the names of its actions they stay numbers.
    """
    columns: dict[str, Any] = columns_of(demonstrations)
    features, observations = demonstrations.observed, demonstrations.observations
    of_words = columns_of_words([one.indicator for one in features])
    in_words: dict[str, Any] = {}
    for name, values in columns.items():
        indicator = next((one.indicator for one in features if f"obs_{one.name}" == name), None)
        if indicator is None:
            in_words[name] = values
            continue
        places = of_words[indicator.column]
        indicators = [one for at in places if (one := features[at].indicator) is not None]
        in_words[f"obs_{indicator.column}"] = _texts(spelled(observations[:, places], indicators))
    if demonstrations.is_discrete and not demonstrations.env_id:
        actions = [name for name in in_words if name == "action" or name.startswith("action_")]
        for name, dimension in zip(actions, demonstrations.action_dimensions, strict=True):
            if dimension.labels != tuple(map(str, dimension.actions)):
                codes = dimension.labels_of(in_words[name])
                in_words[name] = _texts(Coded(codes, dimension.labels))
    return in_words


def _texts(coded: Coded) -> list[str]:
    words = [*coded.words, ""]  # the last one for -1
    return [words[code] for code in coded.codes.tolist()]
