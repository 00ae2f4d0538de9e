"""Multi-layer perceptron policies in NumPy: the weights a file brings, and nothing that runs.

A policy acts on a batch, and what it does in one episode does not depend on the others in the
batch: every row is multiplied on its own (a stacked ``matmul``), so that the same seed gives the
same episode whatever the number of environments. Randomness comes in as uniform numbers, which
keeps ``act`` a pure function.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.activations import Activation, activate
from sarl_core.agents.policy_files import read_limited_npz
from sarl_core.errors import InputError, quoted
from sarl_core.files import whole_file

Head = Literal["categorical", "gaussian", "squashed_gaussian", "clipped", "squashed", "greedy"]

_FORMAT = "sarl-policy"
_VERSION = 1
_MOST_DIMENSIONS = 4096  # of an action
_VARIANCE_FLOOR = 1e-8  # what Stable-Baselines3's VecNormalize adds under the root


@dataclass(frozen=True)
class Normalisation:
    """Observation statistics a policy was trained with.

    Attributes:
        mean: Running mean, shape (d,), in the precision in which it was kept.
        variance: Running variance, shape (d,), likewise.
        clip: Bound on the normalised values, in standard deviations.
        epsilon: Added to the variance, under the root.
    """

    mean: NDArray[np.floating[Any]]
    variance: NDArray[np.floating[Any]]
    clip: float
    epsilon: float = _VARIANCE_FLOOR

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Normalise a batch.

        Args:
            observations: Shape (B, d).

        Returns:
            Shape (B, d), within [-clip, clip].
        """
        scaled = self.deviations(observations)
        clipped: NDArray[np.float32] = np.clip(scaled, -self.clip, self.clip).astype(np.float32)
        return clipped

    def deviations(self, observations: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
        """How far observations lie from the mean.

        Args:
            observations: Shape (B, d).

        Returns:
            Shape (B, d), in standard deviations.
        """
        result: NDArray[np.floating[Any]] = (observations - self.mean) / np.sqrt(
            self.variance + self.epsilon
        )
        return result


@dataclass(frozen=True, repr=False)
class MlpPolicy:
    """A trained policy: hidden layers, an output layer, and what its output means.

    Attributes:
        weights: One (inputs, outputs) matrix a layer.
        biases: One (outputs,) vector a layer.
        activation: Between the layers.
        head: ``categorical``: logits, one block of ``label_counts[i]`` a dimension;
            ``gaussian``: the mean of a normal distribution, clipped to the action space;
            ``squashed_gaussian``: mean and log standard deviation side by side, through tanh;
            ``clipped``: one action and no distribution, clipped to the action space;
            ``squashed``: one action and no distribution, through tanh;
            ``greedy``: values of discrete actions, of which the largest is taken.
        label_counts: Number of labels of each discrete dimension; empty for continuous actions.
        log_std: Of a ``gaussian`` head, shape (m,).
        action_low: Lower bounds of continuous actions, shape (m,).
        action_high: Upper bounds of continuous actions, shape (m,).
        normalisation: Of the observations, or None.
        env_id: Environment it was trained on, or "".
        mean_bound: What a ``squashed`` action is clipped to before its tanh, or None.
        noise_by_state: Whether it explored by noise that hangs on the state (gSDE), which is
            not read: such a policy cannot be sampled.
    """

    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    activation: Activation
    head: Head
    label_counts: tuple[int, ...] = ()
    log_std: NDArray[np.float32] | None = None
    action_low: NDArray[np.float32] | None = None
    action_high: NDArray[np.float32] | None = None
    normalisation: Normalisation | None = None
    env_id: str = ""
    mean_bound: float | None = None
    noise_by_state: bool = False

    def __post_init__(self) -> None:
        """Refuse weights that do not fit together.

        Raises:
            InputError: If a layer, the head, the bounds or the normalisation have the wrong
                shape, or a number is missing (NaN).
        """
        if not self.weights or self.weights[0].ndim != 2:
            raise InputError("the policy has no layers; export the policy again")
        self._check_layers()
        self._check_vectors()

    def __repr__(self) -> str:
        """Its shape, as `MlpPolicy('CartPole-v1', layers=4x64x64x2, head='categorical')`."""
        widths = [self.n_features, *(len(bias) for bias in self.biases)]
        layers = "x".join(map(str, widths))
        return f"MlpPolicy({self.env_id!r}, layers={layers}, head={self.head!r})"

    @property
    def digest(self) -> str:
        """Fingerprint (blake2b, 32 hex digits) of all that its actions depend on."""
        digest = hashlib.blake2b(digest_size=16)

        def add(value: object) -> None:
            if isinstance(value, np.ndarray):
                digest.update(f"{value.dtype}{value.shape}".encode())
                digest.update(np.ascontiguousarray(value).data)
            elif isinstance(value, tuple):
                digest.update(f"{len(value)} of".encode())
                for one in value:
                    add(one)
            else:
                digest.update(f"{value!r};".encode())

        for holder in (self, self.normalisation):
            for part in fields(holder) if holder is not None else ():
                if part.name != "normalisation":
                    add(part.name)
                    add(getattr(holder, part.name))
        return digest.hexdigest()

    def _check_layers(self) -> None:
        width = self.n_features
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.ndim != 2 or weight.shape[0] != width or bias.shape != weight.shape[1:]:
                raise InputError(
                    f"layer {layer} of the policy has weights {weight.shape} and biases "
                    f"{bias.shape}, which do not fit {width} inputs; export the policy again"
                )
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise InputError(
                    f"layer {layer} of the policy holds NaN or infinity, as after a training "
                    "that diverged; train it again"
                )
            width = weight.shape[1]
        if width != self._expected_outputs():
            raise InputError(
                f"the policy's last layer has {width} outputs where its head "
                f"({self.head}) needs {self._expected_outputs()}; export the policy again"
            )

    def _check_vectors(self) -> None:
        m, d = self.n_dimensions, self.n_features
        expected = {"action_low": m, "action_high": m, "log_std": m}
        vectors = {name: getattr(self, name) for name in expected}
        if self.normalisation is not None:
            expected |= {"observation_mean": d, "observation_variance": d}
            vectors["observation_mean"] = self.normalisation.mean
            vectors["observation_variance"] = self.normalisation.variance
        needed = [] if self.is_discrete else ["action_low", "action_high"]
        needed += ["log_std"] if self.head == "gaussian" else []
        for name, length in expected.items():
            vector = vectors[name]
            if vector is None and name not in needed:
                continue
            # Bounds may be infinite, as an action space's are.
            wrong = np.isnan if name.startswith("action") else _is_no_number
            if vector is None or vector.shape != (length,) or wrong(vector).any():
                raise InputError(
                    f"the policy's {name.replace('_', ' ')} is not a row of {length} numbers; "
                    "export the policy again"
                )
        normalisation = self.normalisation
        if normalisation is not None and not (
            normalisation.clip > 0.0 and (normalisation.variance >= 0.0).all()
        ):
            raise InputError(
                "the policy's observations are normalised by a variance or a bound below 0; "
                "export the policy again"
            )
        if any(count < 1 for count in self.label_counts):
            raise InputError(
                "the policy has an action dimension without labels; export the policy again"
            )

    @property
    def n_features(self) -> int:
        """Length of the observation vector it takes."""
        return int(self.weights[0].shape[0])

    @property
    def n_dimensions(self) -> int:
        """Number of action dimensions."""
        if self.action_low is not None:
            return int(self.action_low.shape[0])
        return len(self.label_counts)

    @property
    def is_discrete(self) -> bool:
        """Whether it gives labels and not continuous actions."""
        return self.head in ("categorical", "greedy")

    @property
    def is_sampled(self) -> bool:
        """Whether its output is a distribution, of which actions can be drawn."""
        return self.head in ("categorical", "gaussian", "squashed_gaussian")

    def _expected_outputs(self) -> int:
        if self.is_discrete:
            return sum(self.label_counts)
        return self.n_dimensions * (2 if self.head == "squashed_gaussian" else 1)

    def outputs(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Run the network.

        Args:
            observations: Shape (B, d), float32.

        Returns:
            What the last layer gives, shape (B, outputs): logits, values, or means.
        """
        hidden = observations
        if self.normalisation is not None:
            hidden = self.normalisation(hidden)
        # (B, 1, d) @ (d, h): one product a row, so that a row's result does not hang on the batch.
        stacked = hidden[:, None, :]
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            stacked = stacked @ weight + bias
            if layer < last:
                stacked = activate(self.activation, stacked)
        result: NDArray[np.float32] = stacked[:, 0, :]
        return result

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None = None
    ) -> NDArray[np.int64] | NDArray[np.float32]:
        """Choose actions.

        Args:
            observations: Shape (B, d), float32.
            uniforms: Numbers in [0, 1), shape (B, m), to sample with; None takes the most
                likely action.

        Returns:
            Labels (B, m) int64, or continuous actions (B, m) float32 within the bounds.
        """
        outputs = self.outputs(observations)
        uniforms = uniforms if self.is_sampled else None
        if self.is_discrete:
            return self._labels(outputs, uniforms)
        return self._continuous(outputs, uniforms)

    def log_probabilities(self, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """Log-probabilities of the labels of a ``categorical`` policy with one dimension.

        Args:
            observations: Shape (B, d), float32.

        Returns:
            Shape (B, labels).
        """
        logits = self.outputs(observations).astype(np.float64)
        shifted = logits - logits.max(axis=1, keepdims=True)
        result: NDArray[np.float64] = shifted - np.log(np.exp(shifted).sum(axis=1, keepdims=True))
        return result

    def _labels(
        self, outputs: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> NDArray[np.int64]:
        labels = np.empty((len(outputs), len(self.label_counts)), dtype=np.int64)
        start = 0
        for dimension, count in enumerate(self.label_counts):
            logits = outputs[:, start : start + count].astype(np.float64)
            start += count
            if uniforms is None:
                labels[:, dimension] = logits.argmax(axis=1)
                continue
            cumulative = np.exp(logits - logits.max(axis=1, keepdims=True)).cumsum(axis=1)
            drawn = uniforms[:, dimension, None] * cumulative[:, -1:]
            # The last label catches what rounding leaves over.
            labels[:, dimension] = (cumulative[:, :-1] <= drawn).sum(axis=1)
        return labels

    def _continuous(
        self, outputs: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> NDArray[np.float32]:
        from scipy.special import ndtri

        assert self.action_low is not None
        assert self.action_high is not None
        m = self.n_dimensions
        actions = outputs[:, :m]
        if uniforms is not None:
            noise = ndtri(np.clip(uniforms, 1e-12, 1.0 - 1e-12)).astype(np.float32)
            if self.head == "squashed_gaussian":
                # The bounds Stable-Baselines3's SAC puts on the logarithm.
                log_std = np.clip(outputs[:, m:], -20.0, 2.0)
            else:
                assert self.log_std is not None
                log_std = np.broadcast_to(self.log_std, actions.shape)
            actions = actions + np.exp(log_std) * noise
        if self.mean_bound is not None:
            actions = np.clip(actions, -self.mean_bound, self.mean_bound)
        if self.head in ("squashed_gaussian", "squashed"):
            span = self.action_high - self.action_low
            actions = self.action_low + 0.5 * (np.tanh(actions) + 1.0) * span
        return np.clip(actions, self.action_low, self.action_high).astype(np.float32)

    def save(self, path: str | Path) -> None:
        """Write the policy as `.npz`: arrays and strings only, no pickle.

        Args:
            path: File to write; it appears whole or not at all.

        Raises:
            InputError: If the folder does not exist.
        """
        arrays: dict[str, Any] = {
            "format": np.array(_FORMAT),
            "version": np.array(_VERSION),
            "activation": np.array(self.activation),
            "head": np.array(self.head),
            "env_id": np.array(self.env_id),
            "label_counts": np.array(self.label_counts, dtype=np.int64),
        }
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays[f"weight_{layer}"] = weight
            arrays[f"bias_{layer}"] = bias
        for name in ("log_std", "action_low", "action_high"):
            value = getattr(self, name)
            if value is not None:
                arrays[name] = value
        if self.normalisation is not None:
            arrays["observation_mean"] = self.normalisation.mean
            arrays["observation_variance"] = self.normalisation.variance
            arrays["observation_clip"] = np.array(self.normalisation.clip)
            arrays["observation_epsilon"] = np.array(self.normalisation.epsilon)
        if self.mean_bound is not None:
            arrays["mean_bound"] = np.array(self.mean_bound)
        if self.noise_by_state:
            arrays["noise_by_state"] = np.array(True)
        with whole_file(Path(path)) as unfinished, unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> MlpPolicy:
        """Read a policy that `save` wrote.

        Args:
            path: An `.npz` file.

        Returns:
            The policy.

        Raises:
            InputError: If the file is no such policy; nothing in it is executed.
        """
        arrays = read_limited_npz(Path(path))
        if str(arrays.get("format", "")) != _FORMAT or str(arrays.get("version")) != str(_VERSION):
            raise InputError(
                f"{path} is not a policy of this program (format {_FORMAT}, version {_VERSION}); "
                "export one with `train-expert`, or give a Stable-Baselines3 .zip"
            )
        head, activation = str(arrays.get("head")), str(arrays.get("activation"))
        if head not in get_args(Head) or activation not in get_args(Activation):
            raise InputError(
                f"{path} names the head {quoted(head)} and activation {quoted(activation)}, "
                "of which this version does not know both; export it again"
            )
        try:
            return cls(
                activation=cast(Activation, activation),  # both checked above
                head=cast(Head, head),
                **_parts(arrays),
            )
        except KeyError as error:
            raise InputError(
                f"{path} lacks a part of its policy, {quoted(error.args[0])}; export the policy "
                "again"
            ) from error
        except (IndexError, TypeError, ValueError, OverflowError) as error:
            raise InputError(
                f"{path} holds a part of its policy in another form; export the policy again"
            ) from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error


def _is_no_number(values: NDArray[np.float32]) -> NDArray[np.bool_]:
    return ~np.isfinite(values)


def _parts(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """The fields of a policy from the arrays of its file."""
    layers = sum(1 for name in arrays if name.startswith("weight_"))

    def plain(name: str) -> NDArray[Any]:
        values = arrays[name]
        if values.dtype.kind not in "biuf":
            raise TypeError(f"{name} are no numbers")
        return values

    def numbers(name: str) -> NDArray[np.float32]:
        with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
            return plain(name).astype(np.float32)

    def optional(name: str) -> NDArray[np.float32] | None:
        return numbers(name) if name in arrays else None

    normalisation = None
    if "observation_mean" in arrays:
        normalisation = Normalisation(
            mean=_floats(plain("observation_mean")),
            variance=_floats(plain("observation_variance")),
            clip=float(arrays["observation_clip"]),
            # Older files have the one that Stable-Baselines3 takes unless told otherwise.
            epsilon=float(arrays.get("observation_epsilon", np.array(_VARIANCE_FLOOR))),
        )
    if arrays["label_counts"].size > _MOST_DIMENSIONS:
        raise ValueError("more action dimensions than any policy has")
    return {
        "weights": tuple(numbers(f"weight_{i}") for i in range(layers)),
        "biases": tuple(numbers(f"bias_{i}") for i in range(layers)),
        "label_counts": tuple(int(count) for count in arrays["label_counts"]),
        "log_std": optional("log_std"),
        "action_low": optional("action_low"),
        "action_high": optional("action_high"),
        "normalisation": normalisation,
        "env_id": str(arrays["env_id"]),
        "mean_bound": float(arrays["mean_bound"]) if "mean_bound" in arrays else None,
        "noise_by_state": bool(arrays.get("noise_by_state", np.array(False))),
    }


def _floats(values: NDArray[Any]) -> NDArray[np.floating[Any]]:
    """Kept as precise as they are: some files have float32, some float64."""
    return values if values.dtype == np.float64 else values.astype(np.float32)
