"""Reading a Stable-Baselines3 `.zip` without running anything that is in it.

Two entries are looked at: `policy.pth`, by torch's reader for weights only, and the plain text
in `data`, for the activation. The pickles that `data` also holds stay closed.
"""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.rollouts.files import MAX_POLICY_BYTES, check_unpacked_size
from sarl_core.rollouts.policies import Activation, MlpPolicy
from sarl_core.rollouts.sb3_weights import policy_from_state
from sarl_core.rollouts.spaces import label_counts

_ACTIVATIONS = {"Tanh": "tanh", "ReLU": "relu"}


def load_sb3_zip(path: str | Path, env: Any, env_id: str) -> MlpPolicy:
    """Read the policy of a `.zip` that PPO, A2C or DQN saved.

    Args:
        path: The file.
        env: The environment, for the action space.
        env_id: Its id.

    Returns:
        The policy, in NumPy.

    Raises:
        InputError: If the file is no such zip, is too large, holds anything but weights where
            the weights should be, or another kind of policy.
    """
    source = Path(path)
    try:
        with zipfile.ZipFile(source) as archive:
            check_unpacked_size(archive, source)
            weights, text = archive.read("policy.pth"), archive.read("data")
    except KeyError as error:
        raise InputError(
            f"{path} is not a model of Stable-Baselines3 (it lacks policy.pth or data); "
            "give what model.save() wrote"
        ) from error
    except (OSError, zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError(
            f"{path} cannot be read as a zip file ({error}); give what model.save() wrote"
        ) from error
    from gymnasium.spaces import Box

    space = env.action_space
    box = isinstance(space, Box)
    # With one dimension the weights say how many labels there are, and the caller compares.
    counts = label_counts(space) if len(label_counts(space)) > 1 else ()
    try:
        return policy_from_state(
            _state(weights, source),
            discrete=not box,
            label_counts=counts,
            action_low=space.low.reshape(-1).astype(np.float32) if box else None,
            action_high=space.high.reshape(-1).astype(np.float32) if box else None,
            activation=_activation(text),
            env_id=env_id,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _state(data: bytes, path: Path) -> dict[str, NDArray[np.float32]]:
    """Weights by name, from the bytes of `policy.pth`."""
    import torch

    try:
        # Torch's older format is a bare pickle stream; only the zip has sizes to check first.
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            check_unpacked_size(archive, path)
        loaded = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except (
        zipfile.BadZipFile,
        pickle.UnpicklingError,
        RuntimeError,
        EOFError,
        ValueError,
        KeyError,
        IndexError,
        AttributeError,
        TypeError,
    ) as error:
        raise InputError(
            "its policy.pth holds something else than weights, and is not opened; "
            "give a file that model.save() wrote"
        ) from error
    if not isinstance(loaded, dict):
        raise InputError("its policy.pth holds no weights by name; save the model again")
    tensors = {str(name): value for name, value in loaded.items() if torch.is_tensor(value)}
    # A tensor may claim to be larger than what it is stored in (a stride of zero).
    if sum(tensor.numel() for tensor in tensors.values()) * 4 > MAX_POLICY_BYTES:
        raise InputError("its weights claim more memory than any MlpPolicy has; give a policy")
    return {
        name: tensor.detach().to(torch.float32).numpy().copy() for name, tensor in tensors.items()
    }


def _activation(text: bytes) -> Activation | None:
    """The activation, where `data` names it in plain text; None means the algorithm's default.

    Stable-Baselines3 writes each object twice: pickled, and as text for people. Only the text
    is read, as in ``"policy_kwargs": {"activation_fn": "<class 'torch...activation.ReLU'>"}``.
    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError("its entry 'data' is no JSON; give what model.save() wrote") from error
    arguments = data.get("policy_kwargs") if isinstance(data, dict) else None
    written = arguments.get("activation_fn") if isinstance(arguments, dict) else None
    if not isinstance(written, str):
        return None
    name = written.removesuffix("'>").rsplit(".", 1)[-1]
    if name not in _ACTIVATIONS:
        raise InputError(
            f"it uses the activation {name[:40]}, of which only Tanh and ReLU are known; "
            "train it with one of these"
        )
    return cast(Activation, _ACTIVATIONS[name])
