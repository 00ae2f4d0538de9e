"""What a label is worth is learned from what followed it."""

from __future__ import annotations

import numpy as np
import pytest

from sarl_core.improving.critic import Critic, Experience, Horizon

BATCHES = 500


def experience(episodes: list[list[tuple[float, tuple[int, ...], float]]], *, cut: bool = False):
    """Episodes of (state, labels, reward); with `cut` a limit ended them."""
    steps = [step for episode in episodes for step in episode]
    last = np.array([place == len(one) - 1 for one in episodes for place in range(len(one))])
    return Experience(
        observations=np.array([[state] for state, _, _ in steps], dtype=np.float32),
        labels=np.array([labels for _, labels, _ in steps]),
        rewards=np.array([reward for *_, reward in steps]),
        last=last,
        open=last & cut,
    )


def learned(
    shown: Experience,
    said,
    labels=(2,),
    *,
    discount: float,
    trace: float,
    batches: int = BATCHES,
) -> Critic:
    critic = Critic(labels, Horizon(discount, trace), seed=0)
    critic.learn(shown, np.asarray(said).reshape(len(shown), -1), batches)
    return critic


def values(critic: Critic, *states: float) -> list[np.ndarray]:
    return critic.values(np.array(states, dtype=np.float32)[:, None])


def test_where_an_episode_ends_a_label_is_worth_its_reward() -> None:
    generator = np.random.default_rng(0)
    states, labels = generator.uniform(-1, 1, 400), generator.integers(0, 2, 400)
    # The one on the right, the other on the left.
    shown = experience(
        [
            [(state, (label,), 10.0 * ((state > 0) == label))]
            for state, label in zip(states, labels, strict=True)
        ]
    )
    critic = learned(shown, np.zeros(400, dtype=int), discount=0.9, trace=0.5)
    (found,) = values(critic, -0.8, 0.8)
    assert found == pytest.approx(np.array([[10, 0], [0, 10]]), abs=1.5)


@pytest.mark.parametrize("trace", [0.0, 0.9, 1.0])
def test_what_comes_later_counts_less(trace: float) -> None:
    """Of two ways only the second label leads to where a reward is."""
    shown = experience(
        [[(0.0, (0,), 0.0), (-1.0, (0,), 0.0)], [(0.0, (1,), 0.0), (1.0, (0,), 10.0)]] * 50
    )
    critic = learned(shown, np.zeros(200, dtype=int), discount=0.8, trace=trace)
    (found,) = values(critic, 0.0)
    assert found[0] == pytest.approx([0, 8], abs=1.5)


@pytest.mark.parametrize("trace", [0.0, 0.9, 1.0])
def test_what_the_rules_would_not_do_says_nothing_of_what_came_before(trace: float) -> None:
    """Half of the time the next action is another than the rules', and costs much."""
    follows = [(0.0, (0,), 0.0), (1.0, (0,), 10.0)]
    deviates = [(0.0, (0,), 0.0), (1.0, (1,), -90.0)]
    shown = experience([follows, deviates] * 50)
    critic = learned(shown, np.zeros(200, dtype=int), discount=1.0, trace=trace)
    first, second = values(critic, 0.0, 1.0)[0]
    assert second == pytest.approx([10, -90], abs=8)
    # Not the mean of both, -40. At first nothing is known of the next state but what followed.
    assert first[0] == pytest.approx(10, abs=8)


def test_what_a_limit_of_time_ended_would_have_gone_on() -> None:
    walk = [(0.5, (0,), 1.0)] * 12
    other = [(0.5, (0,), 1.0)] * 3  # so that returns differ
    for cut, most in ((True, np.inf), (False, 7.5)):
        shown = experience([walk, other] * 20, cut=cut)
        said = np.zeros(len(shown), dtype=int)
        critic = learned(shown, said, discount=0.9, trace=0.9, batches=3 * BATCHES)
        (found,) = values(critic, 0.5)
        assert found[0, 0] < most
        if cut:  # 1 + 0.9 + 0.81 + ...
            assert found[0, 0] == pytest.approx(10, abs=1)


def test_a_dimension_is_judged_where_the_others_do_as_they_are_told() -> None:
    """The second label of the first dimension was always shown with a fault of the other."""
    steps = [((0, 0), 1.0), ((1, 0), 5.0), ((1, 1), -20.0), ((0, 1), -20.0)]
    shown = experience([[(0.0, labels, reward)] for labels, reward in steps] * 60)
    said = np.zeros((240, 2), dtype=int)
    critic = learned(shown, said, (2, 3), discount=0.9, trace=0.9)
    first, second = values(critic, 0.0)
    assert first.shape == (1, 2)
    assert second.shape == (1, 3)
    assert first[0] == pytest.approx([1, 5], abs=1.5)
    assert second[0, :2] == pytest.approx([1, -20], abs=3)


def test_of_a_dimension_that_never_stood_alone_nothing_is_known() -> None:
    """The second always did otherwise than it is told: of the first no label is worth more."""
    shown = experience([[(0.0, (label, 1), 5.0 * label)] for label in (0, 1)] * 40)
    critic = learned(shown, np.zeros((80, 2), dtype=int), (2, 2), discount=0.9, trace=0.9)
    first, second = values(critic, 0.0)
    np.testing.assert_array_equal(first, [[0.0, 0.0]])
    assert second[0, 1] != 0


def test_features_of_any_size_and_none_at_all_are_learned_from() -> None:
    generator = np.random.default_rng(1)
    sizes = np.array([1e6, 1e-6, 0.0], dtype=np.float32)
    observations = generator.uniform(-1, 1, (400, 3)).astype(np.float32) * sizes
    observations[::50, 2] = np.nan
    labels = generator.integers(0, 2, (400, 1))
    rewards = 10.0 * ((observations[:, 1] > 0) == labels[:, 0])
    ends = np.ones(400, dtype=bool)
    shown = Experience(observations, labels, rewards, last=ends, open=~ends)
    critic = Critic([2], Horizon(0.9, 0.5), seed=0)
    critic.learn(shown, np.zeros((400, 1), dtype=int), BATCHES)
    (found,) = critic.values(np.array([[0, -8e-7, 0], [0, 8e-7, 0]], dtype=np.float32))
    assert found == pytest.approx(np.array([[10, 0], [0, 10]]), abs=2.5)


def test_a_seed_gives_the_same_critic_again() -> None:
    shown = experience([[(0.0, (0,), 1.0), (1.0, (1,), 2.0)], [(0.3, (1,), 0.5)]] * 30)
    said = np.zeros(90, dtype=int)

    def found(seed: int) -> np.ndarray:
        critic = Critic([2], Horizon(0.9, 0.9), seed=seed)
        critic.learn(shown, said[:, None], 100)
        return values(critic, 0.0, 0.7)[0]

    np.testing.assert_array_equal(found(3), found(3))
    assert (found(3) != found(4)).any()
