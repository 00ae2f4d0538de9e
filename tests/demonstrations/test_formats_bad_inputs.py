from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import (
    ColumnMap,
    load_demonstrations,
    read_demonstrations,
    save_demonstrations,
    table_columns,
)
from sarl_core.errors import InputError
from tests.bad_inputs import (
    BAD_INPUTS,
    HEADER,
    ROWS,
    changed,
    csv_bytes,
    good_arrays,
    npz_bytes,
    parquet_bytes,
    with_value,
)
from tests.hostile_archives import malicious_npz


def sentence(error: pytest.ExceptionInfo[InputError]) -> str:
    text = str(error.value)
    assert "\n" not in text
    assert not text.endswith(".")
    return text


@pytest.mark.parametrize("name", BAD_INPUTS)
def test_refused_in_one_sentence_from_disk_and_from_upload(name: str, tmp_path: Path) -> None:
    file_name, content, fragments = BAD_INPUTS[name]
    with pytest.raises(InputError) as uploaded:
        read_demonstrations(io.BytesIO(content), file_name)
    text = sentence(uploaded)
    assert text.startswith(f"{file_name}: ")
    for fragment in fragments:
        assert fragment in text
    path = tmp_path / file_name
    path.write_bytes(content)
    with pytest.raises(InputError) as loaded:
        load_demonstrations(path)
    assert sentence(loaded) == text.replace(file_name, str(path), 1)
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_the_good_files_that_the_bad_ones_are_made_from_are_read() -> None:
    for name, content in (
        ("demo.csv", csv_bytes(*ROWS)),
        ("demo.parquet", parquet_bytes()),
        ("demo.npz", npz_bytes(**good_arrays())),
    ):
        demonstrations = read_demonstrations(content, name)
        assert demonstrations.n_episodes == 2
        assert demonstrations.actions.tolist() == [0, 1, 0, 1, 1]
        assert demonstrations.observations[:, 0].tolist() == [0.5, 0.25, 0.125, 0.75, 0.0]


def test_a_pickle_is_never_executed(tmp_path: Path) -> None:
    witness = tmp_path / "executed"
    content = malicious_npz(str(witness))
    with pytest.raises(InputError, match="never opened"):
        read_demonstrations(content, "demo.npz")
    assert not witness.exists()
    np.load(io.BytesIO(content), allow_pickle=True)["actions"][0].close()
    assert witness.exists()  # the payload is a real one


def test_a_pickle_that_is_not_needed_is_left_alone(tmp_path: Path) -> None:
    witness = tmp_path / "executed"
    infos = np.load(io.BytesIO(npz_bytes(x=np.zeros(1))))["x"]
    with_infos = npz_bytes(
        **good_arrays(), infos=np.array([Opens(str(witness))], dtype=object), more=infos
    )
    assert len(read_demonstrations(with_infos, "demo.npz")) == 5
    assert not witness.exists()


class Opens:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (self.path, "w")


@pytest.mark.parametrize(("action", "kind"), [("0.5", "csv"), (0.5, "parquet"), (0.5, "npz")])
def test_non_integer_discrete_action(action: object, kind: str) -> None:
    header = "obs_0,obs_1,obs_2,obs_3,action"
    if kind == "csv":
        content = csv_bytes("0,0,0,0,1", f"0,0,0,1,{action}", header=header)
        column = "'action'"
    elif kind == "parquet":
        columns = {f"obs_{i}": [0.0, 1.0] for i in range(4)} | {"action": [1.0, action]}
        content, column = parquet_bytes(columns), "'action'"
    else:
        content = npz_bytes(obs=np.zeros((2, 4)), acts=np.array([1, action]))
        column = "'acts'"
    with pytest.raises(InputError) as error:
        read_demonstrations(content, f"demo.{kind}", env_id="CartPole-v1")
    assert f"{column} is 0.5 in row 2" in sentence(error)
    assert "whole numbers" in sentence(error)


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_an_action_too_large_for_a_label_is_not_said_to_be_no_whole_number(kind: str) -> None:
    large = 2**63
    content = {
        "csv": csv_bytes("1,0", f"2,{large}", header="obs_x,action"),
        "parquet": parquet_bytes({"obs_x": [1, 2], "action": np.array([0, large], np.uint64)}),
        "npz": npz_bytes(obs=np.ones((2, 1)), acts=np.array([0.0, large])),
    }[kind]
    with pytest.raises(InputError) as error:
        read_demonstrations(content, f"demo.{kind}")
    assert "in row 2, which is too large for a label; mend that row" in sentence(error)


def test_discrete_action_outside_the_action_space() -> None:
    content = csv_bytes("0,0,0,0,1", "0,0,0,1,2", header="obs_0,obs_1,obs_2,obs_3,action")
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "demo.csv", env_id="CartPole-v1")
    assert "demo.csv: column 'action' is 2 in row 2" in sentence(error)
    assert "0 to 1" in sentence(error)


def test_continuous_action_outside_the_action_space() -> None:
    content = csv_bytes("1,0,0,1.5", "1,0,0,-2.25", header="obs_0,obs_1,obs_2,action")
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "demo.csv", env_id="Pendulum-v1")
    assert "column 'action' is -2.25 in row 2, outside the action space [-2, 2]" in sentence(error)


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (csv_bytes("1,0,1", "1,0,0", header="obs_0,obs_1,action"), "2 observation columns"),
        (
            csv_bytes(
                "0,0,0,1,1,1", "1,1,1,1,1,0", header="obs_0,obs_1,obs_2,obs_3,action_0,action_1"
            ),
            "2 action columns",
        ),
    ],
)
def test_width_that_is_not_the_environments(content: bytes, fragment: str) -> None:
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "demo.csv", env_id="CartPole-v1")
    assert fragment in sentence(error)
    assert "CartPole-v1" in sentence(error)


