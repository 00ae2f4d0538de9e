from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core import InputError
from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.explaining.figures.aggregation import (
    RoundPoint,
    card_points,
    points_of,
    rounds_figure,
)
from sarl_core.explaining.figures.gaps import gap_figure, gap_histograms
from sarl_core.explaining.figures.rule_budgets import PublishedPoint, budget_figure, budget_points
from sarl_core.improving.aggregation import AggregationRound
from sarl_core.improving.gaps import Gaps, join_gaps


def rounds() -> tuple[AggregationRound, ...]:
    returns = ([1.0, 3.0], [10.0, 30.0], [5.0, 5.0])
    return tuple(
        AggregationRound(
            number=number,
            pairs=100 * number,
            rules=4 + number,
            returns=np.array(each),
            coverage=0.5 + 0.1 * number,
            disagreement=0.3 / number,
            needed=0.4,
        )
        for number, each in enumerate(returns, start=1)
    )


def test_each_round_is_a_point_with_the_spread_of_its_episodes():
    points = points_of(rounds())
    assert [point.mean for point in points] == [2.0, 20.0, 5.0]
    assert points[1].std == pytest.approx(200**0.5)  # of 10 and 30, with n - 1
    assert points[2].std == 0.0
    assert [point.rules for point in points] == [5, 6, 7]


def test_a_single_episode_has_no_spread():
    (one,) = points_of([AggregationRound(1, 10, 3, np.array([7.0]), 1.0, 0.0, 0.0)])
    assert (one.mean, one.std) == (7.0, 0.0)


def card() -> dict[str, object]:
    return {
        "rounds": [
            {
                "number": 1,
                "pairs": 100,
                "rules": 4,
                "mean": 3.5,
                "std": 1.25,
                "coverage": 1.0,
                "disagreement": 0.2,
            }
        ]
    }


def test_a_card_gives_the_same_points():
    assert card_points(card()) == (RoundPoint(1, 3.5, 1.25, 1.0, 0.2, 4, 100),)


@pytest.mark.parametrize(
    "broken",
    [{}, {"rounds": 3}, {"rounds": [{}]}, {"rounds": [{**card()["rounds"][0], "mean": "x"}]}],
)
def test_a_card_of_another_form_is_refused(broken):
    with pytest.raises(InputError, match="does not tell of its rounds"):
        card_points(broken)


def panels(figure):
    """Traces with points by the axis they stand on."""
    return {trace.yaxis or "y": trace for trace in figure.data if trace.mode == "lines+markers"}


def test_four_panels_share_the_axis_of_rounds():
    points = points_of(rounds())
    figure = rounds_figure(points)
    traces = panels(figure)
    assert len(traces) == 4
    assert traces["y"].y.tolist() == [2.0, 20.0, 5.0]
    np.testing.assert_allclose(traces["y2"].y, [0.6, 0.7, 0.8])
    np.testing.assert_allclose(traces["y3"].y, [0.3, 0.15, 0.1])
    assert traces["y4"].y.tolist() == [5, 6, 7]
    assert {tuple(trace.x) for trace in traces.values()} == {(1, 2, 3)}
    band = next(trace for trace in figure.data if trace.fill == "toself")
    assert max(band.y) == pytest.approx(20 + 200**0.5, abs=1e-3)
    assert min(band.y) == pytest.approx(2 - 2**0.5, abs=1e-3)
    assert not figure.layout.shapes
    json.loads(figure.to_json())


def test_room_is_left_for_the_rounds_to_come():
    figure = rounds_figure(points_of(rounds())[:1], planned=12)
    assert tuple(figure.layout.xaxis.range) == (0.5, 12.5)


def test_the_chosen_round_is_marked_in_every_panel():
    figure = rounds_figure(points_of(rounds()), chosen=2, reported=17.5)
    assert len(figure.layout.shapes) == 4
    assert all(shape.x0 < 2 < shape.x1 for shape in figure.layout.shapes)
    named = {trace.name: trace for trace in figure.data if trace.name}
    assert (named["chosen"].x[0], named["chosen"].y[0]) == (2, 20.0)
    assert (named["fresh episodes"].x[0], named["fresh episodes"].y[0]) == (2, 17.5)


def test_many_rounds_are_numbered_without_crowding():
    points = [RoundPoint(n, 0.0, 1.0, 1.0, 0.5, 4, 10) for n in range(1, 61)]
    assert rounds_figure(points).layout.xaxis.dtick == 5


