"""What stands in an HDF5 file, and nothing that stands elsewhere: no link is followed.

A file of a few bytes can declare any size, name other files, or ask for filters that are plug-ins;
so what a data set says of itself is looked at before anything of it is read.
"""

from __future__ import annotations

import io
import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError, quoted
from sarl_core.limits import read_limit, require_memory

MAGIC = b"\x89HDF"
_MOST_ENTRIES = 200_000
_DEFLATE, _SHUFFLE, _CHECKSUM, _LZF = 1, 2, 3, 32000
_FILTERS = (_DEFLATE, _SHUFFLE, _CHECKSUM, _LZF)
_MOST_PACKED = {_DEFLATE: 1100, _LZF: 100}  # times that zeros become smaller
_MARGIN = 4096  # bytes; a checksum may follow
_PART = 2**22  # bytes that are unpacked at once


class Hdf5Content:
    """An opened file, and how much has been read of it.

    Args:
        file: The ``h5py.File``.
        size: Bytes of the file.
    """

    def __init__(self, file: Any, size: int) -> None:
        self.root = file
        self._size = self._taken = size

    def names_in(self, group: Any) -> tuple[str, ...]:
        """What stands in a group, under which names.

        Args:
            group: A ``h5py.Group``.

        Returns:
            The names.

        Raises:
            InputError: If there are far too many.
        """
        with _refusing_damage():
            if len(group) > _MOST_ENTRIES:
                raise InputError(f"there are {len(group):,} entries in it; give a smaller file")
            names = tuple(group)
            if not all(isinstance(name, str) for name in names):  # bytes that are no text
                raise ValueError("a name is no text")
            return names

    def entry_of(self, group: Any, name: str) -> Any:
        """What stands under a name.

        Args:
            group: A ``h5py.Group``.
            name: In it.

        Returns:
            A ``h5py.Group`` or a ``h5py.Dataset``; None if there is nothing.

        Raises:
            InputError: If it is a link to somewhere else.
        """
        import h5py

        with _refusing_damage():
            link = group.get(name, getlink=True)
            if link is None:
                return None
            if not isinstance(link, h5py.HardLink):
                raise InputError(
                    f"{quoted(name)} is a link to another place, which is not followed; save the "
                    "data themselves in the file"
                )
            return group[name]

    def is_group(self, entry: Any) -> bool:
        """Whether an entry holds others."""
        import h5py

        return isinstance(entry, h5py.Group)

    def array_of(
        self, dataset: Any, name: str, *, room: int = 1, texts: bool = False
    ) -> NDArray[Any]:
        """The numbers of a data set, or its texts.

        Args:
            dataset: A ``h5py.Dataset``.
            name: What it is called in messages.
            room: How often it will be held at once.
            texts: Whether it may hold those, of one length or of any.

        Returns:
            The array; of texts as objects, as one long text would make all of them wide.

        Raises:
            InputError: If it is none, holds anything else, lies elsewhere, is packed by a filter
                that is not read, or is too large.
        """
        import h5py

        with _refusing_damage():
            if not isinstance(dataset, h5py.Dataset):
                raise InputError(f"{quoted(name)} is no array of numbers; save it as one")
            kind = dataset.dtype
            of_texts = texts and h5py.check_string_dtype(kind) is not None
            if kind.kind not in "biuf" and not of_texts:
                raise InputError(
                    f"{quoted(name)} holds {_said(kind)}, which are no numbers; save plain numbers"
                )
            if dataset.is_virtual or dataset.external:
                raise InputError(
                    f"{quoted(name)} lies in another file, which is not opened; save the data "
                    "themselves in this one"
                )
            self._taken += room * math.prod(dataset.shape or ()) * kind.itemsize
            require_memory(self._taken)
            _require_readable(dataset, name, self._taken)
            return self._texts_of(dataset, name) if of_texts else np.asarray(dataset[()])

    def _texts_of(self, dataset: Any, name: str) -> NDArray[Any]:
        """Texts, of which many places can name one long one: read in parts, each kept once."""
        values = np.empty(dataset.shape, dtype=object)
        if not values.size:
            return values.astype(np.str_)
        longest = self._size if dataset.dtype.hasobject else dataset.dtype.itemsize
        longest *= math.prod(values.shape[1:])
        require_memory(self._taken + longest)
        rows = max(1, read_limit() // 4 // longest)
        known: dict[bytes, str] = {}
        for start in range(0, len(values) if values.ndim else 1, rows):
            place = slice(start, start + rows) if values.ndim else ()
            part = np.asarray(dataset[place])
            for text in part.reshape(-1):
                if text not in known:
                    self._taken += 2 * len(text)
                    require_memory(self._taken)
                    known[text] = _decoded(text, name)
            flat = [known[text] for text in part.reshape(-1)]
            values[place] = np.array(flat, dtype=object).reshape(part.shape)
        return values


@contextmanager
def opened_hdf5(data: memoryview) -> Iterator[Hdf5Content]:
    """Open an HDF5 file.

    Args:
        data: The whole file.

    Yields:
        Its content, to be read inside the block.

    Raises:
        InputError: If it is damaged, found here or where it is read.
    """
    import h5py

    with _refusing_damage():
        file = h5py.File(io.BytesIO(data), "r")
    try:
        yield Hdf5Content(file, len(data))
    finally:
        file.close()


def _require_readable(dataset: Any, name: str, taken: int) -> None:
    """Refuse filters that are not read, and chunks that unpack to more than they say."""
    filters = dataset.id.get_create_plist()
    codes = [filters.get_filter(index)[0] for index in range(filters.get_nfilters())]
    other = next((code for code in codes if code not in _FILTERS), None)
    if other is not None:
        raise InputError(
            f"{quoted(name)} is packed by a filter that is not read (number {other}); save it with "
            "gzip, or with none"
        )
    if dataset.chunks is None:
        return
    chunk = math.prod(dataset.chunks) * dataset.id.get_type().get_size()
    require_memory(taken + chunk)
    packers = [code for code in codes if code in (_DEFLATE, _LZF)]
    if len(packers) > 1:
        raise InputError(f"{quoted(name)} is packed twice; save it with gzip, or with none")
    if not packers:
        return
    stored: list[Any] = []
    dataset.id.chunk_iter(stored.append)
    for part in stored:
        if part.size * _MOST_PACKED[packers[0]] <= max(read_limit() // 4, 2 * chunk):
            continue
        if packers[0] == _LZF:
            require_memory(taken + part.size * _MOST_PACKED[_LZF])
        elif _longer_than(dataset.id.read_direct_chunk(part.chunk_offset)[1], chunk):
            raise InputError("it is damaged: a part of it unpacks to more than it says")


def _decoded(text: bytes, name: str) -> str:
    try:
        return text.decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{quoted(name)} holds texts that are not UTF-8; save them so") from error


def _longer_than(packed: bytes, size: int) -> bool:
    unpacker = zlib.decompressobj()
    left = size + _MARGIN
    while packed and left > 0:
        part = unpacker.decompress(packed, min(left, _PART))
        left -= len(part)
        packed = unpacker.unconsumed_tail
        if not part:
            break
    return left <= 0


@contextmanager
def _refusing_damage() -> Iterator[None]:
    """Turn what h5py raises on a damaged file into one sentence."""
    try:
        yield
    except InputError:
        raise
    except (
        OSError,
        KeyError,
        RuntimeError,
        ValueError,
        TypeError,
        OverflowError,
        AttributeError,
        zlib.error,
    ) as error:
        raise InputError("it is damaged or cut off; save or download it again") from error


def _said(kind: np.dtype[Any]) -> str:
    return "texts or Python objects" if kind.hasobject else f"values of the type {quoted(kind)}"
