"""Reading a Stable-Baselines3 `.zip` without running anything that is in it.

Two entries are looked at: `policy.pth`, by torch's reader for weights only, and `data`, as data.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.agents.plain_pickle import MAX_BYTES
from sarl_core.agents.policy_files import MAX_POLICY_BYTES, check_unpacked_size
from sarl_core.agents.sb3_data import check_actions, odd_observations, read_data
from sarl_core.agents.sb3_normalisation import TrainingEnd, find_statistics
from sarl_core.agents.sb3_settings import read_settings
from sarl_core.agents.sb3_weights import policy_from_state
from sarl_core.agents.spaces import label_counts
from sarl_core.archives import entry_content, opened
from sarl_core.errors import InputError
from sarl_core.limits import limited_bytes

_MAX_STRUCTURE = 2**20  # bytes that say which weights there are; some kilobytes do


def load_sb3_zip(
    path: str | Path, env: Any, env_id: str, *, normalise: str | Path | None = None
) -> tuple[MlpPolicy, tuple[str, ...], TrainingEnd | None]:
    """Read the policy of a `.zip` that Stable-Baselines3 or its contrib saved.

    Args:
        path: The file.
        env: The environment, for its spaces.
        env_id: Its id.
        normalise: The `.pkl` with the statistics of its observations, or ``none`` where they
            were not normalised; looked for beside the file where not given.

    Returns:
        The policy, in NumPy; sentences on what was found, and on what looks odd; and what leaves
        open whether its observations were normalised, or None.

    Raises:
        InputError: If the file is no such zip, is too large, holds anything but weights where
            the weights should be, or another kind of policy; if it lacks its statistics; or if
            its actions were of another range than the environment's.
    """
    source = Path(path)
    weights, text = _entries(source)
    from gymnasium.spaces import Box

    space = env.action_space
    box = isinstance(space, Box)
    # With one dimension the weights say how many labels there are, and the caller compares.
    counts = label_counts(space) if len(label_counts(space)) > 1 else ()
    try:
        training = read_data(text)
        settings = read_settings(training.policy_class, training.arguments)
        policy = policy_from_state(
            _state(weights),
            discrete=not box,
            label_counts=counts,
            action_low=space.low.reshape(-1).astype(np.float32) if box else None,
            action_high=space.high.reshape(-1).astype(np.float32) if box else None,
            settings=settings,
        )
        if box:
            check_actions(training.actions, (space.low, space.high), env_id)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    notes = []
    if training.policy_class is None:
        notes.append(
            f"{path} does not name the class of its policy; it was read as the one whose weights "
            "have these names"
        )
    statistics, note, doubt = find_statistics(source, training, normalise, env.observation_space)
    if statistics is not None and len(statistics.mean) != policy.n_features:
        raise InputError(
            f"{path} takes {policy.n_features} features, and the statistics given with it or "
            f"beside it are of {len(statistics.mean)}; give those of this policy"
        )
    odd = odd_observations(training, env.observation_space, env_id)
    notes += [each for each in (note, f"{path}: {odd}" if odd else "") if each]
    return replace(policy, normalisation=statistics), tuple(notes), doubt


def _entries(path: Path) -> tuple[bytes, bytes]:
    """The weights and the text."""
    try:
        with opened(limited_bytes(path, MAX_POLICY_BYTES)) as archive:
            check_unpacked_size(archive)
            contents = []
            # Half of what a policy may take: the weights are in memory twice while they are read.
            for name, most in (("policy.pth", MAX_POLICY_BYTES // 2), ("data", MAX_BYTES)):
                entry = archive.getinfo(name)
                if entry.file_size > most:
                    raise InputError(
                        f"its {name} unpacks to more than {most // 2**20} MB, more than any "
                        "MlpPolicy has; give a policy file"
                    )
                contents.append(entry_content(archive, entry, most))
            return contents[0], contents[1]
    except KeyError as error:
        raise InputError(
            f"{path} is not a model of Stable-Baselines3 (it lacks policy.pth or data); "
            "give what model.save() wrote"
        ) from error
    except OSError as error:
        raise InputError(
            f"{path} cannot be read as a zip file ({error.strerror or type(error).__name__}); "
            "give what model.save() wrote"
        ) from error
    except InputError as error:
        raise InputError(f"{path} cannot be read as a zip file: {error}") from error


def _state(data: bytes) -> dict[str, NDArray[np.float32]]:
    """Weights by name, from the bytes of `policy.pth`."""
    import torch

    if not data.startswith(b"PK"):
        raise _no_weights()
    try:
        # Torch's older format is a bare pickle stream; only the zip has sizes to check first.
        with opened(data) as archive:
            check_unpacked_size(archive)
            for entry in archive.infolist():
                # Each byte of a pickle may become an object of a hundred.
                if entry.filename.endswith(".pkl") and entry.file_size > _MAX_STRUCTURE:
                    raise InputError(
                        "its policy.pth lists more than any MlpPolicy has; give a policy file"
                    )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a pickle protocol that is not its own
            loaded = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except InputError:
        raise
    except Exception as error:  # torch's reader may raise anything on what is damaged
        raise _no_weights() from error
    if not isinstance(loaded, dict):
        raise InputError("its policy.pth holds no weights by name; save the model again")
    tensors = {str(name): value for name, value in loaded.items() if torch.is_tensor(value)}
    if any(not _is_plain(tensor) for tensor in tensors.values()):
        raise InputError("its weights are no plain numbers; save the model again")
    # A tensor may claim to be larger than what it is stored in (a stride of zero).
    if sum(tensor.numel() for tensor in tensors.values()) * 4 > MAX_POLICY_BYTES:
        raise InputError("its weights claim more memory than any MlpPolicy has; give a policy")
    return {name: tensor.detach().to(torch.float32).numpy() for name, tensor in tensors.items()}


def _no_weights() -> InputError:
    return InputError(
        "its policy.pth holds something else than weights, and is not opened; give a file that "
        "model.save() wrote"
    )


def _is_plain(tensor: Any) -> bool:
    """Whether a tensor holds real numbers, one after the other, in this computer's memory."""
    import torch

    return (
        tensor.layout == torch.strided
        and tensor.device.type == "cpu"
        and not tensor.is_quantized
        and not tensor.is_complex()
    )
