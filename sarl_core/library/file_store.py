"""Large things as files, named by the digest of their content."""

from __future__ import annotations

import hashlib
import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from sarl_core.errors import InputError, WorkError
from sarl_core.files import whole_file
from sarl_core.library.items import ItemFile

_CHUNK = 2**20
_ENDING = re.compile(r"\.[a-z0-9]{1,12}")


@dataclass(frozen=True)
class FileStore:
    """A folder of files that never change.

    Attributes:
        folder: In which they lie, in folders by the first two digits of their digests.
    """

    folder: Path

    def path(self, file: ItemFile) -> Path:
        """Where a file lies, if it does."""
        return self.folder / file.digest[:2] / f"{file.digest}{file.ending}"

    def describe(self, role: str, source: Path | bytes, ending: str) -> ItemFile:
        """What a file would be here.

        Args:
            role: What it is to its item.
            source: The file, or its content.
            ending: Of its name, as ".json".

        Raises:
            InputError: If it cannot be read.
        """
        if not _ENDING.fullmatch(ending):
            raise InputError(f"{ending!r} is no ending of a file; give one like .json")
        digest, size = content_digest(source)
        return ItemFile(role, digest, ending, size)

    def put(self, file: ItemFile, source: Path | bytes) -> None:
        """Let a file be here; it appears whole or not at all.

        Args:
            file: What it is.
            source: The file, or its content.

        Raises:
            WorkError: If it cannot be written, or has changed since it was described.
        """
        path = self.path(file)
        if path.is_file() and path.stat().st_size == file.size:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WorkError(
                f"{path.parent} cannot be made ({error.strerror or error}); look after the "
                "library's disk, or choose another place with SARL_LIBRARY"
            ) from error
        with whole_file(path) as unfinished:
            digest = hashlib.blake2b(digest_size=16)
            with unfinished.open("xb") as out:
                for chunk in _chunks(source):
                    digest.update(chunk)
                    out.write(chunk)
                out.flush()
                os.fsync(out.fileno())  # what a database speaks of has to be there
            if digest.hexdigest() != file.digest:
                raise WorkError(f"{source!s} changed while it was read; try again")

    def located(self, file: ItemFile, of: str) -> Path:
        """Where a file lies.

        Args:
            file: Which.
            of: What it belongs to, for the error.

        Raises:
            InputError: If it is missing, or was cut off.
        """
        path = self.path(file)
        try:
            size = path.stat().st_size
        except OSError as error:
            raise InputError(
                f"the file {path} of {of} is missing from the library; bring it back from a "
                "backup, or remove the entry"
            ) from error
        if size != file.size:
            raise InputError(
                f"the file {path} of {of} has {size:,} bytes and should have {file.size:,}; bring "
                "it back from a backup, or remove the entry"
            )
        return path

    def older_than(self, age: timedelta) -> list[ItemFile]:
        """Files that were written before, without a role."""
        before = time.time() - age.total_seconds()
        return [
            ItemFile("", path.stem, path.suffix, path.stat().st_size)
            for path in sorted(self.folder.glob("??/*"))
            if path.stat().st_mtime < before and not path.name.startswith(".")
        ]

    def forget(self, file: ItemFile) -> None:
        """Remove a file that nothing speaks of any more."""
        self.path(file).unlink(missing_ok=True)


def content_digest(source: Path | bytes) -> tuple[str, int]:
    """Fingerprint (blake2b, 32 hex digits) and size of a file or its content.

    Raises:
        InputError: If it cannot be read.
    """
    digest, size = hashlib.blake2b(digest_size=16), 0
    for chunk in _chunks(source):
        digest.update(chunk)
        size += len(chunk)
    return digest.hexdigest(), size


def _chunks(source: Path | bytes) -> Iterator[bytes]:
    if isinstance(source, bytes):
        yield source
        return
    try:
        with source.open("rb") as file:
            while chunk := file.read(_CHUNK):
                yield chunk
    except OSError as error:
        raise InputError(
            f"{source} cannot be read ({error.strerror or error}); give a file that can"
        ) from error
