from __future__ import annotations

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.errors import InputError
from tests.bad_inputs import csv_bytes, npz_bytes

N, EPISODE = 60, 15


def table(**columns: object) -> bytes:
    """A CSV file of these columns; numbers of N rows in the order they are given."""
    arrays = [np.asarray(values).tolist() for values in columns.values()]
    rows = [",".join(str(value) for value in row) for row in zip(*arrays, strict=True)]
    return csv_bytes(*rows, header=",".join(columns))


def noise(seed: int, decimals: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 9, N).round(decimals)


def moved(values: np.ndarray) -> np.ndarray:
    """What comes a step later; at the end of an episode something new."""
    later = np.append(values[1:], 0.5)
    later[EPISODE - 1 :: EPISODE] = 11 + np.arange(N // EPISODE)
    return later


LABELS = np.random.default_rng(7).integers(0, 2, N)
EPISODES = np.arange(N) // EPISODE
DONE = (np.arange(N) % EPISODE == EPISODE - 1).astype(int)


def read(**columns: object) -> Demonstrations:
    return read_demonstrations(table(**columns), "demo.csv")


def uses(demonstrations: Demonstrations) -> dict[str, str]:
    return {use.column: use.use for use in demonstrations.columns}


def refusal(**columns: object) -> str:
    with pytest.raises(InputError) as error:
        read(**columns)
    return str(error.value)


@pytest.mark.parametrize(
    ("names", "later"),
    [
        (("s0", "s1"), ("ns0", "ns1")),
        (("pos", "speed"), ("new_pos", "new_speed")),
        (("s_0", "s_1"), ("s'_0", "s'_1")),
        (("x", "y"), ("next_x", "next_y")),
        (("x", "y"), ("x_next", "y_next")),
        (("x", "y"), ("x'", "y'")),
        (("x", "y"), ("nextX", "nextY")),
        (("obs1_0", "obs1_1"), ("obs2_0", "obs2_1")),
        (("obs_0", "obs_1"), ("obs2_0", "obs2_1")),
        (("obs_0", "obs_1"), ("obs_next_0", "obs_next_1")),
        (("obs_0", "obs_1"), ("next_obs_0", "next_obs_1")),
        (("state_0", "state_1"), ("state_prime_0", "state_prime_1")),
        (("s0", "s1"), ("sp0", "sp1")),
        (("x", "v"), ("x_t+1", "v_t+1")),
        (("x", "v"), ("x_", "v_")),
    ],
)
def test_next_states_are_no_features(names: tuple[str, str], later: tuple[str, str]) -> None:
    x, y = noise(0), noise(1)
    demonstrations = read(
        **dict(zip(names, (x, y), strict=True)),
        action=LABELS,
        **dict(zip(later, (moved(x), moved(y)), strict=True)),
        done=DONE,
    )
    assert demonstrations.observations.shape == (N, 2)
    assert np.allclose(demonstrations.observations[:, 0], x)
    found = uses(demonstrations)
    assert [found[name] for name in names] == ["feature"] * 2
    assert [found[name] for name in later] == ["not used"] * 2
    told = " ".join(demonstrations.notes)
    assert all(repr(name) in told for name in later)


def test_next_states_of_rows_in_any_order_are_known_by_their_names() -> None:
    found = uses(
        read(s0=noise(0), s1=noise(1), action=LABELS, ns0=noise(2), ns1=noise(3), r=noise(4))
    )
    assert (found["ns0"], found["ns1"]) == ("not used", "not used")
    assert found["r"] == "reward"


def test_a_name_that_only_resembles_a_next_state_is_a_feature() -> None:
    found = uses(read(x=noise(0), nx=noise(1), new_load=noise(2), action=LABELS))
    assert (found["nx"], found["new_load"]) == ("feature", "feature")


@pytest.mark.parametrize("names", [("s1", "s2"), ("x1", "x2"), ("left_1", "left_2")])
def test_numbered_features_are_all_features(names: tuple[str, str]) -> None:
    columns = dict(zip(names, (noise(0), noise(1)), strict=True))
    assert list(uses(read(**columns, action=LABELS)).values()) == ["feature", "feature", "action"]


def test_two_sensors_are_not_a_state_and_the_next() -> None:
    names = ("lidar1_x", "lidar1_y", "lidar2_x", "lidar2_y")
    columns = {name: noise(seed) for seed, name in enumerate(names)}
    assert read(**columns, action=LABELS).feature_names == names


def test_the_letters_of_textbooks() -> None:
    x = noise(0)
    found = uses(read(s=x, a=LABELS, r=noise(1), s_=moved(x), episode=EPISODES))
    assert (found["a"], found["r"], found["s_"]) == ("action", "reward", "not used")


def test_an_earlier_state_is_a_feature() -> None:
    x = noise(0)
    found = uses(read(x=x, previous_x=np.append(0.25, x[:-1]), action=LABELS))
    assert found == {"x": "feature", "previous_x": "feature", "action": "action"}


def test_the_next_value_under_a_name_that_does_not_say_so_is_refused_by_name() -> None:
    x = noise(0)
    sentence = refusal(x=x, outcome=moved(x), action=LABELS, episode=EPISODES)
    assert "'outcome' holds in each row what 'x' holds in the next one" in sentence
    assert uses(read(x=x, next_x=moved(x), action=LABELS, episode=EPISODES))["next_x"] == "not used"


def test_something_next_that_no_column_precedes_is_unclear() -> None:
    assert "'next_waypoint'" in refusal(speed=noise(0), next_waypoint=noise(1), action=LABELS)


@pytest.mark.parametrize("rival", ["brake", "steering", "throttle_cmd"])
def test_a_is_no_action_where_another_column_may_be_one(rival: str) -> None:
    sentence = refusal(v=noise(0), a=noise(1), **{rival: noise(2)}, episode=EPISODES)
    assert f"which column is the action, 'a' or '{rival}'" in sentence


def test_a_is_no_action_beside_a_column_that_looks_like_labels() -> None:
    assert "'a' or 'lamp'" in refusal(v=noise(0), a=noise(1), lamp=LABELS, episode=EPISODES)
    assert "whether the column 'a' is the action" in refusal(v=noise(0), a=noise(1))


def test_a_is_the_action_where_nothing_else_can_be_and_it_is_told() -> None:
    for columns in (
        {"speed": noise(0), "gap": noise(1), "a": LABELS},
        {"s0": noise(0), "s1": noise(1), "a": noise(2)},
        {"speed": noise(0), "a": noise(1), "reward": noise(2)},
    ):
        demonstrations = read(**columns)
        assert uses(demonstrations)["a"] == "action"
        assert "the column 'a' was taken as the action" in demonstrations.notes


def test_r_is_the_reward_only_where_the_other_names_speak_so() -> None:
    assert "'r' is the reward or a feature" in refusal(r=noise(0), angle=noise(1), action=LABELS)
    demonstrations = read(x=noise(0), action=LABELS, r=noise(1), done=DONE)
    assert demonstrations.rewards is not None
    assert "the column 'r' was taken as the reward" in demonstrations.notes


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("row", np.arange(N)),
        ("id", np.arange(N) + 1),
        ("sample_nr", np.arange(N)),
        ("k", np.arange(N) % EPISODE),
        ("anything", np.arange(N) + 100),
        ("time", np.arange(N) * 0.02),
        ("timestamp", 1.7e9 + np.arange(N)),
        ("t", np.arange(N) * 0.5),
        ("elapsed_s", noise(5)),
        ("unix", 1.7e9 + np.arange(N)),
        ("anything", np.arange(N) * 20),
        ("anything", np.arange(N) % EPISODE),
        ("anything", np.arange(N) % EPISODE + 1.0),
        ("anything", EPISODE - np.arange(N) % EPISODE),
        ("anything", -(np.arange(N) % EPISODE)),
        ("anything", N - np.arange(N)),
    ],
)
def test_a_counter_is_no_feature(name: str, values: np.ndarray) -> None:
    demonstrations = read(**{name: values}, x=noise(0), v=noise(1), action=LABELS, episode=EPISODES)
    assert demonstrations.feature_names == ("x", "v")
    noted = any(f"'{name}' was not used" in note for note in demonstrations.notes)
    assert noted == (demonstrations.times is None)


