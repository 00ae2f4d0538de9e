"""Errors that begin with the name of the file they are about."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sarl_core.errors import InputError


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Put a file's name before the sentence of any `InputError` raised inside."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{' '.join(file.split())}: {error}") from error.__cause__
