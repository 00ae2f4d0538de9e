"""Mined files: what was mined comes back as it was, and nothing else is believed."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarl_core import Demonstrations, InputError
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.distributed.mined_files import (
    load_mined_data,
    read_mined_data,
    save_mined_data,
)
from tests.mining.distributed.conftest import Mine, cut


@pytest.fixture
def mined(fleet: Demonstrations, tmp_path: Path, mine: Mine) -> MinedData:
    return mine(cut(fleet, tmp_path / "parts", 2), hold_out=0.2, min_support=0.005)


def test_what_was_mined_comes_back(mined: MinedData, tmp_path: Path) -> None:
    path = tmp_path / "fleet.mined"
    save_mined_data(mined, path)
    again = load_mined_data(path)
    assert [tree.digest for tree in again.trees] == [tree.digest for tree in mined.trees]
    assert again.sample.digest == mined.sample.digest
    assert (again.share, again.seed, again.min_support) == (0.2, 0, 0.005)
    for one, other in zip(mined.histograms, again.histograms, strict=True):
        assert np.array_equal(one.borders, other.borders)
        assert np.array_equal(one.counts, other.counts)
    rules = [one.mine(supp_min=0.01, conf_min=0.8, lift_min=1.1) for one in (mined, again)]
    assert rules[0].digest == rules[1].digest
    assert len(rules[0]) > 2
    save_mined_data(again, tmp_path / "again.mined")
    assert (tmp_path / "again.mined").read_bytes() == path.read_bytes()


def test_rules_below_what_was_grown_are_not_promised(mined: MinedData) -> None:
    with pytest.raises(InputError, match=r"support is 0.001, .* grown down to 0.005; give that"):
        mined.mine(supp_min=0.001, conf_min=0.8)
    assert "grown down to a support of 0.005" in mined.notes[-1]


def rewritten(content: bytes, changes: dict[str, Callable[[bytes], bytes | None]]) -> bytes:
    """An archive with some entries changed, or left out."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            entry = changes.get(name, lambda same: same)(old.read(name))
            if entry is not None:
                new.writestr(name, entry)
    return out.getvalue()


def document(**changes: Any) -> Callable[[bytes], bytes]:
    return lambda old: json.dumps(json.loads(old) | changes).encode()


def array(change: Callable[[Any], Any]) -> Callable[[bytes], bytes]:
    def changed(old: bytes) -> bytes:
        out = io.BytesIO()
        np.save(out, change(np.load(io.BytesIO(old))), allow_pickle=False)
        return out.getvalue()

    return changed


def with_circle(left: Any) -> Any:
    """A node below itself."""
    inner = np.flatnonzero(left >= 0)
    left[inner[-1]] = inner[-1]
    return left


MISFIT = "its parts do not fit one another; mine it again"
FAULTS: dict[str, tuple[dict[str, Callable[[bytes], bytes | None]], str]] = {
    "a later version": ({"mined.json": document(version=2)}, "it is of version 2, .* update it"),
    "something unknown": ({"mined.json": document(extra=1)}, "'extra' is not known"),
    "another format": ({"mined.json": document(format="other")}, "its mined.json is wrong"),
    "no JSON": ({"mined.json": lambda old: b"{"}, "its mined.json is wrong"),
    "no document": ({"mined.json": lambda old: None}, "it is no mined file, as it holds no mined"),
    "no sample": ({"sample.parquet": lambda old: None}, "it holds no sample.parquet"),
    "a broken sample": ({"sample.parquet": lambda old: old[:-9]}, "sample.parquet: it is damaged"),
    "other steps": ({"mined.json": document(steps=7)}, MISFIT),
    "another divider": ({"mined.json": document(trees=2)}, MISFIT),
    "a missing array": ({"trees/0/threshold.npy": lambda old: None}, MISFIT),
    "a tree in circles": ({"trees/0/children_left.npy": array(with_circle)}, MISFIT),
    "an unknown feature": ({"trees/0/feature.npy": array(lambda old: old + 9)}, MISFIT),
    "no thresholds": ({"trees/0/threshold.npy": array(lambda old: old * np.nan)}, MISFIT),
    "fewer than none": ({"trees/0/counts.npy": array(lambda old: -old)}, MISFIT),
    "a smaller box": ({"trees/0/box.npy": array(lambda old: old[:, 1:])}, MISFIT),
    "another type": ({"trees/0/feature.npy": array(lambda old: old.astype(float))}, MISFIT),
    "more right than there are": (
        {"trees/0/held_out/correct.npy": array(lambda old: old + 1_000)},
        MISFIT,
    ),
    "words": (
        {"trees/0/feature.npy": array(lambda old: old.astype(str))},
        "its array 'trees/0/feature' holds no numbers",
    ),
    "objects": (
        {"trees/0/feature.npy": lambda old: _pickled()},
        "holds Python objects",
    ),
}


def _pickled() -> bytes:
    out = io.BytesIO()
    np.save(out, np.array([{}]), allow_pickle=True)
    return out.getvalue()


def test_what_does_not_fit_is_refused(mined: MinedData, tmp_path: Path) -> None:
    path = tmp_path / "fleet.mined"
    save_mined_data(mined, path)
    content = path.read_bytes()
    assert read_mined_data(rewritten(content, {})).trees[0].digest == mined.trees[0].digest
    for changes, sentence in FAULTS.values():
        wrong = rewritten(content, changes)
        with pytest.raises(InputError, match=sentence):
            read_mined_data(wrong)


def test_what_is_no_mined_file_is_refused(mined: MinedData, tmp_path: Path) -> None:
    path = tmp_path / "fleet.mined"
    path.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"fleet.mined: it is damaged or cut off"):
        load_mined_data(path)
    save_mined_data(mined, path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"fleet.mined: "):
        load_mined_data(path)
    with pytest.raises(InputError, match=r"does not end in \.mined"):
        save_mined_data(mined, tmp_path / "fleet.zip")
    with pytest.raises(InputError, match="must be MinedData"):
        save_mined_data(mined.sample, path)  # type: ignore[arg-type]
