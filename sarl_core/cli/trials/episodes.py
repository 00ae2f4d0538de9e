"""Commands that run agents in environments, shielded or not."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_agent, read_shield, workers_at
from sarl_core.cli.options import (
    AgentName,
    ClusterAddress,
    Env,
    Json,
    MaxSteps,
    Normalise,
    OnInvalidName,
    OutsideName,
    ProjectionName,
    Rules,
    Seed,
    Stochastic,
    out_option,
    with_played_environment,
)
from sarl_core.cli.stand_ins import called
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.rollouts.episodes import Episodes


@with_played_environment
def evaluate(
    env: Env,
    agent: AgentName,
    normalise: Normalise = None,
    rules: Rules = None,
    episodes: Annotated[int, typer.Option("--episodes", min=1, help="How many.")] = 10,
    seed: Annotated[
        int,
        typer.Option(
            "--seed",
            min=0,
            help="Episode i uses this seed + i.",
        ),
    ] = 0,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    outside: OutsideName = "act",
    on_invalid: OnInvalidName = "raise",
    max_steps: MaxSteps = None,
    cluster: ClusterAddress = None,
    out: Annotated[
        Path | None,
        out_option(
            "Write every episode to this file, some thousand at a time, and answer with the "
            "summary alone.",
            metavar="FILE.parquet",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Run episodes, shielded or not: returns, failures, interventions, coverage, freedom.

    Example: `python -m sarl_core evaluate --env LunarLander-v3 --agent novice --rules rules.json
    --episodes 50 --seed 1 --json`
    """
    if out is not None:
        terminal.check_output(out, (".parquet",))
    with workers_at(cluster) as executor, terminal.working("Running episodes") as advance:
        from sarl_core.rollouts.episode_tables import rollout_into
        from sarl_core.rollouts.episodes import finished_before, rollout
        from sarl_core.rollouts.player import EpisodeFaultError

        shield = read_shield(rules, projection, outside, on_invalid)
        actor = read_agent(agent, env, normalise, stochastic=stochastic, seed=seed)
        fault: EpisodeFaultError | None = None
        try:
            play = rollout if out is None else partial(rollout_into, out)
            played = play(
                env,
                actor,
                shield=shield,
                episodes=episodes,
                seed=seed,
                executor=executor,
                keep_steps=False,
                max_steps=max_steps,
                progress=advance,
            )
        except EpisodeFaultError as error:
            finished = finished_before(error, env, actor, seed)
            if finished is None:
                raise
            fault, played = error, finished
        document = played.to_dict() if out is None else _summary(played, out)
    if as_json:
        terminal.print_json(document)
    else:
        from sarl_core.cli.answers.summaries import print_episodes

        shielded = "unshielded" if rules is None else f"shielded by {called(rules)}"
        print_episodes(document, str(env), f"{played.agent} in {env}, {shielded}", shield)
    if fault is not None:
        raise InputError(f"{fault}; the answer is of the {len(played)} before that one")


def _summary(played: Episodes, out: Path) -> dict[str, Any]:
    """What is told of episodes that stand in a file."""
    return {
        "file": str(out),
        "count": len(played),
        "summary": played.summary(),
        "notes": list(played.remarks),
        "environment": played.env_id,
        **({"failure": played.failure} if played.failure else {}),
    }


@with_played_environment
def render(
    env: Env,
    agent: AgentName,
    out: Annotated[Path, out_option("A .gif or .mp4 file.")],
    normalise: Normalise = None,
    rules: Rules = None,
    seed: Seed = 0,
    both: Annotated[
        bool,
        typer.Option(
            "--side-by-side",
            help="With the shield and without it, on the same seed.",
        ),
    ] = False,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    outside: OutsideName = "act",
    on_invalid: OnInvalidName = "raise",
    max_steps: MaxSteps = None,
    as_json: Json = False,
) -> None:
    """Play one episode and save it as a moving picture, in real time.

    Example: `python -m sarl_core render --env LunarLander-v3 --agent novice --rules rules.json
    --seed 1 --side-by-side --out replay.gif`
    """
    terminal.check_output(out, (".gif", ".mp4"))
    shield = read_shield(rules, projection, outside, on_invalid)
    if both and shield is None:
        raise InputError("--side-by-side compares with a shield; give --rules, or leave it out")
    with terminal.working("Playing") as advance:
        from sarl_core.rendering.replay import render_episode, side_by_side

        actor = read_agent(agent, env, normalise, stochastic=stochastic, seed=seed)
        if both and shield is not None:
            replay = side_by_side(
                env, actor, shield, seed=seed, max_steps=max_steps, progress=advance
            )
        else:
            replay = render_episode(
                env, actor, shield=shield, seed=seed, max_steps=max_steps, progress=advance
            )
    with terminal.working("Writing") as advance:
        replay.save(out, progress=advance)
    from sarl_core.cli.answers.summaries import describe_replay, print_replay

    document = describe_replay(replay, out, [shield is not None, False])
    if as_json:
        terminal.print_json(document)
    else:
        print_replay(document)
