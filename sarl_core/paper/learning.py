"""Figure 4: how relevant the rules are to an agent that learns."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.learning.relevance import (
    PAPER_LEARNING,
    PAPER_TEST,
    relevance_from_frame,
    study_relevance,
)
from sarl_core.mining.rules import FILTERED
from sarl_core.paper.claims import FIGURE_4, decided
from sarl_core.paper.metrics.learning import end_of, learners_in
from sarl_core.paper.replicates import (
    environment_name,
    named_rules,
    recorded_seeds,
    replicates_of,
)
from sarl_core.paper.study import Drawing, Effort, Study
from sarl_core.paper.verdicts import Floats, over_recordings
from sarl_core.progress import Progress, part_of
from sarl_core.rollouts.seeds import RELEVANCE, SEEDS_A_LEARNER

if TYPE_CHECKING:
    import pandas as pd

_ENVIRONMENT = "CartPole-v1"
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
        tests = study_relevance(
            _ENVIRONMENT,
            named_rules(replicate),
            seeds=(replicate.recording,),
            phases=effort.phases,
            test_steps=effort.test_steps,
            progress=part_of(progress, len(parts) * (effort.phases + 1), total),
        ).to_frame()
        parts.append(tests.assign(expert=replicate.name, recording=replicate.recording))
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
            "recordings": recorded_seeds([_ENVIRONMENT], effort.recordings)[_ENVIRONMENT],
            "tests": [RELEVANCE + number * SEEDS_A_LEARNER for number in range(effort.recordings)],
        },
    }


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    learners = learners_in(frame)
    relevance = learners.relevance

    def interval(values: Floats) -> dict[str, float]:
        return asdict(over_recordings(values, learners.experts))

    numbers: dict[str, Any] = {}
    for number, name in enumerate(relevance.names):
        counts = frame[frame["rules"] == name]["rule_count"]
        numbers[name] = {
            "rules": [int(counts.min()), int(counts.max())],
            **{
                f"{word}_{when}": interval(values)
                for word, parts in (
                    ("applied", relevance.applied_share[number]),
                    ("kept", relevance.obeyed_share[number]),
                    ("broken_of_all", relevance.broken[number] / relevance.test_steps),
                )
                for when, values in (("first", parts[:, 0]), ("last", end_of(parts)))
            },
        }
    numbers["mean_return_first"] = interval(relevance.returns[:, 0])
    numbers["mean_return_last"] = interval(end_of(relevance.returns))
    return numbers


def _exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same tests in another order, the same for all learners, by either rule set's name."""
    counted = ["applied", "kept", "broken"]
    shape = tuple(frame[name].nunique() for name in ("rules", "seed", "learned_steps"))
    order, names = rng.permutation(shape[2]), rng.permutation(shape[0])
    values = frame[counted].to_numpy().reshape(*shape, len(counted))[names][:, :, order]
    dealt = frame.copy()
    dealt[counted] = values.reshape(-1, len(counted))
    return dealt


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.relevance import applied_figure, learner_figure, obeyed_figure

    relevance = relevance_from_frame(frame)
    return (
        Drawing(
            "How often the rule that applied was kept or broken",
            obeyed_figure(relevance, confidence=FILTERED.confidence),
            share=1.0,
            alt="Shares of kept and broken rules against steps learned, filtered and unfiltered",
        ),
        Drawing(
            "How often some rule applied",
            applied_figure(relevance),
            alt="Share of the steps with a rule against steps learned",
        ),
        Drawing(
            "How good the learner was",
            learner_figure(relevance),
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
    claims=lambda frames: decided(FIGURE_4, learners_in(frames["4"])),
    exchanged=_exchanged,
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