def budgets() -> dict[str, object]:
    one = [{"rules": n, "mean": m, "std": 20.0, "episodes": 100, "failures": f,
            "failure_low": f / 120, "failure_high": f / 80}
           for n, m, f in ((8, 500.0, 0), (2, 200.0, 60), (4, 480.0, 4))]  # fmt: skip
    two = [{**point, "mean": 500.0, "combined": True} for point in one[:1]]
    return {"environments": {"CartPole-v1": [*one, *two], "Calm-v0": [
        {"rules": 3, "mean": 1.0, "std": 0.0, "episodes": 1, "refined": True}]}}  # fmt: skip


def test_return_and_failures_stand_against_the_number_of_rules():
    points = budget_points(budgets(), "CartPole-v1")
    assert [point.rules for point in points] == [2, 4, 8, 8]
    assert budget_points(budgets(), "Elsewhere-v0") == ()
    figure = budget_figure(points, published=[PublishedPoint(3, 500.0, "others")])
    returns, failures, two, two_failures, published = figure.data
    assert list(returns.y) == [200.0, 480.0, 500.0]
    assert list(returns.error_y.array) == pytest.approx([3.92] * 3)  # 1.96 times 20 / sqrt(100)
    assert list(failures.y) == [0.6, 0.04, 0.0]
    assert list(failures.error_y.array) == pytest.approx([0.15, 0.01, 0.0])
    assert list(failures.error_y.arrayminus) == pytest.approx([0.1, 0.04 - 4 / 120, 0.0])
    assert two.marker.color == two_failures.marker.color != returns.marker.color
    assert (list(published.x), list(published.y)) == ([3], [500.0])


def test_where_no_failures_are_known_there_is_no_panel_of_them():
    (alone,) = budget_figure(budget_points(budgets(), "Calm-v0")).data
    assert (list(alone.x), list(alone.y)) == ([3], [1.0])
    assert alone.mode == "markers"


@pytest.mark.parametrize(
    "broken", [{}, {"environments": []}, {"environments": {"CartPole-v1": [{"rules": 2}]}}]
)
def test_returns_of_another_form_are_refused(broken):
    with pytest.raises(InputError, match="not of the expected form"):
        budget_points(broken, "CartPole-v1")


# --- gaps --------------------------------------------------------------------------------------


def gaps(values, *, met=50, episodes=2) -> Gaps:
    observations = np.array(values, dtype=np.float32)
    count = len(observations)
    return Gaps(
        feature_names=("a", "b"),
        episode=np.arange(count, dtype=np.int64) % episodes,
        step=np.arange(count, dtype=np.int64),
        observations=observations,
        missing=np.ones((count, 1), dtype=np.bool_),
        met=met,
        episodes=episodes,
    )


def shown() -> Demonstrations:
    states = np.stack([np.linspace(0, 1, 200), np.linspace(0, 1, 200)], axis=1).astype(np.float32)
    return Demonstrations(states, np.arange(200) % 2, np.zeros(200, dtype=np.int64))


def test_the_feature_in_which_gaps_differ_most_comes_first():
    states = np.stack([np.linspace(0, 1, 100), np.linspace(5, 6, 100)], axis=1)
    first, second = gap_histograms(shown(), gaps(states), bins=10)
    assert (first.feature, second.feature) == (1, 0)
    assert first.difference == pytest.approx(1.0)
    assert second.difference < 0.05
    for one in (first, second):
        assert one.demonstrated.sum() == pytest.approx(1.0)
        assert one.missing.sum() == pytest.approx(1.0)
    # The demonstrated states fill the left of the common range, the gaps the right.
    assert first.demonstrated[:2].sum() == pytest.approx(1.0)
    assert first.missing[8:].sum() == pytest.approx(1.0)


def test_a_feature_that_never_changes_has_a_histogram_all_the_same():
    same = Demonstrations(np.zeros((9, 2), np.float32), np.arange(9) % 2, np.zeros(9, np.int64))
    (one, _) = gap_histograms(same, gaps(np.zeros((3, 2))))
    assert one.edges[0] < 0 < one.edges[-1]
    assert one.difference == 0.0


def test_both_kinds_of_states_are_drawn_each_as_a_share_of_its_own():
    (one, _) = gap_histograms(shown(), gaps([[0.2, 0.2]]), bins=5)
    figure = gap_figure(one, Feature("speed <b>", "m/s"))
    demonstrated, missing = figure.data
    assert sum(demonstrated.y) == pytest.approx(1.0, abs=1e-4)
    assert max(missing.y) == 1.0
    assert figure.layout.xaxis.title.text == "m/s"


def test_joined_gaps_number_their_episodes_on():
    whole = join_gaps([gaps([[0, 0], [1, 1]], met=20, episodes=3), gaps([[2, 2]], met=5)])
    assert whole.episode.tolist() == [0, 1, 3]
    assert whole.observations[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert (whole.met, whole.episodes, len(whole)) == (25, 5, 3)
    assert whole.share == pytest.approx(3 / 25)
