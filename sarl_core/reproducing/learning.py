"""Figure 4: how relevant the rules are to an agent that learns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.language import share_text
from sarl_core.mining.rules import FILTERED
from sarl_core.reproducing.shipped import environment_name, named_rules
from sarl_core.reproducing.study import Claim, Drawing, Effort, Frames, Study, judge
from sarl_core.reproducing.words import percent
from sarl_core.rollouts.progress import Progress
from sarl_core.rollouts.relevance import (
    PAPER_LEARNING,
    PAPER_TEST,
    Relevance,
    relevance_from_frame,
    study_relevance,
)
from sarl_core.rollouts.statistics import MeanInterval, mean_interval

if TYPE_CHECKING:
    import pandas as pd

_ENVIRONMENT = "CartPole-v1"
_CLOSE, _NEAR = 0.02, 0.05  # to the minimum confidence
_LAST = 0.1  # of the tests: the end of learning
_AGAIN = 0.05  # a rise of so much is no chance


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """Let learners learn and be tested in turns, while the two rule sets watch.

    Args:
        effort: How many learners, phases and steps.
        progress: Called with (tests done, in all); returning False stops.

    Returns:
        What `Relevance.to_frame` gives.
    """
    return study_relevance(
        _ENVIRONMENT,
        named_rules(_ENVIRONMENT),
        seeds=range(effort.learners),
        phases=effort.phases,
        test_steps=effort.test_steps,
        progress=progress,
    ).to_frame()


def _settings(effort: Effort) -> dict[str, Any]:
    return {
        "environment": _ENVIRONMENT,
        "learner": "PPO of Stable-Baselines3, actions sampled in the tests",
        "phases": effort.phases,
        "learning_steps": PAPER_LEARNING,
        "test_steps": effort.test_steps,
        "test_steps_of_the_paper": PAPER_TEST,
        "seeds": {"learners": list(range(effort.learners))},
    }


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    found = relevance_from_frame(frame)
    numbers: dict[str, Any] = {}
    for number, name in enumerate(found.names):
        numbers[name] = {
            "rules": found.rule_counts[number],
            **{
                f"{word}_{when}": _interval(values)
                for word, shares in (
                    ("applied", found.applied_share[number]),
                    ("kept", found.kept_share[number]),
                    ("broken_of_all", found.broken[number] / found.test_steps),
                )
                for when, values in (("first", shares[:, 0]), ("last", _end(shares)))
            },
        }
    numbers["mean_return_first"] = _interval(found.returns[:, 0])
    numbers["mean_return_last"] = _interval(_end(found.returns))
    return numbers


def _interval(values: NDArray[np.float64]) -> dict[str, float]:
    found = mean_interval(values)
    return {"mean": found.mean, "low": found.low, "high": found.high}


def _end(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of each learner's last tests, (K,) of (K, P + 1)."""
    count = max(1, round(_LAST * values.shape[1]))
    return np.asarray(values[:, -count:].mean(axis=1))


def learning_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of rules and a learner.

    Args:
        frames: With the table of Figure 4.

    Returns:
        Its claims and ours.
    """
    found = relevance_from_frame(frames["4"])
    filtered, unfiltered = found.names.index("filtered"), found.names.index("unfiltered")
    return (
        _fewer_violations(found),
        _converges(found, filtered),
        _does_not_converge(found, unfiltered),
        _every_state(found, unfiltered),
        _smaller_effect(found, filtered, unfiltered),
    )


def _fewer_violations(found: Relevance) -> Claim:
    shares = found.broken / found.test_steps
    first, last = shares[:, :, 0], np.array([_end(share) for share in shares])
    falls = [mean_interval(change) for change in last - first]
    lowest = [_lowest(found, share) for share in shares]
    again = [
        mean_interval(end - least).low > 0 and float((end - least).mean()) > _AGAIN
        for end, (_, least) in zip(last, lowest, strict=True)
    ]
    told = []
    for number, name in enumerate(found.names):
        steps, least = lowest[number]
        told.append(
            f"{name} from {share_text(_mean(first[number]))} to "
            f"{share_text(_mean(last[number]))}"
            + (
                f", after as little as {share_text(_mean(least))} at about {steps:,} steps"
                if again[number]
                else ""
                if falls[number].high < 0
                else f" (the change lies between {percent(falls[number].low)} and "
                f"{percent(falls[number].high)}, so it may be none)"
            )
        )
    fall = [interval.high < 0 for interval in falls]
    return Claim(
        paper="For both rule sets, violations become fewer as the agent learns.",
        where="Figure 4",
        ours=f"Share of the steps at which a rule was broken, before learning and over the last "
        f"tests: {'; '.join(told)}.",
        verdict=judge(all(fall) and not any(again), any(fall)),
        decided_by="The change of each learner from its first test to the mean of its last tenth. "
        "Agrees if the 95 % interval of its mean lies below 0 for both rule sets, and the end is "
        f"not more than {_AGAIN} above the lowest tenth; partly if it falls for one at least.",
        numbers={
            f"change_{name}": interval.mean
            for name, interval in zip(found.names, falls, strict=True)
        },
    )


def _lowest(found: Relevance, share: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
    """Steps learned at the tenth of the tests with the least, and each learner's mean there."""
    count = max(1, round(_LAST * share.shape[1]))
    means = np.lib.stride_tricks.sliding_window_view(share, count, axis=1).mean(axis=2)
    at = int(means.mean(axis=0).argmin())
    return int(found.learned_steps[at : at + count].mean()), np.asarray(means[:, at])


