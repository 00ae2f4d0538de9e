"""Learning beside the pages: what is asked for, the process that does it, and where it is kept.

A study learns in a process of its own, the `learn` command, which writes into a folder that can
be read at any moment. The folder is found by what was asked for, so whoever asks the same again
sees it at once, and what was stopped goes on. The process ends when nobody waits for it any
more: it holds one end of a pipe, and stops in good order when the other end is let go of, were it
because the dashboard has died.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

import streamlit as st

import sarl_core
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError, SarlError, WorkError
from sarl_core.files import shared_temporary_folder
from sarl_core.learning.arms import LearningArm
from sarl_core.learning.run import TRIAL_EPISODES
from sarl_core.learning.study_copies import restore_study, study_contents
from sarl_core.learning.study_files import (
    PLAN,
    LearningStudy,
    load_run,
    load_study,
    make_folder,
    policy_path,
)
from sarl_core.library.items import Kind
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.choices import Choice
from sarl_core.serving.limits import ServerLimits
from sarl_core.shielding.shield import Projection
from sarl_core.shipped import DATA
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.queue import JobKind
from sarl_dashboard.state import library
from sarl_dashboard.text import digest_of

ROOT = Path(sarl_core.__file__).parents[1]  # where a process of its own finds the library
STUDIES = DATA / "learning"
MOST_TRAININGS = 2  # at once, of all visitors: each takes a core
STUDIES_OF_LEARNING = JobKind("studies of learning", MOST_TRAININGS)
MOST_FOLDERS = 24  # the oldest go first; one takes a few MB
LEFT_ALONE = 6 * 3600.0  # seconds without a look before a folder may go
PATIENCE = 30.0  # seconds that a process gets to save what it has learned
_KIND: Kind = "study"
_LOOKED_AT_EVERY = 1.0  # seconds
_NICE = 10  # the dashboard answers first


@dataclass(frozen=True, eq=False)
class LearningOrder:
    """A study that a visitor asks for.

    Attributes:
        env_id: Environment.
        rules: Of the shield, or None.
        arms: Ways to learn.
        steps: Of each run.
        seeds: How many learners of each kind.
        projection: What becomes of a continuous action that breaks a rule.
        episodes: Of each learner after learning.
        choose: What comes first where the best way to learn is chosen.
        agent: Whom the learners are compared with: its name on screen, and what the command line
            calls it; None for nobody.
    """

    env_id: EnvironmentOrId
    rules: RuleSet | None
    arms: tuple[LearningArm, ...]
    steps: int
    seeds: int
    projection: Projection
    episodes: int = TRIAL_EPISODES
    choose: Choice = "return"
    agent: tuple[str, str] | None = None

    @property
    def conditions(self) -> str:
        """Digest of what all runs share."""
        rules = self.rules.digest if self.rules is not None else ""
        shared = (
            as_environment(self.env_id).key,
            rules,
            self.steps,
            self.projection,
            self.episodes,
        )
        return digest_of(repr(shared).encode())[:16]

    @property
    def folder(self) -> Path:
        """Where the study is, or will be."""
        names = tuple(arm.name for arm in self.arms)
        wanted = (names, self.seeds, *(() if self.agent is None else (self.agent,)))
        return base() / f"{self.conditions}-{digest_of(repr(wanted).encode())[:16]}"

    @property
    def steps_in_all(self) -> int:
        """Over all runs."""
        return self.steps * self.seeds * len(self.arms)


def base() -> Path:
    """The folder of all studies that visitors asked for; SARL_LEARNING names another one."""
    name = f"sarl-explorer-{os.getuid()}" if hasattr(os, "getuid") else "sarl-explorer"
    return Path(os.environ.get("SARL_LEARNING", "") or shared_temporary_folder() / name)


def _import_path() -> str:
    """Where a module that this server offers is found, by a process in another folder."""
    return os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), str(Path.cwd()))))


def study_of(order: LearningOrder) -> LearningStudy | None:
    """What there is of a study.

    Args:
        order: What was asked for.

    Returns:
        None if it was never begun.

    Raises:
        InputError: If its folder is damaged.
    """
    if not (order.folder / PLAN).is_file():
        _restore(order)
    if not (order.folder / PLAN).is_file():
        return None
    with suppress(OSError):
        os.utime(order.folder)  # somebody looks at it: it stays
    study = load_study(order.folder)
    compared = study.compared
    if compared is not None and order.agent is not None:
        compared = replace(compared, agent=order.agent[0])
    # Chosen is among what has been played: another choice plays nothing anew.
    return replace(study, settings={**study.settings, "choose": order.choose}, compared=compared)


def keep_study(order: LearningOrder) -> None:
    """Keep what is finished of a study: a link then opens it whatever becomes of its folder.

    Args:
        order: What was asked for.

    Raises:
        SarlError: If it cannot be kept.
    """
    study = study_of(order)
    if study is not None and study.finished:
        contents = study_contents(order.folder, study)
        name, runs = str(order.env_id), len(study.finished)
        library.keep_work(_KIND, name, order.folder.name, contents, runs)


def _restore(order: LearningOrder) -> None:
    """Make the folder of a study anew, where it is gone and the study was kept."""
    with suppress(SarlError):  # what cannot be read is learned again
        for files in library.stored_work(_KIND, order.folder.name):
            _make_base()
            restore_study(order.folder, files)


class Training:
    """The process of one study, and how many wait for it."""

    def __init__(self, order: LearningOrder, keep: set[Path]) -> None:
        """Start it.

        Args:
            order: What is asked for.
            keep: Folders that are in use.

        Raises:
            SarlError: If the folder or the process cannot be made.
        """
        self.waiting, self.fresh = 0, True
        self.folder = order.folder
        _tidy_up(keep | {self.folder})
        _make_base()
        make_folder(self.folder)
        _take_over_finished(order)
        rules = ["--rules", str(self.folder / "asked.json")] if order.rules is not None else []
        if order.rules is not None:
            order.rules.save(self.folder / "asked.json")
        self.log = self.folder / "log.txt"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "sarl_core", "learn", "--stop-with-input"),
                    *(*as_environment(order.env_id).words, *rules, "--steps", str(order.steps)),
                    *(part for arm in order.arms for part in ("--arm", arm.name)),
                    *("--seeds", str(order.seeds), "--projection", order.projection),
                    *("--episodes", str(order.episodes), "--choose", order.choose),
                    *(() if order.agent is None else ("--agent", order.agent[1])),
                    *("--out", str(self.folder)),
                ],
                cwd=ROOT,
                env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": _import_path()},
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,  # Ctrl-C in the dashboard's terminal is for the dashboard
            )
        with suppress(
            OSError, AttributeError
        ):  # where there are no priorities, it learns all the same
            os.setpriority(os.PRIO_PROCESS, self.process.pid, _NICE)

    @property
    def running(self) -> bool:
        """Whether it is at work."""
        return self.process.poll() is None

    def stop(self) -> None:
        """Let go of it, and wait until it is gone."""
        assert self.process.stdin is not None
        with suppress(OSError):
            self.process.stdin.close()
        for end in (self.process.terminate, self.process.kill):
            try:
                self.process.wait(PATIENCE)
                return
            except subprocess.TimeoutExpired:
                end()
        self.process.wait()

    def problem(self) -> str:
        """Why it ended early, in its one sentence; "" if it did not."""
        if not self.process.returncode:
            return ""
        lines = self.log.read_text(errors="replace").strip().splitlines()
        complaint = next((line for line in reversed(lines) if line.startswith("error: ")), "")
        return complaint.removeprefix("error: ") or "learning ended unexpectedly; start it again"


class Trainings:
    """The processes at work, shared between visitors."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._at_work: dict[Path, Training] = {}

    def join(self, order: LearningOrder) -> Training:
        """Wait for a study with others, or start it.

        Raises:
            SarlError: If it cannot be started.
        """
        while True:
            with self._lock:
                training = self._at_work.get(order.folder)
                if training is None or not (training.waiting or training.running):
                    training = self._at_work[order.folder] = self._start(order)
                if training.waiting or training.fresh:
                    training.fresh = False
                    training.waiting += 1
                    return training
            time.sleep(_LOOKED_AT_EVERY)  # it is stopping; two must not write into a folder

    def _start(self, order: LearningOrder) -> Training:
        busy = sum(other.running for other in self._at_work.values())
        if busy >= MOST_TRAININGS:
            raise WorkError(
                f"{busy} studies are learning on this machine already, which is as many as it "
                "takes; try again when one has ended"
            )
        try:
            return Training(order, keep=set(self._at_work))
        except OSError as error:
            raise WorkError(
                f"learning cannot be started ({error.strerror or error}); make room in {base()}"
            ) from error

    def leave(self, training: Training) -> None:
        """Wait no longer; the last one stops the process."""
        with self._lock:
            training.waiting -= 1
            if training.waiting:
                return
        training.stop()
        with self._lock:
            if self._at_work.get(training.folder) is training:
                del self._at_work[training.folder]


