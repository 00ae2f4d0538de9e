"""The command that reproduces the paper's figures and claims."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import workers_at
from sarl_core.cli.options import ClusterAddress, Json, out_option

if TYPE_CHECKING:
    from sarl_core.paper.report import Entry, PaperReport
    from sarl_core.paper.study import Study
    from sarl_core.progress import Progress


def reproduce(
    out: Annotated[
        Path,
        out_option(
            "The folder for the figures, tables and report.json; made if it is not there.",
            metavar="DIR",
        ),
    ],
    figure: Annotated[
        list[str] | None,
        typer.Option(
            "--figure",
            metavar="N",
            help="One only: 2 to 7, table-1, or divider; give it again for one more.",
            show_default="all",
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Few episodes and little learning, to see that everything works.",
        ),
    ] = False,
    cluster: ClusterAddress = None,
    as_json: Json = False,
) -> None:
    """Reproduce the paper's figures and hold its claims against ours.

    Writes for each figure a page (.html), a picture (.png) and its data (.csv), and one
    report.json with every number, seed and version. What is finished stays when it is stopped.

    Example: `python -m sarl_core reproduce --figure 5 --quick --out paper`
    """
    with terminal.working("Starting"):
        from sarl_core.paper.run import reproduce as run
        from sarl_core.paper.studies import STUDIES, find_study
        from sarl_core.paper.study import FULL, QUICK

        names = list(STUDIES) if not figure else [find_study(name).name for name in figure]
        chosen = tuple(STUDIES[name] for name in STUDIES if name in names)
    done: list[str] = []

    def finished(_: str, entry: Entry) -> None:
        done.append(entry.place)
        if not as_json:
            terminal.print_lines([f"{entry.place} is finished: {out / entry.files['page']}"])

    @contextmanager
    def watch(study: Study) -> Iterator[Progress]:
        with terminal.working(f"{study.place} ({len(done) + 1} of {len(chosen)})") as advance:
            yield advance

    try:
        with workers_at(cluster) as executor:
            effort = replace(QUICK if quick else FULL, executor=executor)
            report = run(out, chosen, effort=effort, watch=watch, finished=finished)
    except KeyboardInterrupt as error:
        usable = f"{', '.join(done)} in {out} can be used" if done else "no figure was finished"
        raise terminal.StoppedError(f"stopped; {usable}") from error
    if as_json:
        from sarl_core.paper.report import report_document

        terminal.print_json(report_document(report))
    else:
        _print_claims(report, [study.name for study in chosen])


def _print_claims(report: PaperReport, names: list[str]) -> None:
    from sarl_core.paper.chance import chance_text
    from sarl_core.paper.verdicts import VERDICTS

    entries = [report.studies[name] for name in names]
    claims = [(entry.place, claim) for entry in entries for claim in entry.claims]
    width = max(len(verdict) for verdict in VERDICTS)
    for place, claim in claims:
        terminal.print_lines([f"{claim.verdict:{width}}  {place}: {claim.paper}"])
        if claim.verdict != VERDICTS[0]:
            terminal.print_lines([f"{'':{width}}  Here: {claim.ours}"])
    counts = [sum(claim.verdict == verdict for _, claim in claims) for verdict in VERDICTS]
    terminal.print_lines(
        [
            f"Of {len(claims)} claims of the paper, our numbers agree with {counts[0]}, agree "
            f"partly with {counts[1]}, and do not agree with {counts[2]}; {counts[3]} cannot be "
            "judged.",
        ]
    )
    if by_chance := chance_text(claim for _, claim in claims):
        terminal.print_lines([by_chance])
    if any(entry.quick for entry in entries):
        terminal.print_lines(["This was a quick run: its numbers and verdicts mean little."])
