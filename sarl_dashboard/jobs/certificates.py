"""Certificates: episodes run until a test is decided, kept for whoever asks again."""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass

from sarl_core.environments.environment import as_environment
from sarl_core.errors import SarlError
from sarl_core.explaining.words.certificate import progress_text
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.tasks import Task
from sarl_core.studies.certificate import Certificate, certificate_of, run_test, subject_of
from sarl_core.studies.sequential_test import SequentialTest, Verdict
from sarl_dashboard.jobs.episodes import Results, Row, known, results
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.state import library

CERTIFICATE = Place[None]("certificate")  # of the page Measure


@dataclass(frozen=True, eq=False)
class WantedCertificate:
    """A certificate that is asked for.

    Attributes:
        row: Whose episodes they are; with rules.
        test: What decides.
        command: That makes the same elsewhere; "" where none does.
    """

    row: Row
    test: SequentialTest
    command: str

    @property
    def key(self) -> object:
        """Of everything that it depends on."""
        return (self.row.key, self.test)

    @property
    def verdict(self) -> Verdict:
        """What has been found so far, by whomever."""
        (episodes,) = known([self.row], self.test.episodes)
        if episodes is None:
            return Verdict(None, 0, 0, 0)
        return self.test.decided(episodes.failed, episodes.undecided)

    def certificate(self) -> Certificate:
        """The certificate as it stands.

        Raises:
            SarlError: If agent, shield and environment do not fit.
        """
        shield = self.row.shield()
        assert shield is not None
        (episodes,) = known([self.row], self.test.episodes)
        subject = subject_of(as_environment(self.row.env_id), self.row.agent(), shield)
        remarks = () if episodes is None else episodes.remarks
        return certificate_of(
            subject,
            self.test,
            self.verdict,
            self.row.seed,
            command=self.command,
            notes=remarks,
        )


def certifying(wanted: WantedCertificate) -> Job[None]:
    """Run the episodes that are missing for a verdict.

    Args:
        wanted: What is asked for.
    """
    episodes, executor = results(), processes()
    return Job(
        wanted.key,
        lambda job: _certify(job, wanted, episodes, executor),
        wanted.test.certified[0],
        lasts=True,
    )


def _certify(
    job: Job[None], wanted: WantedCertificate, episodes: Results, executor: Executor
) -> None:
    row, test = wanted.row, wanted.test
    agent, shield = row.agent(), row.shield()
    check_environment(row.env_id, shield)
    have = episodes.get(row.key, test.episodes)
    task = Task(row.env_id, agent, shield, row.seed, test.episodes)
    work = run_test(test, task, [] if have is None else [have], executor)
    for step in work:
        episodes.add(row, step.fresh)
        job.done = step.verdict.episodes
        rest = test.episodes - step.verdict.episodes if step.more is None else step.more
        job.total = step.verdict.episodes + rest
        job.text = progress_text(step.verdict, step.more)
        if not job.wanted():
            work.close()
            break
    finished = episodes.get(row.key, test.episodes)
    if finished is not None:
        with suppress(SarlError):  # here it is all the same; a page has said that it fails
            library.keep_episodes(finished, row.name, row.digest)
