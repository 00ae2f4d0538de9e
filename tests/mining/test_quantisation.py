from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.quantisation import SNAPPINGS, quantise, snap


def demonstrated(values: list[float], low: float = -1.0, high: float = 1.0) -> Demonstrations:
    count = len(values)
    return Demonstrations(
        observations=np.zeros((count, 1), dtype=np.float32),
        actions=np.array(values, dtype=np.float32)[:, None],
        episodes=np.zeros(count, dtype=np.int64),
        action_names=("torque",),
        action_low=(low,),
        action_high=(high,),
        bounds_from="action space",
    )


def test_occupancy_medians_and_errors_by_hand() -> None:
    #                            lower interval      | upper (an inner edge belongs to it)
    ((two, four),) = quantise(demonstrated([-1.0, -0.5, -0.25, 0.0]), (2, 4))
    assert two.counts.tolist() == [3, 1]
    assert two.occupancy.tolist() == [0.75, 0.25]
    assert two.medians.tolist() == [-0.5, 0.0]
    # To the centres -0.5 and 0.5: moved by 0.5, 0, 0.25, 0.5.
    assert two.errors["centre"] == pytest.approx(np.sqrt((0.25 + 0.0625 + 0.25) / 4))
    # To the medians -0.5 and 0: moved by 0.5, 0, 0.25, 0.
    assert two.errors["expert"] == pytest.approx(np.sqrt((0.25 + 0.0625) / 4))
    assert two.errors["clip"] == 0.0
    assert two.share_of_width("centre") == two.errors["centre"] / 2
    assert two.never_seen == ()
    assert four.counts.tolist() == [1, 2, 1, 0]
    assert four.never_seen == (3,)
    assert four.medians[3] == 0.75  # nothing was shown there: the centre


def test_every_dimension_is_divided_on_its_own() -> None:
    demonstrations = Demonstrations(
        observations=np.zeros((3, 1), dtype=np.float32),
        actions=np.array([[-1, 0], [-1, 4], [1, 8]], dtype=np.float32),
        episodes=np.zeros(3, dtype=np.int64),
        action_low=(-1.0, 0.0),
        action_high=(1.0, 8.0),
        bounds_from="action space",
    )
    first, second = quantise(demonstrations, (2,))
    assert first[0].counts.tolist() == [2, 1]
    assert second[0].counts.tolist() == [1, 2]
    assert (first[0].width, second[0].width) == (2.0, 8.0)


@given(
    st.lists(st.floats(-1.0, 1.0, width=32), min_size=2, max_size=60),
    st.integers(2, 12),
    st.sampled_from(SNAPPINGS),
)
def test_a_snapped_action_stays_in_its_interval(
    values: list[float], divider: int, snapping: str
) -> None:
    demonstrations = demonstrated(values)
    ((divided,),) = quantise(demonstrations, (divider,))
    (dimension,) = label_dimensions(demonstrations, divider)
    before = demonstrations.action_columns[:, 0]
    after = snap(before, divided.dimension, divided.targets(snapping))  # type: ignore[arg-type]
    assert after.dtype == np.float32
    assert dimension.labels_of(after).tolist() == dimension.labels_of(before).tolist()
    # Snapping once is enough, and the error is the distance it moves.
    again = snap(after, divided.dimension, divided.targets(snapping))  # type: ignore[arg-type]
    assert again.tolist() == after.tolist()
    moved = after.astype(np.float64) - before
    assert divided.errors[snapping] == pytest.approx(  # type: ignore[index]
        float(np.sqrt(np.mean(moved**2))), abs=1e-6
    )
    if snapping == "clip":
        assert after.tolist() == before.tolist()


@given(st.lists(st.floats(-1.0, 1.0, width=32), min_size=2, max_size=60))
def test_a_value_moves_to_the_centre_by_half_an_interval_at_most(values: list[float]) -> None:
    (row,) = quantise(demonstrated(values))
    for divided in row:
        assert divided.errors["centre"] <= divided.width / divided.divider / 2 + 1e-9
        assert divided.counts.sum() == len(values)


def test_discrete_actions_are_not_divided() -> None:
    demonstrations = Demonstrations(
        observations=np.zeros((2, 1), dtype=np.float32),
        actions=np.array([0, 1]),
        episodes=np.zeros(2, dtype=np.int64),
    )
    with pytest.raises(InputError, match="nothing to divide"):
        quantise(demonstrations)


@pytest.mark.parametrize("dividers", [(), (1,), (0, 2), (101,)])
def test_a_divider_out_of_range_is_named(dividers: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="divider"):
        quantise(demonstrated([0.0, 0.5]), dividers)
