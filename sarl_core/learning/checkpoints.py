"""A learner at rest: its weights, its optimisers, what it remembers, and its curve.

Torch's own file, read by its reader for weights only: tensors, numbers and text, no code.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct

from sarl_core.documents import Count, NotNegative, conformed
from sarl_core.errors import InputError, WorkError
from sarl_core.files import whole_file
from sarl_core.learning.curves import Columns, LearningEpisodes

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

_FORMAT = "sarl-learner"
_VERSION = 1
_REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


@dataclass(frozen=True, eq=False)
class Rest:
    """Where a learner stopped, as far as it is not in the learner.

    Attributes:
        curve: What had happened.
        seconds: That it had taken.
        sittings: In how many goes.
    """

    curve: LearningEpisodes
    seconds: float
    sittings: int


def save_checkpoint(
    path: Path, learner: BaseAlgorithm, identity: Mapping[str, Any], rest: Rest
) -> None:
    """Write a learner, whole or not at all.

    Args:
        path: File.
        learner: Of `make_learner`.
        identity: What tells this run from others.
        rest: The curve and the time so far.

    Raises:
        InputError: If the folder does not exist.
        WorkError: If the file cannot be written.
    """
    import torch

    document = {
        "format": _FORMAT,
        "version": _VERSION,
        "identity": dict(identity),
        "steps": learner.num_timesteps,
        "curve": rest.curve.to_dict(),
        "seconds": rest.seconds,
        "sittings": rest.sittings,
        "parameters": learner.get_parameters(),
        "memory": _memory_of(learner),
    }
    with whole_file(path) as unfinished:
        try:
            torch.save(document, unfinished)
        except RuntimeError as error:  # torch's word for what the disk refused
            raise WorkError(
                f"{path} cannot be written, as when a disk is full; make room, or choose another "
                "place"
            ) from error


def load_checkpoint(path: Path, learner: BaseAlgorithm, identity: Mapping[str, Any]) -> Rest | None:
    """Put a fresh learner where another one stopped.

    Args:
        path: What `save_checkpoint` wrote.
        learner: Made for the same run.
        identity: Of this run.

    Returns:
        The rest of what was kept; None if there is no such file.

    Raises:
        InputError: If the file is no checkpoint, or that of another run. Nothing in it is
            executed.
    """
    import torch

    if not path.exists():
        return None
    advice = "delete it to begin anew, or choose another folder"
    try:
        document = torch.load(path, weights_only=True)
    except (OSError, RuntimeError, EOFError, ValueError, pickle.UnpicklingError) as error:
        reason = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise InputError(f"{path} cannot be read as a checkpoint ({reason}); {advice}") from error
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise InputError(f"{path} is not a checkpoint of a learner; {advice}")
    if document.get("version") != _VERSION:
        raise InputError(f"{path} is a checkpoint of another version of this program; {advice}")
    saved_earlier = document.get("identity")
    if saved_earlier != dict(identity):
        other = [
            name
            for name in identity
            if not isinstance(saved_earlier, dict) or saved_earlier.get(name) != identity[name]
        ]
        raise InputError(
            f"{path} is the checkpoint of another run (its {' and '.join(other) or 'settings'} "
            f"differ); {advice}"
        )
    try:
        checkpoint = conformed(document, _CheckpointDocument)
        learner.set_parameters(checkpoint.parameters)
        learner.num_timesteps = checkpoint.steps
        _remember(learner, checkpoint.memory)
        return Rest(checkpoint.curve.read(), checkpoint.seconds, checkpoint.sittings)
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise InputError(f"{path} lacks a part of its learner ({error}); {advice}") from error


class _CheckpointDocument(Struct):
    steps: Count
    curve: Columns
    seconds: NotNegative
    sittings: Count
    parameters: dict[str, Any]
    memory: dict[str, Any]


def _memory_of(learner: Any) -> dict[str, Any]:
    """What a learner remembers beside its weights."""
    import torch

    memory: dict[str, Any] = {}
    if getattr(learner, "log_ent_coef", None) is not None:
        memory["log_ent_coef"] = learner.log_ent_coef.detach().clone()
    replay = getattr(learner, "replay_buffer", None)
    if replay is not None:
        filled = replay.buffer_size if replay.full else replay.pos
        memory["replay"] = {
            "pos": replay.pos,
            "full": replay.full,
            **{
                name: torch.from_numpy(np.ascontiguousarray(getattr(replay, name)[:filled]))
                for name in _REPLAYED
            },
        }
    lessons = getattr(getattr(learner, "rollout_buffer", None), "lessons", None)
    if lessons is not None:
        memory["lessons"] = lessons.state()
    return memory


def _remember(learner: Any, memory: Mapping[str, Any]) -> None:
    """Undo `_memory_of`."""
    if "log_ent_coef" in memory:
        learner.log_ent_coef.data.copy_(memory["log_ent_coef"])
    if "replay" in memory:
        replay, saved = learner.replay_buffer, memory["replay"]
        replay.pos, replay.full = int(saved["pos"]), bool(saved["full"])
        for name in _REPLAYED:
            getattr(replay, name)[: len(saved[name])] = saved[name].numpy()
    if "lessons" in memory:
        learner.rollout_buffer.lessons.restore(memory["lessons"])
