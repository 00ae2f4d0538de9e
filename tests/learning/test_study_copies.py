"""A study's folder made anew of what was kept of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from sarl_core.errors import InputError
from sarl_core.learning.arms import arms_named
from sarl_core.learning.study import LearningPlan, run_study
from sarl_core.learning.study_copies import restore_study, study_contents
from sarl_core.learning.study_files import load_study


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    plan = LearningPlan("CartPole-v1", None, arms_named(["none"]), 300, (0,), episodes=2)
    run_study(plan, folder)
    return folder


def kept(folder: Path, store: Path) -> dict[str, Path]:
    """The files under names that say nothing, as a library has them."""
    store.mkdir()
    files = {}
    for number, (name, (path, ending)) in enumerate(
        study_contents(folder, load_study(folder)).items()
    ):
        files[name] = store / f"{number}{ending}"
        shutil.copyfile(path, files[name])
    return files


def test_a_folder_made_anew_holds_the_same_study(folder: Path, tmp_path: Path) -> None:
    files = kept(folder, tmp_path / "store")
    restore_study(tmp_path / "again", files)
    again, before = load_study(tmp_path / "again"), load_study(folder)
    assert again.complete
    assert again.settings == before.settings
    assert again.runs[0].alone == before.runs[0].alone
    for name, path in files.items():
        assert (tmp_path / "again" / name).read_bytes() == path.read_bytes()
    assert {Path(name).suffix for name in files} == {".json", ".csv", ".npz"}


@pytest.mark.parametrize(
    "name", ["../outside.json", "/etc/passwd", "runs/../../x-0.json", "log.txt", "runs/a-0.npz"]
)
def test_nothing_is_written_that_is_no_file_of_a_study(
    folder: Path, tmp_path: Path, name: str
) -> None:
    files = kept(folder, tmp_path / "store")
    with pytest.raises(InputError, match="no file of a study"):
        restore_study(tmp_path / "again", files | {name: next(iter(files.values()))})
    assert not (tmp_path / "again").exists()


def test_without_a_plan_there_is_no_study(folder: Path, tmp_path: Path) -> None:
    files = kept(folder, tmp_path / "store")
    del files["plan.json"]
    with pytest.raises(InputError, match="lacks its plan"):
        restore_study(tmp_path / "again", files)
