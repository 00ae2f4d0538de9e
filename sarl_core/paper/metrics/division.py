"""What dividing continuous actions costs (the paper's open question)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sarl_core.mining.language import share_text
from sarl_core.mining.quantisation import Snapping
from sarl_core.paper.criteria import Measurement, Sample
from sarl_core.paper.divider_table import failures_of, typical_of
from sarl_core.paper.replicates import PAPER_DIVIDER, environment_name
from sarl_core.paper.study import experts_in
from sarl_core.paper.verdicts import Floats, over_recordings
from sarl_core.paper.words import interval
from sarl_core.rollouts.statistics import MeanInterval

if TYPE_CHECKING:
    import pandas as pd

_WALKER = "BipedalWalker-v3"
_AS_IT_IS: tuple[int, Snapping] = (0, "clip")


@dataclass(frozen=True, eq=False)
class Divided:
    """The expert of an environment with its actions divided, by divider and way to snap.

    Attributes:
        typical: Typical returns (IQM), one a recording.
        failures: Shares of the episodes that failed; NaN where it is not known.
        experts: Of each recording.
    """

    typical: Mapping[tuple[int, Snapping], Floats]
    failures: Mapping[tuple[int, Snapping], float]
    experts: tuple[str, ...]

    def over(self, key: tuple[int, Snapping]) -> MeanInterval:
        """The typical return over recordings."""
        return over_recordings(self.typical[key], self.experts)

    def in_words(self, key: tuple[int, Snapping]) -> str:
        """Typical return and share of failures, for people; the latter where it is known."""
        text, failing = interval(self.over(key)), self.failures[key]
        if math.isnan(failing):
            return text
        fail = f"{share_text(failing)} fail)"
        return f"{text[:-1]}; {fail}" if text.endswith(")") else f"{text} ({fail}"


Environments = Mapping[str, Divided]


def divided_in(frame: pd.DataFrame) -> Environments:
    """What the table of the divider study holds."""
    return {
        env_id: Divided(typical_of(frame, env_id), failures_of(frame, env_id), experts)
        for env_id, experts in experts_in(frame).items()
    }


def finer(environments: Environments) -> Measurement:
    """What finer divisions bring on average over the paper's."""
    samples, parts = [], []
    numbers: dict[str, float] = {}
    for env_id, own in environments.items():
        centred = [key for key in own.typical if key[1] == "centre"]
        values = [own.typical[key] for key in centred if key[0] > PAPER_DIVIDER]
        coarse = own.typical[PAPER_DIVIDER, "centre"]
        samples.append(Sample(np.mean(values, axis=0) - coarse, own.experts))
        each = [
            f"{own.in_words(key)} with {key[0]}{' intervals' if key[0] == PAPER_DIVIDER else ''}"
            for key in centred
        ]
        parts.append(
            f"{environment_name(env_id)} {', '.join(each)}, {own.in_words(_AS_IT_IS)} as it is"
        )
        numbers |= {f"{env_id}_{key[0]}": own.over(key).mean for key in centred}
    return Measurement(
        tuple(samples),
        "Typical returns of the experts themselves, each action replaced by the centre of its "
        f"interval: {'; '.join(parts)}.",
        numbers,
    )


def return_with_two_intervals(environments: Environments) -> Measurement | None:
    """How much of its typical return the walker's expert keeps with the better way to snap."""
    if _WALKER not in environments:
        return None
    own = environments[_WALKER]
    ways: tuple[tuple[int, Snapping], ...] = ((PAPER_DIVIDER, "centre"), (PAPER_DIVIDER, "expert"))
    whole, better = own.typical[_AS_IT_IS], max((own.typical[way] for way in ways), key=np.mean)
    before, *after = (own.over(key) for key in (_AS_IT_IS, *ways))
    left = [
        share_text(min(one.mean / before.mean, 1.0))
        if min(one.mean, before.mean) > 0
        else "nothing"
        for one in after
    ]
    centre, typical = (own.in_words(way) for way in ways)
    return Measurement(
        (Sample(np.divide(better, whole, out=np.zeros(len(whole)), where=whole > 0), own.experts),),
        f"Two intervals alone, without any rule, bring the experts from {own.in_words(_AS_IT_IS)} "
        f"to {centre} if each action becomes the centre of its interval, as under the shield of "
        f"Figure 7, and to {typical} if it becomes what the expert typically did in it. That "
        f"leaves {left[0]} and {left[1]} of their typical return.",
        {"as_it_is": before.mean, "centre": after[0].mean, "expert": after[1].mean},
    )
