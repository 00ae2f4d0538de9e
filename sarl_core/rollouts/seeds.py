"""Which episodes are used for what: the first seed of every purpose, in one place.

Episode i of a run has the seed of its purpose + i. A number that something was chosen by is too
good by what luck it had, so it is told on episodes of another purpose.

====================  =====================================================================
first seed            what its episodes are for
====================  =====================================================================
`DEMONSTRATED`        shipped demonstrations; learners that experts are trained by
`FRESH`               what a page plays or looks for where nobody says otherwise; the examples
`EXPERT_CHOICE`       a training keeps its best policy by them
`EXPERT_REPORT`       and reports it on these
`TRIAL`               what learning under a shield (`learn`) has come to; its learners have the
                      seeds below, 100,000 for each
`RECORDED`            further recordings that claims of the paper are decided over,
                      `SEEDS_A_RECORDING` for each
`REPRODUCED`          figures of the paper (`reproduce`), `SEEDS_A_REPLICATE` for each recording
`RELEVANCE`           steps at which learners are tested for the paper's Figure 4,
                      `SEEDS_A_LEARNER` for each
`POOLED`              the benchmark of intervals draws its demonstrations from these
`CERTIFIED`           certificates; nothing is chosen by them
`ROUNDS`              rounds of `aggregate` and of `probe`, `SEEDS_A_ROUND` for each
`VALIDATION`          the best of its rounds, or of its refinement, is chosen by them
`REFINEMENT`          the search of its refinement
`REPORT`              what came of it is reported on them
====================  =====================================================================

`aggregate --seed s` and `probe --seed s` begin s times `SEEDS_A_RUN` further on, whatever the
purpose. Within one run no two purposes meet: `MOST_ROUNDS` and the numbers beside it see to that.
What the paper is reproduced with, and what certificates are made on, lies below all of them, so no
run, however far on, reaches it.

`RANGES` says how far each purpose goes. Ranges that do meet, `SHARED`, and why that does no harm:

- `TRIAL` and `EXPERT_REPORT` are the same seeds: an expert and a learner are two policies, and
  neither is chosen by what is told of the other.
- Learners of `learn` pass over `DEMONSTRATED`, `FRESH` and `EXPERT_CHOICE`. They are tried on
  `TRIAL`, which none of them reaches.

They stay as they are, because shipped files name them. Besides:

- The numbers in the README for rules at the paper's thresholds begin at `REFINEMENT`. They are
  chosen by no episode.
- Runs of `aggregate` whose seeds are ten apart: the rounds of one are the validation of the other.
  They share no rules.
- Cards of older rule sets name a second validation, half a `SEEDS_A_RUN` behind the first.
- `aggregate` and `probe` of the same seed play the same episodes. Neither chooses by the other.
- `FRESH` serves all pages, the search for gaps included. Nothing that is shipped is chosen by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from sarl_core.errors import require_whole

DEMONSTRATED = 0
LEARNERS = 0
FRESH = 100_000  # far from those the demonstrations were recorded with

EXPERT_CHOICE = 5_000_000
EXPERT_REPORT = 9_000_000
TRIAL = 9_000_000

RECORDED = 10_000_000
REPRODUCED = 12_000_000
RELEVANCE = 14_000_000
POOLED = 19_000_000
CERTIFIED = 19_500_000

ROUNDS = 20_000_000
VALIDATION = 30_000_000
REFINEMENT = 40_000_000
REPORT = 50_000_000

LARGEST_SEED = 2**53
"""Of a first episode: whole numbers up to here are exact in every file."""
LARGEST_RUN = 10**9
"""Of `aggregate` and `probe`, whose episodes begin so much further on."""

SEEDS_A_RUN = 1_000_000  # between two values of the seed of `aggregate`
SEEDS_A_ROUND = 10_000
SEEDS_A_RECORDING = 100_000  # more than its steps
SEEDS_A_REPLICATE = 10_000
SEEDS_A_LEARNER = 100_000

MOST_EPISODES_A_ROUND = SEEDS_A_ROUND
MOST_ROUNDS = (VALIDATION - ROUNDS) // SEEDS_A_ROUND
MOST_VALIDATION = SEEDS_A_RUN // 2
MOST_CERTIFIED = ROUNDS - CERTIFIED
MOST_LEARNERS = (POOLED - RELEVANCE) // SEEDS_A_LEARNER

RANGES: Mapping[str, range] = {
    "DEMONSTRATED": range(DEMONSTRATED, FRESH),
    "LEARNERS": range(LEARNERS, TRIAL),
    "FRESH": range(FRESH, 1_000_000),
    "EXPERT_CHOICE": range(EXPERT_CHOICE, EXPERT_REPORT),
    "EXPERT_REPORT": range(EXPERT_REPORT, RECORDED),
    "TRIAL": range(TRIAL, RECORDED),
    "RECORDED": range(RECORDED, REPRODUCED),
    "REPRODUCED": range(REPRODUCED, RELEVANCE),
    "RELEVANCE": range(RELEVANCE, POOLED),
    "POOLED": range(POOLED, CERTIFIED),
    "CERTIFIED": range(CERTIFIED, ROUNDS),
    "ROUNDS": range(ROUNDS, VALIDATION),
    "VALIDATION": range(VALIDATION, VALIDATION + MOST_VALIDATION),
    "REFINEMENT": range(REFINEMENT, REPORT),
    "REPORT": range(REPORT, REPORT + MOST_VALIDATION),
}
"""The seeds of each purpose, those of `aggregate` for its run of seed 0."""

SHARED = frozenset(
    {
        frozenset({"TRIAL", "EXPERT_REPORT"}),
        *(frozenset({"LEARNERS", one}) for one in ("DEMONSTRATED", "FRESH", "EXPERT_CHOICE")),
    }
)
"""Purposes whose seeds meet; the module says why that does no harm."""


class RunSeeds(NamedTuple):
    """First seed of every part of one aggregation.

    A part that did not take place, or was stopped before anything came of it, has None.

    Attributes:
        rounds: The rules act, the expert answers.
        validation: The best round, or the best point of the refinement, was chosen.
        refinement: Queries, labels and thresholds were changed.
        report: What came of it, on episodes that nothing was chosen by.
    """

    rounds: int
    validation: int | None = None
    refinement: int | None = None
    report: int | None = None


def require_seed(seed: int, most: int = LARGEST_SEED) -> None:
    """Refuse what is no seed.

    Args:
        seed: As it was given.
        most: The largest.

    Raises:
        InputError: If it is no whole number from 0 to that.
    """
    require_whole("seed", seed, 0, most)


def of_run(first: int, seed: int) -> int:
    """Where a purpose begins in one run of `aggregate`.

    Args:
        first: Of the purpose, in the run of seed 0.
        seed: Of the run.

    Returns:
        The seed of its first episode.
    """
    return first + seed * SEEDS_A_RUN
