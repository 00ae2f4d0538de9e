from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core import PolicyTree, threshold_landscape
from sarl_core.explaining.figures import thresholds as figures
from sarl_core.explaining.figures.pareto_front import front_figure, thin_front
from sarl_core.mining.language import share_text
from sarl_core.mining.never.landscape import never_landscape
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS, Landscape
from sarl_core.mining.thresholds.pareto import ParetoPoint, pareto_front
from sarl_core.mining.thresholds.steps import FINE_CONFIDENCES, FINE_SUPPORTS


@pytest.fixture(scope="module")
def paper(lander_trees: tuple[PolicyTree, ...]) -> Landscape:
    return threshold_landscape(lander_trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)


@pytest.mark.parametrize("layer", list(figures.LAYERS))
@pytest.mark.parametrize("dark", [False, True])
def test_a_map_has_a_cell_and_a_point_for_every_pair(
    paper: Landscape, layer: figures.Layer, dark: bool
) -> None:
    figure = figures.heatmap(paper, layer, dark=dark)
    cells, points = figure.data
    assert np.asarray(cells.z).shape == (21, 11)
    assert len(points.x) == 231
    for place in (0, 17, 230):
        support, confidence, rules, *_ = points.customdata[place]
        column, row = round(points.x[place]), round(points.y[place])
        assert support == PAPER_SUPPORTS[column]
        assert confidence == PAPER_CONFIDENCES[row]
        assert rules == paper.rule_count[column, row]
    json.loads(figure.to_json())


def test_the_colours_of_fidelity_are_spread_over_what_is_there(paper: Landscape) -> None:
    cells = figures.heatmap(paper, "fidelity").data[0]
    assert cells.zmin == pytest.approx(np.nanmin(paper.fidelity))
    assert cells.zmin > 0.3
    ticks = np.array(cells.colorbar.tickvals)
    assert len(ticks) > 1
    assert ((ticks >= cells.zmin) & (ticks <= 1)).all()
    assert figures.heatmap(paper, "coverage").data[0].zmin == 0


def test_counts_are_coloured_by_powers_of_ten(paper: Landscape) -> None:
    cells = figures.heatmap(paper, "rule_count").data[0]
    assert np.allclose(10 ** np.asarray(cells.z).T - 1, paper.rule_count, rtol=1e-3, atol=1e-3)
    assert cells.colorbar.ticktext[:2] == ("0", "1")


def test_no_rule_is_no_fidelity_not_none(lander_trees: tuple[PolicyTree, ...]) -> None:
    empty = threshold_landscape(lander_trees, [1.0], [1.0])
    points = figures.heatmap(empty, "fidelity").data[1]
    assert points.customdata[0][5] == "–"


def test_positions_count_cells() -> None:
    assert figures.position(0.005, FINE_SUPPORTS) == FINE_SUPPORTS.index(0.005)
    assert figures.position(0.6, FINE_SUPPORTS) == len(FINE_SUPPORTS) - 1
    between = figures.position(0.0035, FINE_SUPPORTS)
    assert between == pytest.approx(FINE_SUPPORTS.index(0.003) + 0.5)


def test_the_mark_stands_in_the_middle_of_its_cell(
    lander_trees: tuple[PolicyTree, ...],
) -> None:
    fine = threshold_landscape(lander_trees, FINE_SUPPORTS, FINE_CONFIDENCES)
    across, down = figures.mark_place(fine, 0.0, 1.0)
    assert across == pytest.approx(0.5 / len(FINE_SUPPORTS))
    assert down == pytest.approx(0.5 / len(FINE_CONFIDENCES))


@pytest.mark.parametrize("layer", list(figures.LAYERS))
def test_the_surface_stands_as_high_as_the_layer(paper: Landscape, layer: figures.Layer) -> None:
    figure = figures.surface(paper, layer, chosen=(0.05, 0.95, 3.0))
    surface, dot = figure.data
    assert np.array_equal(
        np.asarray(surface.z).T, np.asarray(getattr(paper, layer)), equal_nan=True
    )
    assert (dot.x[0], dot.y[0], dot.z[0]) == (1.0, 19.0, 3.0)
    assert len(figures.surface(paper, layer, chosen=(0.5, 1.0, float("nan"))).data) == 1


def test_one_sheet_shows_the_four_layers(paper: Landscape) -> None:
    figure = figures.landscape_figure(paper, title="Lander")
    assert [trace.type for trace in figure.data] == ["heatmap", "scatter"] * 4
    assert figure.layout.title.text == "Lander"
    titles = [note.text for note in figure.layout.annotations]
    assert titles == [style.title for style in figures.LAYERS.values()]
    assert figure.layout.xaxis4.title.text == "Minimum support"
    assert figures.landscape_figure(paper).layout.title.text is None


def test_a_sheet_of_rules_that_forbid_shows_freedom(
    lander_trees: tuple[PolicyTree, ...],
) -> None:
    landscape = never_landscape(lander_trees, [0.0, 0.05], [0.05, 0.1, 0.3])
    figure = figures.landscape_figure(landscape)
    titles = [note.text for note in figure.layout.annotations]
    assert titles[-1] == "Freedom: what is left to choose"
    cells, points = figure.data[-2:]
    assert np.asarray(cells.z) == pytest.approx(landscape.freedom.T, abs=1e-4)
    assert figure.layout.yaxis4.title.text == "Epsilon"
    assert points.customdata[4][:2].tolist() == [0.05, 0.1]
    assert points.customdata[4][6] == f", freedom {share_text(landscape.freedom[1, 1], decimals=1)}"
    assert "epsilon %{customdata[1]}" in points.hovertemplate


def test_a_thinned_front_is_part_of_it(lander_trees: tuple[PolicyTree, ...]) -> None:
    front = pareto_front(lander_trees)
    thin = thin_front(front, most=30)
    assert 0 < len(thin) <= 40 < len(front)
    assert set(thin) <= set(front)
    assert thin_front(front[:5]) == front[:5]


def test_the_front_carries_its_thresholds() -> None:
    points = [ParetoPoint(1, 0.2, 0.9, 0.1, 0.8), ParetoPoint(7, 0.5, 0.95, 0.01, 0.9)]
    figure = front_figure(points, chosen=(3, 0.4, 0.9))
    assert figure.data[0].customdata[1][:2] == [0.01, 0.9]
    assert list(figure.data[1].x) == [3]
    assert len(front_figure(points, chosen=(0, 0.0, float("nan"))).data) == 1
