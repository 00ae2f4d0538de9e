"""Ablations: run beside the page in processes, kept for whoever asks again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import streamlit as st

from sarl_core.agents.agent import Agent
from sarl_core.processes import Processes
from sarl_core.rollouts.tasks import run_tasks
from sarl_core.shielding.shield import Shield
from sarl_core.studies.ablation import Ablation
from sarl_core.studies.ablation_run import AblationRecord
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.memory_cache import BoundedCache

MOST_RECORDS = 24


@dataclass(frozen=True, eq=False)
class Wanted:
    """An ablation that is asked for.

    Attributes:
        key: Digest of everything it depends on, its size left out.
        env_id: Environment.
        seed: Of the first episode.
        episodes: How many.
        most: Rules to take out at most.
        agent: Makes the agent.
        shield: With all its rules.
    """

    key: str
    env_id: str
    seed: int
    episodes: int
    most: int
    agent: Callable[[], Agent]
    shield: Callable[[], Shield]

    @property
    def known(self) -> Ablation | None:
        """What has been run of it, by whomever."""
        record = records().get(self.key)
        return None if record is None else record.result(self.episodes, self.most)


@st.cache_resource
def records() -> BoundedCache[AblationRecord]:
    """What has been run of each ablation so far, by its key."""
    return BoundedCache(MOST_RECORDS)


def ablating(wanted: Wanted) -> Job[AblationRecord]:
    """Run the episodes of an ablation that are not known yet.

    Args:
        wanted: What is asked for.
    """
    kept, executor = records(), processes()
    return Job(wanted.key, lambda job: _ablate(job, wanted, kept, executor), wanted.episodes)


def _ablate(
    job: Job[AblationRecord],
    wanted: Wanted,
    kept: BoundedCache[AblationRecord],
    executor: Processes,
) -> None:
    record = kept.get(wanted.key)
    if record is None:
        job.text = "Making the agent …"
        record = AblationRecord(wanted.env_id, wanted.agent(), wanted.shield(), wanted.seed)
        kept.put(wanted.key, record)
    work = record.run(wanted.episodes, wanted.most, partial(run_tasks, executor=executor))
    for job.done, job.total, job.text in work:
        if not job.wanted():
            work.close()
            return
