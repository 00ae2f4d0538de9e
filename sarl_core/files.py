"""Writing files whole or not at all, and leaving nothing behind."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sarl_core.errors import InputError, WorkError, require

_TEMPORARY = ".sarl"
_LONGEST_STEM = 60  # of a file's name, so that what is put around it fits


def as_path(path: str | Path, *, ending: str = "") -> Path:
    """A path as a public name takes it.

    Args:
        path: Text, or a path.
        ending: What the name of a file to write has to end in; "" for anything.

    Returns:
        The path.

    Raises:
        InputError: If it is neither, or ends in something else.
    """
    require(path, (str, os.PathLike), "the path of a file must be text or a Path", "give one")
    if ending and Path(path).suffix.lower() != ending:
        raise InputError(f"{path} does not end in {ending}; give it this ending")
    return Path(path)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it takes the place of `path` when all went well.

    What killed processes left unfinished in its folder is removed.

    Args:
        path: The file that is to appear; its suffix is kept, because writers look at it.

    Yields:
        The path to write to.

    Raises:
        InputError: If the folder does not exist.
        WorkError: If the file cannot be written.
    """
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} does not exist; make it or choose another")
    _remove_abandoned(path.parent)
    unfinished = path.with_name(f".{path.stem[:_LONGEST_STEM]}.{_mark()}{path.suffix}")
    try:
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise WorkError(
            f"{path} cannot be written ({error.strerror or error}); choose another place"
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def temporary_folder() -> Iterator[None]:
    """Let everything that is put aside for a while lie in one folder, removed in the end.

    Libraries leave things behind when they are killed, and some always do (Stable-Baselines3 makes
    a folder a learner). What a killed process left is removed by the next one that begins.
    """
    shared = shared_temporary_folder()
    _remove_abandoned(shared)
    folder = shared / f"{_TEMPORARY}.{_mark()}"
    before = tempfile.tempdir, os.environ.get("TMPDIR")
    try:
        folder.mkdir(mode=0o700)
    except OSError:  # nothing can be put aside there; most work needs nothing of the kind
        yield
        return
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
    try:
        yield
    finally:
        tempfile.tempdir, variable = before
        if variable is None:
            del os.environ["TMPDIR"]
        else:
            os.environ["TMPDIR"] = variable
        shutil.rmtree(folder, ignore_errors=True)


def shared_temporary_folder() -> Path:
    """Where things are put aside that outlive this process."""
    folder = Path(tempfile.gettempdir())
    return folder.parent if folder.name.startswith(f"{_TEMPORARY}.unfinished-") else folder


def _mark() -> str:
    """What nobody else puts into a name, and what tells who did: the machine and the process."""
    return f"unfinished-{_machine()}-{os.getpid()}-{os.urandom(4).hex()}"


def _remove_abandoned(folder: Path) -> None:
    """Remove what processes of this machine that are no longer there left in a folder."""
    pattern = re.compile(rf"\..*\.unfinished-{_machine()}-(\d{{1,10}})-[0-9a-f]{{8}}(\..*)?")
    try:
        names = [entry.name for entry in os.scandir(folder)]
    except OSError:
        return
    for name in names:
        match = pattern.fullmatch(name)
        if match is not None and not _is_alive(int(match[1])):
            _remove(folder / name)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:  # somebody else's; it stays
        return


def _machine() -> str:
    """Processes are numbered on each machine anew, and a folder may be shared by several."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _is_alive(process: int) -> bool:
    if os.name != "posix":  # where asking with signal 0 would end it
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
