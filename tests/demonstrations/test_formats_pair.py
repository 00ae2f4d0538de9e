from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sarl_core.demonstrations.formats import (
    ColumnMap,
    load_demonstrations,
    read_demonstrations,
)
from sarl_core.errors import InputError
from tests.bad_inputs import ROWS, csv_bytes

OBSERVATIONS = b"0.5;1.5;-1e-3;2\n0.25;1.25;0;3\n0.125;1;0;4\n"
ACTIONS = b"0\n1\n1\n"


def write(
    folder: Path,
    observations: bytes = OBSERVATIONS,
    actions: bytes = ACTIONS,
    names: tuple[str, str] = ("obs.csv", "actions.csv"),
) -> Path:
    (folder / names[0]).write_bytes(observations)
    (folder / names[1]).write_bytes(actions)
    return folder


@pytest.mark.parametrize(
    "names",
    [
        ("obs.csv", "actions.csv"),
        ("obs_train.csv", "actions_train.csv"),
        ("cart-observations.csv", "cart-actions.csv"),
    ],
)
def test_from_either_file_from_the_folder_and_from_uploads(
    names: tuple[str, str], tmp_path: Path
) -> None:
    write(tmp_path, names=names)
    expected = np.array([[0.5, 1.5, -1e-3, 2], [0.25, 1.25, 0, 3], [0.125, 1, 0, 4]], np.float32)
    contents = [(OBSERVATIONS, names[0]), (ACTIONS, names[1])]
    loaded = [
        load_demonstrations(tmp_path / names[0]),
        load_demonstrations(tmp_path / names[1]),
        load_demonstrations(tmp_path),
        read_demonstrations(*contents[0], companion=contents[1]),
        read_demonstrations(*contents[1], companion=contents[0]),
    ]
    for demonstrations in loaded:
        assert demonstrations.observations.tobytes() == expected.tobytes()
        assert demonstrations.actions.tolist() == [0, 1, 1]
        assert demonstrations.n_episodes == 1
        assert "one episode" in demonstrations.notes[0]
        assert demonstrations.digest == loaded[0].digest


def test_as_numpy_savetxt_writes_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(50, 4)).astype(np.float32)
    actions = rng.integers(0, 2, 50)
    np.savetxt(tmp_path / "obs.csv", observations, delimiter=";")
    np.savetxt(tmp_path / "actions.csv", actions, delimiter=";")
    demonstrations = load_demonstrations(tmp_path / "obs.csv", env_id="CartPole-v1")
    assert demonstrations.observations.tobytes() == observations.tobytes()
    assert demonstrations.actions.tolist() == actions.tolist()
    assert demonstrations.feature_names is not None
    assert demonstrations.feature_names[0] == "cart position"
    assert demonstrations.label_names == (("push left", "push right"),)


def test_decimal_comma_in_both(tmp_path: Path) -> None:
    write(tmp_path, b"0,5;1\n1,5;0\n", b"0,25\n0,75\n")
    demonstrations = load_demonstrations(tmp_path)
    assert demonstrations.observations.tolist() == [[0.5, 1], [1.5, 0]]
    assert demonstrations.actions.tolist() == [[0.25], [0.75]]


def test_one_observation_more_than_actions(tmp_path: Path) -> None:
    write(tmp_path, actions=b"0\n1\n")
    demonstrations = load_demonstrations(tmp_path)
    assert demonstrations.observations[:, 3].tolist() == [2, 3]
    assert any("dropped" in note for note in demonstrations.notes)


