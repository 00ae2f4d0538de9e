"""Archives of arrays that are not what they say."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from sarl_core.archives import array_of, arrays_in, opened, promise_of
from sarl_core.errors import InputError
from tests.hostile_archives import npy, npz_bytes, zip_bomb, zipped


def read(content: bytes) -> dict[str, np.ndarray]:
    with opened(content) as archive:
        return {
            name: array_of(archive, entry, promise_of(archive, entry))
            for name, entry in arrays_in(archive).items()
        }


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.arange(6, dtype=">i2"),
        np.float16(0.5) * np.ones((2, 0, 3)),
        np.array("text ⅓ \N{GRINNING FACE}"),
        np.array(True),
    ],
)
def test_arrays_are_read_as_they_were_written(array):
    for pack in (np.savez, np.savez_compressed):
        out = io.BytesIO()
        pack(out, array=array)
        found = read(out.getvalue())["array"]
        assert found.dtype == array.dtype
        assert np.array_equal(found, array)
        assert found.flags.f_contiguous == array.flags.f_contiguous


def test_a_text_of_signs_that_do_not_exist_is_damage():
    for order in "<>":
        text = np.array("xx").astype(f"{order}U2")
        wrong = npy(text).replace("x".encode(f"utf-32-{'lb'[order == '>']}e"), b"\xff\xff\xff\x7f")
        with pytest.raises(InputError, match="'text' is cut off or damaged"):
            read(zipped(text=wrong))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (zipped(x=npy(np.ones(3))[:-1]), "'x' is cut off or damaged"),
        (zipped(x=npy(np.ones(3)) + b"more"), "'x' is cut off or damaged"),
        (zipped(x=npy(np.ones(3)).replace(b"(3,)", b"(-1, -3)")), "'x'"),
        (zipped(x=npy(np.ones(3)).replace(b"'descr'", b"'d'    ")), "'x' cannot be read as NumPy"),
        (zipped(x=b"\x93NUMPY\x09\x00"), "'x' cannot be read as NumPy"),
        (zipped(x=npy(np.ones(3)).replace(b"{", b"[" * 9)), "'x' cannot be read as NumPy"),
        (zip_bomb(says=100), "damaged"),
        (npz_bytes(x=np.ones(9))[:-30], "damaged or cut off"),
        (b"PK\x05\x06", "damaged or cut off"),
        (b"", "damaged or cut off"),
    ],
)
def test_damage_is_one_sentence(content, reason):
    with pytest.raises(InputError, match=reason):
        read(content)


@pytest.mark.parametrize("compression", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_what_cannot_be_unpacked_in_parts_is_refused(compression):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        archive.writestr("x.npy", npy(np.ones(3)))
    with pytest.raises(InputError, match="compressed in a way"):
        read(out.getvalue())
