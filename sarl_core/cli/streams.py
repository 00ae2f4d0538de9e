"""Standard output and error of which no command dies: closed, full, or with few characters."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

# What stands for a sign where only ASCII can be shown; any other becomes a question mark.
_PLAIN = str.maketrans(
    {
        "−": "-",
        "–": "-",
        "—": "-",
        "…": "...",
        "·": "-",
        "×": "x",
        "±": "+-",
        "≤": "<=",
        "≥": ">=",
        "→": "->",
        "“": '"',
        "”": '"',
        "‘": "'",
        "’": "'",
        "\u00a0": " ",
        "\u202f": " ",
    }
)


class Stream:
    """A stream that takes everything, whether or not anybody reads it.

    Attributes:
        failure: Why what was written is lost, as on a full disk. None while nothing is, and where
            the reader has had enough (a closed pipe), which is no failure.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._is_lost = False
        self.failure: str | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or drop what cannot be written."""
        if not self._is_lost:
            try:
                self._write(text)
            except (OSError, ValueError) as error:
                self._lose(error)
        return len(text)

    def flush(self) -> None:
        """Hand on what waits to be written, or drop it."""
        if not self._is_lost:
            try:
                self._stream.flush()
            except (OSError, ValueError) as error:
                self._lose(error)

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:
            encoding = self._stream.encoding
            plain = text.translate(_PLAIN)
            self._stream.write(plain.encode(encoding, "replace").decode(encoding))

    def _lose(self, error: OSError | ValueError) -> None:
        self._is_lost = True
        if isinstance(error, OSError) and not isinstance(error, BrokenPipeError):
            self.failure = error.strerror or str(error)
        # What still waits in the stream would fail again when Python ends.
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


@contextmanager
def lasting_streams() -> Iterator[Stream]:
    """Let nothing that happens to standard output or error end the work.

    Where one of them is closed, what is written to it is dropped.

    Yields:
        Standard output, to be asked at the end whether it failed.
    """
    _open_missing_descriptors()
    streams = sys.stdout, sys.stderr
    out, error = (Stream(stream or _nowhere()) for stream in streams)
    sys.stdout, sys.stderr = out, error
    try:
        yield out
    finally:
        out.flush()
        error.flush()
        sys.stdout, sys.stderr = streams


@contextmanager
def interruptible() -> Iterator[None]:
    """Let a request to end (SIGTERM, SIGHUP) end the work as Ctrl-C does, so that it clears up."""
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    if threading.current_thread() is not threading.main_thread():
        names = []  # signals are the main thread's
    before = {name: signal.signal(getattr(signal, name), _interrupt) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _open_missing_descriptors() -> None:
    """Take the places of closed streams, or the next file opened would get what is printed."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free


def _nowhere() -> TextIO:
    return Path(os.devnull).open("w", encoding="utf-8")  # lasts as long as the process
