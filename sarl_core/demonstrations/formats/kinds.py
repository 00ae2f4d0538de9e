"""What a single file is, by the ending of its name and by how it begins."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import BinaryIO

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.arrow.parquet_file import MAGIC, open_parquet, write_parquet
from sarl_core.demonstrations.formats.arrow.table import FILE_MAGIC, STREAM_MAGIC, open_arrow
from sarl_core.demonstrations.formats.hdf5.content import MAGIC as HDF5_MAGIC
from sarl_core.demonstrations.formats.hdf5.layouts import read_hdf5
from sarl_core.demonstrations.formats.npz_file import read_npz, write_npz
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.texts.csv_file import open_csv, write_csv
from sarl_core.demonstrations.formats.texts.excel_file import open_excel
from sarl_core.demonstrations.formats.texts.json_file import open_json, open_json_lines
from sarl_core.errors import InputError
from sarl_core.limits import require_memory

GZIP = ".gz"
ZIP = ".zip"
_CHUNK = 2**22  # bytes that are unpacked at once


@dataclass(frozen=True)
class FileFormat:
    """How files of one extension are read and written.

    Attributes:
        kind: What such a file is, in words.
        open_table: Opens a file with named columns; None where there are none.
        read: Reads a file without; None where there is `open_table`.
        write: Writes demonstrations; None where they are not written so.
        text: Whether it is text, which begins with anything.
    """

    kind: str
    open_table: Callable[[memoryview], Table] | None = None
    read: Callable[[memoryview], Recording] | None = None
    write: Callable[[Demonstrations, BinaryIO], None] | None = None
    text: bool = False


_ARROW = FileFormat("Arrow", open_arrow)
_HDF5 = FileFormat("HDF5", read=read_hdf5)
_LINES = FileFormat("JSON lines", open_json_lines, text=True)
FORMATS = {
    ".parquet": FileFormat("Parquet", open_parquet, write=write_parquet),
    ".csv": FileFormat("CSV", open_csv, write=write_csv, text=True),
    ".npz": FileFormat("NPZ", read=read_npz, write=write_npz),
    ".tsv": FileFormat("TSV", open_csv, text=True),
    ".jsonl": _LINES,
    ".ndjson": _LINES,
    ".json": FileFormat("JSON", open_json, text=True),
    ".arrow": _ARROW,
    ".feather": _ARROW,
    ".ipc": _ARROW,
    ".xlsx": FileFormat("Excel", open_excel),
    ".hdf5": _HDF5,
    ".h5": _HDF5,
}
EXTENSIONS = (*FORMATS, ZIP)
WRITTEN = tuple(extension for extension, form in FORMATS.items() if form.write is not None)

_IS_ARROW = (".arrow", ".feather", ".ipc")
_PICKLE = "a pickle, which may run code and is never opened"
# How a file begins, what that makes it, and the extensions it may have then.
_SIGNATURES: tuple[tuple[bytes, str, tuple[str, ...]], ...] = (
    (MAGIC, "Parquet", (".parquet",)),
    (b"PK\x03\x04", "a ZIP archive", (".npz", ".xlsx", ZIP)),
    (b"PK\x05\x06", "a ZIP archive", (".npz", ".xlsx", ZIP)),
    (b"\x93NUMPY", "a single NumPy array", ()),
    (HDF5_MAGIC, "HDF5", (".hdf5", ".h5")),
    (b"\x1f\x8b", "compressed with gzip", (GZIP,)),
    (FILE_MAGIC, "Arrow", _IS_ARROW),
    (STREAM_MAGIC, "Arrow", _IS_ARROW),
    (b"FEA1", "the first version of Feather, which nobody writes any more", ()),
    (b"\xd0\xcf\x11\xe0", "an old or encrypted Excel workbook", ()),
    *((bytes([0x80, version]), _PICKLE, ()) for version in (2, 3, 4, 5)),
)


def extension_of(name: str) -> str:
    """The ending that says what a file is, without one that says that it is compressed."""
    path = PurePath(name)
    inner = path.suffix.lower()
    return PurePath(path.stem).suffix.lower() if inner == GZIP else inner


def format_of(name: str) -> FileFormat:
    """How a file is read.

    Args:
        name: Of the file.

    Returns:
        Its format.

    Raises:
        InputError: If its ending is none that is known.
    """
    extension = extension_of(name)
    if extension not in FORMATS:
        says = f"ends in {extension!r}" if extension else "has no extension"
        raise InputError(
            f"it {says}, which is none of {', '.join(EXTENSIONS)}; if it is a table in text, name "
            "it .csv, else convert it"
        )
    return FORMATS[extension]


def unpacked(content: memoryview, name: str) -> memoryview:
    """The content of a file, which is what its ending says.

    Args:
        content: The whole file.
        name: Its name.

    Returns:
        The content, without the compression of gzip.

    Raises:
        InputError: If it is something else, damaged, or unpacks to too much.
    """
    extension = PurePath(name).suffix.lower()
    _check_signature(content, extension)
    if extension != GZIP:
        return content
    inner = extension_of(name)
    content = _decompressed(content)
    if inner in EXTENSIONS:
        _check_signature(content, inner)
    return content


def _check_signature(content: memoryview, extension: str) -> None:
    """Refuse a file whose content is not what its extension says."""
    if len(content) == 0:
        raise InputError("it is empty (0 bytes); save or download it again")
    signature = next(
        (entry for entry in _SIGNATURES if bytes(content[:6]).startswith(entry[0])), None
    )
    form = FORMATS.get(extension)
    kind = form.kind if form is not None else {GZIP: "compressed with gzip"}.get(extension, "ZIP")
    if signature is not None and extension not in signature[2]:
        _, what, right = signature
        cure = f"name it {right[0]}" if right else f"save it as {EXTENSIONS[0]} or {kind}"
        raise InputError(f"it is named {extension}, but its content is {what}; {cure}")
    if signature is None and not (form is not None and form.text):
        raise InputError(
            f"it is named {extension}, but its content is not {kind}; if it is text, name it .csv"
        )


def _decompressed(content: memoryview) -> memoryview:
    """What gzip packed, and never more than is read of any file."""
    parts: list[bytes] = []
    size = len(content)
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(content)) as file:
            while part := file.read(_CHUNK):
                parts.append(part)
                size += len(part)
                require_memory(size)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError("it is damaged or cut off; save or download it again") from error
    return memoryview(b"".join(parts))
