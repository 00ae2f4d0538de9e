"""Large arrays for other processes of this machine: written to a file once, and shared by all."""

from __future__ import annotations

import os
import pickle
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LEAST = 2**22  # bytes of an array that is worth a file
_FILES: dict[int, Path] = {}
"""Where arrays stand that were handed over, by their identity."""
_LOCK = Lock()


def handed_over(array: NDArray[Any]) -> Any:
    """What `pickle` makes of an array, for `copyreg` and the like.

    Args:
        array: Any. A large one that nobody can change goes by a file, which is removed with it:
            however often it is handed over, and to however many processes, it is there once.

    Returns:
        A function and its arguments, which give the array again.
    """
    if array.nbytes >= _LEAST and _is_fixed(array) and not array.dtype.hasobject:
        with suppress(OSError):  # no room for a file: then as all others
            return _opened, (_file_of(array),)
    return array.__reduce_ex__(pickle.HIGHEST_PROTOCOL)


def shared(array: NDArray[Any]) -> NDArray[Any]:
    """The same numbers where other processes find them, and in their memory and here only once.

    Args:
        array: Any.

    Returns:
        Of a large one that nobody can change, what stands in its file; else the array itself.
    """
    if not (array.nbytes >= _LEAST and _is_fixed(array) and not array.dtype.hasobject):
        return array
    try:
        path = _written(array)
    except OSError:  # no room for a file
        return array
    opened = _opened(path)
    with _LOCK:
        _remember(opened, path)
    return opened


def is_shared(array: NDArray[Any]) -> bool:
    """Whether an array is what `shared` gave: nobody can change it, though it owns no memory."""
    return id(array) in _FILES and array.base is not None


def _is_fixed(array: Any) -> bool:
    """Whether nobody can change an array, nor what it is a view of."""
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return False
        array = array.base
    return True


def _file_of(array: NDArray[Any]) -> Path:
    with _LOCK:
        if id(array) not in _FILES or not _FILES[id(array)].exists():
            _remember(array, _written(array))
        return _FILES[id(array)]


def _written(array: NDArray[Any]) -> Path:
    """A new file of an array."""
    handle, name = tempfile.mkstemp(suffix=".npy")
    path = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            np.save(file, array, allow_pickle=False)
    except OSError:
        path.unlink()
        raise
    return path


def _remember(array: NDArray[Any], path: Path) -> None:
    """Know where an array stands, for as long as it is there."""
    if id(array) not in _FILES:
        weakref.finalize(array, _remove, id(array))
    _FILES[id(array)] = path


def _remove(identity: int) -> None:
    with suppress(OSError):  # where a process has it open that ends later; its folder goes then
        _FILES.pop(identity).unlink()


def _opened(path: Path) -> NDArray[Any]:
    # What stands in a file is mapped, so all processes look at the same memory.
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
