"""A dot a recording, and the mean with its interval."""

from __future__ import annotations

import math

import numpy as np

from sarl_core.explaining.figures.recording import recordings_figure
from sarl_core.rollouts.statistics import MeanInterval

EXPERTS = ("a", "b", "c", "a", "b", "c")
COLOURS = {"alone": "#0072B2", "shielded": "#E69F00"}
VALUES = {"alone": np.linspace(0, 0.5, 6), "shielded": np.ones(6)}


def test_recordings_of_one_expert_have_one_symbol() -> None:
    means = {"alone": MeanInterval(0.25, -0.1, 0.6), "shielded": MeanInterval(1.0, 0.98, 1.0)}
    figure = recordings_figure(
        VALUES, means, experts=EXPERTS, colours=COLOURS, title="failures", share=True
    )
    dots, mean, *_ = figure.data
    assert list(dots.x) == VALUES["alone"].tolist()
    symbols = list(dots.marker.symbol)
    assert symbols[:3] == symbols[3:]
    assert len(set(symbols)) == 3
    assert list(mean.x) == [0.25]
    assert list(mean.error_x.array) == [0.35]
    assert "0 % to 60 %" in mean.hovertemplate  # a share is never below 0
    assert "6 recordings of 3 experts" in mean.hovertemplate
    assert list(figure.layout.yaxis.ticktext) == ["alone", "shielded"]


def test_where_there_is_no_interval_none_is_shown() -> None:
    figure = recordings_figure(
        {"alone": np.array([200.0])},
        {"alone": MeanInterval(200.0, math.nan, math.nan)},
        experts=("a",),
        colours=COLOURS,
        title="return",
    )
    assert "nan" not in figure.to_json()
    assert "interval" not in figure.data[1].hovertemplate
    assert "200.0" in figure.data[1].text[0]
