from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sarl_core.demonstrations.formats import (
    ColumnMap,
    guess_columns,
    load_demonstrations,
    read_demonstrations,
    table_columns,
)
from sarl_core.errors import InputError
from tests.bad_inputs import HEADER, ROWS, csv_bytes, parquet_bytes


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_delimiters_line_ends_and_byte_order_marks(
    delimiter: str, newline: str, mark: bytes
) -> None:
    text = newline.join((HEADER, *ROWS)).replace(",", delimiter)
    demonstrations = read_demonstrations(mark + text.encode(), "demo.csv")
    assert demonstrations.observations.tolist() == [
        [0.5, 1.5],
        [0.25, 1.25],
        [0.125, 1.0],
        [0.75, 0.5],
        [0.0, 0.25],
    ]
    assert demonstrations.feature_names == ("x", "y")
    assert demonstrations.episode_lengths.tolist() == [3, 2]
    assert demonstrations.notes == ()


def test_decimal_comma() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("0,5;1;0", "-1,25;2e-1;1", header="obs_x;obs_y;action"),
        "demo.csv",
    )
    assert demonstrations.observations[:, 0].tolist() == [0.5, -1.25]
    with pytest.raises(InputError, match=r"'obs_y' holds '0,5' in row 2"):
        read_demonstrations(csv_bytes("0.5;1;0", "1;0,5;1", header="obs_x;obs_y;action"), "d.csv")


def test_decimal_comma_beside_dates_and_sentences_with_points() -> None:
    rows = [f"2{day}.03.2024;0,{day};crane no. 4.5 of 7;{day % 2}" for day in range(4)]
    demonstrations = read_demonstrations(
        csv_bytes(*rows, header="Datum;wind;crane;action"), "demo.csv"
    )
    assert demonstrations.observations[:, 0].tolist() == np.float32([0, 0.1, 0.2, 0.3]).tolist()


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_text_in_utf_16_as_spreadsheets_save_it(encoding: str) -> None:
    text = "Fahrt;Höhe;Aktion\r\n0;0,5;Höher\r\n0;1,5;Senken\r\n"
    mark = "" if encoding == "utf-16" else "\ufeff"
    demonstrations = read_demonstrations((mark + text).encode(encoding), "demo.csv")
    assert demonstrations.feature_names == ("Höhe",)
    assert demonstrations.observations[:, 0].tolist() == [0.5, 1.5]
    assert demonstrations.action_dimensions[0].labels == ("Höher", "Senken")


@pytest.mark.parametrize("field", ["{:,.1f}", "{:.1f} %", "{:.0f} m/s"])
def test_numbers_with_something_around_them_are_said_to_be_no_words(field: str) -> None:
    rows = [f'"{field.format(1000.0 + row)}",{row % 2}' for row in range(40)]
    with pytest.raises(InputError) as error:
        read_demonstrations(csv_bytes(*rows, header="load,action"), "demo.csv")
    said = str(error.value)
    assert "'load' holds 40 different texts that begin as numbers do" in said
    assert "write plain numbers" in said


def test_delimiter_inside_quoted_names() -> None:
    demonstrations = read_demonstrations(
        b'"obs_a;b","obs_c|""d""",action\n1,2,0\n3,4,1\n', "demo.csv"
    )
    assert demonstrations.feature_names == ("a;b", 'c|"d"')


def test_header_of_numpy_savetxt_blank_lines_and_spaces() -> None:
    demonstrations = read_demonstrations(
        b"\n# obs_x, obs_y, action\n 1.0, 2.0, 0\n\n 3.0, 4.0, 1\n", "demo.csv"
    )
    assert demonstrations.feature_names == ("x", "y")
    assert demonstrations.observations.tolist() == [[1, 2], [3, 4]]


def test_no_episode_column_is_one_episode_and_said_so() -> None:
    demonstrations = read_demonstrations(csv_bytes("1,0", "2,1", header="obs_x,action"), "demo.csv")
    assert demonstrations.n_episodes == 1
    assert demonstrations.notes == (
        "there is no episode column, so every step belongs to one episode",
    )