@pytest.mark.parametrize(
    ("observations", "actions", "fragments"),
    [
        (OBSERVATIONS, b"0\n", ("1 actions for 3 observations", "obs.csv", "actions.csv")),
        (OBSERVATIONS, b"0\n1\n1\n1\n", ("4 actions for 3 observations",)),
        (OBSERVATIONS, b"", ("actions.csv: it is empty",)),
        (b"", ACTIONS, ("obs.csv: it is empty",)),
        (b"1;2\n3\n4;5\n", ACTIONS, ("obs.csv: row 2 (line 2) has 1 field in place of 2",)),
        (b"1;2\n3;x\n4;5\n", ACTIONS, ("obs.csv: column 'column 2' holds 'x' in row 2",)),
        (b"1;2\n3;nan\n4;5\n", ACTIONS, ("obs.csv", "'column 2'", "empty", "row 2")),
        (OBSERVATIONS, b"0\n1\nleft\n", ("actions.csv: column 'column 1' holds 'left' in row 3",)),
        (b"\xff\xfe1", ACTIONS, ("obs.csv: it is damaged text in UTF-16",)),
        (b"PAR1....", ACTIONS, ("obs.csv: it is named .csv, but its content is Parquet",)),
    ],
)
def test_bad_pairs(
    observations: bytes, actions: bytes, fragments: tuple[str, ...], tmp_path: Path
) -> None:
    write(tmp_path, observations, actions)
    with pytest.raises(InputError) as error:
        load_demonstrations(tmp_path)
    assert "\n" not in str(error.value)
    for fragment in fragments:
        assert fragment in str(error.value)


def test_half_a_pair(tmp_path: Path) -> None:
    (tmp_path / "obs.csv").write_bytes(OBSERVATIONS)
    with pytest.raises(InputError, match=r"observations of a pair alone; give 'actions\.csv'"):
        load_demonstrations(tmp_path / "obs.csv")
    with pytest.raises(InputError, match=r"actions of a pair alone; give 'obs\.csv'"):
        read_demonstrations(b"0\n1\n", "actions.csv")
    with pytest.raises(InputError, match=r"folder without obs\.csv"):
        load_demonstrations(tmp_path)


def test_several_pairs_in_a_folder(tmp_path: Path) -> None:
    write(tmp_path)
    write(tmp_path, names=("obs_2.csv", "actions_2.csv"))
    with pytest.raises(InputError, match="2 pairs"):
        load_demonstrations(tmp_path)
    assert len(load_demonstrations(tmp_path / "obs_2.csv")) == 3


def test_a_whole_table_may_be_called_obs() -> None:
    assert len(read_demonstrations(csv_bytes(*ROWS), "obs.csv")) == 5


RIG = csv_bytes(
    "0.3,0.8,0,0", "0.2,0.9,0,0", "0.1,0.1,1,0", "0.7,0.2,1,1", header="speed,gap,action,episode"
)
FOREIGN = csv_bytes("1", "1", "0", "0", header="action")


@pytest.mark.parametrize(
    "names",
    [
        ("rig_states.csv", "rig_actions.csv"),
        ("obs.csv", "actions.csv"),
        ("Rig-observations.csv", "Rig-actions.csv"),
        ("obs.2.csv", "acts.2.csv"),
    ],
)
def test_a_complete_table_is_no_half(names: tuple[str, str], tmp_path: Path) -> None:
    write(tmp_path, RIG, FOREIGN, names)
    demonstrations = load_demonstrations(tmp_path / names[0])
    assert demonstrations.feature_names == ("speed", "gap")
    assert demonstrations.actions.tolist() == [0, 0, 1, 1]
    assert demonstrations.episodes.tolist() == [0, 0, 0, 1]
    told = next(note for note in demonstrations.notes if "was not read" in note)
    assert all(repr(name) in told for name in names)
    for attempt in (
        lambda: load_demonstrations(tmp_path / names[1]),
        lambda: load_demonstrations(tmp_path),
        lambda: read_demonstrations(RIG, names[0], companion=(FOREIGN, names[1])),
    ):
        with pytest.raises(InputError, match="actions of its own") as error:
            attempt()
        assert all(name in str(error.value) for name in names)


def test_a_complete_table_that_is_called_actions_is_no_half(tmp_path: Path) -> None:
    write(tmp_path, OBSERVATIONS, RIG, ("rig_states.csv", "rig_actions.csv"))
    demonstrations = load_demonstrations(tmp_path / "rig_actions.csv")
    assert demonstrations.feature_names == ("speed", "gap")
    assert any("'rig_states.csv' was not read" in note for note in demonstrations.notes)
    with pytest.raises(InputError, match=r"observations of its own .*'rig_states\.csv'"):
        load_demonstrations(tmp_path / "rig_states.csv")


