"""From the names of Stable-Baselines3's weights to the layers of a policy.

Both ways in come through here: a learner in memory, and the weights inside a `.zip`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.rollouts.policies import Activation, Head, MlpPolicy, Normalisation

Weights = Mapping[str, NDArray[np.float32]]


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
        InputError: If the names are of another kind of policy.
    """
    if any(name.startswith("q_net.q_net.") for name in state):
        layers, head, default = _sequence(state, "q_net.q_net"), "greedy", "relu"
    elif "action_net.weight" in state:
        hidden = _sequence(state, "mlp_extractor.policy_net")
        layers = [*hidden, "action_net"]
        head, default = ("categorical" if discrete else "gaussian"), "tanh"
    elif "actor.mu.weight" in state and "actor.log_std.weight" in state:
        layers, head, default = _sequence(state, "actor.latent_pi"), "squashed_gaussian", "relu"
    else:
        raise InputError(
            "the weights are not those of an MlpPolicy of PPO, A2C or DQN; "
            "give such a .zip, or an .npz policy"
        )
    weights = [_array(state, f"{layer}.weight").T for layer in layers]
    biases = [_array(state, f"{layer}.bias") for layer in layers]
    if head == "squashed_gaussian":
        weights.append(np.concatenate(
            [_array(state, "actor.mu.weight").T, _array(state, "actor.log_std.weight").T], axis=1))
        biases.append(np.concatenate(
            [_array(state, "actor.mu.bias"), _array(state, "actor.log_std.bias")]))
    if discrete and not label_counts:
        label_counts = (int(biases[-1].shape[0]),)
    chosen: Head = head  # type: ignore[assignment]  # one of the literals above
    return MlpPolicy(
        weights=tuple(np.ascontiguousarray(weight) for weight in weights),
        biases=tuple(biases),
        activation=activation or default,  # type: ignore[arg-type]  # a literal above
        head=chosen,
        label_counts=label_counts if discrete else (),
        log_std=_array(state, "log_std") if head == "gaussian" else None,
        action_low=action_low,
        action_high=action_high,
        normalisation=normalisation,
        env_id=env_id,
    )


def _sequence(state: Weights, prefix: str) -> list[str]:
    """Names of a Sequential's linear layers, in order."""
    pattern = re.compile(re.escape(prefix) + r"\.(\d+)\.weight")
    numbers = sorted(int(match[1]) for name in state if (match := pattern.fullmatch(name)))
    return [f"{prefix}.{number}" for number in numbers]


def _array(state: Weights, name: str) -> NDArray[np.float32]:
    if name not in state:
        raise InputError(f"the policy's weights lack {name!r}; save the policy again")
    return np.asarray(state[name], dtype=np.float32)
