"""How the features of two things line up: by name, by place, or not at all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.environments.feature_order import NamedFeatures as Named
from sarl_core.environments.feature_order import compared_names, line_up, numbered, only_counts
from sarl_core.errors import InputError

CART = ("cart position", "cart velocity", "pole angle", "pole angular velocity")
ENV = Named("CartPole-v1", CART, "CartPole-v1")

words = st.lists(
    st.text("abcdefgh", min_size=3, max_size=8), min_size=1, max_size=9, unique=True
).map(tuple)


@given(words, st.randoms())
def test_the_same_names_in_any_order_are_matched(names, random):
    other = list(names)
    random.shuffle(other)
    order = line_up(Named("the rules", tuple(other)), Named("the environment", names))
    assert order.put(tuple(other)) == names
    assert order.how == ("same" if tuple(other) == names else "permuted")
    assert bool(order.note) == (order.how == "permuted")


def test_capitals_and_what_parts_words_do_not_matter():
    spelled = ("Pole_Angle", "pole-angular velocity", "CART POSITION", "cart  velocity")
    order = line_up(Named("the rules", spelled), ENV)
    assert order.how == "permuted"
    assert order.put(spelled) == (spelled[2], spelled[3], spelled[0], spelled[1])


def test_names_that_read_alike_are_told_apart_as_they_stand():
    ours, theirs = compared_names(("x", "X", "Lane_Width"), ("X", "lane width"))
    assert (ours, theirs) == (["x", "X", "lane width"], ["X", "lane width"])
    three, turned = ("x", "X", "v"), ("X", "v", "x")
    order = line_up(Named("the log", turned), Named("the rules", three))
    assert (order.how, order.put(turned)) == ("permuted", three)
    with pytest.raises(InputError, match="different features"):
        line_up(Named("the log", ("x", "X", "v")), Named("the rules", ("x", "v", "w")))


@pytest.mark.parametrize(
    "names", [numbered(4), ("obs_0", "obs_1", "obs_2", "obs_3"), tuple("0123")]
)
def test_names_that_only_count_are_trusted_and_it_is_said(names):
    for one, other in (
        (Named("the rules", names), ENV),
        (ENV, Named("the file", names)),
    ):
        order = line_up(one, other)
        assert (order.how, order.places) == ("trusted", (0, 1, 2, 3))
        assert "CartPole-v1" in order.note
        assert "no names" in order.note


def test_two_without_names_are_trusted_unless_they_are_of_one_environment():
    assert line_up(Named("one", numbered(3)), Named("other", numbered(3))).how == "trusted"
    known = line_up(Named("one", numbered(3), "m:Own-v0"), Named("other", numbered(3), "Own-v0"))
    assert (known.how, known.note) == ("same", "")


def test_a_person_may_rename_the_features_of_one_environment():
    tilt = (*CART[:2], "tilt", CART[3])
    order = line_up(Named("the rules", tilt, "CartPole-v1"), ENV)
    assert (order.how, order.places) == ("trusted", (0, 1, 2, 3))
    assert "'tilt' for 'pole angle'" in order.note


@pytest.mark.parametrize(
    "side",
    [
        Named("the rules", ("a", "b", "c", "d")),
        Named("the rules", ("a", "b", "c", "d"), "Other-v1"),
        # One was renamed and the others moved: nothing says which is the renamed one.
        Named("the rules", ("pole angle", "tempo", "cart position", "drift"), "CartPole-v1"),
    ],
)
def test_other_names_are_refused_with_both_lists(side):
    with pytest.raises(InputError) as error:
        line_up(side, ENV)
    text = str(error.value)
    assert all(name in text for name in (*side.names, *CART))


def test_long_lists_are_shortened():
    many = tuple(f"a reading of the sensor called {letter * 60}" for letter in "abcdefghijkl")
    with pytest.raises(InputError) as error:
        line_up(
            Named("the rules", many),
            Named("the file", tuple(f"{one}!" for one in many)),
        )
    assert len(str(error.value)) < 500
    assert "more" in str(error.value)


def test_another_number_of_features_is_refused():
    with pytest.raises(InputError, match="ask about 2 features and CartPole-v1 has 4"):
        line_up(Named("the rules", ("a", "b")), ENV)


@pytest.mark.parametrize(
    ("names", "counts"),
    [
        (("x0", "x1"), True),
        (("feature 1", "feature 2"), True),
        (("observation[0]", "observation[1]"), True),
        (("x1", "x0"), False),
        (("x3", "x4"), False),
        (("x0", "y1"), False),
        (("temperature 0", "temperature 1"), False),
        (("speed", "x1"), False),
    ],
)
def test_what_only_counts(names, counts):
    assert only_counts(names) is counts


def test_places_are_those_of_the_first():
    first = ("c", "a", "b")
    order = line_up(Named("one", first), Named("other", ("a", "b", "c")))
    np.testing.assert_array_equal(np.array(first)[list(order.places)], ["a", "b", "c"])
