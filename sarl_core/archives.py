"""Arrays in ZIP archives, as NumPy writes them: nothing unpickled, never more than is expected.

What an archive says of itself is held against the limit before anything is unpacked, and then
nothing is unpacked beyond what it said.
"""

from __future__ import annotations

import io
import lzma
import math
import struct
import sys
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError, quoted

_HEADER = 2**16  # bytes that the header of an array is looked for in; NumPy's own have 128
_DIRECTORY = 2**22  # bytes of an archive's list of entries, of which each takes a hundred
_CHUNK = 2**22  # bytes that are unpacked at once
_END = 2**16 + 100  # of the archive, in which that list's size stands
_SIZES = ((b"PK\x05\x06", 12, 4), (b"PK\x06\x06", 40, 8))  # where, after these signs


class Promise(NamedTuple):
    """What an array will be, before it is unpacked.

    Attributes:
        shape: Its shape.
        dtype: Of its numbers, never of objects.
        fortran: Whether it lies there column by column.
        start: Where its numbers begin in the entry.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    start: int


@contextmanager
def opened(content: bytes | memoryview) -> Iterator[zipfile.ZipFile]:
    """Open an archive.

    Args:
        content: The whole file.

    Yields:
        The archive, to be read by `entry_content` and `array_of` inside the block.

    Raises:
        InputError: If it is no archive or is damaged, found here or inside the block.
    """
    end = bytes(content[-_END:])
    for sign, after, width in _SIZES:
        at = end.find(sign)
        while at >= 0:
            size = int.from_bytes(end[at + after : at + after + width], "little")
            if size > _DIRECTORY:
                raise InputError(
                    "it is damaged, or an archive of far too many files; save it again"
                )
            at = end.find(sign, at + 1)
    try:
        # BytesIO copies nothing that is already bytes.
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            yield archive
    except (
        zipfile.BadZipFile,
        zlib.error,
        lzma.LZMAError,
        struct.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        OverflowError,
        IndexError,
    ) as error:
        # All of these come from zipfile, ValueError for offsets that lie outside the file.
        raise InputError("it is damaged or cut off; save or download it again") from error


def entry_content(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, size: int) -> bytes:
    """What an entry begins with.

    Args:
        archive: That holds it.
        entry: The entry.
        size: How many bytes at most.

    Returns:
        So many bytes, or all there are.

    Raises:
        InputError: If it is encrypted, or compressed in another way than NumPy does.
    """
    if entry.flag_bits & 1:
        raise InputError(
            f"its entry {quoted(entry.filename)} is encrypted; save it without a password"
        )
    # Others would be unpacked whole, whatever size is asked for.
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise InputError(
            f"its entry {quoted(entry.filename)} is compressed in a way that is not read; save it "
            "with the usual one of ZIP files (deflate), or with none"
        )
    with archive.open(entry) as file:
        return file.read(size)


def arrays_in(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The entries that hold arrays, by the arrays' names."""
    return {
        info.filename.removesuffix(".npy"): info
        for info in archive.infolist()
        if info.filename.endswith(".npy")
    }


def promise_of(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Promise:
    """What an array will be.

    Args:
        archive: That holds it.
        entry: The array's.

    Returns:
        The promise; the entry has as many bytes as it takes, or says so.

    Raises:
        InputError: If it is no array, of objects, or the entry is shorter or longer.
    """
    name = quoted(entry.filename.removesuffix(".npy"))
    header = io.BytesIO(entry_content(archive, entry, _HEADER))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of headers that Python 2 wrote
            shape, fortran, dtype = _header(header)
    except Exception as error:  # whatever NumPy meets in a damaged header
        raise InputError(f"the array {name} cannot be read as NumPy's; save it again") from error
    if dtype.hasobject:
        raise InputError(
            f"the array {name} holds Python objects (a pickle), which may run code and are never "
            "opened; save plain numbers"
        )
    promise = Promise(tuple(shape), dtype, fortran, header.tell())
    if (
        any(size < 0 for size in promise.shape)
        or math.prod(promise.shape) * dtype.itemsize != entry.file_size - promise.start
    ):
        raise _damaged(entry)
    return promise


def _header(file: BinaryIO) -> Any:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(file)
    return np.lib.format.read_array_header_2_0(file)


def array_of(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, promise: Promise) -> NDArray[Any]:
    """An array, unpacked.

    Args:
        archive: That holds it.
        entry: The array's.
        promise: What it will be.

    Returns:
        The array.

    Raises:
        InputError: If it is not what was promised.
    """
    try:
        array = np.empty(promise.shape, promise.dtype, order="F" if promise.fortran else "C")
    except ValueError as error:  # of dimensions that are too large beside one of 0
        raise _damaged(entry) from error
    # Unpacked to where it stays: in one piece, zlib would take the memory twice.
    free = array.ravel(order="K").view(np.uint8) if array.nbytes else np.empty(0, dtype=np.uint8)
    with archive.open(entry) as file:
        file.read(promise.start)
        while len(free) and (chunk := file.read(min(len(free), _CHUNK))):
            free[: len(chunk)] = np.frombuffer(chunk, dtype=np.uint8)
            free = free[len(chunk) :]
        if len(free) or file.read(1):
            raise _damaged(entry)
    # Python does not look at the signs of a text that NumPy hands it, and fails on it later.
    if array.dtype.kind == "U" and array.nbytes:
        signs = array.ravel().view(array.dtype.byteorder + "u4")
        if int(signs.max()) > sys.maxunicode:
            raise _damaged(entry)
    return array


def _damaged(entry: zipfile.ZipInfo) -> InputError:
    name = quoted(entry.filename.removesuffix(".npy"))
    return InputError(f"the array {name} is cut off or damaged; save it again")
