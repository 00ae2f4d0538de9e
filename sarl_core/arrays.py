"""Arrays that nobody changes."""

from __future__ import annotations

import numpy as np


def make_read_only(holder: object) -> None:
    """Make the arrays read-only that an object holds under its names.

    Args:
        holder: As a dataclass under construction.
    """
    for value in vars(holder).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
