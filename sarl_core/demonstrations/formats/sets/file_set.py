"""Several files, wherever they lie: in a folder, in an archive, or given one by one."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from sarl_core.archives import entry_content, opened
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.errors import InputError, quoted
from sarl_core.limits import limited_bytes, require_memory

_MOST_FILES = 100_000
_GIVEN = "a choice of files"


@dataclass(frozen=True)
class FileSet:
    """Several files, of which only those that are needed are read.

    Attributes:
        name: What they are called together.
        what: They are, as "a folder".
        sizes: Bytes of each by its path, with `/` between folders; in their natural order.
        read: Gives the contents of some.
    """

    name: str
    what: str
    sizes: Mapping[str, int]
    read: Callable[[Sequence[str]], list[memoryview]]

    def contents(self, paths: Sequence[str]) -> dict[str, memoryview]:
        """The contents of some files.

        Args:
            paths: Of these.

        Returns:
            Them by path.

        Raises:
            InputError: If there is no such file, one cannot be read, or they are too large.
        """
        missing = next((path for path in paths if path not in self.sizes), None)
        if missing is not None:
            raise InputError(f"there is no {missing!r} in it; give the whole folder, or its ZIP")
        require_memory(sum(self.sizes[path] for path in paths))
        return dict(zip(paths, self.read(paths), strict=True))

    def content(self, path: str) -> memoryview:
        """The content of one file; arguments and errors as of `contents`."""
        return self.contents([path])[path]

    def below(self, root: str) -> FileSet:
        """The files below a folder of these.

        Args:
            root: With `/` at its end, or "" for all.

        Returns:
            Them, by their paths from there.
        """
        sizes = {
            path.removeprefix(root): size
            for path, size in self.sizes.items()
            if path.startswith(root)
        }
        return replace(
            self, sizes=sizes, read=lambda paths: self.read([f"{root}{path}" for path in paths])
        )

    def root_of(self, marker: str) -> str | None:
        """The folder in which a file lies that tells what they are.

        Args:
            marker: The file's path from there, as "meta/info.json".

        Returns:
            The folder, with `/` at its end unless it is ""; None if there is no such file.

        Raises:
            InputError: If there are several.
        """
        roots = [
            path.removesuffix(marker)
            for path in self.sizes
            if path == marker or path.endswith(f"/{marker}")
        ]
        if len(roots) > 1:
            first, second = (root.rstrip("/") or "." for root in roots[:2])
            raise InputError(
                f"there are {len(roots)} data sets in it, as {first!r} and {second!r}; give one of "
                "them"
            )
        return roots[0] if roots else None


def natural_order(name: str) -> list[tuple[int, int, str]]:
    """The key by which episode_2 stands before episode_10."""
    return [
        (0, int(part), "") if part.isdecimal() else (1, 0, part)
        for part in re.split(r"(\d{1,18})", name.casefold())
        if part
    ]


def files_in_folder(folder: Path) -> FileSet:
    """The files below a folder, but not hidden ones.

    Args:
        folder: The folder; links to other folders are not followed.

    Returns:
        The files.

    Raises:
        InputError: If there are far too many.
    """
    sizes: dict[str, int] = {}
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not _hidden(name)]
        for name in names:
            path = Path(place) / name
            if not _hidden(name) and path.is_file():
                sizes[path.relative_to(folder).as_posix()] = path.stat().st_size
        if len(sizes) > _MOST_FILES:
            raise _too_many()

    def read(paths: Sequence[str]) -> list[memoryview]:
        return [_content(folder / path, path) for path in paths]

    return FileSet(folder.name, "a folder", _sorted(sizes), read)


def files_in_archive(content: memoryview, name: str) -> FileSet:
    """The files in a ZIP archive; nothing is unpacked to a disk.

    Args:
        content: The whole archive.
        name: What it is called.

    Returns:
        The files.

    Raises:
        InputError: If it is damaged, has far too many files, two of one path, or one whose path
            leads out of it.
    """
    sizes: dict[str, int] = {}
    with opened(content) as archive:
        for info in archive.infolist():
            path = PurePosixPath(info.filename.replace("\\", "/"))
            if path.is_absolute() or ".." in path.parts or re.match(r"[A-Za-z]:", info.filename):
                raise InputError(
                    f"the path of its file {quoted(info.filename)} leads out of the archive; make "
                    "it again from the folder alone"
                )
            if info.is_dir() or any(map(_hidden, path.parts)):
                continue
            if info.filename in sizes:
                raise InputError(f"it has two files {quoted(info.filename)}; make it again")
            sizes[info.filename] = info.file_size
    if len(sizes) > _MOST_FILES:
        raise _too_many()

    def read(paths: Sequence[str]) -> list[memoryview]:
        require_memory(len(content) + sum(sizes[path] for path in paths))
        with opened(content) as archive:
            return [
                memoryview(entry_content(archive, archive.getinfo(path), sizes[path]))
                for path in paths
            ]

    return FileSet(name, "an archive", _sorted(sizes), read)


def files_given(contents: Iterable[tuple[str, memoryview]], name: str) -> FileSet:
    """Files that were given together.

    Args:
        contents: Name and content of each.
        name: What they are called together.

    Returns:
        The files.

    Raises:
        InputError: If two have one name.
    """
    held: dict[str, memoryview] = {}
    for path, content in contents:
        if path in held:
            raise InputError(f"two of the files are called {quoted(path)}; give each its own name")
        held[path] = content
    sizes = {path: len(content) for path, content in held.items()}
    return FileSet(name, _GIVEN, _sorted(sizes), lambda paths: [held[path] for path in paths])


def files_at(paths: Sequence[Path], name: str) -> FileSet:
    """Files that lie anywhere.

    Args:
        paths: Of the files.
        name: What they are called together.

    Returns:
        The files, by their names, or by their paths where two have one name.

    Raises:
        InputError: If one is none.
    """
    alone = len({path.name for path in paths}) == len(paths)
    named = {path.name if alone else path.as_posix(): path for path in paths}
    for path in paths:
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "does not exist"
            raise InputError(f"{str(path)!r} {what}; give files, or one folder")
    sizes = {key: path.stat().st_size for key, path in named.items()}
    return FileSet(
        name, _GIVEN, _sorted(sizes), lambda keys: [_content(named[key], key) for key in keys]
    )


def _content(path: Path, name: str) -> memoryview:
    with naming(name):
        try:
            return memoryview(limited_bytes(path))
        except OSError as error:
            raise InputError(
                f"it cannot be read ({error.strerror}); check its permissions"
            ) from error


def _sorted(sizes: Mapping[str, int]) -> dict[str, int]:
    def order(item: tuple[str, int]) -> Any:
        return [natural_order(part) for part in item[0].split("/")]

    return dict(sorted(sizes.items(), key=order))


def _hidden(name: str) -> bool:
    return name.startswith(".") or name == "__MACOSX"


def _too_many() -> InputError:
    return InputError(f"there are more than {_MOST_FILES:,} files in it; give a smaller folder")
