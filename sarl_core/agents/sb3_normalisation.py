"""The statistics by which a model's observations were normalised in its training.

They lie beside it, or are given. Whether it had any, its entry `data` tells: a learner that keeps
no buffer of steps keeps the observations as they were only if a VecNormalize changed them; one
with a buffer keeps the last observations and those before them, and these show it or do not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class TrainingEnd:
    """What a model met last, where nothing else tells whether its observations were normalised.

    Attributes:
        path: The model.
        before: Its last observations but one, shape (environments, d); None where not known.
        last: The next ones, likewise.
    """

    path: Path
    before: NDArray[np.float64] | None
    last: NDArray[np.float64] | None


def find_statistics(
    path: Path, training: TrainingRecord, given: str | Path | None, space: Any
) -> tuple[Normalisation | None, str, TrainingEnd | None]:
    """Find the statistics of a model's observations.

    Args:
        path: The model.
        training: What it tells.
        given: The file with its statistics, ``none`` where it had none, or None to look for it.
        space: The environment's observations.

    Returns:
        The statistics, or None; a sentence on where they are from, or ""; and, where neither the
        model nor a file tells whether there are any, what leaves it open.

    Raises:
        InputError: If it had statistics and they are not there, or if a file cannot be read.
    """
    if given is not None and str(given) == AS_THEY_ARE:
        return None, "", None
    normalised = _is_normalised(training, space)
    if given is not None:
        statistics = load_statistics(Path(given))
        if statistics is None:
            return None, f"{given} says that the observations of {path} were not normalised", None
        unasked = normalised is False or (
            normalised is None and not _explains(statistics, training)
        )
        note = (
            f"{path} does not look as if it was trained under this VecNormalize; observations "
            f"are normalised by {given} all the same"
        )
        return statistics, note if unasked else "", None
    if normalised is False:
        return None, "", None
    if normalised is None:
        return _explaining(path, training)
    file = _beside(path)
    if file is None:
        raise InputError(
            f"{path} was trained under a VecNormalize, and its statistics do not lie beside it; "
            "without them it would act at random. Give the .pkl that VecNormalize.save() wrote "
            f"(--normalise FILE), or --normalise {AS_THEY_ARE} if only rewards were normalised"
        )
    statistics = load_statistics(file)
    if statistics is None:
        return None, f"{file} says that the observations of {path} were not normalised", None
    return statistics, _beside_text(file, path), None


def _is_normalised(training: TrainingRecord, space: Any) -> bool | None:
    """Whether a model was trained under a VecNormalize; None where it does not tell."""
    from gymnasium.spaces import Box

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
    if not isinstance(space, Box) and training.last.shape[1:] == space.shape:
        return False  # a VecNormalize takes boxes only
    beyond = [outside(rows, space) for rows in (training.last, training.original)]
    if beyond[0] is not None and beyond[1] is None:
        return True
    return None


def _explaining(
    path: Path, training: TrainingRecord
) -> tuple[Normalisation | None, str, TrainingEnd | None]:
    """The statistics beside a model that make of its last observations what it says it saw."""
    for file in (*_own_names(path), *_shared_names(path)):
        if not file.is_file():
            continue
        statistics = load_statistics(file)
        if statistics is not None and _explains(statistics, training):
            return statistics, _beside_text(file, path), None
    return None, "", TrainingEnd(path, training.original, training.last)


def _beside_text(file: Path, path: Path) -> str:
    return f"observations are normalised by {file}, which lies beside {path.name}"


def _explains(statistics: Normalisation, training: TrainingRecord) -> bool:
    """Whether statistics make what a model saw last of what it was before; nearly will do."""
    last, original = training.last, training.original
    if last is None or original is None or last.shape != original.shape:
        return False
    if last.ndim != 2 or last.shape[1] != len(statistics.mean):
        return False
    made = np.clip(statistics.deviations(original), -statistics.clip, statistics.clip)
    return bool((np.abs(made - last) <= 0.1 + 0.05 * np.abs(last)).all())


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
