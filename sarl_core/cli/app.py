"""The command line, put together; each command stands in a file beside it.

What is heavy is imported where it is used, so that ``--help`` answers at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from sarl_core import __version__
from sarl_core.cli import terminal
from sarl_core.cli.aggregate import aggregate
from sarl_core.cli.audit import audit
from sarl_core.cli.dashboard import app as dashboard
from sarl_core.cli.demonstrations import check, record
from sarl_core.cli.diff import diff
from sarl_core.cli.export import export
from sarl_core.cli.learning import learn, train_expert
from sarl_core.cli.library import CommandGroup, library
from sarl_core.cli.options import with_bare_combine
from sarl_core.cli.probe import probe
from sarl_core.cli.report import report
from sarl_core.cli.reproduce import reproduce
from sarl_core.cli.rules import landscape, mine
from sarl_core.cli.trials.ablate import ablate
from sarl_core.cli.trials.certify import certify
from sarl_core.cli.trials.episodes import evaluate, render

app = typer.Typer(
    name="sarl_core",
    cls=CommandGroup,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="Readable safety rules from expert demonstrations, and a shield made of them.",
)

# In the order of the work, which is the order of ``--help``.
for command in (
    record,
    check,
    mine,
    landscape,
    diff,
    audit,
    evaluate,
    render,
    ablate,
    certify,
    report,
    export,
    aggregate,
    probe,
    learn,
    train_expert,
    reproduce,
):
    app.command(command.__name__.replace("_", "-"))(command)


app.add_typer(library)
app.command("app")(dashboard)


def main(arguments: Sequence[str]) -> int:
    """Run the command line.

    Args:
        arguments: Without the program's name.

    Returns:
        The exit code.
    """
    return terminal.run(app, with_bare_combine(arguments))


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="After an error, show where it came from. Also after a command.",
        ),
    ] = False,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        terminal.print_lines([__version__])
        raise typer.Exit
    if context.invoked_subcommand is None:
        terminal.print_lines([context.get_help()])
