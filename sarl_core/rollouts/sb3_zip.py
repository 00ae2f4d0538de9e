"""Reading a Stable-Baselines3 `.zip` without running anything that is in it.

Two entries are looked at: `policy.pth`, by torch's reader for weights only, and `data`: its plain
text, and of its pickles those of the spaces and the last observations, read as data.
"""

from __future__ import annotations

import base64
import io
import json
import lzma
import pickle
import re
import zipfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.rollouts.files import MAX_POLICY_BYTES, check_unpacked_size
from sarl_core.rollouts.plain_pickle import MAX_BYTES
from sarl_core.rollouts.policies import MlpPolicy, Normalisation
from sarl_core.rollouts.sb3_settings import WITH_BUFFER, read_settings
from sarl_core.rollouts.sb3_statistics import load_statistics, read_array, read_box
from sarl_core.rollouts.sb3_weights import policy_from_state
from sarl_core.rollouts.spaces import label_counts

AS_THEY_ARE = "none"  # in the place of statistics: observations were not normalised

Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]

_CLASS_OF_METHOD = re.compile(r"<function (\w+)\.")
_TRIED_EPISODES, _TRIED_STEPS = 4, 50


@dataclass(frozen=True)
class _Told:
    """What a model says of itself.

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


def load_sb3_zip(
    path: str | Path, env: Any, env_id: str, *, normalise: str | Path | None = None
) -> tuple[MlpPolicy, tuple[str, ...]]:
    """Read the policy of a `.zip` that Stable-Baselines3 or its contrib saved.

    Args:
        path: The file.
        env: The environment, for its spaces.
        env_id: Its id.
        normalise: The `.pkl` with the statistics of its observations, or ``none`` where they
            were not normalised; looked for beside the file where not given.

    Returns:
        The policy, in NumPy; and sentences on what was found, and on what looks odd.

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
        told = _told(text)
        settings = read_settings(told.policy_class, told.arguments)
        policy = policy_from_state(
            _state(weights, source),
            discrete=not box,
            label_counts=counts,
            action_low=space.low.reshape(-1).astype(np.float32) if box else None,
            action_high=space.high.reshape(-1).astype(np.float32) if box else None,
            settings=settings,
            env_id=env_id,
        )
        if box:
            _check_actions(told.actions, (space.low, space.high), env_id)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    notes = []
    if told.policy_class is None:
        notes.append(
            f"{path} does not name the class of its policy; it was read as the one whose weights "
            "have these names"
        )
    statistics, note = _statistics(source, told, normalise, env)
    if statistics is not None and len(statistics.mean) != policy.n_features:
        raise InputError(
            f"{path} takes {policy.n_features} features, and the statistics given with it or "
            f"beside it are of {len(statistics.mean)}; give those of this policy"
        )
    odd = _odd_observations(told, env.observation_space, env_id)
    notes += [each for each in (note, f"{path}: {odd}" if odd else "") if each]
    return replace(policy, normalisation=statistics), tuple(notes)


