"""Cards beside shipped files, and policies read with care: never larger than expected."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.files import whole_file

MAX_POLICY_BYTES = 256 * 2**20  # an MlpPolicy takes kilobytes; more is not a policy


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
        with zipfile.ZipFile(path) as archive:
            check_unpacked_size(archive, path)
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except InputError:
        raise
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise InputError(
            f"{path} cannot be read as a policy ({reason}); give an .npz policy"
        ) from error


def check_unpacked_size(archive: zipfile.ZipFile, path: Path) -> None:
    """Refuse an archive that unpacks to more than any policy needs.

    Args:
        archive: Opened, nothing read yet. Reading an entry stops at its declared size.
        path: Named in the error.

    Raises:
        InputError: If it is larger.
    """
    size = sum(entry.file_size for entry in archive.infolist())
    if size > MAX_POLICY_BYTES:
        raise InputError(
            f"{path} unpacks to {size / 2**20:.0f} MB, more than any MlpPolicy has; "
            "give a policy file"
        )
