"""What a Stable-Baselines3 model remembers of its observations: statistics, spaces, the last ones.

All of it lies in pickles, which `plain_pickle` reads without running them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.mlp_policy import Normalisation
from sarl_core.agents.plain_pickle import MAX_BYTES, Made, read_pickle
from sarl_core.errors import InputError

_STATISTICS = "stable_baselines3.common.vec_env.vec_normalize.VecNormalize"
_RUNNING = "stable_baselines3.common.running_mean_std.RunningMeanStd"
_RECONSTRUCT = ("numpy._core.multiarray._reconstruct", "numpy.core.multiarray._reconstruct")
_SCALAR = ("numpy._core.multiarray.scalar", "numpy.core.multiarray.scalar")
_BUFFER = ("numpy._core.numeric._frombuffer", "numpy.core.numeric._frombuffer")
_TEXT_AS_BYTES = "_codecs.encode"  # how bytes look in a pickle of protocol 2

_RANDOM = (  # a space that has been sampled keeps its generator
    "numpy.random._pickle.__generator_ctor",
    "numpy.random._pickle.__bit_generator_ctor",
    "numpy.random._pickle.__randomstate_ctor",
    "numpy.random._pcg64.PCG64",
    "numpy.random._mt19937.MT19937",
    "numpy.random.bit_generator.SeedSequence",
    "numpy.random.bit_generator.__pyx_unpickle_SeedSequence",
    "numpy.random._bit_generator.SeedSequence",
    "numpy.random._bit_generator.__pyx_unpickle_SeedSequence",
    "gym.utils.seeding.RandomNumberGenerator",
)
_SPACES = frozenset(
    f"{package}.spaces.{name}"
    for package in ("gymnasium", "gym")
    for name in (
        "box.Box",
        "discrete.Discrete",
        "multi_discrete.MultiDiscrete",
        "multi_binary.MultiBinary",
        "dict.Dict",
        "tuple.Tuple",
    )
)
KNOWN = frozenset(
    {
        _STATISTICS,
        _RUNNING,
        *_RECONSTRUCT,
        *_SCALAR,
        *_BUFFER,
        _TEXT_AS_BYTES,
        "numpy.ndarray",
        "numpy.dtype",
        "collections.OrderedDict",
        *_RANDOM,
        *_SPACES,
    }
)
_NUMBERS = re.compile(r"[fiub][1248]")


def load_statistics(path: Path) -> Normalisation | None:
    """Read the statistics that `VecNormalize.save` wrote, without running anything in them.

    Args:
        path: The `.pkl` file.

    Returns:
        The statistics; None where they say that observations were left as they are.

    Raises:
        InputError: If it is no such file, or holds anything else.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(
            f"the statistics {path} cannot be read ({reason}); check the path"
        ) from error
    try:
        return _normalisation(read_pickle(data, KNOWN))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_box(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Bounds of a space that is a box.

    Args:
        data: Its pickle.

    Returns:
        Lower and upper bounds; None if it is another space, or cannot be read.
    """
    try:
        space = read_pickle(data, KNOWN)
        if not isinstance(space, Made) or not space.maker.endswith(".box.Box"):
            return None
        return _array(space.state["low"]), _array(space.state["high"])
    except (InputError, KeyError, TypeError):
        return None


def read_array(data: bytes) -> NDArray[np.float64] | None:
    """An array from its pickle.

    Args:
        data: The pickle.

    Returns:
        The array; None if it is something else, or cannot be read.
    """
    try:
        return _array(read_pickle(data, KNOWN))
    except InputError:
        return None


def _normalisation(made: Any) -> Normalisation | None:
    if not isinstance(made, Made) or made.maker != _STATISTICS or not isinstance(made.state, dict):
        raise InputError(
            "it holds no statistics of observations; give the .pkl that VecNormalize.save() wrote"
        )
    fields = made.state
    if fields.get("norm_obs", True) is False:
        return None
    running = fields.get("obs_rms")
    if isinstance(running, dict):
        raise InputError(
            "it holds statistics of observations in several parts, which no MlpPolicy takes; "
            "give those of this policy"
        )
    if (
        not isinstance(running, Made)
        or running.maker != _RUNNING
        or not isinstance(running.state, dict)
    ):
        raise InputError("it lacks the statistics 'obs_rms'; save the statistics again")
    mean, variance = (_array(running.state.get(name)).reshape(-1) for name in ("mean", "var"))
    clip, epsilon = (_number(fields.get(name)) for name in ("clip_obs", "epsilon"))
    if (
        mean.shape != variance.shape
        or not np.isfinite([*mean, *variance, epsilon]).all()
        or not clip > 0.0
        or not (variance + epsilon > 0.0).all()
    ):
        raise InputError(
            "its means and variances are not one number a feature each; save the statistics again"
        )
    return Normalisation(mean=mean, variance=variance, clip=clip, epsilon=epsilon)


def _number(value: Any) -> float:
    try:
        if isinstance(value, Made) and value.maker in _SCALAR:
            kind, data = value.arguments
            return float(_from_bytes(data, kind, ())[()])
        if isinstance(value, (int, float)):
            return float(value)
    except (ValueError, TypeError, LookupError, OverflowError) as error:
        raise InputError("one of its numbers is damaged; save the statistics again") from error
    raise InputError("it lacks a number of its statistics; save the statistics again")


def _array(value: Any) -> NDArray[np.float64]:
    """An array from the note of how it would have been made."""
    try:
        if isinstance(value, Made) and value.maker in _RECONSTRUCT:
            *_, shape, kind, by_columns, data = value.state
            return _from_bytes(data, kind, shape, "F" if by_columns else "C")
        if isinstance(value, Made) and value.maker in _BUFFER:
            data, kind, shape, order = value.arguments
            return _from_bytes(data, kind, shape, "F" if order == "F" else "C")
    except (ValueError, TypeError, LookupError) as error:
        raise InputError("one of its arrays is damaged; save it again") from error
    raise InputError("it lacks one of its arrays; save it again")


def _from_bytes(data: Any, kind: Any, shape: Any, order: Any = "C") -> NDArray[np.float64]:
    if isinstance(data, Made) and data.maker == _TEXT_AS_BYTES:
        data = str(data.arguments[0]).encode("latin-1")
    if not isinstance(data, (bytes, bytearray)) or not isinstance(shape, tuple):
        raise TypeError
    array = np.frombuffer(data, _dtype(kind)).reshape(shape, order=order)
    result: NDArray[np.float64] = array.astype(np.float64)
    return result


def _dtype(kind: Any) -> np.dtype[Any]:
    """The type of an array's numbers; numbers only."""
    if not isinstance(kind, Made) or kind.maker != "numpy.dtype":
        raise TypeError
    code = kind.arguments[0]
    if not isinstance(code, str) or not _NUMBERS.fullmatch(code):
        raise TypeError
    byte_order = kind.state[1] if isinstance(kind.state, tuple) else "="
    return np.dtype({"<": "<", ">": ">"}.get(byte_order, "=") + code)