def _entries(path: Path) -> tuple[bytes, bytes]:
    """The weights and the text."""
    try:
        with zipfile.ZipFile(path) as archive:
            check_unpacked_size(archive, path)
            # Half of what a policy may take: the weights are in memory twice while they are read.
            for entry, most in (("policy.pth", MAX_POLICY_BYTES // 2), ("data", MAX_BYTES)):
                if archive.getinfo(entry).file_size > most:
                    raise InputError(
                        f"{path}: its {entry} unpacks to more than {most // 2**20} MB, more than "
                        "any MlpPolicy has; give a policy file"
                    )
            return archive.read("policy.pth"), archive.read("data")
    except InputError:
        raise
    except KeyError as error:
        raise InputError(
            f"{path} is not a model of Stable-Baselines3 (it lacks policy.pth or data); "
            "give what model.save() wrote"
        ) from error
    except (
        OSError,
        zipfile.BadZipFile,
        EOFError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        zlib.error,
        lzma.LZMAError,
    ) as error:
        raise InputError(
            f"{path} cannot be read as a zip file (it is damaged, encrypted, or packed in a way "
            "that is not known); give what model.save() wrote"
        ) from error


def _told(text: bytes) -> _Told:
    """Read `data`.

    Stable-Baselines3 writes each object twice: pickled, and as text for people, as in
    ``"policy_kwargs": {"activation_fn": "<class 'torch...activation.ReLU'>"}``.
    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError("its entry 'data' is no JSON; give what model.save() wrote") from error
    if not isinstance(data, dict):
        raise InputError("its entry 'data' holds no settings; give what model.save() wrote")
    arguments = data.get("policy_kwargs")
    if not isinstance(arguments, dict):
        arguments = {}
    return _Told(
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
    found = (_CLASS_OF_METHOD.match(text) for text in methods if isinstance(text, str))
    name = next((match[1] for match in found if match), "")
    return f"{written['__module__']}.{name}".removesuffix(".")


def _pickled(written: object) -> bytes:
    """The pickle of an object; nothing where it is not there."""
    serialised = written.get(":serialized:") if isinstance(written, dict) else None
    try:
        return base64.b64decode(serialised) if isinstance(serialised, str) else b""
    except ValueError:
        return b""


def _statistics(
    path: Path, told: _Told, given: str | Path | None, env: Any
) -> tuple[Normalisation | None, str]:
    """The statistics of a model's observations, and a sentence on where they are from."""
    if given is not None and str(given) == AS_THEY_ARE:
        return None, ""
    normalised = _is_normalised(told, env.observation_space)
    if given is not None:
        found = load_statistics(Path(given))
        if found is None:
            return None, f"{given} says that the observations of {path} were not normalised"
        unasked = normalised is False or (normalised is None and not _explains(found, told))
        return found, (
            f"{path} does not look as if it was trained under this VecNormalize; observations "
            f"are normalised by {given} all the same"
            if unasked
            else ""
        )
    if normalised is False:
        return None, ""
    if normalised is None:
        return _explaining(path, told, env)
    file = _beside(path)
    if file is None:
        raise InputError(
            f"{path} was trained under a VecNormalize, and its statistics do not lie beside it; "
            "without them it would act at random. Give the .pkl that VecNormalize.save() wrote "
            f"(--normalise FILE), or --normalise {AS_THEY_ARE} if only rewards were normalised"
        )
    found = load_statistics(file)
    if found is None:
        return None, f"{file} says that the observations of {path} were not normalised"
    return found, f"observations are normalised by {file}, which lies beside {path.name}"


def _is_normalised(told: _Told, space: Any) -> bool | None:
    """Whether a model was trained under a VecNormalize; None where it does not tell."""
    if not told.originals:
        return False
    if told.policy_class is not None and told.policy_class not in WITH_BUFFER:
        return True  # these keep originals only then
    if told.last is None or told.original is None or told.last.shape != told.original.shape:
        return None
    if np.array_equal(told.last, told.original):
        return False
    outside = [_outside(rows, space) for rows in (told.last, told.original)]
    if outside[0] is not None and outside[1] is None:
        return True
    return None


def _explaining(path: Path, told: _Told, env: Any) -> tuple[Normalisation | None, str]:
    """The statistics beside a model that make of its last observations what it says it saw."""
    for file in (*_own_names(path), *_shared_names(path)):
        if not file.is_file():
            continue
        found = load_statistics(file)
        if found is not None and _explains(found, told):
            return found, f"observations are normalised by {file}, which lies beside {path.name}"
    if _jumps(told, env):
        return None, (
            f"{path}: what it saw last in its training is no step of this environment; if it was "
            "trained under a VecNormalize, it acts wrongly here: give the .pkl that "
            "VecNormalize.save() wrote (--normalise FILE)"
        )
    return None, ""


def _explains(statistics: Normalisation, told: _Told) -> bool:
    """Whether statistics make what a model saw last of what it was before; nearly will do."""
    last, original = told.last, told.original
    if last is None or original is None or last.shape != original.shape:
        return False
    if last.ndim != 2 or last.shape[1] != len(statistics.mean):
        return False
    made = np.clip(statistics.deviations(original), -statistics.clip, statistics.clip)
    return bool((np.abs(made - last) <= 0.1 + 0.05 * np.abs(last)).all())


def _jumps(told: _Told, env: Any) -> bool:
    """Whether from a model's last observation but one to its last is no step of an environment.

    Either it is no longer than three times the longest of some random steps, in each feature, or
    it leads to where episodes start.
    """
    last, before = told.last, told.original
    if last is None or before is None or last.shape != before.shape:
        return False
    if last.shape[1:] != env.observation_space.shape or last.ndim != 2:
        return False
    env.action_space.seed(0)
    starts, steps = [], []
    for seed in range(_TRIED_EPISODES):
        now, over = np.asarray(env.reset(seed=seed)[0], dtype=np.float64), False
        starts.append(now)
        for _ in range(_TRIED_STEPS):
            if over:
                break
            observed, _, terminated, truncated, _ = env.step(env.action_space.sample())
            now, then, over = np.array(observed, np.float64), now, terminated or truncated
            steps.append(np.abs(now - then))
    low, high = np.min(starts, axis=0), np.max(starts, axis=0)
    width = high - low + 1e-3
    starting = ((last >= low - width) & (last <= high + width)).all(axis=1)
    stepping = (np.abs(last - before) <= 3.0 * np.max(steps, axis=0) + 1e-3).all(axis=1)
    return not bool((starting | stepping).all())


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
    found = [file for file in _own_names(path) if file.is_file()]
    own = bool(found)
    found = found or [file for file in _shared_names(path) if file.is_file()]
    if not found:
        return None
    others = sorted(file.name for file in path.parent.glob("*.zip") if file.name != path.name)
    if len(found) > 1 or (others and not own):
        doubt = found[1].name if len(found) > 1 else others[0]
        raise InputError(
            f"{path} was trained under a VecNormalize; beside it lie {found[0].name} and {doubt}, "
            "so it is not clear which statistics are its own; say so with --normalise FILE"
        )
    return found[0]


def _check_actions(trained: Bounds | None, given: Bounds, env_id: str) -> None:
    """Refuse actions of another range, as behind a wrapper that scales them."""
    if trained is None or trained[0].size != given[0].size:
        return
    i = _first_difference(trained, given)
    if i is not None:
        raise InputError(
            f"its actions lay between {_range(trained, i)} in training, and {env_id} takes "
            f"{_range(given, i)}; give an --env with the wrapper that it was trained behind"
        )


def _odd_observations(told: _Told, space: Any, env_id: str) -> str:
    """In what the observations of its training look unlike the environment's."""
    from gymnasium.spaces import Box

    if not isinstance(space, Box):
        return ""
    advice = (
        "; if a wrapper changed them (NormalizeObservation, say), it acts wrongly here: give an "
        "--env with that wrapper"
    )
    given = (space.low, space.high)
    if told.observations is not None and told.observations[0].shape == space.shape:
        i = _first_difference(told.observations, given)
        if i is not None:
            return (
                f"its observations lay between {_range(told.observations, i)} in training "
                f"(feature {i}), and those of {env_id} lie between {_range(given, i)}{advice}"
            )
    # What a VecNormalize made of them is another matter.
    place = None if told.originals else _outside(told.last, space)
    if place is not None and told.last is not None:
        i = place[1]
        return (
            f"the last observation of its training had {told.last[place]:g} for feature {i}, "
            f"which in {env_id} lies between {_range(given, i)}{advice}"
        )
    return ""


def _outside(rows: NDArray[np.float64] | None, space: Any) -> tuple[int, int] | None:
    """Row and feature of the first value that is not in a box; a hair beside it is in it."""
    from gymnasium.spaces import Box

    if rows is None or not isinstance(space, Box) or rows.shape[1:] != space.shape:
        return None
    slack = 1e-4 * (1.0 + np.abs(rows))
    found = np.argwhere((rows < space.low - slack) | (rows > space.high + slack))
    return (int(found[0][0]), int(found[0][1])) if len(found) else None


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
        zlib.error,
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
    if any(not _is_plain(tensor) for tensor in tensors.values()):
        raise InputError("its weights are no plain numbers; save the model again")
    # A tensor may claim to be larger than what it is stored in (a stride of zero).
    if sum(tensor.numel() for tensor in tensors.values()) * 4 > MAX_POLICY_BYTES:
        raise InputError("its weights claim more memory than any MlpPolicy has; give a policy")
    return {name: tensor.detach().to(torch.float32).numpy() for name, tensor in tensors.items()}


def _is_plain(tensor: Any) -> bool:
    """Whether a tensor holds real numbers, one after the other, in this computer's memory."""
    import torch

    return (
        tensor.layout == torch.strided
        and tensor.device.type == "cpu"
        and not tensor.is_quantized
        and not tensor.is_complex()
    )
