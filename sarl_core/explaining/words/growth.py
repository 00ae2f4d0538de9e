"""What is said of the learner that grew trees."""

from __future__ import annotations

from sarl_core.mining.growing.growth import LearnerChoice
from sarl_core.mining.growing.histogram import BINS
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