@st.cache_resource
def trainings() -> Trainings:
    """All of them."""
    return Trainings()


def learning(order: LearningOrder) -> Job[LearningStudy]:
    """Wait for a study, which begins or goes on; what there is of it is the result so far.

    Args:
        order: What is asked for.
    """
    everyone = trainings()
    return Job(
        order.folder,
        lambda job: _wait(job, order, everyone),
        order.steps_in_all,
        _so_far(order),
        lasts=True,
        kind=STUDIES_OF_LEARNING,
    )


def _so_far(order: LearningOrder) -> LearningStudy | None:
    with suppress(SarlError):
        return study_of(order)
    return None


def _wait(job: Job[LearningStudy], order: LearningOrder, everyone: Trainings) -> None:
    limits = ServerLimits.of_process()
    if order.steps > limits.learning_steps or order.seeds > limits.learning_seeds:
        raise InputError(
            f"{order.steps:,} steps and {order.seeds} learners of each kind are more than this "
            f"server takes, {limits.learning_steps:,} and {limits.learning_seeds}; ask for less"
        )
    began, already = time.monotonic(), _steps_made(job.result)
    training = everyone.join(order)
    try:
        while job.wanted() and training.running:
            job.result = _so_far(order) or job.result
            job.done = _steps_made(job.result)
            job.text = _progress_text(job, order, job.done - already, time.monotonic() - began)
            time.sleep(_LOOKED_AT_EVERY)
        ended = not training.running
    finally:
        everyone.leave(training)
    with suppress(SarlError):  # its folder is there all the same; a page says that keeping fails
        keep_study(order)
    if ended and job.wanted() and (problem := training.problem()):
        raise WorkError(problem)


