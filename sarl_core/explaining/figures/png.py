"""Figures as pictures: one browser for many of them, and several on one sheet."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from sarl_core.errors import WorkError
from sarl_core.explaining.exports.landscape import cannot_draw, silence_browser

if TYPE_CHECKING:
    import plotly.graph_objects as go

Draw = Callable[["go.Figure"], bytes]
"""Gives a figure, at the size its layout says, as a PNG."""

_SCALE = 2  # pixels for one, so that text is sharp
_COLOURS = 256


@contextmanager
def drawing_pictures() -> Iterator[Draw]:
    """Start a browser once and draw many figures with it; starting takes longer than drawing.

    The browser is tried at once, so that who has none learns it before the work and not after.

    Yields:
        To be called with each figure.

    Raises:
        WorkError: If there is no Chromium or Chrome to draw with, now or later on.
    """
    # In a thread of its own, because the caller's may run an event loop already.
    with ThreadPoolExecutor(1) as thread:
        session = thread.submit(_Session).result()
        try:
            yield lambda figure: thread.submit(session.draw, figure).result()
        finally:
            thread.submit(session.close).result()


class _Session:
    """A browser in the event loop of one thread."""

    def __init__(self) -> None:
        import plotly.graph_objects as go

        self.runner = asyncio.Runner()
        self.browser: Any = None
        try:
            self.draw(go.Figure())
        except WorkError:
            self.runner.close()
            raise

    def draw(self, figure: go.Figure) -> bytes:
        try:
            return self.runner.run(self._drawn(figure))
        except Exception as error:  # whatever Kaleido or the browser has to complain about
            first = error
        self._end()
        try:  # once more: a browser may be gone when hours lie between two figures
            return self.runner.run(self._drawn(figure))
        except Exception:
            self._end()
            raise cannot_draw(first, "leave the pictures out") from first

    async def _drawn(self, figure: go.Figure) -> bytes:
        import kaleido

        silence_browser()
        if self.browser is None:
            # Formulas would make the browser ask a server for MathJax; there are none.
            self.browser = await kaleido.Kaleido(n=1, mathjax=False).__aenter__()
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
                self.runner.run(browser.__aexit__(None, None, None))

    def close(self) -> None:
        self._end()
        self.runner.close()


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
