"""From the names of Stable-Baselines3's weights to the layers of a policy.

Both ways in come through here: a learner in memory, and the weights inside a `.zip`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.activations import Activation
from sarl_core.agents.mlp_policy import Head, MlpPolicy, Normalisation
from sarl_core.agents.plain_pickle import named
from sarl_core.agents.sb3_settings import KNOWN_ALGORITHMS, PolicySettings
from sarl_core.errors import InputError

Weights = Mapping[str, NDArray[np.float32]]
Layer = tuple[NDArray[np.float32], NDArray[np.float32]]
Layers = list[Layer]
_Affine = tuple[NDArray[np.float64], NDArray[np.float64]]

# Every name that the networks which are read here may hold; another one is another network.
_KNOWN = re.compile(
    r"(mlp_extractor\.(shared|policy|value)_net\.\d+|(action|value)_net|action_net\.\d+"
    r"|q_net(_target)?\.q_net\.\d+|quantile_net(_target)?\.quantile_net\.\d+"
    r"|actor(_target)?\.(latent_pi|mu)\.\d+|actor\.(mu|log_std))\.(weight|bias)"
    r"|actor\.latent_pi\.\d+\.(scale|ra_mean|ra_var|steps)|(actor\.)?log_std"
    r"|critic(_target)?\..+"
)


class _Network(NamedTuple):
    """Layers of (inputs, outputs) weights and biases, and what they mean."""

    layers: Layers
    head: Head
    activation: Activation
    mean_bound: float | None = None
    noise_by_state: bool = False


def policy_from_state(
    state: Weights,
    *,
    discrete: bool,
    label_counts: tuple[int, ...] = (),
    action_low: NDArray[np.float32] | None = None,
    action_high: NDArray[np.float32] | None = None,
    settings: PolicySettings | None = None,
    normalisation: Normalisation | None = None,
    env_id: str = "",
) -> MlpPolicy:
    """Build a policy from the weights of an `MlpPolicy` of Stable-Baselines3.

    Args:
        state: Weights by their names in the policy's state dict.
        discrete: Whether the actions are discrete.
        label_counts: Number of labels a discrete dimension; found from the weights if there
            is one dimension.
        action_low: Bounds of continuous actions, shape (m,).
        action_high: Bounds of continuous actions, shape (m,).
        settings: What the weights do not say; what the algorithms do unless told otherwise.
        normalisation: Of the observations.
        env_id: Kept with the policy.

    Returns:
        The policy.

    Raises:
        InputError: If the names are of another kind of policy, or do not fit the actions.
    """
    settings = settings or PolicySettings()
    network = _network(state, settings, discrete=discrete)
    if discrete and not label_counts:
        label_counts = (len(network.layers[-1][1]),)
    layers = _one_output_a_label(network.layers, label_counts) if discrete else network.layers
    _check_outputs(len(layers[-1][1]), network.head, label_counts, action_low)
    return MlpPolicy(
        weights=tuple(np.ascontiguousarray(weight) for weight, _ in layers),
        biases=tuple(bias for _, bias in layers),
        activation=settings.activation or network.activation,
        head=network.head,
        label_counts=label_counts if discrete else (),
        log_std=_array(state, "log_std") if network.head == "gaussian" else None,
        action_low=None if discrete else action_low,
        action_high=None if discrete else action_high,
        normalisation=normalisation,
        env_id=env_id,
        mean_bound=network.mean_bound,
        noise_by_state=network.noise_by_state,
    )


def _network(state: Weights, settings: PolicySettings, *, discrete: bool) -> _Network:
    stranger = next((name for name in state if not _KNOWN.fullmatch(name)), None)
    read = next((reader for name, reader in _READERS if _has(state, name)), None)
    if stranger is not None or read is None:
        because = "" if stranger is None else f" (they hold {named(stranger)})"
        raise InputError(
            f"the weights are not those of an MlpPolicy of {KNOWN_ALGORITHMS}{because}; "
            "give such a .zip, or an .npz policy"
        )
    network = read(state, settings, discrete)
    has_labels = network.head in ("greedy", "categorical") and "log_std" not in state
    if discrete != has_labels:
        raise InputError(
            "the weights are of a policy for "
            f"{'continuous' if discrete else 'discrete'} actions and the environment takes "
            f"{'discrete' if discrete else 'continuous'} ones; choose a policy trained on it"
        )
    return network


def _has(state: Weights, name: str) -> bool:
    return any(known.startswith(name) for known in state)


def _actor_critic(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """PPO, A2C, TRPO; the first layers may be shared with the critic, in older files."""
    names = [
        *_sequence(state, "mlp_extractor.shared_net"),
        *_sequence(state, "mlp_extractor.policy_net"),
        "action_net",
    ]
    layers = [_layer(state, name) for name in names]
    if "log_std" not in state:
        return _Network(layers, "categorical", "tanh")
    if _array(state, "log_std").ndim == 2:
        head: Head = "squashed" if settings.squash_output else "clipped"
        return _Network(layers, head, "tanh", noise_by_state=True)
    return _Network(layers, "gaussian", "tanh")


def _values(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """DQN."""
    return _Network(_layers(state, _VALUES), "greedy", "relu")


def _quantiles(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """QR-DQN: the value of an action is the mean of its quantiles, which is one more layer."""
    *hidden, (weight, bias) = _layers(state, _QUANTILES)
    n = settings.n_quantiles
    if len(bias) % n:
        raise InputError(
            f"its last layer has {len(bias)} outputs, which are not {n} quantiles of each action; "
            "save the policy again"
        )
    weights = weight.astype(np.float64).reshape(len(weight), n, len(bias) // n).mean(axis=1)
    biases = bias.astype(np.float64).reshape(n, len(bias) // n).mean(axis=0)
    last = (weights.astype(np.float32), biases.astype(np.float32))
    return _Network([*hidden, last], "greedy", "relu")


def _squashed(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """SAC, TQC, CrossQ."""
    hidden: Layers = []
    pending: _Affine | None = None  # the batch normalisation that came last
    for name in _sequence(state, "actor.latent_pi", also="ra_mean"):
        if f"{name}.ra_mean" in state:
            pending = _batch_normalisation(state, name, settings.batch_norm_eps)
        else:
            hidden.append(_after(pending, _layer(state, name)))
            pending = None
    by_state = "actor.log_std" in state
    bounded = "actor.mu.0.weight" in state
    mean = _after(pending, _layer(state, "actor.mu.0" if bounded else "actor.mu"))
    if by_state:
        bound = settings.clip_mean if bounded else None
        return _Network([*hidden, mean], "squashed", "relu", bound, noise_by_state=True)
    log_std = _after(pending, _layer(state, "actor.log_std"))
    if mean[0].shape != log_std[0].shape:
        raise InputError("its mean and its deviation differ in shape; save the policy again")
    # Mean and log standard deviation side by side, as one layer.
    last = (np.concatenate([mean[0], log_std[0]], axis=1), np.concatenate([mean[1], log_std[1]]))
    return _Network([*hidden, last], "squashed_gaussian", "relu")


def _deterministic(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """TD3, DDPG."""
    return _Network(_layers(state, "actor.mu"), "squashed", "relu")


def _searched(state: Weights, settings: PolicySettings, discrete: bool) -> _Network:
    """ARS, of which the weights do not say whether actions are labels or go through a tanh."""
    layers = _layers(state, "action_net", bias_needed=False)
    if discrete:
        return _Network(layers, "greedy", "relu")
    if settings.squash_output is None:
        raise InputError(
            "it does not say whether its actions go through a tanh; save the policy again"
        )
    return _Network(layers, "squashed" if settings.squash_output else "clipped", "relu")


_VALUES, _QUANTILES = "q_net.q_net", "quantile_net.quantile_net"
_Reader = Callable[[Weights, PolicySettings, bool], _Network]
_READERS: tuple[tuple[str, _Reader], ...] = (
    # The first name that there is decides.
    (f"{_VALUES}.", _values),
    (f"{_QUANTILES}.", _quantiles),
    ("action_net.weight", _actor_critic),
    ("action_net.", _searched),
    ("actor.log_std", _squashed),
    ("actor.mu.", _deterministic),
)


def _batch_normalisation(state: Weights, name: str, eps: float) -> _Affine:
    """What it multiplies each input by and adds to it, once trained."""
    mean, variance, gain, offset = (
        _array(state, f"{name}.{part}").astype(np.float64)
        for part in ("ra_mean", "ra_var", "scale", "bias")
    )
    if not mean.shape == variance.shape == gain.shape == offset.shape == (mean.size,):
        raise InputError(f"the parts of {name!r} differ in length; save the policy again")
    if not (variance + eps > 0.0).all():
        raise InputError(f"the variance of {name!r} is below 0; save the policy again")
    scale = gain / np.sqrt(variance + eps)
    return scale, offset - mean * scale


def _after(normalisation: _Affine | None, layer: Layer) -> Layer:
    """One layer that does what a batch normalisation and the layer after it do."""
    if normalisation is None:
        return layer
    (scale, shift), (weight, bias) = normalisation, layer
    if len(scale) != len(weight):
        raise InputError("a batch normalisation does not fit its layer; save the policy again")
    return (
        (scale[:, None] * weight).astype(np.float32),
        (bias + shift @ weight.astype(np.float64)).astype(np.float32),
    )


def _check_outputs(
    outputs: int, head: Head, label_counts: tuple[int, ...], low: NDArray[np.float32] | None
) -> None:
    dimensions = 0 if low is None else len(low) * (2 if head == "squashed_gaussian" else 1)
    if outputs != (sum(label_counts) or dimensions):
        raise InputError(
            f"the policy's last layer has {outputs} outputs where the environment's actions need "
            f"{sum(label_counts) or dimensions}; choose a policy trained on it"
        )


def _one_output_a_label(layers: Layers, label_counts: tuple[int, ...]) -> Layers:
    """Give yes-no outputs (one logit for "yes") a second one, so that all heads look alike."""
    weight, bias = layers[-1]
    if set(label_counts) != {2} or len(bias) != len(label_counts):
        return layers
    wide_weight = np.zeros((weight.shape[0], 2 * len(bias)), dtype=np.float32)
    wide_bias = np.zeros(2 * len(bias), dtype=np.float32)
    wide_weight[:, 1::2], wide_bias[1::2] = weight, bias
    return [*layers[:-1], (wide_weight, wide_bias)]


def _sequence(state: Weights, prefix: str, also: str = "weight") -> list[str]:
    """Names of a Sequential's layers that have weights, or `also`, in order."""
    pattern = re.compile(rf"{re.escape(prefix)}\.(\d+)\.(?:weight|{also})")
    numbers = sorted({int(match[1]) for name in state if (match := pattern.fullmatch(name))})
    return [f"{prefix}.{number}" for number in numbers]


def _layers(state: Weights, prefix: str, *, bias_needed: bool = True) -> Layers:
    """Those of a Sequential; there is at least one."""
    names = _sequence(state, prefix) or [f"{prefix}.0"]
    return [_layer(state, name, bias_needed=bias_needed) for name in names]


def _layer(state: Weights, name: str, *, bias_needed: bool = True) -> Layer:
    weight = _array(state, f"{name}.weight")
    if weight.ndim != 2:
        raise InputError(f"{named(name)} is no layer of an MlpPolicy; give such a policy")
    if not bias_needed and f"{name}.bias" not in state:
        return weight.T, np.zeros(len(weight), dtype=np.float32)
    bias = _array(state, f"{name}.bias")
    if bias.shape != (len(weight),):
        raise InputError(f"the parts of {named(name)} differ in length; save the policy again")
    return weight.T, bias


def _array(state: Weights, name: str) -> NDArray[np.float32]:
    if name not in state:
        raise InputError(f"the policy's weights lack {named(name)}; save the policy again")
    return np.asarray(state[name], dtype=np.float32)
