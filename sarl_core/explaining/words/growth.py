"""What is said of the learner that grew trees."""

from __future__ import annotations

from sarl_core.mining.growing.growth import EXACT_UP_TO, LearnerChoice
from sarl_core.mining.growing.histogram import BINS, is_installed
from sarl_core.mining.tree import Learner

LEARNERS: dict[LearnerChoice, str] = {
    "auto": "Automatic",
    "exact": "Exact",
    "histogram": "Histogram",
}
"""What choices are called."""


def learner_text(learner: Learner) -> str:
    """What a learner tried.

    Args:
        learner: Of trees.

    Returns:
        As "exact: every border between two values was tried".
    """
    if learner == "exact":
        return "exact: every border between two values was tried"
    return (
        f"histogram: the borders between {BINS:,} bins of each feature were tried, and counted on "
        "all states"
    )


def missing_learner_text(choice: LearnerChoice, pairs: int) -> str:
    """Say that many pairs wait for the exact learner because there is no other here.

    Args:
        choice: What was chosen.
        pairs: How many there are.

    Returns:
        One sentence that says what to do; "" where nothing is missing.
    """
    waits = choice == "auto" and pairs > EXACT_UP_TO and not is_installed()
    if not waits:
        return ""
    return (
        f"{pairs:,} states were mined by the exact learner; pip install 'sarl-explorer[large]' "
        "brings one that takes about a fifth of the time."
    )