def _steps_made(study: LearningStudy | None) -> int:
    return sum(run.done for run in study.runs) if study is not None else 0


def _progress_text(job: Job[LearningStudy], order: LearningOrder, made: int, seconds: float) -> str:
    """Who learns, and how long it may still take.

    Args:
        job: The work.
        order: What is asked for.
        made: Steps since it began.
        seconds: Since it began.
    """
    left = ""
    if made > 0 and seconds > 10:
        minutes = seconds / made * (job.total - job.done) / 60
        left = (
            f", about {counted(round(minutes), 'minute')} left"
            if minutes >= 1.5
            else (", about a minute left")
        )
    run = next((run for run in job.result.runs if not run.finished), None) if job.result else None
    who = (
        f"{run.arm.title}, learner {run.seed + 1}: {run.done:,} of {order.steps:,} steps"
        if run is not None
        else "Starting …"
        if made <= 0
        else "Next one …"
    )
    return who + left


def _take_over_finished(order: LearningOrder) -> None:
    """Copy finished runs of other studies under the same conditions; they would be the same."""
    for sibling in sorted(base().glob(f"{order.conditions}-*")):
        if sibling == order.folder:
            continue
        for arm in order.arms:
            for seed in range(order.seeds):
                _take_over(sibling, order.folder, arm, seed)


def _take_over(source: Path, target: Path, arm: LearningArm, seed: int) -> None:
    name = f"runs/{arm.name}-{seed}.json"
    policy = policy_path(source, arm, seed)
    if (target / name).exists() or not (source / name).is_file() or not policy.is_file():
        return
    with suppress(InputError, OSError):  # what cannot be read is learned again
        if load_run(source / name).finished:
            shutil.copyfile(policy, policy_path(target, arm, seed))
            shutil.copyfile(source / name, target / name)


def _tidy_up(keep: set[Path]) -> None:
    """Remove the studies that nobody has looked at for longest, and not within the last hours."""
    folders = [folder for folder in base().glob("*-*") if folder.is_dir() and folder not in keep]
    ages = {folder: time.time() - folder.stat().st_mtime for folder in folders}
    folders.sort(key=lambda folder: -ages[folder])
    for folder in folders[: max(0, len(folders) + 1 - MOST_FOLDERS)]:
        if ages[folder] > LEFT_ALONE:
            shutil.rmtree(folder, ignore_errors=True)


def _make_base() -> None:
    """Make the folder for all studies, for this user alone.

    Raises:
        WorkError: If somebody else on this machine has made it.
    """
    folder = base()
    with suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid") and folder.exists() and folder.stat().st_uid != os.getuid():
        raise WorkError(
            f"the folder {folder} belongs to another user; name another one in SARL_LEARNING"
        )
    with suppress(OSError):
        folder.chmod(0o700)