def test_without_a_header_the_environment_tells_a_complete_table(tmp_path: Path) -> None:
    whole = csv_bytes("0.1,0.2,0.3,0.4,0", "0.4,0.3,0.2,0.1,1", header=None)
    write(tmp_path, whole, b"1\n1\n")
    demonstrations = load_demonstrations(tmp_path / "obs.csv", env_id="CartPole-v1")
    assert demonstrations.actions.tolist() == [0, 1]
    assert any("'actions.csv' was not read" in note for note in demonstrations.notes)


@pytest.mark.parametrize("name", ["a", "operator_action", "command", "Cmd"])
def test_what_may_be_the_action_beside_a_file_of_actions_is_unclear(
    name: str, tmp_path: Path
) -> None:
    write(tmp_path, csv_bytes("0.1,0", "0.2,1", header=f"speed,{name}"), b"0\n1\n")
    with pytest.raises(InputError, match=f"'{name}' is its action or 'actions.csv'"):
        load_demonstrations(tmp_path / "obs.csv")


def test_columns_of_a_pair_are_what_their_names_say(tmp_path: Path) -> None:
    seen = csv_bytes("0,0.5,2,3", "1,0.25,2,4", "2,0.1,3,5", header="step,speed,episode,brake")
    done = csv_bytes("2,0.5,0.1", "2,0.25,0.2", "3,0.5,0.3", header="episode,steer,gas")
    demonstrations = load_demonstrations(write(tmp_path, seen, done))
    assert demonstrations.feature_names == ("speed", "brake")
    assert demonstrations.action_names == ("steer", "gas")
    assert demonstrations.episodes.tolist() == [2, 2, 3]
    assert [(use.column, use.use) for use in demonstrations.columns][:3] == [
        ("step (obs.csv)", "step number"),
        ("speed (obs.csv)", "feature"),
        ("episode (obs.csv)", "episode number"),
    ]
    other = csv_bytes("2,0.5", "3,0.25", "3,0.5", header="episode,steer")
    with pytest.raises(InputError, match="'episode' of the one and 'episode' of the other differ"):
        load_demonstrations(write(tmp_path, seen, other))


@pytest.mark.parametrize("names", [("obs.csv", "actions.csv"), ("states_b.csv", "actions_b.csv")])
@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("action", [0, 1, 1]),
        ("actions", [0, 1, 1]),
        ("action_0,action_1", [[0, 2], [1, 3], [1, 4]]),
        ("act_x,act_y", [[0, 2], [1, 3], [1, 4]]),
        ("episode,action", [0, 1, 1]),
    ],
)
def test_a_file_with_nothing_but_columns_named_as_actions(
    header: str, expected: list[object], names: tuple[str, str], tmp_path: Path
) -> None:
    rows = {"episode,action": ("7,0", "7,1", "8,1")}.get(header, ("0,2", "1,3", "1,4"))
    done = csv_bytes(*(row if "," in header else row[0] for row in rows), header=header)
    seen = csv_bytes("0.5,1", "0.25,2", "0.125,3", header="x,y")
    write(tmp_path, seen, done, names)
    for source in (tmp_path, tmp_path / names[0], tmp_path / names[1]):
        demonstrations = load_demonstrations(source)
        assert demonstrations.actions.tolist() == expected
        assert demonstrations.feature_names == ("x", "y")
    uploaded = read_demonstrations(seen, names[0], companion=(done, names[1]))
    assert uploaded.actions.tolist() == expected
    with pytest.raises(InputError, match="3 actions for 6 observations"):
        load_demonstrations(write(tmp_path, seen + b"0,4\n0,5\n0,6\n", done, names) / names[0])


N = 60
STATES = np.random.default_rng(3).uniform(0, 9, (N, 2)).round(3)
CHOICES = np.random.default_rng(4).integers(0, 2, (N, 2))
EPISODES = np.arange(N) // 15


