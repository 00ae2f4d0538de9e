"""Demonstrations that are some steps of many, and what cannot be worked out from these."""

from __future__ import annotations

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError


def sample_text(demonstrations: Demonstrations) -> str:
    """What part of the steps is here.

    Args:
        demonstrations: A sample.

    Returns:
        As "a sample of 50,000 of 900,000 steps", or "all 12,000 steps".
    """
    here, all_of_them = len(demonstrations), demonstrations.whole.steps
    if here == all_of_them:
        return f"all {here:,} steps"
    return f"a sample of {here:,} of {all_of_them:,} steps"


def needs_steps_text(what: str, demonstrations: Demonstrations) -> str:
    """Why something cannot be worked out from a sample, and what to do.

    Args:
        what: As "cross-fitting".
        demonstrations: The sample.

    Returns:
        A sentence without a full stop.
    """
    here, steps = len(demonstrations), demonstrations.whole.steps
    part = f", with a sample of {here:,}" if here < steps else ""
    return (
        f"{what} needs the demonstrations themselves, and this file is what was left of {steps:,} "
        f"steps that were mined on a cluster{part}; choose demonstrations, or mine those again"
    )


def require_every_step(demonstrations: Demonstrations, what: str) -> None:
    """Refuse a sample, of which numbers would pass for those of the whole.

    Args:
        demonstrations: Any.
        what: What they are needed for.

    Raises:
        InputError: If they are a sample.
    """
    if demonstrations.sample_of is not None:
        raise InputError(needs_steps_text(what, demonstrations))