def test_a_counter_is_known_by_any_mark_of_episodes_of_any_lengths() -> None:
    lengths = [20, 9, 17, 14]
    counted = np.concatenate([np.arange(length) for length in lengths])
    numbers = np.repeat(np.arange(4), lengths)
    for marks in ({"done": np.diff(counted, append=0) < 0}, {"is_first": counted == 0}):
        flags = {name: np.asarray(flag, dtype=int) for name, flag in marks.items()}
        assert read(foo=counted, x=noise(0), action=LABELS, **flags).feature_names == ("x",)
    falling = read(foo=50 - counted, x=noise(0), action=LABELS, episode=numbers)
    assert falling.feature_names == ("x",)


@pytest.mark.parametrize(
    "place",
    [
        np.arange(N) % EPISODE + EPISODES,  # from another place in each episode
        EPISODE - 1 - np.arange(N) % EPISODE + EPISODES % 2,
        np.minimum(np.arange(N) % EPISODE, 12),  # until there is a wall
        np.where(EPISODES % 2, -1, 1) * (np.arange(N) % EPISODE),  # to the one side or the other
        (np.arange(N) % EPISODE) * 0.5,
        np.arange(N) % 5,  # comes round within an episode
    ],
)
def test_a_position_on_a_grid_is_a_feature(place: np.ndarray) -> None:
    demonstrations = read(place=place, x=noise(0), action=LABELS, episode=EPISODES)
    assert demonstrations.feature_names == ("place", "x")


