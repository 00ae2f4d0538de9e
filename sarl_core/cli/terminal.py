"""What every command shares: one line an error, progress on a terminal, JSON that is only JSON."""

from __future__ import annotations

import json
import os
import re
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from sarl_core.cli.stand_ins import said
from sarl_core.cli.streams import interruptible, lasting_streams
from sarl_core.documents import plain
from sarl_core.errors import InputError, SarlError, needing_extras
from sarl_core.files import temporary_folder

if TYPE_CHECKING:
    from rich.console import Console

_WIDTH_IN_A_FILE = 160  # where no terminal says how wide it is, a table shall not be cut
_INTERRUPTED = 130  # what a shell expects of a program that Ctrl-C ended
_PLAIN = {
    ": Value error, ": ": ",
    "Input should be a valid number, unable to parse string as a number": (
        "this is no number; give one such as 0.5"
    ),
    "Input should be a valid integer, unable to parse string as an integer": (
        "this is no whole number; give one such as 5"
    ),
}

Advance = Callable[[int, int], None]


class StoppedError(SarlError):
    """Ctrl-C ended work that keeps what is finished; the message says what is there."""


def run(app: typer.Typer, arguments: Sequence[str]) -> int:
    """Run a command line.

    Args:
        app: The commands.
        arguments: Without the program's name. ``--debug`` may stand anywhere.

    Returns:
        The exit code: 0; 2 if the input was wrong; 1 if the work failed; 130 after Ctrl-C.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # pygame greets on standard output
    with lasting_streams() as output:
        try:
            with interruptible(), temporary_folder():
                code = _run(app, arguments)
        except KeyboardInterrupt:  # before the command began, or after its end
            code = _failed(KeyboardInterrupt())
        output.flush()
        if output.failure is None or code:
            return code
        _complain(
            f"the answer could not be written to standard output ({output.failure}); "
            "free some space, or send it elsewhere"
        )
        return 1


def _run(app: typer.Typer, arguments: Sequence[str]) -> int:
    debug = "--debug" in arguments
    try:
        with warnings.catch_warnings(), needing_extras():
            if not debug:
                warnings.simplefilter("ignore")  # libraries warn who calls them, not the user
            code = app(
                [argument for argument in arguments if argument != "--debug"],
                prog_name="sarl" if Path(sys.argv[0]).stem == "sarl" else "python -m sarl_core",
                standalone_mode=False,
            )
        return _code(code)
    except (Exception, KeyboardInterrupt) as error:
        if debug:
            traceback.print_exc()
        return _failed(error)


def _code(result: object) -> int:
    # Typer turns Ctrl-C into a code, without a word.
    if result == _INTERRUPTED:
        return _failed(KeyboardInterrupt())
    return result if isinstance(result, int) else 0


def _failed(error: BaseException) -> int:
    """Say in one line what went wrong, and give the exit code."""
    sentence, code = _sentence_and_code(error)
    _complain(sentence)
    return code


def _complain(sentence: str) -> None:
    print(f"error: {' '.join(said(sentence).split())}", file=sys.stderr)  # noqa: T201


def _sentence_and_code(error: BaseException) -> tuple[str, int]:
    """An exception as a sentence and an exit code."""
    if isinstance(error, typer.TyperException):
        message = error.format_message()
        for for_programmers, words in _PLAIN.items():
            message = message.replace(for_programmers, words)
        return message + _one_file_advice(message), 2
    if isinstance(error, StoppedError):
        return str(error), _INTERRUPTED
    if isinstance(error, SarlError):
        return str(error), 2 if isinstance(error, InputError) else 1
    if isinstance(error, (KeyboardInterrupt, typer.Abort)):
        return "stopped; nothing was written", _INTERRUPTED
    return f"{type(error).__name__}: {error} (run it again with --debug to see where)", 1


def _one_file_advice(message: str) -> str:
    """What to do where a shell made several files of a pattern, and one argument is wanted."""
    extra = re.search(r"unexpected extra argument\S* \((.*)\)", message)
    if extra is None or not any(Path(name).exists() for name in extra[1].split(" ")):
        return ""
    return '; of several files that are one, quote the pattern ("runs/*.csv") or give the folder'


@contextmanager
def working(description: str) -> Iterator[Advance]:
    """Show how far work is, on a terminal only, and keep standard output for the answer.

    Environments and libraries may print; what they print goes to standard error.

    Args:
        description: In front of the bar.

    Yields:
        To be called with (done, in all).
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    with redirect_stdout(sys.stderr):
        if not sys.stderr.isatty():
            yield lambda done, total: None
            return
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=_console(error=True), transient=True) as bar:
            task = bar.add_task(description, total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)


def print_json(document: object) -> None:
    """Print one JSON document; what is no number becomes null.

    Args:
        document: Mappings, sequences, text, numbers.
    """
    only_ascii = not (sys.stdout.encoding or "").lower().startswith("utf")
    print(json.dumps(plain(document), ensure_ascii=only_ascii, allow_nan=False))  # noqa: T201


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print names and values in two columns.

    Args:
        facts: In order.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for name, value in facts:
        table.add_row(Text(name, style="bold"), Text(value))
    _console().print(table)


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table; the first column is text, the others are numbers.

    Args:
        headings: One a column.
        rows: One text a column.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD)
    for index, heading in enumerate(headings):
        table.add_column(heading, justify="right" if index else "left")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    _console().print(table)


def print_lines(lines: Iterable[str]) -> None:
    """Print sentences, each on its own line.

    Args:
        lines: Without line ends.
    """
    for line in lines:
        print(line)  # noqa: T201


def print_notes(notes: Iterable[str]) -> None:
    """Say what was found or looks odd, beside the answer: on standard error.

    Args:
        notes: Sentences.
    """
    for note in notes:
        print(f"note: {' '.join(said(note).split())}", file=sys.stderr)  # noqa: T201


def check_output(path: Path, suffixes: Sequence[str], *, option: str = "--out") -> None:
    """Refuse a path that cannot be written, before any work is done for it.

    Args:
        path: The file that is to appear.
        suffixes: What it may end in, as ".json".
        option: That gave it.

    Raises:
        InputError: If it ends in something else, its folder does not exist, or it is a folder.
    """
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{option} {path} must end in {' or '.join(suffixes)}; give such a name")
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} does not exist; make it or choose another")
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"the folder {path.parent} cannot be written to; choose another")


def check_folder(path: Path) -> None:
    """Refuse a folder that cannot be made, before any work is done for it.

    Args:
        path: The folder that is to be there.

    Raises:
        InputError: If it is a file, or the folder above it does not exist.
    """
    if path.exists() and not path.is_dir():
        raise InputError(f"{path} is a file; give a folder")
    if not path.parent.is_dir():
        raise InputError(
            f"the folder {path} cannot be made: {path.parent} does not exist; make it or choose "
            "another"
        )


def _console(*, error: bool = False) -> Console:
    from rich.console import Console

    stream = sys.stderr if error else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else _WIDTH_IN_A_FILE)
