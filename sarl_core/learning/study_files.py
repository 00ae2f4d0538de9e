"""A study of learning on disk: one file a run, readable at any moment, and tables of them all."""

from __future__ import annotations

import csv
import io
import json
import os
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgspec import Struct

from sarl_core.documents import Count, MisfitError, NotNegative, conformed, read_object
from sarl_core.environments.environment import Environment
from sarl_core.environments.failures import failure_known
from sarl_core.errors import InputError, WorkError, quoted
from sarl_core.files import whole_file
from sarl_core.learning.arms import ARMS, LearningArm
from sarl_core.learning.curves import NO_EPISODES, Columns, LearningEpisodes, Trial
from sarl_core.limits import limited_bytes
from sarl_core.rollouts.choices import Choice

FORMAT = "sarl-learning"
VERSION = 1
PLAN, RESULTS, CURVES = "plan.json", "results.json", "curves.csv"
COMPARED = "compared.json"
RUNS, POLICIES = "runs", "policies"

_DECIMALS = 4  # of returns in files
_COLUMNS = ("ends", "returns", "lengths", "crashed", "interventions", "covered", "shielded")
_HEADINGS = ("step", "return", "length", "crashed", "interventions", "covered", "shielded")


@dataclass(frozen=True, eq=False)
class LearningRun:
    """One arm with one seed: finished, at work, or stopped.

    Attributes:
        arm: The way it learns.
        seed: Of the learner.
        done: Environment steps made.
        curve: The episodes so far.
        alone: Trial after learning, without a shield; None until it is finished.
        shielded: Likewise with the shield on; None without rules.
        seconds: Taken so far.
        sittings: In how many goes it learned.
    """

    arm: LearningArm
    seed: int
    done: int
    curve: LearningEpisodes
    alone: Trial | None = None
    shielded: Trial | None = None
    seconds: float = 0.0
    sittings: int = 1

    @property
    def finished(self) -> bool:
        """Whether it has learned and was tried."""
        return self.alone is not None

    @property
    def name(self) -> str:
        """Of its files, as "override-0"."""
        return f"{self.arm.name}-{self.seed}"


@dataclass(frozen=True, eq=False)
class ComparedAgent:
    """An agent that has learned nothing here, on the episodes by which learners are judged.

    Attributes:
        agent: Its name.
        alone: Without a shield.
        shielded: With the shield on; None without rules.
    """

    agent: str
    alone: Trial
    shielded: Trial | None


@dataclass(frozen=True, eq=False)
class LearningStudy:
    """Runs of several arms and seeds under the same conditions.

    Attributes:
        env_id: Environment.
        steps: Environment steps of each run.
        settings: All that the runs share: rules, projection, versions, as in the plan's file.
        arms: In the order in which they are shown.
        seeds: Of the learners.
        runs: Those that have begun; finished ones and others.
        compared: The agent that learners are compared with; None where none was named.
    """

    env_id: str
    steps: int
    settings: Mapping[str, Any]
    arms: tuple[LearningArm, ...]
    seeds: tuple[int, ...]
    runs: tuple[LearningRun, ...]
    compared: ComparedAgent | None = None

    @property
    def finished(self) -> tuple[LearningRun, ...]:
        """The runs that are finished."""
        return tuple(run for run in self.runs if run.finished)

    @property
    def failures_known(self) -> bool:
        """Whether it is known which of the environment's episodes are failures."""
        return failure_known(self.environment)

    @property
    def environment(self) -> Environment:
        """The environment and what is called a failure in it: to be told of, and not to be made."""
        made_with = self.settings.get("made_with")
        failure = made_with.get("failure") if isinstance(made_with, dict) else None
        return Environment(self.env_id, failure=failure if isinstance(failure, str) else "")

    @property
    def choose(self) -> Choice:
        """What comes first where the best way to learn is chosen."""
        return "failures" if self.settings.get("choose") == "failures" else "return"

    @property
    def complete(self) -> bool:
        """Whether every run is finished."""
        return len(self.finished) == len(self.arms) * len(self.seeds)

    def of(self, arm: LearningArm) -> tuple[LearningRun, ...]:
        """The finished runs of an arm."""
        return tuple(run for run in self.finished if run.arm == arm)


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document, whole or not at all.

    Args:
        path: A `.json` file.
        document: For JSON.
    """
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    with whole_file(path) as unfinished:
        unfinished.write_text(text + "\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any]:
    """Read a document of a study.

    Args:
        path: A `.json` file.

    Returns:
        The document.

    Raises:
        InputError: If it is no such file, or of another version.
    """
    document = read_object(path, "choose a folder that `learn` wrote")
    if document.get("format") != FORMAT:
        raise InputError(f"{path} is not of a study of learning; choose a folder `learn` wrote")
    if document.get("version") != VERSION:
        raise InputError(
            f"{path} has version {quoted(document.get('version'))} of the format, and this program "
            f"reads version {VERSION}; use a program of its version"
        )
    return document


def save_run(folder: Path, run: LearningRun) -> None:
    """Write a run as it stands.

    Args:
        folder: Of the study.
        run: At work or finished.
    """
    curve = run.curve.to_dict()
    curve["returns"] = [round(value, _DECIMALS) for value in curve["returns"]]
    write_json(
        run_path(folder, run.arm, run.seed),
        {"format": FORMAT, "version": VERSION, **_entry(run), "curve": curve},
    )


def run_path(folder: Path, arm: LearningArm, seed: int) -> Path:
    """Where a run's file is."""
    return folder / RUNS / f"{arm.name}-{seed}.json"


