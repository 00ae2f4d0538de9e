"""Uploaded files on disk: in memory Streamlit would hold them for as long as their names stand."""

from __future__ import annotations

import mmap
import os
import tempfile
import weakref
from collections.abc import Sequence
from dataclasses import dataclass

import streamlit as st
from streamlit.runtime.memory_uploaded_file_manager import MemoryUploadedFileManager
from streamlit.runtime.scriptrunner import get_script_run_ctx
from streamlit.runtime.uploaded_file_manager import DeletedFile, UploadedFile

_KEY = "_stored_files"


@dataclass(frozen=True, eq=False)
class StoredFile:
    """A file that was uploaded.

    Attributes:
        file_id: What tells it from others.
        name: Of the file.
        size: In bytes.
        descriptor: Of what it was written to, which goes from the disk with this; None where there
            was no room.
        content: In memory then.
    """

    file_id: str
    name: str
    size: int
    descriptor: int | None
    content: bytes = b""

    @classmethod
    def of(cls, uploaded: UploadedFile) -> StoredFile:
        """Write a file to the disk, and let go of it in memory; where there is room on the disk."""
        content = uploaded.getvalue()
        descriptor = _written(content)
        context = get_script_run_ctx()
        if context is not None and isinstance(context.uploaded_file_mgr, MemoryUploadedFileManager):
            context.uploaded_file_mgr.remove_file(context.session_id, uploaded.file_id)
        uploaded.truncate(0)  # the session holds on to it, and copies it
        identity = uploaded.file_id, uploaded.name, uploaded.size
        if descriptor is None:
            return cls(*identity, None, content)
        stored = cls(*identity, descriptor)
        weakref.finalize(stored, os.close, descriptor)
        return stored

    def getvalue(self) -> memoryview:
        """Its content, which takes memory only where it is looked at, and no longer than that."""
        if self.descriptor is None or not self.size:  # nothing cannot be mapped
            return memoryview(self.content)
        return memoryview(mmap.mmap(self.descriptor, 0, access=mmap.ACCESS_READ))


def _written(content: bytes) -> int | None:
    try:
        with tempfile.TemporaryFile() as file:
            file.write(content)
            file.flush()
            return os.dup(file.fileno())
    except OSError:  # no room for a file
        return None


def stored_files(key: str) -> Sequence[StoredFile]:
    """The files in an uploader of several.

    Args:
        key: Of the uploader.
    """
    before: dict[str, StoredFile] = st.session_state.get(_KEY, {})
    held: list[UploadedFile | DeletedFile] = list(st.session_state.get(key) or [])
    now = {}
    for one in held:
        if one.file_id in before:
            now[one.file_id] = before[one.file_id]
        elif isinstance(one, UploadedFile):
            now[one.file_id] = StoredFile.of(one)
    st.session_state[_KEY] = now
    return tuple(now.values())
