"""The activations of torch's networks, in NumPy, each with the parameters that torch gives it.

One that learns (PReLU), or that mixes the units of a layer (Softmax), is not among them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Activation = Literal[
    "tanh",
    "relu",
    "leaky_relu",
    "rrelu",
    "elu",
    "celu",
    "selu",
    "gelu",
    "silu",
    "mish",
    "sigmoid",
    "log_sigmoid",
    "softplus",
    "softsign",
    "hardtanh",
    "relu6",
    "hardsigmoid",
    "hardswish",
    "tanhshrink",
    "softshrink",
    "hardshrink",
    "identity",
]
Values = NDArray[np.float32]

# Torch's class of each, as a model of Stable-Baselines3 names it.
TORCH_CLASSES: Mapping[str, Activation] = {
    "Tanh": "tanh",
    "ReLU": "relu",
    "LeakyReLU": "leaky_relu",
    "RReLU": "rrelu",
    "ELU": "elu",
    "CELU": "celu",
    "SELU": "selu",
    "GELU": "gelu",
    "SiLU": "silu",
    "Mish": "mish",
    "Sigmoid": "sigmoid",
    "LogSigmoid": "log_sigmoid",
    "Softplus": "softplus",
    "Softsign": "softsign",
    "Hardtanh": "hardtanh",
    "ReLU6": "relu6",
    "Hardsigmoid": "hardsigmoid",
    "Hardswish": "hardswish",
    "Tanhshrink": "tanhshrink",
    "Softshrink": "softshrink",
    "Hardshrink": "hardshrink",
    "Identity": "identity",
}

_SELU_ALPHA, _SELU_SCALE = np.float32(1.6732632423543772), np.float32(1.0507009873554805)
_RRELU_SLOPE = (1 / 8 + 1 / 3) / 2  # random while it learns; the middle of its range afterwards


def activate(name: Activation, values: Values) -> Values:
    """Apply an activation.

    Args:
        name: Which.
        values: Of any shape, float32.

    Returns:
        The same shape, float32.
    """
    return _FUNCTIONS[name](values)


def _gelu(x: Values) -> Values:
    from scipy.special import ndtr

    result: Values = x * ndtr(x)
    return result


def _sigmoid(x: Values) -> Values:
    from scipy.special import expit

    result: Values = expit(x)
    return result


def _softplus(x: Values) -> Values:
    result: Values = np.logaddexp(x, np.float32(0.0))
    return result


def _softsign(x: Values) -> Values:
    return np.divide(x, np.abs(x) + np.float32(1.0), dtype=np.float32)


def _elu(x: Values) -> Values:
    result: Values = np.maximum(x, 0.0) + np.expm1(np.minimum(x, 0.0))
    return result


def _selu(x: Values) -> Values:
    grown = np.maximum(x, 0.0) + _SELU_ALPHA * np.expm1(np.minimum(x, 0.0))
    result: Values = _SELU_SCALE * grown
    return result


def _gate(x: Values) -> Values:
    """What rises from 0 at -3 to 1 at 3."""
    result: Values = np.clip(x + 3.0, 0.0, 6.0) / 6.0
    return result


_FUNCTIONS: Mapping[Activation, Callable[[Values], Values]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "leaky_relu": lambda x: np.where(x > 0.0, x, 0.01 * x),
    "rrelu": lambda x: np.where(x > 0.0, x, _RRELU_SLOPE * x),
    "elu": _elu,
    "celu": _elu,  # the same where alpha is 1
    "selu": _selu,
    "gelu": _gelu,
    "silu": lambda x: x * _sigmoid(x),
    "mish": lambda x: x * np.tanh(_softplus(x)),
    "sigmoid": _sigmoid,
    "log_sigmoid": lambda x: -_softplus(-x),
    "softplus": _softplus,
    "softsign": _softsign,
    "hardtanh": lambda x: np.clip(x, -1.0, 1.0),
    "relu6": lambda x: np.clip(x, 0.0, 6.0),
    "hardsigmoid": _gate,
    "hardswish": lambda x: x * _gate(x),
    "tanhshrink": lambda x: x - np.tanh(x),
    "softshrink": lambda x: x - np.clip(x, -0.5, 0.5),
    "hardshrink": lambda x: np.where(np.abs(x) > 0.5, x, np.float32(0.0)),
    "identity": lambda x: x,
}