def policy_path(folder: Path, arm: LearningArm, seed: int) -> Path:
    """Where what a run learned is."""
    return folder / POLICIES / f"{arm.name}-{seed}.npz"


def save_compared(folder: Path, compared: ComparedAgent) -> None:
    """Write what an agent that learners are compared with has done.

    Args:
        folder: Of the study.
        compared: The agent and its episodes.
    """
    head = {"format": FORMAT, "version": VERSION}
    write_json(folder / COMPARED, {**head, **_compared_entry(compared)})


def load_run(path: Path) -> LearningRun:
    """Read a run.

    Args:
        path: What `save_run` wrote.

    Returns:
        The run.

    Raises:
        InputError: If it is no such file, or lacks something.
    """
    document = read_json(path)
    try:
        entry = conformed(document, _StoredRunWithCurve)
        return entry.read(entry.curve.read())
    except MisfitError as error:
        raise InputError(f"{path} lacks a part of its run ({error}); delete it") from error


def load_study(folder: Path) -> LearningStudy:
    """Read a study, finished or not: from its runs, or where they are gone from its tables.

    Args:
        folder: That `learn` wrote, or a copy of its tables.

    Returns:
        The study, with the runs there are.

    Raises:
        InputError: If there is none, or a file is damaged.
    """
    settings = read_json(folder / PLAN)
    try:
        plan = conformed(settings, _Plan)
        arms = tuple(map(_arm, plan.arms))
    except MisfitError as error:
        raise InputError(
            f"{folder / PLAN} lacks a part of its plan ({error}); choose a folder that `learn` "
            "wrote"
        ) from error
    compared = _load_compared(folder / COMPARED) if (folder / COMPARED).is_file() else None
    if compared is not None and compared.agent != settings.get("agent"):
        compared = None  # of an earlier order
    if (folder / RUNS).is_dir():
        paths = [run_path(folder, arm, seed) for seed in plan.seeds for arm in arms]
        runs = tuple(load_run(path) for path in paths if path.is_file())
    else:
        runs = _from_tables(folder)
    return LearningStudy(plan.env_id, plan.steps, settings, arms, plan.seeds, runs, compared)


