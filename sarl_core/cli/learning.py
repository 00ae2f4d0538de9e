"""Commands that let agents learn: under a shield, and as the shipped experts did."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_agent, workers_at
from sarl_core.cli.options import (
    ChoiceName,
    ClusterAddress,
    Env,
    Json,
    MaxSteps,
    Normalise,
    ProjectionName,
    Rules,
    Seed,
    out_option,
    with_played_environment,
)

if TYPE_CHECKING:
    from sarl_core.learning.study_files import LearningStudy
    from sarl_core.learning.summary import ArmSummary


@with_played_environment
def learn(
    env: Env,
    steps: Annotated[
        int, typer.Option("--steps", show_default=False, help="Environment steps of each run.")
    ],
    out: Annotated[
        Path,
        out_option(
            "The folder for curves, results and policies; made if it is not there. A study "
            "that was stopped in it goes on.",
            metavar="DIR",
        ),
    ],
    rules: Rules = None,
    arm: Annotated[
        list[str] | None,
        typer.Option(
            "--arm",
            metavar="ARM",
            help="all, none, override, penalty, executed, mask, imitate, handover, none-replay or "
            "replay; may be given several times.",
            show_default="handover",
        ),
    ] = None,
    seed: Seed = 0,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="How many learners: seed, seed + 1 and so on.")
    ] = 1,
    projection: ProjectionName = "centre",
    penalty: Annotated[
        float | None,
        typer.Option(
            "--penalty",
            help="What every replaced action costs the arm penalty, in points of reward.",
            show_default="1",
        ),
    ] = None,
    episodes: Annotated[
        int,
        typer.Option(
            "--episodes",
            min=1,
            help="After learning, with the shield and without.",
        ),
    ] = 50,
    max_steps: MaxSteps = None,
    choose: ChoiceName = "return",
    agent: Annotated[
        str | None,
        typer.Option(
            "--agent",
            metavar="AGENT",
            show_default="nobody",
            help="Whom to compare the learners with: it learns nothing, and plays the episodes "
            "after learning, without the shield and with it. What evaluate --agent takes, "
            "module:name included.",
        ),
    ] = None,
    normalise: Normalise = None,
    figures: Annotated[
        bool, typer.Option("--figures", help="Also draw the study, as .png.")
    ] = False,
    watched: Annotated[bool, typer.Option("--stop-with-input", hidden=True)] = False,
    cluster: ClusterAddress = None,
    as_json: Json = False,
) -> None:
    """Let agents learn, with a shield and without, and see what they are worth without it.

    Writes every episode (curves.csv), what came of it (results.json, and finding.md in words) and
    what was learned (policies, .npz, each an agent for the other commands). Ctrl-C stops; the same
    command goes on.

    Example: `python -m sarl_core learn --env LunarLander-v3 --rules rules.json --arm none --arm
    handover --steps 120000 --seeds 3 --out learned`
    """
    with terminal.working("Starting"):
        from sarl_core.environments.description import describe_environment
        from sarl_core.explaining.words.learning import save_finding
        from sarl_core.learning.arms import arms_named
        from sarl_core.learning.study import LearningPlan, run_study
        from sarl_core.learning.summary import summarise_study
        from sarl_core.mining.rule_set import RuleSet
        from sarl_core.progress import CancelledError

        plan = LearningPlan(
            env,
            None if rules is None else RuleSet.load(rules),
            arms_named(arm or ["handover"], discrete=describe_environment(env).is_discrete),
            steps,
            tuple(range(seed, seed + seeds)),
            projection,
            episodes,
            max_steps,
            choose,
            None if agent is None else read_agent(agent, env, normalise),
            penalty,
        )
        notes = plan.notes
    with terminal.working("Learning") as advance, _stopping(watched) as stopped:

        def advance_or_stop(done: int, total: int) -> bool:
            advance(done, total)
            return not stopped()

        try:
            with workers_at(cluster) as executor:
                study = run_study(plan, out, executor=executor, progress=advance_or_stop)
        except CancelledError as error:
            raise terminal.StoppedError(str(error)) from error
    summaries = summarise_study(study)
    save_finding(study, summaries, out)
    if figures:
        with terminal.working("Drawing"):
            from sarl_core.explaining.figures.learning import save_learning_figures

            save_learning_figures(study, out)
    if as_json:
        terminal.print_json({**_document(study, summaries, out), "notes": list(notes)})
        return
    from sarl_core.cli.answers.summaries import print_notes

    _print_study(study, summaries, out)
    print_notes(notes)


@with_played_environment
def train_expert(
    env: Env,
    out: Annotated[
        Path,
        out_option("The policy to write; its card stands beside it as .json.", metavar="FILE.npz"),
    ],
    seed: Seed = 0,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            min=1,
            help="Environment steps.",
            show_default="the recipe's",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Train an expert as the shipped ones were, and write its weights and its card.

    Example: `python -m sarl_core train-expert --env CartPole-v1 --seed 0 --out expert.npz`
    """
    terminal.check_output(out, (".npz",))
    with terminal.working("Training") as advance:
        from sarl_core.learning.experts import train_expert as train

        card = train(
            env,
            out=out,
            seed=seed,
            steps=steps,
            progress=lambda done, total, _: advance(done, total),
        )
    if as_json:
        terminal.print_json(card)
        return
    returns = card["returns_deterministic"]
    terminal.print_lines(
        [
            f"Wrote {out}: mean return {returns['mean']:.1f} over {returns['episodes']} episodes "
            f"({returns['min']:.1f} to {returns['max']:.1f}), after "
            f"{card['kept_after_steps']:,} steps."
        ]
    )


@contextmanager
def _stopping(watched: bool) -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C, a request to terminate, or the end of the input stop the work in good order.

    Args:
        watched: Whether somebody holds the other end of standard input, and lets go of it, or
            dies, when nobody waits for the work any more.

    Yields:
        Whether to stop.
    """
    stop = threading.Event()
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.signal(number, lambda *_: stop.set())
    if watched:

        def wait() -> None:
            sys.stdin.read()
            stop.set()

        threading.Thread(target=wait, daemon=True).start()
    try:
        yield stop.is_set
    finally:
        for restored, handler in before.items():
            signal.signal(restored, handler)


def _document(study: LearningStudy, summaries: tuple[ArmSummary, ...], out: Path) -> dict[str, Any]:
    from sarl_core.explaining.words.learning import finding
    from sarl_core.learning.study_files import policy_path
    from sarl_core.learning.summary import summarise_compared

    compared = summarise_compared(study)
    return {
        "folder": str(out),
        "env_id": study.env_id,
        "steps": study.steps,
        "seeds": list(study.seeds),
        "arms": [summary.to_dict() for summary in summaries],
        **({} if compared is None else {"compared": compared.to_dict()}),
        "policies": [str(policy_path(out, run.arm, run.seed)) for run in study.finished],
        "finding": finding(study, summaries),
    }


def _print_study(study: LearningStudy, summaries: tuple[ArmSummary, ...], out: Path) -> None:
    from sarl_core.explaining.words.learning import HEADINGS, finding, table_rows
    from sarl_core.learning.summary import summarise_compared
    from sarl_core.mining.language import counted

    terminal.print_table(HEADINGS, table_rows(summaries, summarise_compared(study)))
    terminal.print_lines(
        [*finding(study, summaries), f"Wrote {counted(len(study.finished), 'run')} to {out}."]
    )
