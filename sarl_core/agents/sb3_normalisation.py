"""The statistics by which a model's observations were normalised in its training.

They lie beside it, or are given. Whether it had any, its entry `data` tells: a learner that keeps
no buffer of steps keeps the observations as they were only if a VecNormalize changed them; one
with a buffer keeps the last observations and those before them, and these show it or do not.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.mlp_policy import Normalisation
from sarl_core.agents.sb3_data import TrainingRecord, outside
from sarl_core.agents.sb3_settings import WITH_BUFFER
from sarl_core.agents.sb3_statistics import load_statistics
from sarl_core.errors import InputError

AS_THEY_ARE = "none"  # in the place of statistics: observations were not normalised

_TRIED_EPISODES, _TRIED_STEPS = 4, 50
_LONGEST = 4.0  # a step in training, in the longest of some random ones
_SPREAD = 4.0  # of most normalised values, from one side to the other
_BY_CHANCE = 0.02


def find_statistics(
    path: Path, training: TrainingRecord, given: str | Path | None, env: Any
) -> tuple[Normalisation | None, str]:
    """Find the statistics of a model's observations.

    Args:
        path: The model.
        training: What it tells.
        given: The file with its statistics, ``none`` where it had none, or None to look for it.
        env: The environment; some steps are made in it where that helps to tell.

    Returns:
        The statistics, or None; and a sentence on where they are from or what is not clear, or "".

    Raises:
        InputError: If it had statistics and they are not there, or if a file cannot be read.
    """
    if given is not None and str(given) == AS_THEY_ARE:
        return None, ""
    normalised = _is_normalised(training, env.observation_space)
    if given is not None:
        statistics = load_statistics(Path(given))
        if statistics is None:
            return None, f"{given} says that the observations of {path} were not normalised"
        unasked = normalised is False or (
            normalised is None and not _explains(statistics, training)
        )
        return statistics, (
            f"{path} does not look as if it was trained under this VecNormalize; observations "
            f"are normalised by {given} all the same"
            if unasked
            else ""
        )
    if normalised is False:
        return None, ""
    if normalised is None:
        return _explaining(path, training, env)
    file = _beside(path)
    if file is None:
        raise InputError(
            f"{path} was trained under a VecNormalize, and its statistics do not lie beside it; "
            "without them it would act at random. Give the .pkl that VecNormalize.save() wrote "
            f"(--normalise FILE), or --normalise {AS_THEY_ARE} if only rewards were normalised"
        )
    statistics = load_statistics(file)
    if statistics is None:
        return None, f"{file} says that the observations of {path} were not normalised"
    return statistics, f"observations are normalised by {file}, which lies beside {path.name}"


def _is_normalised(training: TrainingRecord, space: Any) -> bool | None:
    """Whether a model was trained under a VecNormalize; None where it does not tell."""
    if not training.originals:
        return False
    if training.policy_class is not None and training.policy_class not in WITH_BUFFER:
        return True  # these keep originals only then
    if (
        training.last is None
        or training.original is None
        or training.last.shape != training.original.shape
    ):
        return None
    if np.array_equal(training.last, training.original):
        return False
    beyond = [outside(rows, space) for rows in (training.last, training.original)]
    if beyond[0] is not None and beyond[1] is None:
        return True
    return None


def _explaining(path: Path, training: TrainingRecord, env: Any) -> tuple[Normalisation | None, str]:
    """The statistics beside a model that make of its last observations what it says it saw."""
    for file in (*_own_names(path), *_shared_names(path)):
        if not file.is_file():
            continue
        statistics = load_statistics(file)
        if statistics is not None and _explains(statistics, training):
            return (
                statistics,
                f"observations are normalised by {file}, which lies beside {path.name}",
            )
    likely = _is_a_step(training, env)
    if likely:
        return None, ""
    advice = (
        "if it was trained under a VecNormalize, it acts wrongly here: give the .pkl that "
        f"VecNormalize.save() wrote (--normalise FILE; {AS_THEY_ARE} if it was not)"
    )
    if likely is None:
        return None, f"{path} does not tell whether its observations were normalised; {advice}"
    return None, f"{path}: what it saw last in its training is no step of this one; {advice}"


def _explains(statistics: Normalisation, training: TrainingRecord) -> bool:
    """Whether statistics make what a model saw last of what it was before; nearly will do."""
    last, original = training.last, training.original
    if last is None or original is None or last.shape != original.shape:
        return False
    if last.ndim != 2 or last.shape[1] != len(statistics.mean):
        return False
    made = np.clip(statistics.deviations(original), -statistics.clip, statistics.clip)
    return bool((np.abs(made - last) <= 0.1 + 0.05 * np.abs(last)).all())


def _is_a_step(training: TrainingRecord, env: Any) -> bool | None:
    """Whether a model's last observation but one and its last are a step of an environment.

    A step is not much longer than the longest of some random ones, in each feature, or leads to
    where episodes start. None where normalised values would often pass for one.
    """
    last, before = training.last, training.original
    if last is None or before is None or last.shape != before.shape or last.ndim != 2:
        return None
    if last.shape[1:] != env.observation_space.shape:
        return None
    starts, steps = _random_steps(env)
    reach = _LONGEST * np.max(steps, axis=0) + 1e-3
    low, high = np.min(starts, axis=0), np.max(starts, axis=0)
    width = high - low + 1e-3
    starting = ((last >= low - width) & (last <= high + width)).all(axis=1)
    stepping = (np.abs(last - before) <= reach).all(axis=1)
    if not (starting | stepping).all():
        return False
    by_chance = np.where(
        stepping,
        np.minimum(1.0, 2.0 * reach / _SPREAD).prod(),
        np.minimum(1.0, 3.0 * width / _SPREAD).prod(),
    )
    return True if by_chance.prod() <= _BY_CHANCE else None


def _random_steps(env: Any) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Where episodes start, and how far random actions lead in a step, feature by feature."""
    env.action_space.seed(0)
    starts, steps = [], []
    for seed in range(_TRIED_EPISODES):
        now, over = np.array(env.reset(seed=seed)[0], np.float64), False
        starts.append(now)
        for _ in range(_TRIED_STEPS):
            if over:
                break
            observed, _, terminated, truncated, _ = env.step(env.action_space.sample())
            now, then, over = np.array(observed, np.float64), now, terminated or truncated
            steps.append(np.abs(now - then))
    return starts, steps


