"""Writing files whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sarl_core.errors import InputError, WorkError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it takes the place of `path` when all went well.

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
    unfinished = path.with_name(f".{path.stem}.{os.getpid()}.{os.urandom(4).hex()}{path.suffix}")
    try:
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise WorkError(
            f"{path} cannot be written ({error.strerror or error}); choose another place"
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)
