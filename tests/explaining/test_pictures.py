from __future__ import annotations

import asyncio
import io
from typing import Any

import kaleido
import numpy as np
import plotly.graph_objects as go
import pytest
from PIL import Image

from sarl_core import WorkError
from sarl_core.explaining.figures import png
from sarl_core.explaining.figures.png import drawing_pictures, sheet


def opened(content: bytes) -> Image.Image:
    return Image.open(io.BytesIO(content))


def coloured(width: int, height: int, colour: str) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (width, height), colour).save(file, format="PNG")
    return file.getvalue()


def test_pictures_stand_in_rows_on_white() -> None:
    whole = opened(
        sheet([[coloured(30, 10, "red"), coloured(20, 5, "blue")], [coloured(40, 8, "lime")]])
    )
    assert whole.size == (50, 18)
    points = np.asarray(whole.convert("RGB"))
    assert points[0, 0].tolist() == [255, 0, 0]
    assert points[4, 49].tolist() == [0, 0, 255]
    assert points[7, 49].tolist() == [255, 255, 255]
    assert points[12, 39].tolist() == [0, 255, 0]
    assert points[12, 45].tolist() == [255, 255, 255]


def test_one_browser_draws_many_figures() -> None:
    figure = go.Figure(layout={"width": 120, "height": 80, "paper_bgcolor": "#00ff00"})
    with drawing_pictures() as draw:
        first = opened(draw(figure))
        figure.update_layout(width=200, paper_bgcolor="#0000ff")
        second = opened(draw(figure))
    assert (first.size, second.size) == ((240, 160), (400, 160))
    assert first.convert("RGB").getpixel((2, 2)) == (0, 255, 0)
    assert second.convert("RGB").getpixel((2, 2)) == (0, 0, 255)


def test_a_browser_that_starts_and_never_answers_is_started_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun: list[Any] = []
    ended: list[Any] = []

    class Silent(kaleido.Kaleido):
        async def __aenter__(self) -> Any:
            begun.append(self)
            if len(begun) == 1:
                await asyncio.Event().wait()
            return await super().__aenter__()

        async def __aexit__(self, *reasons: Any) -> None:
            ended.append(self)
            await super().__aexit__(*reasons)

    monkeypatch.setattr(kaleido, "Kaleido", Silent)
    patience = png._PATIENCE
    monkeypatch.setattr(png, "_PATIENCE", 0.2)
    end = png._Session._end

    def ending(session: Any) -> None:
        end(session)
        monkeypatch.setattr(png, "_PATIENCE", patience)

    monkeypatch.setattr(png._Session, "_end", ending)
    with drawing_pictures() as draw:
        assert opened(draw(go.Figure(layout={"width": 120, "height": 80}))).size == (240, 160)
    assert len(begun) == 2
    assert ended == begun


def test_without_a_browser_it_is_said_before_anything_is_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("BROWSER_PATH", "/nowhere/chromium")
    with (
        pytest.raises(WorkError, match="installed Chromium or Chrome") as caught,
        drawing_pictures(),
    ):
        raise AssertionError("there is nothing to draw with")
    assert "\n" not in str(caught.value)
