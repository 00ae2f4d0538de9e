"""Arms and seeds, one after the other: begun, stopped, resumed, summed up."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError, SarlError, WorkError
from sarl_core.learning.arms import LearningArm, check_learning
from sarl_core.learning.curves import NO_EPISODES, LearningEpisodes, Trial
from sarl_core.learning.run import (
    TRIAL_EPISODES,
    DivergedError,
    LearningResult,
    learn,
    try_agent,
)
from sarl_core.learning.study_files import (
    FORMAT,
    PLAN,
    VERSION,
    ComparedAgent,
    LearningRun,
    LearningStudy,
    load_run,
    load_study,
    make_folder,
    policy_path,
    read_json,
    remove,
    run_path,
    save_compared,
    save_run,
    save_tables,
    write_json,
)
from sarl_core.learning.summary import summarise_study
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.processes import completed
from sarl_core.progress import CancelledError, Progress
from sarl_core.rollouts.choices import Choice, check_choice
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield
from sarl_core.shielding.wrappers import check_penalty

MAX_STEPS = 10_000_000  # of a run; a mistyped zero shall not work for a week
_LOST = "a process that let somebody learn ended unexpectedly; run the same order again"
_WRITTEN_EVERY = 1.0  # seconds, for who looks on


@dataclass(frozen=True, eq=False)
class LearningPlan:
    """What is to be learned.

    Attributes:
        env_id: What ``gymnasium.make`` takes.
        rules: Of the shield; None where no arm needs one.
        arms: Ways to learn.
        steps: Environment steps of each run.
        seeds: Of the learners.
        projection: What becomes of a continuous action that breaks a rule.
        episodes: Of each trial after learning.
        max_steps: After which one of these is cut off; `episodes.MAX_STEPS` where None.
        choose: What comes first where the best way to learn is chosen.
        agent: Whom the learners are compared with: it plays the episodes by which they are judged;
            None for nobody.
        penalty: What every replaced action costs the arm that learns with a penalty, in points of
            reward; what the arm says where None.
    """

    env_id: EnvironmentOrId
    rules: RuleSet | None
    arms: tuple[LearningArm, ...]
    steps: int
    seeds: tuple[int, ...]
    projection: Projection = "centre"
    episodes: int = TRIAL_EPISODES
    max_steps: int | None = None
    choose: Choice = "return"
    agent: Agent | None = None
    penalty: float | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be learned.

        Raises:
            InputError: If something is missing or out of range, or arms, rules and environment
                do not fit.
        """
        if not self.arms or not self.seeds:
            raise InputError("there is nothing to learn; choose at least one arm and one seed")
        if self.steps > MAX_STEPS:
            raise InputError(
                f"steps is {self.steps:,}, more than {MAX_STEPS:,}; give a smaller number"
            )
        if self.episodes < 1:
            raise InputError(f"episodes is {self.episodes} and must be at least 1")
        if self.max_steps is not None and self.max_steps < 1:
            raise InputError(f"max_steps is {self.max_steps} and must be at least 1")
        if self.penalty is not None:
            check_penalty(self.penalty)
            if not any(arm.penalty for arm in self.arms):
                raise InputError(
                    f"a penalty of {self.penalty:g} is given and no arm learns with one; choose "
                    "the arm penalty, or leave it out"
                )
        check_choice(self.choose, self.env_id)
        for arm in self.arms:
            for seed in (min(self.seeds), max(self.seeds)):
                check_learning(self.env_id, self.rules, arm, steps=self.steps, seed=seed)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of how rules and environment were matched, as clauses."""
        from sarl_core.rollouts.player import check_environment

        shield = None if self.rules is None else Shield(self.rules)
        return check_environment(self.env_id, shield).notes

    def settings(self) -> dict[str, Any]:
        """What the runs share and what was asked for, ready for JSON."""
        rules = self.rules
        forbidding = 0 if rules is None else sum(bool(rule.forbids) for rule in rules.rules)
        return {
            "format": FORMAT,
            "version": VERSION,
            "env_id": str(self.env_id),
            "made_with": {
                name.strip("-"): list(value) if isinstance(value, tuple) else value
                for name, value in as_environment(self.env_id).options.items()
                if value is not None and name != "--env"
            }
            or None,
            "steps": self.steps,
            "arms": [arm.name for arm in self.arms],
            "seeds": list(self.seeds),
            "projection": self.projection,
            "penalty": self.penalty,
            "trial_episodes": self.episodes,
            "trial_max_steps": self.max_steps,
            "choose": self.choose,
            "agent": None if self.agent is None else self.agent.name,
            "rules": None
            if rules is None
            else {
                "digest": rules_digest(rules),
                "count": len(rules),
                "support": rules.thresholds.support,
                "confidence": rules.thresholds.confidence,
                "demonstrations": rules.source.digest,
                **({} if rules.cut == "thresholds" else {"cut": rules.cut}),
                **({"forbidding": forbidding} if forbidding else {}),
            },
        }


def run_study(
    plan: LearningPlan,
    folder: Path,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> LearningStudy:
    """Let every arm learn with every seed; go on where an earlier sitting stopped.

    The folder is readable at any moment by `load_study`. It gets ``plan.json``,
    ``rules.json``, a file for each run in ``runs``, what was learned in ``policies`` (`.npz`,
    usable as an agent), and at the end or when stopped ``results.json`` and ``curves.csv`` of
    what is finished.

    Args:
        plan: What is to be learned.
        folder: Made if it is not there.
        executor: Its processes let several learn at once, each from its beginning to its end; here,
            one after the other, where there is none.
        progress: Called with (steps done, in all, over all runs); returning False stops.

    Returns:
        The study, every run finished.

    Raises:
        InputError: If the folder cannot be written to, or holds another study.
        CancelledError: If `progress` returned False. What is finished is in the folder, and the
            unfinished run goes on from there the next time.
        WorkError: If a file cannot be written.
    """
    make_folder(folder)
    _claim(folder, plan)
    runs = [(seed, arm) for seed in plan.seeds for arm in plan.arms]
    total = len(runs) * plan.steps
    diverged: list[str] = []
    try:
        if plan.agent is not None:
            # First: an agent that cannot play shall be known of before hours of learning.
            save_compared(folder, _compared(plan, plan.agent, progress))
        if executor is not None:
            diverged += _at_once(plan, folder, runs, executor, progress)
        for index, (seed, arm) in enumerate(runs if executor is None else ()):
            before = index * plan.steps

            def advance(done: int, _: int, before: int = before) -> bool:
                return progress is None or progress(before + done, total) is not False

            if not _finished(folder, arm, seed):
                try:
                    _one(plan, folder, arm, seed, advance)
                except DivergedError as error:
                    diverged.append(f"{arm.title}, seed {seed}: {error}")
            elif not advance(plan.steps, plan.steps):
                raise CancelledError("stopped")
    except CancelledError as error:
        study = load_study(folder)
        _sum_up(folder, study)
        raise CancelledError(
            f"stopped; {len(study.finished)} of {len(runs)} runs are finished and kept in {folder}"
            ", and the same order goes on from there"
        ) from error
    except WorkError:
        _sum_up(folder, load_study(folder))
        raise
    study = load_study(folder)
    _sum_up(folder, study)
    if diverged:
        raise WorkError(
            f"{len(study.finished)} of {len(runs)} runs are finished and kept in {folder}; "
            f"{len(diverged)} failed ({diverged[0]})"
        )
    return study


def _at_once(
    plan: LearningPlan,
    folder: Path,
    runs: Sequence[tuple[int, LearningArm]],
    executor: Executor,
    progress: Progress | None,
) -> list[str]:
    """Let several learn at once; what is finished is saved, and what is not begins anew later.

    Returns:
        Sentences on runs that diverged.
    """
    diverged: list[str] = []
    waiting = [(seed, arm) for seed, arm in runs if not _finished(folder, arm, seed)]
    done = len(runs) - len(waiting)
    calls = ((run, _learned, (plan, *run)) for run in waiting)
    with closing(completed(executor, calls, lost=_LOST)) as batches:
        for batch in batches:
            for (seed, arm), outcome in batch:
                if isinstance(outcome, DivergedError):
                    diverged.append(f"{arm.title}, seed {seed}: {outcome}")
                elif isinstance(outcome, SarlError):
                    raise outcome
                else:
                    _save(folder, outcome)
                done += 1
            if progress is not None and not progress(done * plan.steps, len(runs) * plan.steps):
                raise CancelledError("stopped")
    return diverged


def _learned(plan: LearningPlan, seed: int, arm: LearningArm, **meanwhile: Any) -> LearningResult:
    """One run to its end, with what `learn` takes to be watched and taken up again."""
    if plan.penalty is not None and arm.penalty:
        arm = replace(arm, penalty=plan.penalty)
    return learn(
        plan.env_id,
        plan.rules,
        arm,
        steps=plan.steps,
        seed=seed,
        projection=plan.projection,
        episodes=plan.episodes,
        max_steps=plan.max_steps,
        **meanwhile,
    )


_CALLED = {
    "env_id": "environment",
    "made_with": "way to make the environment",
    "steps": "number of steps",
    "trial_episodes": "number of episodes",
    "trial_max_steps": "limit of an episode",
    "rules": "rule set",
}


def _claim(folder: Path, plan: LearningPlan) -> None:
    """Write the plan down, or check that it is the one that was begun here.

    More arms, seeds or runs may be asked for later, and another choice or agent to compare with;
    what runs share must stay.
    """
    path, settings = folder / PLAN, plan.settings()
    if path.is_file():
        before = read_json(path)
        free = ("arms", "seeds", "choose", "agent")
        other = [
            name for name in settings if name not in free and before.get(name) != settings[name]
        ]
        if other:
            what = " and ".join(_CALLED.get(name, name) for name in other)
            raise InputError(
                f"the folder {folder} holds a study with another {what}; choose another folder, or "
                "delete this one"
            )
        if all(before.get(name) == settings[name] for name in free):
            return
    write_json(path, settings)
    if plan.rules is not None:
        plan.rules.save(folder / "rules.json")


def _compared(plan: LearningPlan, agent: Agent, progress: Progress | None) -> ComparedAgent:
    """The agent that the learners are compared with, on their episodes."""
    total = len(plan.arms) * len(plan.seeds) * plan.steps

    def tried(shield: Shield | None) -> Trial:
        return try_agent(
            plan.env_id,
            agent,
            shield,
            episodes=plan.episodes,
            max_steps=plan.max_steps,
            progress=lambda *_: progress is None or progress(0, total) is not False,
        )

    alone = tried(None)
    if plan.rules is None:
        return ComparedAgent(agent.name, alone, None)
    return ComparedAgent(agent.name, alone, tried(Shield(plan.rules, projection=plan.projection)))


def _finished(folder: Path, arm: LearningArm, seed: int) -> bool:
    path = run_path(folder, arm, seed)
    return path.is_file() and load_run(path).finished and policy_path(folder, arm, seed).is_file()


def _one(plan: LearningPlan, folder: Path, arm: LearningArm, seed: int, progress: Progress) -> None:
    """One run, from its checkpoint if there is one."""
    checkpoint = run_path(folder, arm, seed).with_suffix(".pt")
    written = -np.inf
    latest = LearningRun(arm, seed, 0, NO_EPISODES)

    def watch(curve: LearningEpisodes, done: int) -> None:
        nonlocal written, latest
        latest = LearningRun(arm, seed, min(done, plan.steps), curve)
        if time.monotonic() - written > _WRITTEN_EVERY:
            save_run(folder, latest)
            written = time.monotonic()

    try:
        result = _learned(plan, seed, arm, checkpoint=checkpoint, progress=progress, watch=watch)
    except DivergedError:
        raise
    except (CancelledError, WorkError):
        save_run(folder, latest)
        raise
    _save(folder, result)


def _save(folder: Path, result: LearningResult) -> None:
    result.policy.save(policy_path(folder, result.arm, result.seed))
    save_run(
        folder,
        LearningRun(
            result.arm,
            result.seed,
            result.steps,
            result.curve,
            result.alone,
            result.shielded,
            result.seconds,
            result.sittings,
        ),
    )
    remove(run_path(folder, result.arm, result.seed).with_suffix(".pt"))


def _sum_up(folder: Path, study: LearningStudy) -> None:
    save_tables(
        folder,
        study,
        {
            "versions": _versions(),
            "summary": [summary.to_dict() for summary in summarise_study(study)],
        },
    )


def _versions() -> dict[str, str]:
    import platform

    import gymnasium
    import stable_baselines3
    import torch

    return {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "gymnasium": gymnasium.__version__,
        "torch": torch.__version__,
        "stable_baselines3": stable_baselines3.__version__,
    }