def test_one_or_two_walks_along_a_grid_are_no_counter() -> None:
    walk = np.arange(N) % (N // 2)
    twice = read(place=walk, x=noise(0), action=LABELS, episode=np.arange(N) // (N // 2))
    assert twice.feature_names == ("place", "x")


def test_a_time_written_as_text_is_left_alone() -> None:
    stamps = [f"2026-03-01 08:00:{second:02}" for second in range(N)]
    assert read(timestamp=stamps, x=noise(0), action=LABELS).feature_names == ("x",)


@pytest.mark.parametrize("name", ["row", "n", "number", "time_to_collision", "return_temperature"])
def test_a_feature_that_is_called_like_a_counter_is_one(name: str) -> None:
    assert read(**{name: noise(0)}, x=noise(1), action=LABELS).feature_names == (name, "x")


@pytest.mark.parametrize("name", ["lane_id", "id", "value", "return"])
def test_an_unclear_column_is_named(name: str) -> None:
    lanes = np.random.default_rng(3).integers(0, 3, N)
    sentence = refusal(speed=noise(0), **{name: lanes}, gap=noise(1), action=LABELS)
    assert f"unclear of the column '{name}'" in sentence
    renamed = read(speed=noise(0), lane=lanes, gap=noise(1), action=LABELS)
    assert renamed.feature_names == ("speed", "lane", "gap")


@pytest.mark.parametrize("name", ["run", "demo", "trial_id", "episode_nr", "rollout"])
def test_other_words_for_an_episode(name: str) -> None:
    demonstrations = read(**{name: EPISODES}, x=noise(0), action=LABELS)
    assert demonstrations.n_episodes == N // EPISODE
    assert demonstrations.feature_names == ("x",)


def test_a_run_that_comes_back_is_unclear() -> None:
    assert "'run' whether it numbers the episodes" in refusal(run=LABELS, x=noise(0), action=LABELS)


@pytest.mark.parametrize(
    "names", [("state", "pressure"), ("state_of_charge", "load"), ("features", "gap")]
)
def test_a_word_for_observations_may_be_the_name_of_a_feature(names: tuple[str, str]) -> None:
    columns = dict(zip(names, (noise(0), noise(1)), strict=True))
    assert read(**columns, action=LABELS).feature_names == names


def test_words_for_observations_before_every_name_are_left_out() -> None:
    assert read(state_x=noise(0), state_v=noise(1), action=LABELS).feature_names == ("x", "v")


@pytest.mark.parametrize(
    "marks",
    [
        {"is_first": np.roll(DONE, 1)},
        {"is_last": DONE},
        {"is_first": np.roll(DONE, 1), "is_last": DONE, "is_terminal": DONE * 0},
        {"isFirst": [bool(flag) for flag in np.roll(DONE, 1)]},
        {"episode_start": np.roll(DONE, 1)},
    ],
)
def test_marks_of_first_and_last_steps_tell_the_episodes(marks: dict[str, object]) -> None:
    demonstrations = read(x=noise(0), action=LABELS, discount=np.ones(N), **marks)
    assert demonstrations.episode_lengths.tolist() == [EPISODE] * (N // EPISODE)
    assert demonstrations.feature_names == ("x",)
    assert set(uses(demonstrations).values()) >= {"feature", "action", "not used"}
    assert all(uses(demonstrations)[name] not in ("feature", "not used") for name in marks)
    if "is_last" in marks:
        assert demonstrations.episode_finished is not None
        assert demonstrations.episode_finished.all()


def test_marks_that_contradict_each_other_are_refused() -> None:
    sentence = refusal(x=noise(0), action=LABELS, is_first=DONE, is_last=DONE)
    assert "'is_first' and column 'is_last' contradict each other in rows" in sentence


def test_every_column_is_told_in_the_order_of_the_file() -> None:
    demonstrations = read(
        row=np.arange(N), x=noise(0), action=LABELS, reward=noise(1), episode=EPISODES
    )
    assert [(use.column, use.use) for use in demonstrations.columns] == [
        ("row", "not used"),
        ("x", "feature"),
        ("action", "action"),
        ("reward", "reward"),
        ("episode", "episode number"),
    ]
    assert all(use.why for use in demonstrations.columns)


def test_the_arrays_of_a_npz_are_told_too() -> None:
    arrays = {"obs": np.zeros((4, 2)), "acts": np.array([0, 1, 0, 1]), "indices": np.array([2])}
    found = uses(read_demonstrations(npz_bytes(**arrays, infos=np.zeros(4)), "demo.npz"))
    assert found == {
        "obs": "features",
        "acts": "actions",
        "indices": "rows at which episodes begin",
    }


def test_names_of_any_length_are_read_or_refused_in_a_short_sentence() -> None:
    digits = "9" * 5000
    assert len(read(**{f"obs_{digits[:290]}": noise(0)}, action=LABELS)) == N
    assert len(refusal(**{f"obs_{digits}": noise(0)}, action=LABELS)) < 500
    assert len(refusal(**{digits: noise(0)}, x=noise(1))) < 500


@pytest.mark.parametrize("name", ["Trip No.", "run nr.", "Fahrt Nr."])
def test_a_number_that_is_written_short_is_that_of_an_episode(name: str) -> None:
    held = read(**{"wind": noise(1), "action": LABELS, name: EPISODES})
    assert held.feature_names == ("wind",)
    assert held.episodes.tolist() == EPISODES.tolist()
