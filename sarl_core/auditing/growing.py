"""A log that grows while somebody writes it: its whole lines, as often as there are more."""

from __future__ import annotations

from pathlib import Path

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.demonstrations.formats.columns import Columns
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.errors import InputError
from sarl_core.limits import limited_bytes

_TEXTS = (".csv", ".tsv", ".jsonl", ".ndjson")
_FEWEST_LINES = 3  # a head and two steps


class RotatedError(InputError):
    """The file that was followed is not the same any more."""


class GrowingLog:
    """A text file of lines that somebody writes to."""

    def __init__(
        self, path: Path, columns: Columns | None = None, missing: Missing = "refuse"
    ) -> None:
        """Begin with nothing read.

        Args:
            path: A `.csv`, `.tsv`, `.jsonl` or `.ndjson` file.
            columns: What is said of its columns, as for `load_demonstrations`.
            missing: What becomes of steps that lack a value, likewise.

        Raises:
            InputError: If it is of another kind, or not there.
        """
        if path.suffix.lower() not in _TEXTS:
            raise InputError(
                f"{path} cannot be followed: only text of lines can grow; give one of "
                f"{', '.join(_TEXTS)}"
            )
        if not path.is_file():
            raise InputError(f"{path} is no file that could be followed; check its name")
        self.path = path
        self.columns = columns
        self.missing: Missing = missing
        self._file = path.stat().st_ino
        self._size = 0

    def read(self) -> Demonstrations | None:
        """Read all whole lines, where there are more than the last time.

        Returns:
            The steps so far; None while there are no more of them. A line that is not finished
            counts when it is.

        Raises:
            RotatedError: If the file was cut, or another one has taken its place.
            InputError: If its lines are no demonstrations.
        """
        try:
            about = self.path.stat()
            if about.st_ino != self._file or about.st_size < self._size:
                raise RotatedError(
                    f"{self.path} was rotated (it is another file, or shorter than before), so "
                    "what was read of it ends here; follow it again"
                )
            if about.st_size == self._size:
                return None
            content = limited_bytes(self.path)
        except OSError as error:
            raise RotatedError(
                f"{self.path} cannot be read any more ({error.strerror}), so what was read of it "
                "ends here; follow it again"
            ) from error
        self._size = len(content)
        whole = content[: content.rfind(b"\n") + 1]
        if whole.count(b"\n") < _FEWEST_LINES:
            return None
        return read_demonstrations(
            whole, str(self.path), columns=self.columns, missing=self.missing
        )
