"""Files appear whole or not at all, and what a killed process left is removed by the next."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from sarl_core.errors import WorkError
from sarl_core.files import shared_temporary_folder, temporary_folder, whole_file

BEGIN = """
import os, signal, sys, tempfile
from pathlib import Path
from sarl_core.files import temporary_folder, whole_file
with temporary_folder(), whole_file(Path(sys.argv[1])) as unfinished:
    unfinished.write_text("half")
    (Path(tempfile.gettempdir()) / "left").mkdir()
    if sys.argv[2] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    print("ready", flush=True)
    sys.stdin.readline()
"""


def begin(file: Path, how: str) -> subprocess.Popen[str]:
    """A process that is in the middle of writing a file."""
    return subprocess.Popen(
        [sys.executable, "-c", BEGIN, str(file), how],
        env={**os.environ, "TMPDIR": str(file.parent)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def test_what_a_killed_process_left_is_removed_by_the_next(folder: Path) -> None:
    file = folder / "rules.json"
    begin(file, "die").communicate()
    assert len(list(folder.iterdir())) == 2
    other = folder / "another.csv"
    with temporary_folder(), whole_file(other) as unfinished:
        unfinished.write_text("whole")
    assert list(folder.iterdir()) == [other]
    assert other.read_text() == "whole"


def test_what_a_living_process_writes_stays(folder: Path) -> None:
    file = folder / "rules.json"
    process = begin(file, "wait")
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    theirs = set(folder.iterdir())
    with temporary_folder(), whole_file(file) as unfinished:
        unfinished.write_text("ours")
    assert set(folder.iterdir()) == theirs | {file}
    process.communicate("go on\n")
    assert list(folder.iterdir()) == [file]
    assert file.read_text() == "half"


def test_files_of_others_with_like_names_stay(folder: Path) -> None:
    others = [
        folder / ".rules.json",
        folder / ".rules.1.deadbeef.json",
        folder / ".sarl.unfinished-x",
    ]
    for other in others:
        other.write_text("mine")
    with temporary_folder(), whole_file(folder / "rules.json") as unfinished:
        unfinished.write_text("whole")
    assert set(folder.iterdir()) == {*others, folder / "rules.json"}


def test_a_name_as_long_as_names_may_be_can_be_written(tmp_path: Path) -> None:
    file = tmp_path / ("x" * 250 + ".json")
    with whole_file(file) as unfinished:
        unfinished.write_text("whole")
    assert list(tmp_path.iterdir()) == [file]


def test_what_fails_leaves_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "rules.json"
    file.write_text("old")

    def write() -> None:
        with whole_file(file) as unfinished:
            unfinished.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(WorkError, match="No space left"):
        write()
    assert (file.read_text(), list(tmp_path.iterdir())) == ("old", [file])


def test_what_is_put_aside_lies_in_one_folder_that_goes(folder: Path) -> None:
    with temporary_folder():
        own = Path(tempfile.gettempdir())
        assert own.parent == shared_temporary_folder() == folder
        assert os.environ["TMPDIR"] == str(own)
        (own / "left").write_text("by a library")
    assert (tempfile.gettempdir(), os.environ["TMPDIR"]) == (str(folder), str(folder))
    assert list(folder.iterdir()) == []


def test_work_goes_on_where_nothing_can_be_put_aside(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(folder / "missing"))
    with temporary_folder():
        assert tempfile.gettempdir() == str(folder / "missing")
