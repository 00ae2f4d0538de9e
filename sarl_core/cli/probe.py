"""The command that finds out what must never be done."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_agent, typed_again, workers_at
from sarl_core.cli.options import (
    AgentName,
    ClusterAddress,
    Divider,
    Env,
    Json,
    MaxSteps,
    Normalise,
    ReportEpisodes,
    Seed,
    out_option,
    with_played_environment,
)


@with_played_environment
def probe(
    context: typer.Context,
    env: Env,
    out: Annotated[Path, out_option("The rule file (.json) to write, its card beside it.")],
    agent: AgentName = "novice",
    expert: Annotated[
        str,
        typer.Option(
            "--expert",
            metavar="AGENT",
            help="Who recovers: expert (the shipped one), the path of a trained policy, or "
            "module:name as of --agent.",
        ),
    ] = "expert",
    normalise: Normalise = None,
    rounds: Annotated[
        int, typer.Option("--rounds", help="How often the rules act and are probed.")
    ] = 8,
    episodes: Annotated[int, typer.Option("--episodes", help="Episodes a round.")] = 200,
    states: Annotated[
        int, typer.Option("--states", help="Most states that are probed in an episode.")
    ] = 8,
    steps: Annotated[
        int,
        typer.Option(
            "--steps", help="How long an action is done before the expert has the controls."
        ),
    ] = 10,
    leaves: Annotated[
        int, typer.Option("--leaves", help="Most leaves of each tree; each forbids some actions.")
    ] = 24,
    risk: Annotated[
        float,
        typer.Option(
            "--risk",
            metavar="SHARE",
            help="Forbid an action where the expert failed after it in more than this share of "
            "the states.",
        ),
    ] = 0.2,
    combine: Annotated[
        bool,
        typer.Option(
            "--two-features/--one-feature",
            help="Whether rules may ask about combinations of two features.",
        ),
    ] = True,
    divider: Divider = 2,
    validation: Annotated[
        int, typer.Option("--validation", help="Episodes by which the best round is chosen.")
    ] = 200,
    report: ReportEpisodes = 1_000,
    seed: Seed = 0,
    max_steps: MaxSteps = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes.")] = 1,
    cluster: ClusterAddress = None,
    as_json: Json = False,
) -> None:
    """Try every action where an agent goes, and forbid what the expert does not recover from.

    Episodes are played again up to some of their states; there an action is done for some steps,
    and then the expert has the controls. Rules that forbid are made of what came of it, round by
    round where the agent goes under the rules of the round before.

    Example: `python -m sarl_core probe --env LunarLander-v3 --jobs 2 --out never.json`
    """
    terminal.check_output(out, (".json",))
    with workers_at(cluster) as executor, terminal.working("Probing") as advance:
        from sarl_core.improving.probing.probe_files import save_probing
        from sarl_core.improving.probing.probing import ProbePlan
        from sarl_core.improving.probing.probing import probe as run

        plan = ProbePlan(
            rounds=rounds,
            episodes=episodes,
            states=states,
            steps=steps,
            leaves=leaves,
            risk=risk,
            combine=combine,
            divider=divider,
            validation=validation,
            report=report,
            seed=seed,
            max_steps=max_steps,
        )
        probing = run(
            env,
            plan,
            agent=read_agent(agent, env, None),
            expert=read_agent(expert, env, normalise),
            jobs=jobs,
            executor=executor,
            progress=advance,
        )
        card = save_probing(probing, out, command=typed_again(context))
    if as_json:
        terminal.print_json(card)
        return
    from sarl_core.mining.language import share_text
    from sarl_core.rollouts.failures import safety_facts

    terminal.print_table(
        ("Round", "States", "Rules", "Failures", "Mean return", "Freedom"),
        [
            (
                str(one["number"]),
                f"{one['states']:,}",
                str(one["rules"]),
                f"{one['failures']} of {plan.validation}",
                f"{one['mean']:.1f}",
                share_text(one["freedom"]),
            )
            for one in card["rounds"]
        ],
    )
    reported = card["reported"]
    facts = safety_facts(reported, reported["episodes"], card["env_id"], shielded=True)
    terminal.print_lines(
        [
            f"Wrote {out}: {card['rules']} rules of round {card['chosen_round']}.",
            f"Mean return {reported['mean']:.1f} over {reported['episodes']} episodes used for "
            "nothing else.",
            *(f"{what[0].upper()}{what[1:]}: {text}." for what, text in facts),
            f"Chosen by {card['chosen_by']}.",
        ]
    )
