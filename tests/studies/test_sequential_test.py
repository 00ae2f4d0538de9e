"""A test that stops early is wrong no more often than it says, however it ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import InputError
from sarl_core.studies.sequential_test import chances, sequential_test

NONE = np.zeros(40_000, dtype=np.bool_)


def failures(*episodes, of=40_000):
    """Episodes of which those with these numbers, from 1, failed."""
    failed = np.zeros(of, dtype=np.bool_)
    failed[np.array(episodes, dtype=np.int64) - 1] = True
    return failed


@pytest.mark.parametrize(
    ("at_most", "certainty", "episodes"),
    [
        (0.01, 0.95, 299),
        (0.001, 0.95, 2_995),
        (0.02, 0.95, 149),
        (0.05, 0.95, 59),
        (0.01, 0.99, 459),
    ],
)
def test_without_a_failure_it_takes_what_a_test_of_a_fixed_size_does(at_most, certainty, episodes):
    test = sequential_test(at_most, certainty)
    assert (1 - at_most) ** episodes <= 1 - certainty < (1 - at_most) ** (episodes - 1)
    assert test.decided(NONE[: episodes - 1], NONE[: episodes - 1]).certified is None
    verdict = test.decided(NONE, NONE)
    assert (verdict.certified, verdict.episodes, verdict.failures) == (True, episodes, 0)
    assert test.episodes == 10 * episodes


def test_a_failure_asks_for_more_episodes_and_many_refuse():
    test = sequential_test(0.01)
    once = test.decided(failures(200), NONE)
    assert (once.certified, once.failures) == (True, 1)
    assert once.episodes > 2 * 299
    assert test.least_more(299, 1) == once.episodes - 299
    assert test.least_more(299, len(test.certified)) is None
    many = test.decided(failures(*range(10, 20)), NONE)
    assert many.certified is False
    assert many.episodes < 20
    undecided = test.decided(failures(*range(100, 2_990, 100)), NONE)
    assert (undecided.certified, undecided.episodes) == (None, 2_990)


def test_more_episodes_go_on_where_fewer_ended():
    few, many = sequential_test(0.02), sequential_test(0.02, 0.95, 6_000)
    assert many.certified[: len(few.certified)] == few.certified
    assert many.refused[: len(few.refused) - 1] == few.refused[:-1]


def test_what_is_not_known_counts_against_both_verdicts():
    test = sequential_test(0.01)
    unknown = failures(200)
    verdict = test.decided(NONE, unknown)
    assert (verdict.certified, verdict.failures, verdict.undecided) == (True, 0, 1)
    assert verdict.episodes == test.decided(unknown, NONE).episodes
    early = failures(*range(1, 30))
    assert test.decided(early, NONE).certified is False
    assert test.decided(NONE, early).certified is not False


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.005, 0.6),
    st.floats(0.5, 0.995),
    st.one_of(st.none(), st.floats(1.0, 30.0)),
)
def test_neither_verdict_is_wrong_more_often_than_it_says(at_most, certainty, times):
    usual = sequential_test(at_most, certainty)
    test = usual
    if times is not None:
        episodes = min(int(times * usual.certified[0]) + 1, 8_000)
        if episodes >= usual.certified[0]:
            test = sequential_test(at_most, certainty, episodes)
    error = (1.0 - certainty) * (1.0 + 1e-9)
    assert list(test.certified) == sorted(set(test.certified))
    assert list(test.refused) == sorted(test.refused)
    # Each alone, as if the other could not stop it: the strictest reading.
    for at in (at_most, min(1.2 * at_most, 1.0)):
        assert chances(replace(test, refused=(0,) * len(test.refused)), at).certified <= error
    for at in (at_most, 0.8 * at_most):
        assert chances(replace(test, certified=()), at).refused <= error


def test_the_exact_chances_are_those_of_episodes_that_are_drawn():
    test = sequential_test(0.1, 0.9)
    drawn = np.random.default_rng(7)
    for rate in (0.02, 0.1, 0.2):
        exact = chances(test, rate)
        verdicts = [
            test.decided(drawn.random(test.episodes) < rate, NONE[: test.episodes])
            for _ in range(2_000)
        ]
        certified = np.mean([one.certified is True for one in verdicts])
        refused = np.mean([one.certified is False for one in verdicts])
        looked_at = np.mean([one.episodes for one in verdicts])
        for share, chance in ((certified, exact.certified), (refused, exact.refused)):
            assert abs(share - chance) <= 5 * math.sqrt(chance * (1 - chance) / 2_000) + 1e-9
        assert looked_at == pytest.approx(exact.episodes, rel=0.1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((0.0,), "a rate of 0 cannot be certified"),
        ((0,), "a rate of 0 cannot be certified"),
        ((1.0,), "a rate lies between 0 and 1"),
        ((-0.1,), "a rate lies between 0 and 1"),
        ((math.nan,), "at_most is no number"),
        (("1 %",), "at_most is no number"),
        ((1e-9,), "more than 500,000 episodes without any failure; give a larger rate"),
        ((1e-308,), "more than 500,000 episodes without any failure; give a larger rate"),
        ((0.01, 1.0), "certainty is 1.0; give a number from 0.5"),
        ((0.01, 0.2), "certainty is 0.2; give a number from 0.5"),
        ((0.01, 0.95, 298), "takes 299 without any failure"),
        ((0.01, 0.95, 10**7), "can use 100,000"),
        ((0.01, 0.95, 300.5), "episodes must be a whole number"),
    ],
)
def test_what_cannot_be_tested_is_one_sentence(arguments, sentence):
    with pytest.raises(InputError, match=sentence):
        sequential_test(*arguments)
