"""What comes first where the best of several is chosen by the episodes that each has played."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.failures import no_failures_text
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import Episodes

Choice: TypeAlias = Literal["return", "failures"]
"""The highest mean return; or the fewest failures, and among equals the highest mean return."""

CHOICE_TEXTS: dict[Choice, str] = {
    "return": "the highest mean return",
    "failures": "the fewest failures, and among equals the highest mean return",
}


def check_choice(choose: Choice, environment: EnvironmentOrId) -> None:
    """Refuse to choose by failures where nothing says what one is.

    Args:
        choose: What comes first.
        environment: Whose episodes are played.

    Raises:
        InputError: If failures come first and are not known, or none can be.
    """
    if choose == "failures" and (why := no_failures_text(environment)):
        raise InputError(
            f"the best cannot be chosen by failures, because {why}; say what a failure is "
            "(--failure), or choose by return"
        )


def scores(episodes: Episodes, choose: Choice) -> NDArray[np.float64]:
    """What episodes count where the best is chosen.

    Args:
        episodes: E of them.
        choose: What comes first.

    Returns:
        Columns of which more is better, the most important first, (E, 1) or (E, 2): of two that
        are chosen from, the better one has the higher mean in the first in which they differ. What
        may have failed counts as a failure.
    """
    if choose == "return":
        return episodes.returns[:, None]
    may_have_failed = episodes.failed | episodes.undecided
    return np.column_stack([-may_have_failed.astype(np.float64), episodes.returns])


def weighed(episodes: Episodes, worth: float) -> NDArray[np.float64]:
    """What episodes count where something is moved to where it achieves more.

    Where failures came first, what never ends would be better than what fails once; so what is
    moved is led by returns, less by so much for a failure.

    Args:
        episodes: E of them.
        worth: Of a failure, in units of the return, at least 0. What may have failed counts as a
            failure.

    Returns:
        Numbers of which more is better, (E,).
    """
    may_have_failed = episodes.failed | episodes.undecided
    less: NDArray[np.float64] = episodes.returns - worth * may_have_failed
    return less


def mean_score(scored: NDArray[np.float64]) -> tuple[float, ...]:
    """What the episodes of a candidate come to.

    Args:
        scored: Of `scores`, (E, K).

    Returns:
        The mean of each column; the better of two candidates has the higher tuple.
    """
    return tuple(float(column.mean()) for column in scored.T)