def save_tables(folder: Path, study: LearningStudy, results: Mapping[str, Any]) -> None:
    """Write what is finished as `results.json` and `curves.csv`.

    Args:
        folder: Of the study.
        study: With the runs there are.
        results: More to stand in `results.json`.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("arm", "seed", *_HEADINGS))
    for run in study.finished:
        columns = [getattr(run.curve, name) for name in _COLUMNS]
        writer.writerows(
            (run.arm.name, run.seed, *(_cell(value) for value in row))
            for row in zip(*(column.tolist() for column in columns), strict=True)
        )
    with whole_file(folder / CURVES) as unfinished:
        unfinished.write_text(text.getvalue(), encoding="utf-8")
    write_json(
        folder / RESULTS,
        {
            **study.settings,
            **results,
            **({} if study.compared is None else {"compared": _compared_entry(study.compared)}),
            "runs": [_entry(run) for run in study.finished],
        },
    )


def make_folder(folder: Path) -> None:
    """Make a study's folder, and refuse one that cannot be written to.

    Args:
        folder: To make; it may be there.

    Raises:
        InputError: If that is not possible.
    """
    try:
        for path in (folder, folder / RUNS, folder / POLICIES):
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be made ({error.strerror or error}); choose another"
        ) from error
    if not os.access(folder / RUNS, os.W_OK):
        raise InputError(f"the folder {folder} cannot be written to; choose another")


def remove(path: Path) -> None:
    """Remove a file that is not needed any more, if it is there."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise WorkError(f"{path} cannot be removed ({error.strerror or error})") from error


def _cell(value: float | bool) -> float | int:
    return round(value, _DECIMALS) if isinstance(value, float) else int(value)


def _entry(run: LearningRun) -> dict[str, Any]:
    """A run without its curve, for JSON."""
    return {
        "arm": run.arm.name,
        "seed": run.seed,
        "steps_done": run.done,
        "seconds": round(run.seconds, 1),
        "sittings": run.sittings,
        "episodes": len(run.curve),
        "crashes": run.curve.crashes,
        "alone": None if run.alone is None else run.alone.to_dict(),
        "shielded": None if run.shielded is None else run.shielded.to_dict(),
    }


def _compared_entry(compared: ComparedAgent) -> dict[str, Any]:
    return {
        "agent": compared.agent,
        "alone": compared.alone.to_dict(),
        "shielded": None if compared.shielded is None else compared.shielded.to_dict(),
    }


def _load_compared(path: Path) -> ComparedAgent:
    try:
        stored = conformed(read_json(path), _StoredCompared)
    except MisfitError as error:
        raise InputError(f"{path} lacks a part ({error}); delete it") from error
    return ComparedAgent(stored.agent, stored.alone, stored.shielded)


# What a file says at least.
class _Plan(Struct):
    env_id: str
    steps: Count
    arms: tuple[str, ...]
    seeds: tuple[Count, ...]
    trial_episodes: Count
    penalty: float | None = None


class _StoredRun(Struct):
    arm: str
    seed: Count
    steps_done: Count
    seconds: NotNegative
    sittings: Count
    alone: Trial | None
    shielded: Trial | None

    def read(self, curve: LearningEpisodes) -> LearningRun:
        return LearningRun(
            _arm(self.arm),
            self.seed,
            self.steps_done,
            curve,
            self.alone,
            self.shielded,
            self.seconds,
            self.sittings,
        )


class _StoredRunWithCurve(_StoredRun):
    curve: Columns


class _StoredCompared(Struct):
    agent: str
    alone: Trial
    shielded: Trial | None


class _Results(Struct):
    runs: tuple[_StoredRun, ...] = ()


def _arm(name: str) -> LearningArm:
    if name not in ARMS:
        raise MisfitError(f"there is no arm {quoted(name)}")
    return ARMS[name]


def _from_tables(folder: Path) -> tuple[LearningRun, ...]:
    document = read_json(folder / RESULTS)
    try:
        columns: dict[tuple[str, str], dict[str, list[str]]] = defaultdict(
            lambda: {name: [] for name in _COLUMNS}
        )
        text = limited_bytes(folder / CURVES).decode()
        for row in csv.DictReader(io.StringIO(text), strict=True):
            of_run = columns[row["arm"], row["seed"]]
            for name, heading in zip(_COLUMNS, _HEADINGS, strict=True):
                of_run[name].append(row[heading])
        curves = {
            key: conformed(of_run, Columns, strict=False).read() for key, of_run in columns.items()
        }
        return tuple(
            run.read(curves.get((run.arm, str(run.seed)), NO_EPISODES))
            for run in conformed(document, _Results).runs
        )
    except (OSError, KeyError, ValueError, csv.Error) as error:
        raise InputError(
            f"{folder / CURVES} does not fit {RESULTS} ({error}); copy both from a folder that "
            "`learn` wrote"
        ) from error
