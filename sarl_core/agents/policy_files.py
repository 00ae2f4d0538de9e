"""Cards beside shipped files, and policies read with care: never larger than expected."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from sarl_core.archives import array_of, arrays_in, opened, promise_of
from sarl_core.errors import InputError
from sarl_core.files import whole_file
from sarl_core.limits import limited_bytes

MAX_POLICY_BYTES = 256 * 2**20  # an MlpPolicy takes kilobytes; more is not a policy
_NUMBER = 8  # bytes of a number of any kind: as it is read, and as it is kept


def write_card(path: Path, card: Mapping[str, Any]) -> None:
    """Write the JSON that says what a shipped file is and how it was made.

    Args:
        path: The `.json` beside the file.
        card: Values for JSON.
    """
    with whole_file(path) as unfinished:
        unfinished.write_text(json.dumps(card, indent=2) + "\n", encoding="utf-8")


def read_limited_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Read every array of an `.npz` without unpickling.

    Args:
        path: The file.

    Returns:
        The arrays by name.

    Raises:
        InputError: If it is no such file, holds objects, or unpacks to more than a policy has.
    """
    try:
        content = limited_bytes(path, MAX_POLICY_BYTES)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read as a policy ({error.strerror or error}); give an .npz policy"
        ) from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    try:
        with opened(content) as archive:
            entries = arrays_in(archive)
            _require_size(sum(entry.file_size for entry in entries.values()))
            promises = {name: promise_of(archive, entry) for name, entry in entries.items()}
            _require_size(
                len(content)
                + sum(
                    math.prod(promise.shape) * max(promise.dtype.itemsize, _NUMBER)
                    for promise in promises.values()
                )
            )
            return {
                name: array_of(archive, entry, promises[name]) for name, entry in entries.items()
            }
    except InputError as error:
        raise InputError(f"{path} cannot be read as a policy: {error}") from error


def check_unpacked_size(archive: zipfile.ZipFile) -> None:
    """Refuse an archive that unpacks to more than any policy needs.

    Args:
        archive: Opened, nothing read yet. Reading an entry stops at its declared size.

    Raises:
        InputError: If it is larger.
    """
    _require_size(sum(entry.file_size for entry in archive.infolist()))


def _require_size(size: int) -> None:
    if size > MAX_POLICY_BYTES:
        raise InputError(
            f"it unpacks to {size / 2**20:,.0f} MB, more than any MlpPolicy has; give a policy file"
        )