def test_unknown_environment() -> None:
    with pytest.raises(InputError, match="'NoSuch-v9' cannot be made"):
        read_demonstrations(csv_bytes(*ROWS), "demo.csv", env_id="NoSuch-v9")


def test_missing_file_and_folder_without_pair(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load_demonstrations(tmp_path / "nothing.csv")
    assert "nothing.csv: there is no such file" in sentence(error)
    with pytest.raises(InputError) as error:
        load_demonstrations(tmp_path)
    assert f"{tmp_path}: it is a folder without obs.csv" in sentence(error)
    with pytest.raises(InputError) as error:
        table_columns(tmp_path)
    assert "folder" in sentence(error)


def test_rows_count_as_in_the_file_where_ends_of_episodes_are_dropped() -> None:
    content = csv_bytes("0,1,0", "0,2,", "1,3,-4294967296", "1,3,", header="episode,obs_x,action")
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "demo.csv")
    assert "'action' is -4294967296 in row 3" in sentence(error)


@pytest.mark.parametrize(
    ("columns", "fragment"),
    [
        (ColumnMap(("obs_x", "wrong"), ("action",)), "no column 'wrong'"),
        (ColumnMap(("obs_x", "obs_x"), ("action",)), "'obs_x' is mapped twice"),
        (ColumnMap(("obs_x", "action"), ("action",)), "'action' is mapped twice"),
        (ColumnMap((), ("action",)), "names no observations"),
        (ColumnMap(("obs_x",), ()), "names no observations or no actions"),
    ],
)
def test_bad_column_map(columns: ColumnMap, fragment: str) -> None:
    with pytest.raises(InputError) as error:
        read_demonstrations(csv_bytes(*ROWS), "demo.csv", columns=columns)
    assert fragment in sentence(error)


def test_column_map_for_arrays() -> None:
    with pytest.raises(InputError, match="columns are mapped in a table"):
        read_demonstrations(
            npz_bytes(**good_arrays()), "demo.npz", columns=ColumnMap(("x",), ("a",))
        )


def test_name_of_the_column_is_the_files_own() -> None:
    content = csv_bytes("7,0.5,1", "x,0.5,1", header="traj,velocity,acts")
    with pytest.raises(InputError, match="column 'traj' holds 'x' in row 2"):
        read_demonstrations(content, "demo.csv")
    content = csv_bytes("7,0.5,1", "-7,0.5,1", header="traj,velocity,acts")
    with pytest.raises(InputError, match="column 'traj' is -7 in row 2"):
        read_demonstrations(content, "demo.csv")


def test_only_the_columns_in_use_are_checked() -> None:
    content = csv_bytes("1,a,0", "2,b,1", header="obs_x,comment,action")
    demonstrations = read_demonstrations(content, "demo.csv")
    assert demonstrations.observations.tolist() == [[1], [2]]
    assert "the column 'comment' was not used" in demonstrations.notes


def test_error_far_down_a_large_file() -> None:
    rows = [f"{i // 100},{i % 100},{i / 7},1,0" for i in range(30_000)]
    rows[28_765] = "287,65,1,oops,0"
    with pytest.raises(InputError, match=r"'obs_y' holds 'oops' in row 28766 \(line 28767\)"):
        read_demonstrations(csv_bytes(*rows), "demo.csv")
    rows[28_765] = "287,65,1,1"
    with pytest.raises(InputError, match=r"row 28766 \(line 28767\) has 4 fields"):
        read_demonstrations(csv_bytes(*rows), "demo.csv")


def test_environment_in_metadata_does_not_import_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "planted.py").write_text("open(__file__ + '.ran', 'w').close()")
    monkeypatch.syspath_prepend(tmp_path)
    content = parquet_bytes(metadata='{"env_id": "planted:CartPole-v1"}')
    assert read_demonstrations(content, "demo.parquet").env_id == "planted:CartPole-v1"
    assert not (tmp_path / "planted.py.ran").exists()


@pytest.mark.parametrize("name", ["demo.txt", "demo", "missing/demo.csv", "folder.csv"])
def test_saving_where_it_cannot_be(name: str, tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError) as error:
        save_demonstrations(read_demonstrations(csv_bytes(*ROWS), "demo.csv"), tmp_path / name)
    assert sentence(error).startswith(str(tmp_path / name))
    assert sorted(tmp_path.rglob("*")) == before


def test_failed_saving_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "demo.csv"
    path.write_text("old")
    demonstrations = Demonstrations(
        np.zeros((2, 1)), np.array([0, 1]), np.zeros(2, int), feature_names=("a\nb",)
    )
    with pytest.raises(InputError, match="line break"):
        save_demonstrations(demonstrations, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_numbers_too_large_for_labels_in_arrays() -> None:
    actions = np.array([0, 2**64 - 1, 1, 0, 0], dtype=np.uint64)
    with pytest.raises(InputError, match=r"'actions' is 18446744073709551615 in row 2"):
        read_demonstrations(npz_bytes(**good_arrays() | {"actions": actions}), "demo.npz")


def test_huge_float_label() -> None:
    content = parquet_bytes(with_value("action", 2, 1e300))
    with pytest.raises(InputError, match=r"'action' is 1e\+300 in row 2"):
        read_demonstrations(content, "demo.parquet")


def test_shuffled_rows_are_named() -> None:
    with pytest.raises(InputError, match="'step' goes from 2 to 1 in row 3"):
        read_demonstrations(
            csv_bytes("0,0,1,1,0", "0,2,1,1,0", "0,1,1,1,1", header=HEADER), "demo.csv"
        )
    assert read_demonstrations(changed(3, "0,9,1,1,0"), "demo.csv").steps is not None
