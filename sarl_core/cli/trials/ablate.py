"""The command that says what each rule of a shield is worth."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_agent, read_shield, workers_at
from sarl_core.cli.options import (
    AgentName,
    ClusterAddress,
    Env,
    Jobs,
    Json,
    MaxSteps,
    Normalise,
    OnInvalidName,
    OutsideName,
    ProjectionName,
    Seed,
    Stochastic,
    out_option,
    with_played_environment,
)
from sarl_core.files import whole_file

if TYPE_CHECKING:
    from sarl_core.studies.ablation import Ablation


@with_played_environment
def ablate(
    env: Env,
    agent: AgentName,
    rules: Annotated[
        Path,
        typer.Option(
            "--rules", metavar="RULES.json", show_default=False, help="The rules of the shield."
        ),
    ],
    normalise: Normalise = None,
    episodes: Annotated[
        int,
        typer.Option("--episodes", help="With every rule taken out, and with none; at least 2."),
    ] = 50,
    most: Annotated[
        int,
        typer.Option(
            "--most", help="Rules to take out at most: those that change the most actions."
        ),
    ] = 200,
    seed: Seed = 0,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    outside: OutsideName = "act",
    on_invalid: OnInvalidName = "raise",
    max_steps: MaxSteps = None,
    jobs: Jobs = None,
    cluster: ClusterAddress = None,
    out: Annotated[
        Path | None, out_option("Write the table to this file.", metavar="FILE.csv")
    ] = None,
    as_json: Json = False,
) -> None:
    """Take the rules out one by one, and say what becomes of the same episodes without each.

    Each rule is load-bearing, harmful, or makes no difference that can be seen. Only episodes in
    which a rule changed an action are run without it: the others are the same.

    Example: `python -m sarl_core ablate --env LunarLander-v3 --agent novice --rules rules.json
    --episodes 100 --seed 100000 --out ablation.csv`
    """
    if out is not None:
        terminal.check_output(out, (".csv",))
    with workers_at(cluster) as executor, terminal.working("Taking rules out") as advance:
        from sarl_core.explaining.tables.spreadsheet_cells import safe_cells
        from sarl_core.studies.ablation_run import ablate as run

        shield = read_shield(rules, projection, outside, on_invalid)
        assert shield is not None
        ablation = run(
            env,
            read_agent(agent, env, normalise, stochastic=stochastic, seed=seed),
            shield,
            episodes=episodes,
            seed=seed,
            most=most,
            jobs=jobs or os.cpu_count() or 1,
            executor=executor,
            max_steps=max_steps,
            progress=lambda done, total: advance(done, total),
        )
        if out is not None:
            with whole_file(out) as unfinished:
                safe_cells(ablation.to_frame()).to_csv(unfinished, index=False)
    if as_json:
        terminal.print_json(_document(ablation))
    else:
        _print(ablation, out)


def _document(ablation: Ablation) -> dict[str, Any]:
    rules = ablation.shield.rule_set.rules
    return {
        "env_id": ablation.base.env_id,
        "agent": ablation.base.agent,
        "episodes": len(ablation.base),
        "seed": int(ablation.base.seeds[0]),
        "mean_return": float(ablation.base.returns.mean()),
        "failures": ablation.base_failures if ablation.failures_known else None,
        "rules": ablation.to_frame().to_dict("records"),
        "without_difference": [rules[index].id for index in ablation.unused],
        "left_out": [rules[index].id for index in ablation.left_out],
        "episodes_run": ablation.played,
        "notes": list(ablation.remarks),
    }


def _print(ablation: Ablation, out: Path | None) -> None:
    from sarl_core.cli.answers.summaries import print_notes
    from sarl_core.explaining.figures.ablation import (
        ablation_text,
        difference_interval_text,
        difference_text,
        left_out_text,
    )

    rule_set, known = ablation.shield.rule_set, ablation.failures_known
    if ablation.rules:
        terminal.print_table(
            ("rule", "verdict", "return without it", "95 % interval", "failures", "changed"),
            [
                (
                    rule_set.name_of(rule_set.rules[effect.rule]),
                    effect.verdict,
                    difference_text(effect.difference.mean),
                    difference_interval_text(effect),
                    f"{effect.failures} (with it {ablation.base_failures})" if known else "–",
                    f"{effect.changed:,}",
                )
                for effect in ablation.effects
            ],
        )
    terminal.print_lines([*ablation_text(ablation), *filter(None, [left_out_text(ablation)])])
    print_notes(ablation.remarks)
    if out is not None:
        terminal.print_lines([f"Wrote {out}."])
