from __future__ import annotations

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.divider import (
    error_figure,
    occupancy_figure,
    snapped_figure,
)
from sarl_core.mining.quantisation import Quantisation, quantise
from sarl_core.rollouts.recording import record
from sarl_core.studies.divider import DividerStudy, study_divider


@pytest.fixture(scope="module")
def study() -> DividerStudy:
    return study_divider(
        "Pendulum-v1",
        "novice",
        record("Pendulum-v1", "novice", steps=300),
        dividers=(2, 5),
        episodes=3,
    )


@pytest.fixture(scope="module")
def two() -> tuple[tuple[Quantisation, ...], ...]:
    """Two dimensions; of the second, only one half was shown."""
    rng = np.random.default_rng(1)
    actions = rng.uniform(-1, 1, (400, 2)).astype(np.float32)
    actions[:, 1] = np.abs(actions[:, 1])
    return quantise(
        Demonstrations(
            observations=np.zeros((400, 1), dtype=np.float32),
            actions=actions,
            episodes=np.zeros(400, dtype=np.int64),
            action_names=("hip", "knee <i>"),
            action_low=(-1.0, -1.0),
            action_high=(1.0, 1.0),
            bounds_from="action space",
        ),
        (2, 4),
    )


@pytest.mark.parametrize("dark", [False, True])
def test_a_box_is_an_interval_and_what_was_never_shown_is_hatched(
    two: tuple[tuple[Quantisation, ...], ...], dark: bool
) -> None:
    figure = occupancy_figure(two[1], dark=dark)
    for bars, divided in zip(figure.data, two[1], strict=True):
        assert list(bars.base) == list(divided.dimension.edges[:-1])
        assert np.add(bars.base, bars.x).tolist() == pytest.approx(divided.dimension.edges[1:])
        assert list(bars.marker.color) == divided.occupancy.tolist()
        hatched = [index for index, shape in enumerate(bars.marker.pattern.shape) if shape]
        assert tuple(hatched) == divided.never_seen
    assert figure.data[0].marker.pattern.shape == ("x", "")
    assert "never shown" in figure.data[0].customdata[0][2]
    assert "<i>" not in figure.layout.xaxis.title.text


def test_errors_fall_with_the_divider(two: tuple[tuple[Quantisation, ...], ...]) -> None:
    cells, _ = error_figure(two).data
    assert list(cells.x) == ["2 intervals", "4 intervals"]
    assert [name.split(",")[1] for name in cells.y] == [" centre", " expert"] * 2
    assert cells.z[0][0] == two[0][0].share_of_width("centre")
    assert all(row[1] < row[0] for row in cells.z)


def test_every_cell_holds_the_typical_return_and_its_interval(study: DividerStudy) -> None:
    episodes_of = {(each.divider, each.snapping): each.episodes for each in study.snapped}
    cells, _ = snapped_figure(study.dividers, episodes_of).data
    assert list(cells.y) == ["centre", "clip", "expert"]
    assert list(cells.x) == ["2 intervals", "5 intervals"]
    for row, snapping in enumerate(("centre", "clip", "expert")):
        for column, divider in enumerate((2, 5)):
            episodes = study.of(divider, snapping)
            assert episodes is not None
            numbers = episodes.statistics
            assert cells.z[row][column] == numbers.iqm
            assert f"{numbers.low:,.0f} to {numbers.high:,.0f}" in cells.text[row][column]
            known = episodes.failures
            assert ("fail" in cells.text[row][column]) == (known is not None)


def test_what_has_not_been_run_stays_empty(study: DividerStudy) -> None:
    cells, _ = snapped_figure((2, 5), {(2, "centre"): study.unchanged}).data
    assert cells.z[0][0] is not None
    assert cells.z[0][1] is None
    assert cells.text[0][1] == ""


@pytest.mark.parametrize("dark", [False, True])
def test_words_are_light_on_dark_shades_and_dark_on_light_ones(
    two: tuple[tuple[Quantisation, ...], ...], dark: bool
) -> None:
    cells, words = error_figure(two, dark=dark).data
    assert list(words.text) == [text for row in cells.text for text in row]
    shades = [z / cells.zmax for row in cells.z for z in row]
    inks = dict(zip(shades, words.textfont.color, strict=True))
    assert inks[max(shades)] == ("#0e161b" if dark else "#ffffff")
    assert inks[min(shades)] == ("#ffffff" if dark and min(shades) < 0.3 else "#0e161b")
