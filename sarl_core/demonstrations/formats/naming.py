"""Errors that begin with the name of the file they are about."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath

from sarl_core.errors import InputError


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Put a file's name before the sentence of any `InputError` raised inside."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{' '.join(file.split())}: {error}") from error.__cause__


@contextmanager
def naming_both(files: tuple[str, str]) -> Iterator[None]:
    """Let any `InputError` raised inside name both files of a pair, as one was perhaps not given.

    Args:
        files: Of the observations and of the actions.
    """
    names = [PurePath(file).name for file in files]
    try:
        yield
    except InputError as error:
        unnamed = [name for name in names if name not in str(error)]
        note = f" (it was read together with {unnamed[0]!r})" if unnamed else ""
        raise InputError(f"{error}{note}") from error.__cause__