def test_episodes_from_marks_or_from_step_numbers() -> None:
    marked = read_demonstrations(
        csv_bytes(
            "1,0,0,0",
            "2,1,1,0",
            "3,0,0,0",
            "4,0,0,1",
            "5,1,0,0",
            header="obs_x,action,done,timeout",
        ),
        "demo.csv",
    )
    assert marked.episodes.tolist() == [0, 0, 1, 1, 2]
    assert marked.terminated is not None
    assert marked.terminated.tolist() == [False, True, False, False, False]
    stepped = read_demonstrations(
        csv_bytes("0,1,0", "1,2,1", "0,3,1", "1,4,0", header="t,obs_x,action"), "demo.csv"
    )
    assert stepped.episodes.tolist() == [0, 0, 1, 1]
    assert "begins again" in stepped.notes[0]
    with pytest.raises(InputError, match="'t' goes from 5 to 1 in row 3"):
        read_demonstrations(
            csv_bytes("0,1,0", "5,2,1", "1,3,1", header="t,obs_x,action"), "demo.csv"
        )


def test_names_that_differ_a_little() -> None:
    demonstrations = read_demonstrations(
        csv_bytes(
            "0,0,1,2,0,1.5,False,0",
            "0,1,3,4,1,2.5,True,1",
            header="Traj_ID,Timestep,x,speed,A,Rew,Dones,timeouts",
        ),
        "demo.csv",
    )
    assert demonstrations.feature_names == ("x", "speed")
    assert demonstrations.actions.tolist() == [0, 1]
    assert demonstrations.rewards is not None
    assert demonstrations.rewards.tolist() == [1.5, 2.5]
    assert demonstrations.terminated is not None
    assert demonstrations.terminated.tolist() == [False, True]
    assert "the columns 'x', 'speed' were taken as observations" in demonstrations.notes


def test_numbered_columns_are_ordered_by_number() -> None:
    header = ",".join([*sorted(f"obs_{i}" for i in range(12)), "action"])
    row = ",".join([*(name.removeprefix("obs_") for name in header.split(",")[:-1]), "0"])
    demonstrations = read_demonstrations(csv_bytes(row, row, header=header), "demo.csv")
    assert demonstrations.observations[0].tolist() == list(range(12))


def test_row_numbers_of_a_data_frame_are_left_out() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("0,1,0", "1,2,1", header=",position,action"), "demo.csv"
    )
    assert demonstrations.feature_names == ("position",)


def test_whole_numbers_with_a_point_as_actions() -> None:
    labels = read_demonstrations(csv_bytes("1,0.0", "2,1.0", header="obs_x,action"), "demo.csv")
    assert labels.is_discrete
    assert any("taken as labels" in note for note in labels.notes)
    named = read_demonstrations(
        csv_bytes("1,0.0", "2,1.0", header="obs_x,action_torque"), "demo.csv"
    )
    assert not named.is_discrete
    negative = read_demonstrations(csv_bytes("1,-1.0", "2,1.0", header="obs_x,action"), "demo.csv")
    assert not negative.is_discrete
    many = read_demonstrations(
        csv_bytes(*[f"1,{i}.0" for i in range(40)], header="obs_x,action"), "demo.csv"
    )
    assert not many.is_discrete


def test_the_environments_space_decides() -> None:
    header = "obs_0,obs_1,obs_2,action"
    whole = csv_bytes("1,0,0,1", "1,0,0,-2", header=header)
    continuous = read_demonstrations(whole, "demo.csv", env_id="Pendulum-v1")
    assert not continuous.is_discrete
    assert continuous.action_low == (-2.0,)
    assert continuous.bounds_from == "action space"
    assert continuous.feature_names == (
        "cosine of the angle",
        "sine of the angle",
        "angular velocity",
    )
    assert continuous.feature_units == ("", "", "rad/s")
    assert continuous.action_names == ("torque",)
    assert continuous.env_id == "Pendulum-v1"
    cart = read_demonstrations(
        csv_bytes("0,0,0,0,1.0", "0,0,0,1,0.0", header="obs_0,obs_1,obs_2,obs_3,action"),
        "demo.csv",
        env_id="CartPole-v1",
    )
    assert cart.actions.tolist() == [1, 0]
    assert cart.actions.shape == (2,)
    assert cart.label_names == (("push left", "push right"),)


