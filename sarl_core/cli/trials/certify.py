"""The command that certifies a rate of failures."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Annotated

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
    Stochastic,
    out_option,
    with_played_environment,
)
from sarl_core.cli.stand_ins import called
from sarl_core.rollouts.seeds import CERTIFIED


@with_played_environment
def certify(
    env: Env,
    rules: Annotated[
        Path,
        typer.Option(
            "--rules", metavar="RULES.json", show_default=False, help="The rules of the shield."
        ),
    ],
    at_most: Annotated[
        float,
        typer.Option(
            "--at-most",
            metavar="RATE",
            show_default=False,
            help="The rate of failures that is to be certified: 0.01 for one episode in a hundred.",
        ),
    ],
    certainty: Annotated[
        float,
        typer.Option(
            "--certainty", help="Of a verdict: 0.95 lets it be wrong in at most one test of twenty."
        ),
    ] = 0.95,
    agent: AgentName = "novice",
    normalise: Normalise = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes",
            min=1,
            show_default="ten times as many as are enough without a failure",
            help="End undecided after so many.",
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            "--seed",
            min=0,
            help="Episode i uses this seed + i. Take none by which the rules were chosen; the "
            "usual ones are used for nothing else.",
        ),
    ] = CERTIFIED,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    outside: OutsideName = "act",
    on_invalid: OnInvalidName = "raise",
    max_steps: MaxSteps = None,
    jobs: Jobs = None,
    cluster: ClusterAddress = None,
    out: Annotated[
        Path | None,
        out_option(
            "Write the certificate to this file, whatever the verdict.", metavar="FILE.json"
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Test whether a shielded agent fails in at most so many episodes, and stop when it is shown.

    Without a failure 299 episodes certify 1 % and 2,995 certify 0.1 %, with 95 % certainty. The
    answer is certified, refused (more fail, at the same certainty), or undecided.

    Example: `python -m sarl_core certify --env CartPole-v1 --rules
    data/rules/cartpole_compact.json --at-most 0.01 --out certificate.json`
    """
    if out is not None:
        terminal.check_output(out, (".json",))
    with workers_at(cluster) as executor, terminal.working("Certifying") as advance:
        from sarl_core.studies.certificate import CertificateStep
        from sarl_core.studies.certificate import certify as run
        from sarl_core.studies.certificate_files import certificate_document, save_certificate

        def progress(step: CertificateStep) -> None:
            done = step.verdict.episodes
            advance(done, done + (step.more or 0))

        options: dict[str, object] = {
            "--rules": called(rules),
            "--at-most": at_most,
            "--certainty": certainty,
            "--agent": agent,
            "--normalise": normalise,
            "--episodes": episodes,
            "--seed": seed,
            "--stochastic": True if stochastic else None,
            "--projection": projection if projection != "centre" else None,
            "--outside": outside if outside != "act" else None,
            "--on-invalid": on_invalid if on_invalid != "raise" else None,
            "--max-steps": max_steps,
        }
        shield = read_shield(rules, projection, outside, on_invalid)
        assert shield is not None
        certificate = run(
            env,
            read_agent(agent, env, normalise, stochastic=stochastic, seed=seed),
            shield,
            at_most=at_most,
            certainty=certainty,
            episodes=episodes,
            seed=seed,
            jobs=jobs or os.cpu_count() or 1,
            executor=executor,
            max_steps=max_steps,
            command=_command(env.words, options),
            progress=progress,
        )
        if out is not None:
            save_certificate(certificate, out)
    if as_json:
        terminal.print_json(certificate_document(certificate))
        return
    from sarl_core.explaining.words.certificate import LIMITS, certificate_facts

    terminal.print_facts(certificate_facts(certificate))
    terminal.print_lines(["", LIMITS, *([f"Wrote {out}."] if out is not None else [])])


def _command(environment: tuple[str, ...], options: dict[str, object]) -> str:
    words = ["certify", *environment]
    for name, value in options.items():
        if value is not None:
            words += [name] if value is True else [name, str(value)]
    return f"python -m sarl_core {shlex.join(words)}"
