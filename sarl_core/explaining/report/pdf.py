"""An HTML document as a PDF, printed by the Chromium or Chrome of this machine."""

from __future__ import annotations

import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from sarl_core.errors import WorkError, quoted
from sarl_core.explaining.figures.png import without_browser
from sarl_core.progress import Progress, report

_PATIENCE = 180  # seconds; of large reports with many pictures a slow machine needs some
_LOOKED_EVERY = 0.25  # seconds
_WHAT = "the PDF could not be printed"
_ADVICE = "write .html and print it from a browser"
_ROOM = "make room in memory and in the folder for temporary files and try again"


def document_to_pdf(html: str, progress: Progress | None = None) -> bytes:
    """Print a document that opens by itself.

    Args:
        html: The document, with its style for paper.
        progress: Called with the seconds that it has taken and those after which it is given up;
            returning False stops.

    Returns:
        A PDF file.

    Raises:
        WorkError: If there is no Chromium or Chrome to print it with, or it did not print it.
        CancelledError: If the caller wants no more.
    """
    try:
        from choreographer.browsers.chromium import Chromium

        browser = Chromium.find_browser(skip_local=False)
        if browser is None:
            raise FileNotFoundError
        return _printed(browser, html, progress)
    except (ImportError, OSError) as error:
        raise without_browser(error, _WHAT, _ADVICE) from error


def can_print() -> bool:
    """Whether there is a browser of this machine to print with."""
    try:
        from choreographer.browsers.chromium import Chromium
    except ImportError:
        return False
    browser = Chromium.find_browser(skip_local=False)
    return browser is not None and Path(browser).is_file()


def _printed(browser: str, html: str, progress: Progress | None) -> bytes:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page, printed = Path(folder, "report.html"), Path(folder, "report.pdf")
        try:
            page.write_text(html, encoding="utf-8", newline="\n")
        except OSError as error:
            why = error.strerror or error
            raise WorkError(f"{_WHAT}: {page} cannot be written ({why}); {_ROOM}") from error
        # Without its sandbox, as pictures are drawn: root has none. The page runs no script and
        # fetches nothing.
        arguments = (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={printed}",
            page.as_uri(),
        )
        code = _run([browser, *arguments], progress)
        if code or not printed.is_file():
            ended = f"ended with code {code}" if code else "ended and wrote nothing"
            raise WorkError(f"{_WHAT}: {quoted(browser)} {ended}; {_ROOM}, or {_ADVICE}")
        return printed.read_bytes()


def _run(command: list[str], progress: Progress | None) -> int:
    """Run a program to its end, which is its own or the caller's.

    Returns:
        The code with which it ended.
    """
    began = time.monotonic()
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as process:
        try:
            while process.poll() is None:
                seconds = time.monotonic() - began
                if seconds > _PATIENCE:
                    raise WorkError(
                        f"{_WHAT}: the browser was not done after {_PATIENCE:g} seconds; try "
                        f"again when this machine is less busy, or {_ADVICE}"
                    )
                report(progress, int(seconds), _PATIENCE)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(_LOOKED_EVERY)
        finally:
            process.kill()  # nothing, where it has ended; its own processes go with it
    return process.returncode