def rows(*columns: NDArray[Any]) -> bytes:
    """A file without a header."""
    table = np.column_stack(columns).tolist()
    return csv_bytes(*(",".join(f"{value:g}" for value in row) for row in table), header=None)


@pytest.mark.parametrize(
    ("seen", "done", "told"),
    [
        ((STATES, CHOICES[:, 0]), (CHOICES[:, 0],), "obs.csv: .*'column 3' holds what 'act"),
        ((STATES, CHOICES), (CHOICES,), "obs.csv: .*'column 3', 'column 4' hold what 'act"),
        ((STATES, EPISODES, CHOICES[:, 1]), (CHOICES[:, 0],), "'column 3' numbers the episodes"),
        ((EPISODES + 1, STATES), (CHOICES[:, 0],), "obs.csv: .*'column 1' numbers the episodes"),
        ((STATES,), (STATES, CHOICES[:, 0]), "actions.csv: .*'column 2' hold what 'obs.csv'"),
        ((STATES,), (CHOICES[:, 0], EPISODES), "actions.csv: .*'column 2' numbers the episodes"),
    ],
)
def test_without_a_header_what_is_no_half_is_told_by_its_values(
    seen: tuple[Any, ...], done: tuple[Any, ...], told: str, tmp_path: Path
) -> None:
    write(tmp_path, rows(*seen), rows(*done))
    with pytest.raises(InputError, match=told) as error:
        load_demonstrations(tmp_path)
    assert "it has no header" in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    "feature",
    [
        CHOICES[:, 1],  # a contact
        np.minimum.accumulate(np.arange(N)[::-1] // 20),  # what is left of three lives
        EPISODES == 3,  # a switch that is thrown once
        np.cumsum(CHOICES[:, 0] * 2 - 1),  # a position on a grid
        np.arange(N) // 20 * 0.5,
    ],
)
def test_without_a_header_a_feature_of_whole_numbers_is_one(feature: Any, tmp_path: Path) -> None:
    write(tmp_path, rows(STATES, feature), rows(CHOICES[:, 0]))
    assert load_demonstrations(tmp_path).observations.shape == (N, 3)
    write(tmp_path, rows(STATES), rows(np.sort(CHOICES[:, 0]) + (np.arange(N) > 50)))
    assert load_demonstrations(tmp_path).observations.shape == (N, 2)


def test_the_last_observation_of_each_episode_needs_no_action(tmp_path: Path) -> None:
    seen = csv_bytes("0,1", "0,2", "1,3", "1,4", "1,5", header="episode,speed")
    demonstrations = load_demonstrations(write(tmp_path, seen, b"1\n0\n1\n"))
    assert demonstrations.observations[:, 0].tolist() == [1, 3, 4]
    assert demonstrations.episodes.tolist() == [0, 1, 1]


def test_both_names_of_a_pair_are_said(tmp_path: Path) -> None:
    write(tmp_path, names=("cart_obs.csv", "cart_acts.csv"))
    notes = load_demonstrations(tmp_path / "cart_obs.csv").notes
    assert any("'cart_obs.csv'" in note and "'cart_acts.csv'" in note for note in notes)
    write(tmp_path, actions=b"0\nleft\n1\n", names=("cart_obs.csv", "cart_acts.csv"))
    with pytest.raises(InputError, match=r"cart_acts\.csv.*'left'.*'cart_obs\.csv'"):
        load_demonstrations(tmp_path / "cart_obs.csv")


def test_no_column_map_and_no_other_formats_in_a_pair() -> None:
    with pytest.raises(InputError, match="not in a pair"):
        read_demonstrations(
            OBSERVATIONS,
            "obs.csv",
            companion=(ACTIONS, "actions.csv"),
            columns=ColumnMap(("a",), ("b",)),
        )
    with pytest.raises(InputError, match=r"obs\.npz: .*two \.csv files"):
        read_demonstrations(OBSERVATIONS, "obs.npz", companion=(ACTIONS, "actions.csv"))
