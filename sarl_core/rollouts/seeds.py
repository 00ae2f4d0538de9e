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
`ROUNDS`              rounds of `aggregate`, `SEEDS_A_ROUND` for each
`VALIDATION`          the best of its rounds is chosen by them
`SECOND_VALIDATION`   the best point of its refinement is chosen by them
`REPRODUCED`          figures of the paper (`reproduce`), the study of the divider in it
`REFINEMENT`          the search of its refinement
`REPORT`              what came of it is reported on them
`RELEVANCE`           steps at which learners are tested for the paper's Figure 4
====================  =====================================================================

`aggregate --seed s` begins s times `SEEDS_A_RUN` further on, whatever the purpose. Within one run
no two purposes meet: `MOST_ROUNDS` and the numbers beside it see to that.

Ranges that do meet, and why that does no harm:

- `TRIAL` and `EXPERT_REPORT` are the same seeds: an expert and a learner are two policies, and
  neither is chosen by what is told of the other.
- Learners of `learn` pass over `DEMONSTRATED`, `FRESH` and `EXPERT_CHOICE`. They are tried on
  `TRIAL`, which none of them reaches.
- `REPRODUCED` and `VALIDATION` are the same seeds. What `reproduce` plays is mined at the paper's
  thresholds and chosen by no episode. Compact rules are chosen by these seeds and are therefore
  never to be judged by them.
- The numbers in the README for rules at the paper's thresholds begin at `REFINEMENT`. They too are
  chosen by no episode.
- `RELEVANCE` and `REPORT` are the same seeds. Nothing is chosen by either.
- Runs of `aggregate` whose seeds are ten apart: the rounds of one are the validation of the other.
  They share no rules.
- `FRESH` serves all pages, the search for gaps included. Nothing that is shipped is chosen by it.

They stay as they are, because shipped files name them.
"""

from __future__ import annotations

from typing import NamedTuple

DEMONSTRATED = 0
FRESH = 100_000  # far from those the demonstrations were recorded with

EXPERT_CHOICE = 5_000_000
EXPERT_REPORT = 9_000_000
TRIAL = 9_000_000

ROUNDS = 20_000_000
VALIDATION = 30_000_000
SECOND_VALIDATION = 30_500_000
REPRODUCED = 30_000_000
REFINEMENT = 40_000_000
REPORT = 50_000_000
RELEVANCE = 50_000_000

SEEDS_A_RUN = 1_000_000  # between two values of the seed of `aggregate`
SEEDS_A_ROUND = 10_000

MOST_EPISODES_A_ROUND = SEEDS_A_ROUND
MOST_ROUNDS = (VALIDATION - ROUNDS) // SEEDS_A_ROUND
MOST_VALIDATION = SECOND_VALIDATION - VALIDATION


class RunSeeds(NamedTuple):
    """First seed of every part of one aggregation.

    A part that did not take place, or was stopped before anything came of it, has None.

    Attributes:
        rounds: The rules act, the expert answers.
        validation: The best round was chosen.
        refinement: Thresholds and labels were moved.
        second_validation: The best point of the refinement was chosen.
        report: What came of it, on episodes that nothing was chosen by.
    """

    rounds: int
    validation: int | None = None
    refinement: int | None = None
    second_validation: int | None = None
    report: int | None = None


def of_run(first: int, seed: int) -> int:
    """Where a purpose begins in one run of `aggregate`.

    Args:
        first: Of the purpose, in the run of seed 0.
        seed: Of the run.

    Returns:
        The seed of its first episode.
    """
    return first + seed * SEEDS_A_RUN