def _own_names(path: Path) -> list[Path]:
    """Where the statistics of a model lie, if they have its name."""
    names = [f"{path.stem}_vecnormalize.pkl", f"{path.stem}_vec_normalize.pkl"]
    if match := re.fullmatch(r"(.+)_(\d+_steps)", path.stem):  # how checkpoints are called
        names.append(f"{match[1]}_vecnormalize_{match[2]}.pkl")
    return [path.parent / name for name in names]


def _shared_names(path: Path) -> list[Path]:
    """Where they lie, if they may be those of another model of the folder."""
    return [path.parent / name for name in ("vecnormalize.pkl", "vec_normalize.pkl")]


def _beside(path: Path) -> Path | None:
    """The statistics that lie beside a model, where their name leaves no doubt.

    Raises:
        InputError: If there is a doubt.
    """
    files = [file for file in _own_names(path) if file.is_file()]
    own = bool(files)
    files = files or [file for file in _shared_names(path) if file.is_file()]
    if not files:
        return None
    others = sorted(file.name for file in path.parent.glob("*.zip") if file.name != path.name)
    if len(files) > 1 or (others and not own):
        doubt = files[1].name if len(files) > 1 else others[0]
        raise InputError(
            f"{path} was trained under a VecNormalize; beside it lie {files[0].name} and {doubt}, "
            "so it is not clear which statistics are its own; say so with --normalise FILE"
        )
    return files[0]
