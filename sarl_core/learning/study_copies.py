"""What is finished of a study as files to be kept elsewhere, and a study's folder made of them."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from sarl_core.errors import InputError, WorkError, quoted
from sarl_core.files import whole_file
from sarl_core.learning.study_files import (
    COMPARED,
    CURVES,
    PLAN,
    POLICIES,
    RESULTS,
    RUNS,
    LearningStudy,
    make_folder,
    policy_path,
    run_path,
)

_SINGLE = (RESULTS, CURVES, COMPARED, "rules.json")
_NAME = re.compile(rf"{RUNS}/[a-z0-9_-]+-\d+\.json|{POLICIES}/[a-z0-9_-]+-\d+\.npz")


def study_contents(folder: Path, study: LearningStudy) -> dict[str, tuple[Path, str]]:
    """The files of a study that change no more; `restore_study` makes a folder of them.

    Args:
        folder: Of the study.
        study: As it stands.

    Returns:
        By their paths in the folder, each with the ending of its name.
    """
    runs = study.finished
    paths = [
        folder / PLAN,
        *(folder / name for name in _SINGLE),
        *(run_path(folder, run.arm, run.seed) for run in runs),
        *(policy_path(folder, run.arm, run.seed) for run in runs),
    ]
    return {
        path.relative_to(folder).as_posix(): (path, path.suffix) for path in paths if path.is_file()
    }


def restore_study(folder: Path, files: Mapping[str, Path]) -> None:
    """Make the folder of a study anew.

    Args:
        folder: That the study had; there is none, or none with a plan.
        files: What `study_contents` named, by the paths in the folder, wherever they lie now.

    Raises:
        InputError: If a path is of no study, or the folder cannot be made.
        WorkError: If it cannot be written to.
    """
    if PLAN not in files:
        raise InputError("what is kept of the study lacks its plan; let it learn again")
    for name in files:
        if name not in (PLAN, *_SINGLE) and not _NAME.fullmatch(name):
            raise InputError(f"{quoted(name)} is no file of a study; let it learn again")
    make_folder(folder)
    try:
        # Without its plan it is no study yet: who looks in meanwhile sees none.
        for name in sorted(files, key=lambda name: name == PLAN):
            with whole_file(folder / name) as unfinished:
                shutil.copyfile(files[name], unfinished)
    except OSError as error:
        raise WorkError(
            f"{folder} cannot be written ({error.strerror or error}); make room there"
        ) from error
