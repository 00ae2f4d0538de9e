"""Rules that are kept and broken while an agent learns (Figure 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sarl_core.learning.relevance import Relevance, relevance_from_frame
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import FILTERED
from sarl_core.paper.criteria import Measurement, Sample
from sarl_core.paper.verdicts import Floats, over_recordings
from sarl_core.paper.words import percent, shares

if TYPE_CHECKING:
    import pandas as pd

_LAST = 0.1  # of the tests: the end of learning
AGAIN = 0.05  # a rise of so much is no chance


@dataclass(frozen=True, eq=False)
class Learners:
    """Learners and the rule sets that watched them.

    Attributes:
        relevance: What was counted.
        experts: The expert of each learner's recording, K.
    """

    relevance: Relevance
    experts: tuple[str, ...]

    def of(self, shares: Floats, name: str) -> Floats:
        """What belongs to the rule set of a name, (K, P + 1) of (R, K, P + 1)."""
        return np.asarray(shares[self.relevance.names.index(name)])

    def sample(self, values: Floats) -> tuple[Sample]:
        """One number a learner, (K,)."""
        return (Sample(values, self.experts),)


def learners_in(frame: pd.DataFrame) -> Learners:
    """The learners in the table of Figure 4."""
    experts = frame.drop_duplicates("seed")["expert"]
    return Learners(relevance_from_frame(frame), tuple(experts.tolist()))


def end_of(values: Floats) -> Floats:
    """The mean of each learner's last tests, (K,) of (K, P + 1)."""
    return np.asarray(values[:, -_last_tests(values) :].mean(axis=1))


def _last_tests(values: Floats) -> int:
    return max(1, round(_LAST * int(values.shape[1])))


def fewer_violations(learners: Learners) -> Measurement:
    """How much less often each rule set is broken at the end than before learning."""
    samples: list[Sample] = []
    numbers, parts, risen = {}, [], False
    for name, broken in zip(learners.relevance.names, learners.relevance.broken, strict=True):
        share = broken / learners.relevance.test_steps
        first, last = share[:, 0], end_of(share)
        samples += learners.sample(first - last)
        change = samples[-1].interval
        numbers[f"change_{name}"] = -float(change.mean)
        steps, least = _lowest(learners.relevance, share)
        rise = over_recordings(last - least, learners.experts)
        text = f"{name} from {_mean_text(first)} to {_mean_text(last)}"
        if rise.low > 0 and float((last - least).mean()) > AGAIN:
            risen = True
            text += f", after as little as {_mean_text(least)} at about {steps:,} steps"
        elif change.low <= 0:
            text += (
                f" (the change lies between {percent(-change.high)} and {percent(-change.low)}, "
                "so it may be none)"
            )
        parts.append(text)
    return Measurement(
        tuple(samples),
        "Share of the steps at which a rule was broken, before learning and over the last tests: "
        f"{'; '.join(parts)}.",
        numbers,
        no_better_than="partly" if risen else "agrees",
    )


def _lowest(relevance: Relevance, share: Floats) -> tuple[int, Floats]:
    """Steps learned at the tenth of the tests with the least, and each learner's mean there."""
    count = _last_tests(share)
    means = np.lib.stride_tricks.sliding_window_view(share, count, axis=1).mean(axis=2)
    at = int(means.mean(axis=0).argmin())
    return int(relevance.learned_steps[at : at + count].mean()), np.asarray(means[:, at])


def converges(learners: Learners) -> Measurement:
    """How far from their minimum confidence filtered rules are kept at the end."""
    obeyed = end_of(learners.of(learners.relevance.obeyed_share, "filtered"))
    end = over_recordings(obeyed, learners.experts)
    return Measurement(
        learners.sample(obeyed - FILTERED.confidence),
        f"Over the last tests, filtered rules were kept at {shares(end)} of the steps with a rule, "
        f"with the least of the learners at {share_text(float(obeyed.min()))} and the most at "
        f"{share_text(float(obeyed.max()))}.",
        {"kept": end.mean},
    )


def does_not_converge(learners: Learners) -> Measurement:
    """How far below that confidence unfiltered rules are kept at the end."""
    obeyed = end_of(learners.of(learners.relevance.obeyed_share, "unfiltered"))
    end = over_recordings(obeyed, learners.experts)
    return Measurement(
        learners.sample(FILTERED.confidence - obeyed),
        f"Unfiltered rules were kept at {shares(end)} of the steps.",
        {"kept": end.mean},
    )


def every_state(learners: Learners) -> Measurement:
    """The least share of the steps at which an unfiltered rule applied."""
    least = learners.of(learners.relevance.applied_share, "unfiltered").min(axis=1)
    share = float(least.min())
    often = ", in every test." if share == 1.0 else " or more."
    return Measurement(
        learners.sample(least),
        f"One of its rules applied at {share_text(share)} of the steps{often}",
        {"least_share": share},
    )


def smaller_effect(learners: Learners) -> Measurement:
    """How much more often unfiltered rules are broken than filtered ones."""
    broken = 1.0 - learners.relevance.obeyed_share
    some, many = (end_of(learners.of(broken, name)) for name in ("filtered", "unfiltered"))
    return Measurement(
        learners.sample(many - some),
        f"At the end it broke the filtered rule that applied in {_mean_text(some)} of the cases, "
        f"and the unfiltered one in {_mean_text(many)}.",
        {"filtered": float(some.mean()), "unfiltered": float(many.mean())},
        no_better_than="partly" if over_recordings(some, learners.experts).low <= 0 else "agrees",
    )


def _mean_text(share: Floats) -> str:
    return share_text(float(share.mean()))
