"""Archives of arrays: a good one, and such as mean harm or are damaged."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np


def good_columns() -> dict[str, Any]:
    return {
        "episode": [0, 0, 0, 1, 1],
        "step": [0, 1, 2, 0, 1],
        "obs_x": [0.5, 0.25, 0.125, 0.75, 0.0],
        "obs_y": [1.5, 1.25, 1.0, 0.5, 0.25],
        "action": [0, 1, 0, 1, 1],
    }


def npz_bytes(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def good_arrays() -> dict[str, Any]:
    columns = good_columns()
    return {
        "observations": np.array([columns["obs_x"], columns["obs_y"]], np.float32).T,
        "actions": np.array(columns["action"]),
        "episodes": np.array(columns["episode"]),
    }


class Payload:
    """Pickled, it creates a file when it is unpickled."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, str]]:
        return open, (self.path, "w")


def malicious_npz(path: str) -> bytes:
    """NPZ whose actions are a pickle that creates the file `path`."""
    arrays = good_arrays()
    arrays["actions"] = np.array([Payload(path)] * 5, dtype=object)
    return npz_bytes(**arrays)


def zip_bomb(*, says: int) -> bytes:
    """A few kilobytes that unpack to 16 MiB of zeros, whatever their directory says."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("actions.npy", npy(np.zeros(5, np.int64)))
        archive.writestr("observations.npy", npy_header((2**20, 2)) + bytes(2**24))
    content = bytearray(out.getvalue())
    directory = content.rindex(b"PK\x01\x02")
    # The unpacked size that readers go by stands 24 bytes into the entry of the directory.
    content[directory + 24 : directory + 28] = struct.pack("<I", says)
    return bytes(content)


def spoilt_npz(place: int, value: bytes) -> bytes:
    """The good arrays, with something else in every entry of the archive's directory."""
    content = bytearray(npz_bytes(**good_arrays()))
    at = content.find(b"PK\x01\x02")
    while at >= 0:
        content[at + place : at + place + len(value)] = value
        at = content.find(b"PK\x01\x02", at + 1)
    return bytes(content)


def npy_header(shape: tuple[int, ...]) -> bytes:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return header.getvalue()


def zipped(**contents: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in contents.items():
            archive.writestr(f"{name}.npy", content)
    return out.getvalue()


def npy(array: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()
