"""Ablations: run beside the page in processes, kept for whoever asks again."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import streamlit as st

from sarl_core.rollouts.tasks import run_tasks
from sarl_core.studies.ablation import Ablation
from sarl_core.studies.ablation_run import AblationRecord
from sarl_dashboard.jobs.episodes import Row
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.memory_cache import BoundedCache

MOST_RECORDS = 24


@dataclass(frozen=True, eq=False)
class Wanted:
    """An ablation that is asked for.

    Attributes:
        row: Whose episodes they are, with all rules.
        episodes: How many.
        most: Rules to take out at most.
    """

    row: Row
    episodes: int
    most: int

    @property
    def known(self) -> Ablation | None:
        """What has been run of it, by whomever."""
        record = record_cache().get(self.row.key)
        return None if record is None else record.result(self.episodes, self.most)


@st.cache_resource
def record_cache() -> BoundedCache[AblationRecord]:
    """What has been run of each ablation so far, by the key of its row."""
    return BoundedCache(MOST_RECORDS)


def ablating(wanted: Wanted) -> Job[AblationRecord]:
    """Run the episodes of an ablation that are not known yet.

    Args:
        wanted: What is asked for.
    """
    cache, executor = record_cache(), processes()
    return Job(
        wanted.row.key,
        lambda job: _ablate(job, wanted, cache, executor),
        wanted.episodes,
        lasts=True,
    )


def _ablate(
    job: Job[AblationRecord],
    wanted: Wanted,
    cache: BoundedCache[AblationRecord],
    executor: Executor,
) -> None:
    row = wanted.row
    record = cache.get(row.key)
    if record is None:
        job.text = "Making the agent …"
        shield = row.shield()
        assert shield is not None
        record = AblationRecord(row.env_id, row.agent(), shield, row.seed)
        cache.put(row.key, record)
    work = record.run(wanted.episodes, wanted.most, partial(run_tasks, executor=executor))
    for job.done, job.total, job.text in work:
        if not job.wanted():
            work.close()
            return
