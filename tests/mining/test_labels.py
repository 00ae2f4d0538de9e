from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, grow_policy_trees
from sarl_core.mining.labels import LabelledDimension, label_dimensions


def continuous(values, **kwargs):
    values = np.asarray(values, dtype=np.float32).reshape(-1, 1)
    observations = np.arange(len(values), dtype=np.float32)[:, None]
    return Demonstrations(observations, values, np.zeros(len(values), dtype=int), **kwargs)


def test_intervals_span_the_action_space_and_an_inner_edge_belongs_above():
    demonstrations = continuous([-2, -1, 0, 1, 2], action_low=(-2.0,), action_high=(2.0,))
    (dimension,) = label_dimensions(demonstrations, 2)
    assert dimension.edges == (-2.0, 0.0, 2.0)
    assert dimension.bounds_from == "action space"
    labels = dimension.labels_of(demonstrations.action_columns[:, 0])
    assert labels.tolist() == [0, 0, 1, 1, 1]


def test_values_outside_are_clipped():
    dimension = LabelledDimension.of_edges("torque", [-1.0, 0.0, 1.0])
    assert dimension.labels_of(np.array([-7.0, 7.0])).tolist() == [0, 1]


@pytest.mark.parametrize("bounds", [{}, {"action_low": (-np.inf,), "action_high": (np.inf,)}])
def test_an_unbounded_space_is_divided_over_what_was_shown(bounds):
    (dimension,) = label_dimensions(continuous([0, 3, 9], **bounds), 3)
    assert dimension.edges == (0.0, 3.0, 6.0, 9.0)
    assert dimension.bounds_from == "demonstrated values"


def test_a_single_shown_value_still_gives_intervals():
    (dimension,) = label_dimensions(continuous([4, 4, 4]), 2)
    assert dimension.labels_of(np.array([4.0])).tolist() == [0]


def test_a_discrete_space_that_starts_elsewhere_counts_from_zero():
    demonstrations = Demonstrations(
        np.array([[1.0], [2.0], [3.0]]),
        np.array([-1, 0, 1]),
        np.zeros(3, dtype=int),
        label_names=(("left", "stay", "right"),),
        label_first=(-1,),
    )
    (dimension,) = label_dimensions(demonstrations)
    assert dimension.labels_of(demonstrations.actions).tolist() == [0, 1, 2]
    assert dimension.label_of(1) == 2


@given(st.lists(st.floats(-3, 3, width=32), min_size=1, max_size=20), st.integers(2, 9))
def test_one_and_many_agree(values, divider):
    edges = np.linspace(-1, 2, divider + 1).tolist()
    dimension = LabelledDimension.of_edges("x", edges)
    array = np.array(values, dtype=np.float32)
    assert dimension.labels_of(array).tolist() == [dimension.label_of(float(v)) for v in array]


@given(
    st.floats(-1e6, 1e6, width=32),
    st.floats(0.0, 1e3, width=32),
    st.integers(2, 9),
)
def test_no_shown_value_is_outside_what_is_written(low, width, divider):
    high = float(np.float32(low + width))
    (dimension,) = label_dimensions(continuous([low, high]), divider)
    read = [tuple(map(float, name.split(" to "))) for name in dimension.label_names]
    assert np.float32(read[0][0]) <= low
    assert np.float32(read[-1][-1]) >= high
    assert all(first[-1] == after[0] for first, after in pairwise(read))


def test_a_single_shown_value_is_written_whole():
    (dimension,) = label_dimensions(continuous([1000000.5] * 2))
    assert dimension.label_names == ("1000000.5",)
    (dimension,) = label_dimensions(continuous([0.1] * 2))
    assert dimension.label_names == ("0.1",)


@pytest.mark.parametrize("divider", [1, 0, -3, 101, 2.5])
def test_a_divider_out_of_range_is_refused(divider):
    with pytest.raises(InputError, match="divider"):
        grow_policy_trees(continuous([0, 1]), divider=divider)
