"""Several files as one set: folders, archives, patterns, and files that are given together."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, save_demonstrations
from sarl_core.demonstrations.formats import (
    ColumnMap,
    load_demonstrations,
    read_demonstrations,
    read_files,
    table_columns,
)
from sarl_core.errors import InputError
from sarl_core.limits import READ_LIMIT
from tests.bad_inputs import npz_bytes


def run(number: int, rows: int = 3) -> bytes:
    """A run whose states say which it is."""
    body = "".join(f"{number},{row / 2},{row % 2}\n" for row in range(rows))
    return f"obs_x,obs_y,action\n{body}".encode()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "runs"
    place.mkdir()
    for number in (10, 2, 1):
        (place / f"run_{number}.csv").write_bytes(run(number, 3 + number % 2))
    return place


def archive(entries: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as made:
        for name, content in entries.items():
            made.writestr(name, content)
    return out.getvalue()


def test_a_file_an_episode_in_the_natural_order_of_their_names(folder: Path) -> None:
    (folder / "README.md").write_text("by hand")
    (folder / ".hidden.csv").write_text("x")
    read = load_demonstrations(folder)
    assert read.observations[:, 0].tolist() == [1, 1, 1, 1, 2, 2, 2, 10, 10, 10]
    assert read.episodes.tolist() == [0, 0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert any("each begins an episode" in note for note in read.notes)
    assert ("episode", "episode number") in [(one.column, one.use) for one in read.columns]


def test_a_folder_a_pattern_several_paths_an_archive_and_uploads_are_the_same(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digest = load_demonstrations(folder).digest
    paths = sorted(folder.glob("*.csv"))
    files = [(path.read_bytes(), path.name) for path in paths]
    zipped = archive({f"runs/{name}": content for content, name in files})
    (folder.parent / "runs.zip").write_bytes(zipped)
    assert load_demonstrations(f"{folder}/run_*.csv").digest == digest
    assert load_demonstrations(paths).digest == digest
    assert load_demonstrations(folder.parent / "runs.zip").digest == digest
    assert read_files(files).digest == digest
    assert read_files([(zipped, "runs.zip")]).digest == digest
    assert read_demonstrations(zipped, "runs.zip").digest == digest
    monkeypatch.chdir(folder.parent)
    assert load_demonstrations("r*s/run_*.csv").digest == digest
    assert load_demonstrations([paths[0]]).digest == load_demonstrations(paths[0]).digest


def test_columns_of_a_set_can_be_mapped(folder: Path) -> None:
    names = ("obs_x", "obs_y", "action", "episode")
    assert table_columns(folder) == names
    assert table_columns([(run(1), "a.csv"), (run(2), "b.csv")]) == names
    columns = ColumnMap(("obs_y",), ("action",), episode="episode")
    read = load_demonstrations(folder, columns=columns)
    assert read.observations.shape == (10, 1)
    assert read.n_episodes == 3
    one = load_demonstrations(folder, columns=ColumnMap(("obs_y",), ("action",)))
    assert one.n_episodes == 1


def test_marks_and_steps_within_a_file_begin_episodes_too(tmp_path: Path) -> None:
    done = b"obs_x,done,action\n1,0,0\n1,1,1\n2,0,0\n2,0,1\n"
    steps = b"obs_x,step,action\n1,0,0\n1,1,1\n2,0,0\n2,1,1\n"
    for number, content in enumerate((done, steps)):
        files = [(content, "a.csv"), (content.replace(b"\n1", b"\n3"), "b.csv")]
        read = read_files(files)
        assert read.episodes.tolist() == [0, 0, 1, 1, 2, 2, 3, 3], number


def numbered(*episodes: int) -> bytes:
    rows = "".join(f"{number},{row / 4},{row % 2}\n" for row, number in enumerate(episodes))
    return f"episode,obs_x,action\n{rows}".encode()


@pytest.mark.parametrize(
    ("first", "second", "episodes"),
    [
        ((0, 0, 1), (1, 1, 2), [0, 0, 1, 1, 1, 2]),  # one table that was cut
        ((0, 0, 1), (0, 1, 1), [0, 0, 1, 2, 3, 3]),  # each numbers its own
        ((0, 0, 0), (0, 0, 0), [0, 0, 0, 1, 1, 1]),
        ((3, 3, 3), (5, 5, 5), [3, 3, 3, 5, 5, 5]),
    ],
)
def test_numbers_of_episodes_go_on_or_begin_again(
    first: tuple[int, ...], second: tuple[int, ...], episodes: list[int]
) -> None:
    read = read_files([(numbered(*first), "a.csv"), (numbered(*second), "b.csv")])
    assert np.unique(read.episodes, return_inverse=True)[1].tolist() == (
        np.unique(episodes, return_inverse=True)[1].tolist()
    )


def test_parquet_that_was_saved_here_keeps_its_names(tmp_path: Path) -> None:
    for number in range(2):
        demonstrations = Demonstrations(
            np.full((4, 1), number), [0, 1, 0, 1], [0, 0, 1, 1], feature_names=("gap",)
        )
        save_demonstrations(demonstrations, tmp_path / f"part-{number}.parquet")
    read = load_demonstrations(tmp_path)
    assert read.feature_names == ("gap",)
    assert read.n_episodes == 4


def test_files_whose_columns_differ_are_named(folder: Path) -> None:
    (folder / "run_2.csv").write_bytes(run(2).replace(b"obs_y", b"obs_z"))
    with pytest.raises(InputError, match=r"run_2\.csv: it has no column 'obs_y', and 'run_1\.csv'"):
        load_demonstrations(folder)
    (folder / "run_2.csv").write_bytes(b"obs_z,obs_y,obs_x,action\n1,1,2,0\n")
    with pytest.raises(InputError, match=r"run_2\.csv: it has a column 'obs_z', and"):
        load_demonstrations(folder)
    (folder / "run_2.csv").write_bytes(b"action,obs_y,obs_x\n0,0.5,2\n1,1,2\n")
    assert load_demonstrations(folder).observations[4].tolist() == [2, 0.5]
    (folder / "run_2.csv").write_bytes(b"0,1,2\n")
    with pytest.raises(InputError, match=r"run_2\.csv: it has no header"):
        load_demonstrations(folder)
    (folder / "run_2.csv").write_bytes(run(2).replace(b"0.5", b"left"))
    with pytest.raises(InputError, match=r"run_2\.csv: column 'obs_y' holds 'left' in row 2"):
        load_demonstrations(folder)


@pytest.mark.parametrize("numbered", ["run_1.csv", "run_2.csv"])
@pytest.mark.parametrize("name", ["", "Unnamed: 0", "index"])
def test_row_numbers_that_a_data_frame_wrote_along_need_not_be_in_all(
    folder: Path, numbered: str, name: str
) -> None:
    digest = load_demonstrations(folder).digest
    header, *rows = (folder / numbered).read_text().splitlines()
    lines = [f"{name},{header}", *(f"{7 * place},{row}" for place, row in enumerate(rows))]
    (folder / numbered).write_text("\n".join(lines) + "\n")
    assert load_demonstrations(folder).digest == digest
    with pytest.raises(InputError, match="there is no column 'index'"):
        load_demonstrations(folder, columns=ColumnMap(("index", "obs_x", "obs_y"), ("action",)))


def test_files_of_several_formats_are_refused(folder: Path) -> None:
    (folder / "x.jsonl").write_bytes(b'{"obs_x": 1, "action": 0}\n')
    with pytest.raises(InputError, match=r"several formats, CSV \('run_1\.csv'\) and JSON lines"):
        load_demonstrations(folder)


def test_paths_that_are_not_there(folder: Path) -> None:
    with pytest.raises(InputError, match="no file has a name of this pattern"):
        load_demonstrations(folder / "no_*.csv")
    with pytest.raises(InputError, match="does not exist; give files, or one folder"):
        load_demonstrations([folder / "run_1.csv", folder / "run_3.csv"])
    with pytest.raises(InputError, match="is a folder; give files, or one folder"):
        load_demonstrations([folder / "run_1.csv", folder])
    with pytest.raises(InputError, match=r"two of the files are called 'a\.csv'"):
        read_files([(run(1), "a.csv"), (run(2), "a.csv")])


def test_a_pair_in_an_archive_and_an_archive_of_one_file() -> None:
    pair = {"d/obs.csv": b"0.5;1.5\n0.25;1.0\n0.1;0.2\n", "d/actions.csv": b"0\n1\n0\n"}
    assert read_demonstrations(archive(pair), "demo.zip").actions.tolist() == [0, 1, 0]
    arrays = npz_bytes(obs=np.ones((4, 2)), acts=np.array([0, 1, 0, 1]))
    assert len(read_demonstrations(archive({"demo.npz": arrays}), "demo.zip")) == 4
    assert len(read_demonstrations(archive({"a/run.csv": run(1)}), "demo.zip")) == 3


HOSTILE = {
    "a path that leads out": (archive({"../run.csv": run(1)}), "leads out of the archive"),
    "a path from the root": (archive({"/etc/run.csv": run(1)}), "leads out of the archive"),
    "a path of Windows": (archive({"C:\\run.csv": run(1)}), "leads out of the archive"),
    "a bomb": (archive({"run.csv": bytes(2 * 10**8)}), "it unpacks to"),
    "another compression": (archive({"run.csv": run(1)}, zipfile.ZIP_LZMA), "compressed in a way"),
    "nothing": (archive({}), "it is an archive without obs.csv"),
    "nothing of use": (archive({"a.txt": b"a"}), "it is an archive without obs.csv"),
    "an archive in an archive": (
        archive({"a.zip": archive({"run.csv": run(1)})}),
        "an archive wit",
    ),
    "half of it": (archive({"run.csv": run(1)})[:60], "damaged or cut off"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_archives_that_mean_harm_are_one_sentence(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(READ_LIMIT, "0.125")
    content, reason = HOSTILE[name]
    with pytest.raises(InputError, match=reason) as error:
        read_demonstrations(content, "demo.zip")
    assert "\n" not in str(error.value)
    path = tmp_path / "demo.zip"
    path.write_bytes(content)
    with pytest.raises(InputError, match=reason):
        load_demonstrations(path)
    assert list(tmp_path.iterdir()) == [path]
