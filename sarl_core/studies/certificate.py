"""A certificate: that a shielded agent fails in at most so many of its episodes, at a certainty.

It is a statement about episodes drawn as these were: one environment, its resets with seeds that
nothing was chosen by, one agent, these rules. It says nothing of another agent, another start or
another version of the environment, and nothing of how bad a failure is.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sarl_core.agents.agent import Agent, PolicyAgent
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.environments.failures import failure_text, no_failures_text
from sarl_core.errors import InputError, SarlError, require_whole
from sarl_core.mining.rule_set import rules_digest
from sarl_core.processes import executor_of
from sarl_core.rollouts.episodes import MAX_STEPS, Episodes, join
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.seeds import CERTIFIED
from sarl_core.rollouts.statistics import Rate, rate_of
from sarl_core.rollouts.tasks import Task, run_tasks
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield
from sarl_core.studies.sequential_test import SequentialTest, Verdict, sequential_test

CERTAINTY = 0.95
_PACKAGES = ("numpy", "gymnasium")


@dataclass(frozen=True)
class Subject:
    """What is certified.

    Attributes:
        env_id: Environment.
        env_arguments: What it is made with, as JSON.
        wrappers: What is put around it, the innermost first.
        package: What its code comes from, with the version, as "gymnasium 1.2.3"; "" where that
            is not known.
        failure: What a failure is in it, in words.
        agent: Name of who is shielded.
        agent_digest: Of its weights; "" of one that has none.
        sampled: Whether its actions are drawn at random.
        rules: How many are in force.
        rules_digest: As of `rules_digest`.
        projection: How the shield replaces a continuous action.
        outside: Whether rules act in states outside the data they were mined from.
        on_invalid: What becomes of a step whose state is no state.
        max_steps: After which an episode is cut off.
    """

    env_id: str
    env_arguments: str
    wrappers: tuple[str, ...]
    package: str
    failure: str
    agent: str
    agent_digest: str
    sampled: bool
    rules: int
    rules_digest: str
    projection: str
    outside: str
    on_invalid: str
    max_steps: int


@dataclass(frozen=True)
class Certificate:
    """A test of a rate of failures, and what it came to.

    Attributes:
        subject: What was tested.
        test: How.
        verdict: What came of it.
        seed: Of the first episode; episode i has seed + i.
        made: The day, as "2026-11-27"; "" where it is not known.
        command: That makes it again; "" where none does.
        versions: Of Python and the packages that matter, by their names.
        notes: What is to be said of how the episodes came about, as clauses.
    """

    subject: Subject
    test: SequentialTest
    verdict: Verdict
    seed: int
    made: str = ""
    command: str = ""
    versions: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def last_seed(self) -> int:
        """Of the last episode that counts."""
        return self.seed + self.verdict.episodes - 1

    @cached_property
    def rate(self) -> Rate:
        """The share that failed, with the 95 % interval of a number of episodes fixed beforehand.

        It is told beside the verdict, and is no part of it.
        """
        order = np.arange(self.verdict.episodes)
        failures, undecided = self.verdict.failures, self.verdict.undecided
        return rate_of(order < failures, (order >= failures) & (order < failures + undecided))


class CertificateStep(NamedTuple):
    """How far a certificate is.

    Attributes:
        verdict: As far as it has looked.
        more: How many more episodes it takes at least to certify; None where that cannot be any
            more.
        fresh: The episodes that were run last.
    """

    verdict: Verdict
    more: int | None
    fresh: Episodes


def subject_of(
    environment: EnvironmentOrId, agent: Agent, shield: Shield, max_steps: int | None = None
) -> Subject:
    """What a certificate is about.

    Args:
        environment: Where failures are known.
        agent: Who is shielded.
        shield: With its rules, in whatever order.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.

    Returns:
        All of it in words and digests.

    Raises:
        InputError: If it is not known what a failure is, or there is none.
    """
    environment = as_environment(environment)
    if why := no_failures_text(environment):
        raise InputError(
            f"there is nothing to certify in {environment.id}: {why}; say what a failure is with "
            "--failure (`failure` of an Environment), or certify another environment"
        )
    policy = agent.policy if isinstance(agent, PolicyAgent) else None
    return Subject(
        env_id=environment.id,
        env_arguments=environment.arguments,
        wrappers=environment.wrappers,
        package=_package_of(environment.id),
        failure=failure_text(environment),
        agent=agent.name,
        agent_digest="" if policy is None else policy.digest,
        sampled=agent.n_uniforms > 0,
        rules=sum(rule.enabled for rule in shield.rule_set.rules),
        rules_digest=rules_digest(shield.rule_set),
        projection=shield.projection,
        outside=shield.outside,
        on_invalid=shield.on_invalid,
        max_steps=MAX_STEPS if max_steps is None else max_steps,
    )


def run_test(
    test: SequentialTest,
    task: Task,
    known: Sequence[Episodes] = (),
    executor: Executor | None = None,
) -> Generator[CertificateStep, None, None]:
    """Run episodes until a test is decided, none beyond what it takes at least.

    Whatever runs them and however they are handed over, they are counted in the order of their
    seeds, so that the verdict is the same.

    Args:
        test: What decides.
        task: Whose episodes they are; `test.episodes` of them at most.
        known: The first of its episodes that have been run before, if any.
        executor: Its processes do the work; here where there is none.

    Yields:
        How far it is, after every piece; the last one with the verdict.

    Raises:
        SarlError: If episodes cannot be run.
    """
    count = _Count(test)
    for piece in known:
        yield count.step(piece)
        if count.verdict.certified is not None:
            return
    while count.episodes < test.episodes:
        rest = test.episodes - count.episodes
        part = replace(
            task,
            seed=task.seed + count.episodes,
            episodes=rest if count.more is None else min(count.more, rest),
        )
        with closing(run_tasks([part], executor)) as work:
            for _, outcome in work:
                if isinstance(outcome, SarlError):
                    raise outcome
                yield count.step(outcome)
                if count.verdict.certified is not None:
                    return


class _Count:
    """The failures of episodes that come one piece after the other."""

    def __init__(self, test: SequentialTest) -> None:
        self.test, self.verdict = test, Verdict(None, 0, 0, 0)
        self._failed = self._unknown = np.zeros(0, dtype=np.bool_)

    @property
    def episodes(self) -> int:
        return len(self._failed)

    @property
    def more(self) -> int | None:
        verdict = self.verdict
        return self.test.least_more(verdict.episodes, verdict.failures + verdict.undecided)

    def step(self, piece: Episodes) -> CertificateStep:
        self._failed = np.concatenate([self._failed, piece.failed])
        self._unknown = np.concatenate([self._unknown, piece.undecided])
        self.verdict = self.test.decided(self._failed, self._unknown)
        return CertificateStep(self.verdict, self.more, piece)


def certify(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    shield: Shield,
    *,
    at_most: float,
    certainty: float = CERTAINTY,
    episodes: int | None = None,
    seed: int = CERTIFIED,
    stochastic: bool = False,
    jobs: int = 1,
    executor: Executor | None = None,
    max_steps: int | None = None,
    command: str = "",
    progress: Callable[[CertificateStep], None] | None = None,
) -> Certificate:
    """Test whether a shielded agent fails in at most so many of its episodes.

    Args:
        env_id: What ``gymnasium.make`` takes, or that with what a failure is in it.
        agent: An agent, or what `make_agent` takes.
        shield: With its rules.
        at_most: The rate of failures, between 0 and 1.
        certainty: Of a verdict, at least 0.5 and below 1.
        episodes: After which the test ends undecided; ten times as many as are enough without a
            failure where not given.
        seed: Of the first episode. The usual ones are used for nothing else; of others one has to
            know that the rules were not chosen by them.
        stochastic: Whether a trained policy is sampled.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        max_steps: After which an episode is cut off; whether it would have failed later is not
            known, so it counts against a certificate.
        command: That makes the certificate again, if any.
        progress: Called after every piece; may raise to stop.

    Returns:
        The certificate, whatever the verdict; the same arguments give the same one, but for its
        date.

    Raises:
        InputError: If a number is out of range, it is not known what a failure is, or agent,
            shield and environment do not fit.
    """
    require_whole("jobs", jobs, 1)
    require_whole("max_steps", MAX_STEPS if max_steps is None else max_steps, 1)
    test = sequential_test(at_most, certainty, episodes)
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    subject = subject_of(env_id, actor, shield, max_steps)
    _, fitted, notes = check_environment(env_id, shield)
    task = Task(env_id, actor, fitted, seed, test.episodes, max_steps=max_steps)
    verdict, pieces = Verdict(None, 0, 0, 0), []
    for step in run_test(test, task, executor=executor_of(jobs, executor)):
        verdict = step.verdict
        pieces.append(step.fresh)
        if progress is not None:
            progress(step)
    # Of all together: how many were cut off is one number.
    remarks = dict.fromkeys([*notes, *join(pieces).remarks])
    return certificate_of(subject, test, verdict, seed, command=command, notes=tuple(remarks))


def certificate_of(
    subject: Subject,
    test: SequentialTest,
    verdict: Verdict,
    seed: int,
    *,
    command: str = "",
    notes: Sequence[str] = (),
) -> Certificate:
    """A certificate as it is made today.

    Args:
        subject: What was tested.
        test: How.
        verdict: What came of it.
        seed: Of the first episode.
        command: That makes it again, if any.
        notes: What is to be said of how the episodes came about.
    """
    versions = [("python", platform.python_version())]
    versions += [(package, metadata.version(package)) for package in _PACKAGES]
    return Certificate(
        subject,
        test,
        verdict,
        seed,
        made=date.today().isoformat(),
        command=command,
        versions=tuple(versions),
        notes=tuple(notes),
    )


def _package_of(env_id: str) -> str:
    """What an environment's code comes from, with its version."""
    from gymnasium.envs.registration import registry

    spec = registry.get(env_id.rpartition(":")[2])
    entry = spec.entry_point if spec is not None else None
    module = entry if isinstance(entry, str) else getattr(entry, "__module__", "")
    top = (module or env_id).partition(":")[0].partition(".")[0]
    try:
        packages = metadata.packages_distributions().get(top, [])
        return f"{packages[0]} {metadata.version(packages[0])}" if packages else ""
    except metadata.PackageNotFoundError:
        return ""
