"""What a Stable-Baselines3 model says of itself, and which of it is understood.

The weights do not tell a network of the library's from one of somebody's own that is built of
the same layers and acts otherwise: the names of the classes do. What is not known by its name is
refused by its name.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from sarl_core.agents.activations import TORCH_CLASSES, Activation
from sarl_core.agents.plain_pickle import named
from sarl_core.errors import InputError

_LINEAR_ARS = "sb3_contrib.ars.policies.ARSLinearPolicy"
POLICY_CLASSES = (
    "stable_baselines3.common.policies.ActorCriticPolicy",  # PPO, A2C, and contrib's TRPO
    "stable_baselines3.dqn.policies.DQNPolicy",
    "stable_baselines3.sac.policies.SACPolicy",
    "stable_baselines3.td3.policies.TD3Policy",  # and DDPG
    "sb3_contrib.qrdqn.policies.QRDQNPolicy",
    "sb3_contrib.tqc.policies.TQCPolicy",
    "sb3_contrib.crossq.policies.CrossQPolicy",
    "sb3_contrib.ars.policies.ARSPolicy",
    _LINEAR_ARS,
    "sarl_core.learning.learners.DecidedPolicy",  # our own: the same actions, learned otherwise
)
# Those that learn from a buffer of steps, and so keep the last observations twice.
WITH_BUFFER = POLICY_CLASSES[1:7]
KNOWN_ALGORITHMS = "PPO, A2C, DQN, SAC, TD3, DDPG, QR-DQN, TQC, CrossQ, TRPO or ARS"

_WITHOUT_EFFECT = frozenset(
    {
        # on what it does, only on how it learns
        *("ortho_init", "log_std_init", "optimizer_class", "optimizer_kwargs", "n_critics"),
        *("batch_norm_momentum", "renorm_warmup_steps", "share_features_extractor", "sharpness"),
        # or the weights themselves tell it
        *("net_arch", "with_bias", "batch_norm", "use_sde", "full_std", "use_expln"),
        # or it is of images and dictionaries, which rules cannot read
        *("features_extractor_kwargs", "normalize_images"),
    }
)
_FLAT = "stable_baselines3.common.torch_layers.FlattenExtractor"
_CLASS = re.compile(r"<class '([\w.]+)'>")
_ACTIVATION = re.compile(r"torch\.nn\.(?:modules\.\w+\.)?(\w+)")
_INSTEAD = "record demonstrations with it where it was trained, and give those"


@dataclass(frozen=True)
class PolicySettings:
    """What the weights alone do not say.

    Attributes:
        activation: Between the layers; None is the algorithm's default.
        squash_output: Whether actions go through tanh; None where nobody says.
        clip_mean: What SAC, TQC and CrossQ clip their actions to before the tanh, under gSDE.
        n_quantiles: Values that QR-DQN gives of each action.
        batch_norm_eps: What CrossQ adds to the variance of a layer, under the root.
    """

    activation: Activation | None = None
    squash_output: bool | None = None
    clip_mean: float = 2.0
    n_quantiles: int = 200
    batch_norm_eps: float = 1e-3


def read_settings(policy_class: str | None, arguments: Mapping[str, object]) -> PolicySettings:
    """Understand what a model says of itself.

    Args:
        policy_class: Module and name of its policy's class; None where it does not say.
        arguments: Of the policy; what is neither number nor truth value as text, a class as
            ``<class 'torch.nn.modules.activation.ReLU'>``.

    Returns:
        The settings.

    Raises:
        InputError: If it names something that is not known.
    """
    if policy_class is not None and policy_class not in POLICY_CLASSES:
        raise InputError(
            f"its policy is of the class {named(policy_class)}, which is not known here (only "
            f"MlpPolicy of {KNOWN_ALGORITHMS} is); {_INSTEAD}"
        )
    given = dict(arguments)
    squash: bool | None = None
    if policy_class is not None:
        squash = policy_class.startswith("sb3_contrib.ars.") and policy_class != _LINEAR_ARS
    extractor = given.pop("features_extractor_class", None)
    if extractor is not None and _class_of(extractor) != _FLAT:
        raise InputError(
            f"it extracts features by {named(_class_of(extractor))}, which is not known here "
            f"(only FlattenExtractor is); {_INSTEAD}"
        )
    settings = PolicySettings(
        activation=_activation(given.pop("activation_fn", None)),
        squash_output=_truth(given, "squash_output", squash),
        clip_mean=_number(given, "clip_mean", PolicySettings.clip_mean),
        n_quantiles=int(_number(given, "n_quantiles", PolicySettings.n_quantiles, least=1)),
        batch_norm_eps=_number(given, "batch_norm_eps", PolicySettings.batch_norm_eps),
    )
    unknown = sorted(set(given) - _WITHOUT_EFFECT)
    if unknown:
        raise InputError(
            f"its policy was made with {named(unknown[0])}, which is not known here; {_INSTEAD}"
        )
    return settings


def _class_of(written: object) -> str:
    match = _CLASS.fullmatch(str(written))
    return match[1] if match else str(written)


def _activation(written: object) -> Activation | None:
    if written is None:
        return None
    match = _ACTIVATION.fullmatch(_class_of(written))
    if match is None or match[1] not in TORCH_CLASSES:
        raise InputError(
            f"it uses the activation {named(_class_of(written))}, which is not known here (only "
            f"{', '.join(TORCH_CLASSES)} are, as torch makes them); {_INSTEAD}"
        )
    return TORCH_CLASSES[match[1]]


def _truth(given: dict[str, object], name: str, default: bool | None) -> bool | None:
    value = given.pop(name, default)
    if value is not None and not isinstance(value, bool):
        raise InputError(f"it says of {name!r} neither true nor false; {_INSTEAD}")
    return value


def _number(given: dict[str, object], name: str, default: float, least: float = 0.0) -> float:
    value = given.pop(name, default)
    if not isinstance(value, (int, float)) or not least <= value < 1e9:
        raise InputError(f"its {name!r} is no number from {least:g} up; {_INSTEAD}")
    return value
