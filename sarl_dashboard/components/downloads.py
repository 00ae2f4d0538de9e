"""Files to carry away, a button each."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import save_demonstrations
from sarl_core.demonstrations.samples import sample_text

MIMES = {
    ".c": "text/x-c",
    ".csv": "text/csv",
    ".gif": "image/gif",
    ".html": "text/html",
    ".json": "application/json",
    ".sarl": "application/zip",
    ".md": "text/markdown",
    ".mp4": "video/mp4",
    ".npz": "application/octet-stream",
    ".onnx": "application/octet-stream",
    ".pdf": "application/pdf",
    ".parquet": "application/vnd.apache.parquet",
    ".png": "image/png",
    ".py": "text/x-python",
    ".txt": "text/plain",
    ".zip": "application/zip",
}


LARGE = 2**24
"""Bytes of a file that nobody should wait for twice."""
# Streamlit's server would pack such a file at each download, which takes ten seconds for 350 MB;
# this is one of the kinds that it leaves as they are, and to a browser just a file.
_AS_IT_IS = "application/grpc"


@dataclass(frozen=True, eq=False)
class PackedFile:
    """A file to carry away, held packed: many rules take hundreds of megabytes.

    Attributes:
        size: Bytes of it.
        packed: Its content, as `zstd` packs it.
    """

    size: int
    packed: bytes

    @classmethod
    def of(cls, content: str | bytes) -> PackedFile:
        """Take a file's content."""
        import pyarrow as pa

        encoded = content.encode() if isinstance(content, str) else content
        return cls(len(encoded), pa.compress(encoded, codec="zstd", asbytes=True))

    def content(self) -> bytes:
        """All of it."""
        import pyarrow as pa

        return bytes(pa.decompress(self.packed, self.size, codec="zstd", asbytes=True))


def download(
    label: str,
    content: str | bytes | Callable[[], str | bytes],
    file: str,
    *,
    key: str,
    meaning: str | None = None,
    icon: str = "download",
    look: Literal["primary", "secondary"] = "secondary",
    large: bool = False,
) -> None:
    """A button that gives a file, and runs nothing.

    Args:
        label: On the button.
        content: Of the file, or what makes it when it is asked for.
        file: Its name, with an ending of `MIMES`.
        key: Of the button.
        meaning: What is said beside it.
        icon: Name of a Material symbol.
        look: Primary for the one that the page is about.
        large: Whether it may have `LARGE` bytes or more.
    """
    st.download_button(
        label,
        content,
        file,
        _AS_IT_IS if large else MIMES[Path(file).suffix],
        key=key,
        help=meaning,
        type=look,
        icon=f":material/{icon}:",
        on_click="ignore",
    )


def as_file(demonstrations: Demonstrations, extension: str = ".parquet") -> bytes:
    """Demonstrations as a file's bytes; those of a sample say in the file what they are."""
    if demonstrations.sample_of is not None:
        said = f"these are {sample_text(demonstrations)}"
        demonstrations = replace(demonstrations, notes=(*demonstrations.notes, said))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"demonstrations{extension}"
        save_demonstrations(demonstrations, path)
        return path.read_bytes()
