"""From the names of Stable-Baselines3's weights to the layers of a policy.

Both ways in come through here: a learner in memory, and the weights inside a `.zip`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.rollouts.policies import Activation, Head, MlpPolicy, Normalisation

Weights = Mapping[str, NDArray[np.float32]]
Layers = list[tuple[NDArray[np.float32], NDArray[np.float32]]]

_OTHER_NETWORKS = re.compile(r"features_extractor\.|lstm")


class _Network(NamedTuple):
    """Layers of (inputs, outputs) weights and biases, and what they mean."""

    layers: Layers
    head: Head
    activation: Activation


def policy_from_state(
    state: Weights,
    *,
    discrete: bool,
    label_counts: tuple[int, ...] = (),
    action_low: NDArray[np.float32] | None = None,
    action_high: NDArray[np.float32] | None = None,
    activation: Activation | None = None,
    normalisation: Normalisation | None = None,
    env_id: str = "",
) -> MlpPolicy:
    """Build a policy from the weights of PPO, A2C, DQN or SAC with `MlpPolicy`.

    Args:
        state: Weights by their names in the policy's state dict.
        discrete: Whether the actions are discrete.
        label_counts: Number of labels a discrete dimension; found from the weights if there
            is one dimension.
        action_low: Bounds of continuous actions, shape (m,).
        action_high: Bounds of continuous actions, shape (m,).
        activation: Between the layers; the default of the algorithm where not given.
        normalisation: Of the observations.
        env_id: Kept with the policy.

    Returns:
        The policy.

    Raises:
        InputError: If the names are of another kind of policy, or do not fit the actions.
    """
    network = _network(state, discrete=discrete)
    if discrete and not label_counts:
        label_counts = (len(network.layers[-1][1]),)
    layers = _one_output_a_label(network.layers, label_counts) if discrete else network.layers
    _check_outputs(len(layers[-1][1]), network.head, label_counts, action_low)
    log_std = _array(state, "log_std") if network.head == "gaussian" else None
    if log_std is not None and log_std.ndim != 1:
        raise InputError(
            "the policy explores by its state (use_sde=True), which is not read; "
            "train it with use_sde=False"
        )
    return MlpPolicy(
        weights=tuple(np.ascontiguousarray(weight) for weight, _ in layers),
        biases=tuple(bias for _, bias in layers),
        activation=activation or network.activation,
        head=network.head,
        label_counts=label_counts if discrete else (),
        log_std=log_std,
        action_low=None if discrete else action_low,
        action_high=None if discrete else action_high,
        normalisation=normalisation,
        env_id=env_id,
    )


def _network(state: Weights, *, discrete: bool) -> _Network:
    other = next((name for name in state if _OTHER_NETWORKS.search(name)), None)
    if other is None and any(name.startswith("q_net.q_net.") for name in state):
        found = _Network(_layers(state, _sequence(state, "q_net.q_net")), "greedy", "relu")
    elif other is None and "action_net.weight" in state:
        names = [*_sequence(state, "mlp_extractor.policy_net"), "action_net"]
        head: Head = "categorical" if discrete else "gaussian"
        found = _Network(_layers(state, names), head, "tanh")
    elif other is None and "actor.mu.weight" in state and "actor.log_std.weight" in state:
        hidden = _layers(state, _sequence(state, "actor.latent_pi"))
        ends = _layers(state, ["actor.mu", "actor.log_std"])
        # Mean and log standard deviation side by side, as one layer.
        last = (
            np.concatenate([weight for weight, _ in ends], axis=1),
            np.concatenate([bias for _, bias in ends]),
        )
        found = _Network([*hidden, last], "squashed_gaussian", "relu")
    else:
        because = "" if other is None else f" (they hold {other!r})"
        raise InputError(
            f"the weights are not those of an MlpPolicy of PPO, A2C or DQN{because}; "
            "give such a .zip, or an .npz policy"
        )
    has_labels = found.head == "greedy" or (
        found.head in ("categorical", "gaussian") and "log_std" not in state
    )
    if discrete != has_labels:
        raise InputError(
            "the weights are of a policy for "
            f"{'continuous' if discrete else 'discrete'} actions and the environment takes "
            f"{'discrete' if discrete else 'continuous'} ones; choose a policy trained on it"
        )
    return found


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


def _sequence(state: Weights, prefix: str) -> list[str]:
    """Names of a Sequential's linear layers, in order."""
    pattern = re.compile(re.escape(prefix) + r"\.(\d+)\.weight")
    numbers = sorted(int(match[1]) for name in state if (match := pattern.fullmatch(name)))
    return [f"{prefix}.{number}" for number in numbers]


def _layers(state: Weights, names: list[str]) -> Layers:
    return [(_array(state, f"{name}.weight").T, _array(state, f"{name}.bias")) for name in names]


def _array(state: Weights, name: str) -> NDArray[np.float32]:
    if name not in state:
        raise InputError(f"the policy's weights lack {name!r}; save the policy again")
    return np.asarray(state[name], dtype=np.float32)
