"""Demonstrations whose arrays a process and those that it starts have in memory once."""

from __future__ import annotations

from copy import copy
from dataclasses import fields

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.shared_arrays import shared


def in_shared_memory(demonstrations: Demonstrations) -> Demonstrations:
    """The same demonstrations with large arrays in files that other processes look at, too.

    Args:
        demonstrations: N pairs.

    Returns:
        Equal to them; what they take of memory can be freed as soon as nobody holds them.
    """
    known = copy(demonstrations)  # checked, and its fingerprint worked out perhaps
    vars(known).pop("action_columns", None)  # a view of what was there before
    for field in fields(known):
        value = getattr(known, field.name)
        if isinstance(value, np.ndarray):
            object.__setattr__(known, field.name, shared(value))
    return known
