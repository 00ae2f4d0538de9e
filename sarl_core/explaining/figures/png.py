"""Figures as pictures: one browser for many of them, and several on one sheet."""

from __future__ import annotations

import asyncio
import io
import logging
import os
from collections.abc import Callable, Coroutine, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from sarl_core.errors import WorkError, quoted

if TYPE_CHECKING:
    import plotly.graph_objects as go

Result = TypeVar("Result")
Draw = Callable[["go.Figure"], bytes]
"""Gives a figure, at the size its layout says, as a PNG."""

_SCALE = 2  # pixels for one, so that text is sharp
_COLOURS = 256
_WHAT = "the picture could not be drawn"
# Seconds for a picture, which takes about one, and ten where the browser is to start on a busy
# machine: now and then one starts and never answers.
_PATIENCE = 60.0
_BROWSER = "BROWSER_PATH"  # environment variable that Kaleido goes by


@contextmanager
def drawing_pictures(*, otherwise: str = "leave the pictures out") -> Iterator[Draw]:
    """Start a browser once and draw many figures with it; starting takes longer than drawing.

    The browser is tried at once, so that who has none learns it before the work and not after.

    Args:
        otherwise: What to advise who has no browser, besides installing one.

    Yields:
        To be called with each figure.

    Raises:
        WorkError: If there is no Chromium or Chrome to draw with, now or later on.
    """
    # In a thread of its own, because the caller's may run an event loop already.
    with ThreadPoolExecutor(1) as thread:
        session = thread.submit(_Session, otherwise).result()
        try:
            yield lambda figure: thread.submit(session.draw, figure).result()
        finally:
            thread.submit(session.close).result()


class _Session:
    """A browser in the event loop of one thread."""

    def __init__(self, otherwise: str) -> None:
        import plotly.graph_objects as go

        self.otherwise = otherwise
        self.runner = asyncio.Runner()
        self.browser: Any = None
        try:
            self.draw(go.Figure())
        except WorkError:
            self.runner.close()
            raise

    def draw(self, figure: go.Figure) -> bytes:
        try:
            return self._within_patience(self._drawn(figure))
        except Exception as error:  # whatever Kaleido or the browser has to complain about
            first = error
        self._end()
        try:  # once more: a browser may be gone when hours lie between two figures
            return self._within_patience(self._drawn(figure))
        except Exception:
            self._end()
            raise without_browser(first, _WHAT, self.otherwise) from first

    async def _drawn(self, figure: go.Figure) -> bytes:
        import kaleido

        _silence_browser()
        if self.browser is None:
            # Formulas would make the browser ask a server for MathJax; there are none.
            self.browser = kaleido.Kaleido(n=1, mathjax=False)
            await self.browser.__aenter__()
        layout = figure.layout
        size = {"width": layout.width or 700, "height": layout.height or 500}
        picture: bytes = await self.browser.calc_fig(
            figure.to_dict(), opts={"format": "png", "scale": _SCALE, **size}
        )
        return picture

    def _end(self) -> None:
        browser, self.browser = self.browser, None
        if browser is not None:
            with suppress(Exception):  # one that is gone needs no farewell
                self._within_patience(browser.__aexit__(None, None, None))

    def _within_patience(self, work: Coroutine[Any, Any, Result]) -> Result:
        return self.runner.run(asyncio.wait_for(work, _PATIENCE))

    def close(self) -> None:
        self._end()
        self.runner.close()


def figure_to_png(figure: go.Figure) -> bytes:
    """Draw one Plotly figure as a picture, two pixels for one so that text is sharp.

    Args:
        figure: To draw, at the size its layout says.

    Returns:
        A PNG file.

    Raises:
        WorkError: If there is no Chromium or Chrome to draw it with.
    """
    with drawing_pictures(otherwise="write .html") as draw:
        return draw(figure)


def sheet(rows: Sequence[Sequence[bytes]]) -> bytes:
    """Pictures on one sheet, in rows.

    Args:
        rows: PNG files, from top to bottom and from left to right.

    Returns:
        A PNG file with few colours, so that it stays small.
    """
    from PIL import Image

    pictures = [[Image.open(io.BytesIO(one)).convert("RGB") for one in row] for row in rows]
    width = max(sum(one.width for one in row) for row in pictures)
    height = sum(max(one.height for one in row) for row in pictures)
    whole = Image.new("RGB", (width, height), "#ffffff")
    y = 0
    for row in pictures:
        x = 0
        for one in row:
            whole.paste(one, (x, y))
            x += one.width
        y += max(one.height for one in row)
    file = io.BytesIO()
    whole.quantize(_COLOURS, dither=Image.Dither.NONE).save(file, format="PNG", optimize=True)
    return file.getvalue()


def _silence_browser() -> None:
    """Let what speaks to the browser log nothing: traces of what it mends or raises itself."""
    logging.getLogger("choreographer").setLevel(logging.CRITICAL + 1)


def without_browser(error: Exception, what: str, advice: str) -> WorkError:
    """What to tell who has no browser to draw with, or none that works.

    Args:
        error: Of Kaleido or the browser.
        what: What could not be done, as "the picture could not be drawn".
        advice: What else to do, after "or".

    Returns:
        The error to raise.
    """
    return WorkError(
        f"{what}, which takes an installed Chromium or Chrome: {_lacking(error)}, or {advice}"
    )


def _lacking(error: Exception) -> str:
    """What is missing, and how it is mended."""
    try:
        from choreographer.browsers.chromium import Chromium
        from choreographer.errors import BrowserClosedError, BrowserFailedError
    except ImportError:
        return "the package kaleido, which speaks to it, is not installed; install it"
    browser = Chromium.find_browser(skip_local=False)
    named = browser is not None and os.environ.get(_BROWSER) == browser
    if browser is None:
        return f"there is none; install one and, if it is not found, set {_BROWSER} to its program"
    which = f"{quoted(browser)}, to which {_BROWSER} is set," if named else quoted(browser)
    do = f"set {_BROWSER} to one that works" if named else "install it anew"
    if not Path(browser).is_file():
        return f"{which} does not exist; {do}"
    if isinstance(error, (BrowserClosedError, BrowserFailedError, OSError)):
        return f"{which} could not be started; {do}"
    # Some put several sentences in one error, and some none.
    text = error.args[0] if error.args and isinstance(error.args[0], str) else type(error).__name__
    return f"{which} failed ({quoted(text.split('. ')[0].strip(), 120)}); {do}"