def _converges(found: Relevance, number: int) -> Claim:
    end = mean_interval(_end(found.kept_share[number]))
    away = abs(end.mean - FILTERED.confidence)
    return Claim(
        paper="The share of kept filtered rules converges towards their minimum confidence, 0.95.",
        where="Figure 4",
        ours=f"Over the last tests, filtered rules were kept at {_shown(end)} of the steps with a "
        "rule.",
        verdict=judge(away <= _CLOSE, away <= _NEAR),
        decided_by=f"Agrees if the mean of the last tenth of the tests is within {_CLOSE} of 0.95, "
        f"partly within {_NEAR}.",
        numbers={"mean": end.mean, "low": end.low, "high": end.high},
    )


def _does_not_converge(found: Relevance, number: int) -> Claim:
    end = mean_interval(_end(found.kept_share[number]))
    away = FILTERED.confidence - end.high
    return Claim(
        paper="This cannot be seen for the unfiltered rule set.",
        where="Figure 4",
        ours=f"Unfiltered rules were kept at {_shown(end)} of the steps.",
        verdict=judge(away > _NEAR, away > 0),
        decided_by=f"Agrees if the 95 % interval lies more than {_NEAR} below 0.95, partly if it "
        "lies below.",
        numbers={"mean": end.mean, "low": end.low, "high": end.high},
    )


def _every_state(found: Relevance, number: int) -> Claim:
    share = float(found.applied_share[number].min())
    return Claim(
        paper="The unfiltered rule set has an action for each state that the agent meets.",
        where="text on Figure 4",
        ours=f"One of its rules applied at {share_text(share)} of the steps, in every test."
        if share == 1.0
        else f"One of its rules applied at {share_text(share)} of the steps or more.",
        verdict=judge(share >= 0.999, share >= 0.99),
        decided_by="The least share over all tests; agrees from 99.9 %, partly from 99 %.",
        numbers={"least_share": share},
    )


def _smaller_effect(found: Relevance, filtered: int, unfiltered: int) -> Claim:
    broken = 1.0 - found.kept_share
    some, many = _end(broken[filtered]), _end(broken[unfiltered])
    apart = mean_interval(many - some)
    return Claim(
        paper="The agent departs from the filtered rules too, but clearly less than from the "
        "unfiltered ones.",
        where="text on Figure 4",
        ours=f"At the end it broke the filtered rule that applied in {share_text(_mean(some))} of "
        f"the cases, and the unfiltered one in {share_text(_mean(many))}.",
        verdict=judge(bool(apart.low > 0 and some.mean() > 0), bool(apart.mean > 0)),
        decided_by="Agrees if filtered rules are broken, and the 95 % interval of the difference "
        "lies above 0; partly if the mean difference does.",
        numbers={"filtered": _mean(some), "unfiltered": _mean(many)},
    )


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean())


def _shown(interval: MeanInterval) -> str:
    return (
        f"{share_text(interval.mean, decimals=1)} "
        f"({100 * interval.low:.1f} to {100 * interval.high:.1f} %)"
    )


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.relevance_figures import applied_figure, kept_figure, learner_figure

    found = relevance_from_frame(frame)
    return (
        Drawing(
            "How often the rule that applied was kept or broken",
            kept_figure(found, confidence=FILTERED.confidence),
            share=1.0,
            alt="Shares of kept and broken rules against steps learned, filtered and unfiltered",
        ),
        Drawing(
            "How often some rule applied",
            applied_figure(found),
            alt="Share of the steps with a rule against steps learned",
        ),
        Drawing(
            "How good the learner was",
            learner_figure(found),
            alt="Mean return of the learners against steps learned",
        ),
    )


LEARNING = Study(
    name="4",
    place="Figure 4",
    title="Rules and a learner",
    about=f"A learner (PPO) learns {environment_name(_ENVIRONMENT)} for {PAPER_LEARNING} steps and "
    f"is tested for {PAPER_TEST:,} steps, in turns; the first test is before any learning. In the "
    "tests it samples its actions, and the rules only watch. Lines are means over the learners, "
    "each with a seed of its own; bands are 95 % intervals.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=learning_claims,
    parts=lambda frame: (environment_name(_ENVIRONMENT),),
    draw=_draw,
    columns=(
        "environment",
        "rules",
        "rule_count",
        "seed",
        "learned_steps",
        "test_steps",
        "applied",
        "kept",
        "broken",
        "mean_return",
    ),
)