def test_several_integer_columns_are_multi_discrete() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("1,0,2", "2,1,0", header="obs_x,action_left,action_right"), "demo.csv"
    )
    assert demonstrations.actions.tolist() == [[0, 2], [1, 0]]
    assert demonstrations.is_discrete
    assert demonstrations.action_names == ("left", "right")


def test_columns_in_another_order_than_the_environments() -> None:
    names = ("pole angle", "cart position", "pole angular velocity", "cart velocity")
    header = ",".join([*(f"obs_{name}" for name in names), "action"])
    demonstrations = read_demonstrations(
        csv_bytes("0.3,0.1,0.4,0.2,0", "0,0,0,0,1", header=header),
        "demo.csv",
        env_id="CartPole-v1",
    )
    assert np.allclose(demonstrations.observations[0], [0.1, 0.2, 0.3, 0.4])
    assert demonstrations.feature_units == ("m", "m/s", "rad", "rad/s")
    assert any("order of CartPole-v1" in note for note in demonstrations.notes)


def test_no_header_is_clear_with_the_environment() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("0.1,0.2,0.3,0.4,0", "0,0,0,0,1", header=None),
        "demo.csv",
        env_id="CartPole-v1",
    )
    assert demonstrations.actions.tolist() == [0, 1]
    assert demonstrations.feature_names is not None
    assert demonstrations.feature_names[2] == "pole angle"


def test_row_after_the_last_action_of_each_episode_is_dropped() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("0,1,0", "0,2,1", "0,3,", "1,4,1", "1,5,", header="episode,obs_x,action"),
        "demo.csv",
    )
    assert demonstrations.observations[:, 0].tolist() == [1, 2, 4]
    assert demonstrations.actions.tolist() == [0, 1, 1]
    assert any("dropped" in note for note in demonstrations.notes)


def test_column_map() -> None:
    content = csv_bytes("9,1,2,0,7", "9,3,4,1,8", header="who,alpha,beta,button,seed")
    columns = ColumnMap(
        ("beta", "alpha"),
        ("button",),
        episode="who",
        reward="seed",
        feature_names=("b", "a"),
        action_names=("press",),
    )
    demonstrations = read_demonstrations(content, "demo.csv", columns=columns)
    assert demonstrations.observations.tolist() == [[2, 1], [4, 3]]
    assert demonstrations.feature_names == ("b", "a")
    assert demonstrations.action_names == ("press",)
    assert demonstrations.episodes.tolist() == [9, 9]
    assert demonstrations.rewards is not None
    assert demonstrations.rewards.tolist() == [7, 8]


def test_column_map_for_a_file_without_header(tmp_path: Path) -> None:
    path = tmp_path / "demo.csv"
    path.write_bytes(csv_bytes("0.5,0", "1.5,1", header=None))
    assert table_columns(path) == ("column 1", "column 2")
    demonstrations = load_demonstrations(path, columns=ColumnMap(("column 1",), ("column 2",)))
    assert demonstrations.observations.tolist() == [[0.5], [1.5]]
    assert demonstrations.feature_names == ("column 1",)


def test_table_columns_and_the_guess_for_a_form() -> None:
    assert table_columns(csv_bytes(*ROWS), "demo.csv") == tuple(HEADER.split(","))
    assert table_columns(parquet_bytes(), "demo.parquet") == tuple(HEADER.split(","))
    guess = guess_columns(["who", "alpha", "beta", "step", "button"])
    assert guess.step == "step"
    assert guess.actions == ()
    assert guess.observations == ("who", "alpha", "beta", "button")


def test_values_are_rounded_once() -> None:
    text = "7.038531e-26"  # float(text), made a float32, is the neighbour of the nearest one
    demonstrations = read_demonstrations(
        csv_bytes(f"{text},0", f"{text},1", header="obs_x,action"), "demo.csv"
    )
    assert demonstrations.observations.view(np.uint32)[0, 0] == 0x15AE43FD


def test_header_of_numbers_from_a_data_frame() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("0.5,1.5,1", "0.25,2.5,0", header="0,1,2"),
        "demo.csv",
        columns=ColumnMap(("0", "1"), ("2",)),
    )
    assert demonstrations.observations.tolist() == [[0.5, 1.5], [0.25, 2.5]]
