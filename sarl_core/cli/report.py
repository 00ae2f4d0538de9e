"""The command that writes a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import is_mined_file, read_agent, read_demonstrations, sign_off_of
from sarl_core.cli.options import (
    Columns,
    Json,
    MaxSteps,
    MissingName,
    Normalise,
    out_option,
    with_columns,
    with_played_environment,
)
from sarl_core.cli.stand_ins import called
from sarl_core.environments.environment import Environment, EnvironmentOrId
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.agents.agent import Agent

# Those of `make_report`, which is not loaded for --help.
_IN_FULL, _FRAMES, _SEED, _EPISODES = 60, 3, 100_000, 12


@with_played_environment
@with_columns
def report(
    rules: Annotated[
        Path, typer.Argument(metavar="RULES.json", help="The rules.", show_default=False)
    ],
    columns: Columns,
    demonstrations: Annotated[
        Path,
        typer.Option(
            "--demonstrations",
            metavar="FILE",
            show_default=False,
            help="The demonstrations they are about, or a .mined file.",
        ),
    ],
    out: Annotated[Path, out_option("The file to write: .html, or .pdf.", metavar="FILE")],
    comparison: Annotated[
        list[Path] | None,
        typer.Option(
            "--comparison",
            metavar="FILE",
            show_default=False,
            help="Results to show: the CSV file of the page Measure, or what `evaluate --json` "
            "printed. May be given several times.",
        ),
    ] = None,
    certificate: Annotated[
        list[Path] | None,
        typer.Option(
            "--certificate",
            metavar="FILE",
            show_default=False,
            help="What `certify --out` wrote of these rules. May be given several times.",
        ),
    ] = None,
    slides: Annotated[
        Path | None,
        typer.Option(
            "--slides",
            metavar="FILE.html",
            show_default=False,
            help="Write slides as well, one for each rule in full; arrow keys go on.",
        ),
    ] = None,
    title: Annotated[
        str, typer.Option("--title", metavar="TEXT", show_default="the task", help="Of the report.")
    ] = "",
    author: Annotated[
        str, typer.Option("--author", metavar="TEXT", show_default=False, help="Who wrote it.")
    ] = "",
    date: Annotated[
        str | None,
        typer.Option(
            "--date",
            metavar="TEXT",
            show_default="today",
            help="As it is to stand on the report; '' for none.",
        ),
    ] = None,
    logo: Annotated[
        Path | None,
        typer.Option(
            "--logo", metavar="FILE", show_default=False, help="PNG or JPEG, at its head."
        ),
    ] = None,
    notes: Annotated[
        str,
        typer.Option(
            "--notes", metavar="TEXT", show_default=False, help="What you say, on its first page."
        ),
    ] = "",
    signer: Annotated[
        list[str] | None,
        typer.Option(
            "--sign-off",
            metavar="NAME",
            show_default=False,
            help="Who is to sign on its first page. May be given several times.",
        ),
    ] = None,
    in_full: Annotated[
        int,
        typer.Option(
            "--in-full", min=0, help="So many rules with pictures; the others in a table."
        ),
    ] = _IN_FULL,
    frames: Annotated[
        int, typer.Option("--frames", min=0, help="Pictures a rule; 0 for none.")
    ] = _FRAMES,
    env: Annotated[
        Environment | None,
        typer.Option(
            "--env",
            metavar="ENV",
            show_default="that of the demonstrations",
            help="Where the pictures are played; also gives names and bounds that the "
            "demonstrations lack.",
        ),
    ] = None,
    agent: Annotated[
        str | None,
        typer.Option(
            "--agent",
            metavar="AGENT",
            show_default="the shipped expert",
            help="Who plays for the pictures: novice, untrained, expert, or the path of a policy. "
            "Rules that do not come up are shown by a novice that the rules shield.",
        ),
    ] = None,
    normalise: Normalise = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Of the first episode for the pictures.")
    ] = _SEED,
    episodes: Annotated[
        int, typer.Option("--episodes", min=1, help="Played for the pictures.")
    ] = _EPISODES,
    max_steps: MaxSteps = None,
    missing: MissingName = "refuse",
    as_json: Json = False,
) -> None:
    """Write a report of rules: one file for people who know only the task.

    Example: `python -m sarl_core report data/rules/lunar_lander_compact.json --demonstrations
    data/demonstrations/lunar_lander.parquet --out report.html`
    """
    terminal.check_output(out, (".html", ".pdf"))
    if slides is not None:
        terminal.check_output(slides, (".html",), option="--slides")
        if slides.resolve() == out.resolve():
            raise InputError(
                f"--slides and --out both name {out}; write the slides to another file"
            )
    with terminal.working("Making the report") as advance:
        from sarl_core.demonstrations.formats.mapping.roles import as_options
        from sarl_core.demonstrations.recoding import recoded
        from sarl_core.explaining.report.comparison import read_results
        from sarl_core.explaining.report.cover import Cover, read_logo, today_text
        from sarl_core.explaining.report.provenance import command_line, mining_command
        from sarl_core.explaining.report.report import make_report
        from sarl_core.explaining.report.rule_set_card import read_card
        from sarl_core.explaining.words.sign_off import approvals_document
        from sarl_core.mining.rule_set import RuleSet
        from sarl_core.studies.certificate_files import load_certificate

        date = today_text() if date is None else date
        cover = Cover(
            title=title,
            author=author,
            date=date,
            notes=notes,
            signers=tuple(signer or ()),
            logo=None if logo is None else read_logo(logo),
        )
        rule_set = RuleSet.load(rules)
        trees = None
        if is_mined_file(demonstrations):
            from sarl_core.mining.distributed.mined_files import load_mined_data

            if columns or missing != "refuse":
                raise InputError(
                    f"{demonstrations}: how its steps are read was settled when it was mined; "
                    "leave that out"
                )
            data = load_mined_data(demonstrations)
            read, trees = data.sample, data.trees
            if rule_set.divider != data.divider and not read.is_discrete:
                trees = None  # grown from a sample, which is refused
        else:
            read = read_demonstrations(demonstrations, env, columns, missing)
        given = recoded(read, rule_set.source.features, called=called(demonstrations))
        card, sign_off = read_card(rules), sign_off_of(rule_set)
        results = [one for path in comparison or () for one in read_results(path)]
        certificates = [load_certificate(path) for path in certificate or ()]
        options: dict[str, object] = {
            "--demonstrations": called(demonstrations),
            "--column": as_options(columns),
            "--missing": None if missing == "refuse" else missing,
            "--comparison": [called(path) for path in comparison or ()],
            "--certificate": [called(path) for path in certificate or ()],
            "--title": title or None,
            "--author": author or None,
            "--date": date,
            "--logo": logo,
            "--notes": notes or None,
            "--sign-off": list(signer or ()),
            "--slides": slides,
            "--in-full": None if in_full == _IN_FULL else in_full,
            "--frames": None if frames == _FRAMES else frames,
            **({} if env is None else env.options),
            "--agent": agent,
            "--normalise": normalise,
            "--seed": None if seed == _SEED else seed,
            "--episodes": None if episodes == _EPISODES else episodes,
            "--max-steps": max_steps,
            "--out": out,
        }
        mined = mining_command(
            rule_set,
            _written_rules(rules),
            called(demonstrations),
            given,
            env=env,
            columns=columns,
            missing=missing,
            read=read,
        )
        document = make_report(
            rule_set,
            given,
            in_full=in_full,
            frames=frames,
            env_id=env or "",
            agent=_player(agent, env or given.env_id, normalise),
            seed=seed,
            episodes=episodes,
            max_steps=max_steps,
            commands=(
                *([mined] if mined else []),
                command_line("report", called(rules), options),
            ),
            rules_name=called(rules, short=True),
            demonstrations_name=called(demonstrations, short=True),
            sign_off=sign_off,
            cover=cover,
            card=card,
            comparison=results,
            certificates=certificates,
            trees=trees,
            progress=advance,
        )
        document.save(out)
        if slides is not None:
            document.save_slides(slides)
    size = out.stat().st_size
    if as_json:
        terminal.print_json(
            {
                "out": str(out),
                "slides": None if slides is None else str(slides),
                "rules": document.rules,
                "in_full": document.in_full,
                "pictures": document.pictures,
                "without_pictures": document.without or None,
                "bytes": size,
                "approved": approvals_document(sign_off),
                "notes": list(document.notes),
            }
        )
        return
    from sarl_core.mining.language import counted

    lines = [
        f"Wrote {out}: {document.rules:,} rules, {document.in_full:,} of them in full, "
        f"{document.pictures:,} pictures, {size / 1e6:.1f} MB."
    ]
    if slides is not None:
        from sarl_core.explaining.report.slides import BESIDE_RULES

        lines.append(f"Wrote {slides}: {counted(document.in_full + BESIDE_RULES, 'slide')}.")
    if document.without:
        lines.append(f"There are no pictures: {document.without}.")
    from sarl_core.cli.answers.summaries import print_notes

    terminal.print_lines(lines)
    print_notes(document.notes)


def _written_rules(rules: Path) -> str:
    """Where a command would write the rules; what is kept is not written to."""
    name = called(rules)
    return "rules.json" if name != str(rules) else name


def _player(
    agent: str | None, env_id: EnvironmentOrId, normalise: str | None
) -> Agent | str | None:
    """Who plays for the pictures: sampled, if it can be, and so comes by more states."""
    from sarl_core.agents.agent import PolicyAgent

    if agent is None or not env_id:
        return agent
    made = read_agent(agent, env_id, normalise)
    if isinstance(made, PolicyAgent):
        return replace(made, stochastic=not made.policy.noise_by_state)
    return made
