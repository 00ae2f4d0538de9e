"""Figure 4: how relevant the rules are to an agent that learns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.learning.relevance import (
    PAPER_LEARNING,
    PAPER_TEST,
    Relevance,
    relevance_from_frame,
    study_relevance,
)
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import FILTERED
from sarl_core.paper.replicates import (
    environment_name,
    named_rules,
    recorded_seeds,
    replicates_of,
)
from sarl_core.paper.study import Drawing, Effort, Frames, Study
from sarl_core.paper.verdicts import (
    Claim,
    above,
    claim,
    over_recordings,
    together,
    within,
)
from sarl_core.paper.words import percent, shares
from sarl_core.progress import Progress, report
from sarl_core.rollouts.seeds import RELEVANCE, SEEDS_A_LEARNER

if TYPE_CHECKING:
    import pandas as pd

_ENVIRONMENT = "CartPole-v1"
_CLOSE, _NEAR = 0.02, 0.05  # to the minimum confidence
_LAST = 0.1  # of the tests: the end of learning
_AGAIN = 0.05  # a rise of so much is no chance
_CLEARLY = 0.05  # more often broken
_EVERY_STATE, _MOST_STATES = 0.999, 0.99
_FIRST = ["environment", "expert", "recording"]


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """Let learners learn and be tested in turns, while two rule sets watch.

    Each learner has a recording of its own, from which its two rule sets are mined.

    Args:
        effort: How many recordings, phases and steps.
        progress: Called with (tests done, in all); returning False stops.

    Returns:
        What `Relevance.to_frame` gives for every learner, with `expert` and `recording`.
    """
    import pandas as pd

    wanted = replicates_of(_ENVIRONMENT, effort.recordings)
    total = len(wanted) * (effort.phases + 1)
    parts: list[pd.DataFrame] = []
    for replicate in wanted:

        def told(done: int, _: int, before: int = len(parts) * (effort.phases + 1)) -> None:
            report(progress, before + done, total)

        found = study_relevance(
            _ENVIRONMENT,
            named_rules(replicate),
            seeds=(replicate.recording,),
            phases=effort.phases,
            test_steps=effort.test_steps,
            progress=told,
        ).to_frame()
        parts.append(found.assign(expert=replicate.name, recording=replicate.recording))
    # Rule set by rule set, and learner by learner in each, as one study of all would give them.
    frame = pd.concat(parts, ignore_index=True)
    names = frame["rules"].unique().tolist()
    order = np.argsort(frame["rules"].map(names.index).to_numpy(), kind="stable")
    frame = frame.iloc[order].reset_index(drop=True)
    return frame[[*_FIRST, *(name for name in frame.columns if name not in _FIRST)]]


def _settings(effort: Effort) -> dict[str, Any]:
    return {
        "environment": _ENVIRONMENT,
        "learner": "PPO of Stable-Baselines3, actions sampled in the tests",
        "phases": effort.phases,
        "learning_steps": PAPER_LEARNING,
        "test_steps": effort.test_steps,
        "test_steps_of_the_paper": PAPER_TEST,
        "seeds": {
            "learners": list(range(effort.recordings)),
            "recordings": recorded_seeds(_ENVIRONMENT, effort.recordings),
            "tests": [RELEVANCE + number * SEEDS_A_LEARNER for number in range(effort.recordings)],
        },
    }


def _experts(frame: pd.DataFrame) -> tuple[str, ...]:
    """The expert of each learner's recording."""
    return tuple(frame.drop_duplicates("seed")["expert"].tolist())


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    found, experts = relevance_from_frame(frame), _experts(frame)

    def interval(values: NDArray[np.float64]) -> dict[str, float]:
        one = over_recordings(values, experts)
        return {"mean": one.mean, "low": one.low, "high": one.high}

    numbers: dict[str, Any] = {}
    for number, name in enumerate(found.names):
        counts = frame[frame["rules"] == name]["rule_count"]
        numbers[name] = {
            "rules": [int(counts.min()), int(counts.max())],
            **{
                f"{word}_{when}": interval(values)
                for word, parts in (
                    ("applied", found.applied_share[number]),
                    ("kept", found.kept_share[number]),
                    ("broken_of_all", found.broken[number] / found.test_steps),
                )
                for when, values in (("first", parts[:, 0]), ("last", _end(parts)))
            },
        }
    numbers["mean_return_first"] = interval(found.returns[:, 0])
    numbers["mean_return_last"] = interval(_end(found.returns))
    return numbers


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
    found, experts = relevance_from_frame(frames["4"]), _experts(frames["4"])
    filtered, unfiltered = found.names.index("filtered"), found.names.index("unfiltered")
    return (
        _fewer_violations(found, experts),
        _converges(found, experts, filtered),
        _does_not_converge(found, experts, unfiltered),
        _every_state(found, experts, unfiltered),
        _smaller_effect(found, experts, filtered, unfiltered),
    )


def exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same tests in another order, the same for all learners, by either rule set's name.

    Args:
        frame: What `measure` gives.
        rng: Random numbers.

    Returns:
        A table as `measure` gives it.
    """
    counted = ["applied", "kept", "broken"]
    shape = tuple(frame[name].nunique() for name in ("rules", "seed", "learned_steps"))
    order, names = rng.permutation(shape[2]), rng.permutation(shape[0])
    values = frame[counted].to_numpy().reshape(*shape, len(counted))[names][:, :, order]
    dealt = frame.copy()
    dealt[counted] = values.reshape(-1, len(counted))
    return dealt


def _fewer_violations(found: Relevance, experts: tuple[str, ...]) -> Claim:
    parts = found.broken / found.test_steps
    first, last = parts[:, :, 0], np.array([_end(share) for share in parts])
    falls = [
        above(start - end, experts, agrees=0, partly=0)
        for start, end in zip(first, last, strict=True)
    ]
    lowest = [_lowest(found, share) for share in parts]
    again = [
        over_recordings(end - least, experts).low > 0 and float((end - least).mean()) > _AGAIN
        for end, (_, least) in zip(last, lowest, strict=True)
    ]
    told = []
    for number, name in enumerate(found.names):
        steps, least = lowest[number]
        change = falls[number].interval
        assert change is not None
        told.append(
            f"{name} from {share_text(_mean(first[number]))} to "
            f"{share_text(_mean(last[number]))}"
            + (
                f", after as little as {share_text(_mean(least))} at about {steps:,} steps"
                if again[number]
                else ""
                if not change.low <= 0  # NaN where nothing can be told
                else f" (the change lies between {percent(-change.high)} and "
                f"{percent(-change.low)}, so it may be none)"
            )
        )
    whole = together(
        falls,
        "Agrees if the whole 95 % interval over recordings and experts lies below 0 for both rule "
        f"sets, and the end is not more than {percent(_AGAIN)} of the steps above the lowest "
        "tenth; partly, if for one, or if it rises again; does not agree if both rise; else it "
        "cannot be judged.",
    )
    if whole.verdict == "agrees" and any(again):
        whole = replace(whole, verdict="partly")
    return claim(
        whole,
        paper="For both rule sets, violations become fewer as the agent learns.",
        where="Figure 4",
        ours="Share of the steps at which a rule was broken, before learning and over the last "
        f"tests: {'; '.join(told)}.",
        measured="The change of each learner from its first test to the mean of its last tenth.",
        numbers={
            f"change_{name}": -float(one.interval.mean)
            for name, one in zip(found.names, falls, strict=True)
            if one.interval is not None
        },
    )


def _lowest(found: Relevance, share: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
    """Steps learned at the tenth of the tests with the least, and each learner's mean there."""
    count = max(1, round(_LAST * share.shape[1]))
    means = np.lib.stride_tricks.sliding_window_view(share, count, axis=1).mean(axis=2)
    at = int(means.mean(axis=0).argmin())
    return int(found.learned_steps[at : at + count].mean()), np.asarray(means[:, at])


def _converges(found: Relevance, experts: tuple[str, ...], number: int) -> Claim:
    kept = _end(found.kept_share[number])
    end = over_recordings(kept, experts)
    return claim(
        within(kept - FILTERED.confidence, experts, agrees=_CLOSE, partly=_NEAR),
        paper="The share of kept filtered rules converges towards their minimum confidence, 0.95.",
        where="Figure 4",
        ours=f"Over the last tests, filtered rules were kept at {shares(end)} of the steps with a "
        f"rule, with the least of the learners at {share_text(float(kept.min()))} and the most at "
        f"{share_text(float(kept.max()))}.",
        measured="The mean of the last tenth of the tests, as its distance from 0.95.",
        numbers={"kept": end.mean},
    )


def _does_not_converge(found: Relevance, experts: tuple[str, ...], number: int) -> Claim:
    kept = _end(found.kept_share[number])
    end = over_recordings(kept, experts)
    return claim(
        above(FILTERED.confidence - kept, experts, agrees=_NEAR, partly=_CLOSE),
        paper="This cannot be seen for the unfiltered rule set.",
        where="Figure 4",
        ours=f"Unfiltered rules were kept at {shares(end)} of the steps.",
        measured="How far the mean of the last tenth of the tests lies below 0.95.",
        numbers={"kept": end.mean},
    )


def _every_state(found: Relevance, experts: tuple[str, ...], number: int) -> Claim:
    least = found.applied_share[number].min(axis=1)
    share = float(least.min())
    return claim(
        above(least, experts, agrees=_EVERY_STATE, partly=_MOST_STATES, show=share_text),
        paper="The unfiltered rule set has an action for each state that the agent meets.",
        where="text on Figure 4",
        ours=f"One of its rules applied at {share_text(share)} of the steps, in every test."
        if share == 1.0
        else f"One of its rules applied at {share_text(share)} of the steps or more.",
        measured="The least share over the tests of each learner.",
        numbers={"least_share": share},
        constructed="a fully grown tree ends in one action everywhere, but for equal states that "
        "were shown with different ones",
    )


def _smaller_effect(
    found: Relevance, experts: tuple[str, ...], filtered: int, unfiltered: int
) -> Claim:
    broken = 1.0 - found.kept_share
    some, many = _end(broken[filtered]), _end(broken[unfiltered])
    more = above(many - some, experts, agrees=_CLEARLY, partly=0)
    if more.verdict == "agrees" and over_recordings(some, experts).low <= 0:
        more = replace(more, verdict="partly")
    return claim(
        more,
        paper="The agent departs from the filtered rules too, but clearly less than from the "
        "unfiltered ones.",
        where="text on Figure 4",
        ours=f"At the end it broke the filtered rule that applied in {share_text(_mean(some))} of "
        f"the cases, and the unfiltered one in {share_text(_mean(many))}.",
        measured="How much more often the unfiltered rule that applied was broken over the last "
        "tenth of the tests; agrees only if filtered rules are broken too.",
        numbers={"filtered": _mean(some), "unfiltered": _mean(many)},
    )


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean())


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.relevance import applied_figure, kept_figure, learner_figure

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
    "each with a seed and a recording of its own, from which its rules are mined; bands are 95 % "
    "intervals over learners.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=learning_claims,
    exchanged=exchanged,
    parts=lambda frame: (environment_name(_ENVIRONMENT),),
    draw=_draw,
    columns=(
        "environment",
        "expert",
        "recording",
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
