"""The mined file: a ZIP of what `MinedData` holds, as plain arrays, one document and a sample.

Nothing in it is ever run. What it says of itself is checked against the arrays before they are
used: it may come from anywhere.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from sarl_core.archives import array_of, arrays_in, entry_content, opened, promise_of
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.fields import Whole
from sarl_core.demonstrations.formats.arrow.parquet_file import write_parquet
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.registry import read_demonstrations
from sarl_core.demonstrations.splits import Splits
from sarl_core.documents import Count, MisfitError, conformed, parse_json
from sarl_core.errors import InputError, require
from sarl_core.files import as_path, whole_file
from sarl_core.limits import limited_bytes, require_memory
from sarl_core.mining.distributed.mined_data import FeatureHistogram, MinedData
from sarl_core.mining.evidence import EpisodeCounts
from sarl_core.mining.growing.structure import TreeStructure, tree_of_counts
from sarl_core.mining.labels import MAX_DIVIDER, label_dimensions
from sarl_core.mining.tree import LEAF, PolicyTree, Source

ENDING = ".mined"
_FORMAT, _VERSION = "sarl-mined", 1
_DOCUMENT, _SAMPLE = "mined.json", "sample.parquet"
_LONGEST = 2**24  # bytes of the document
_DATE = (1980, 1, 1, 0, 0, 0)  # of every entry: the same content is the same file

_Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class _MinedDocument(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["sarl-mined"]
    version: Literal[1]
    digest: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{32}$")]
    steps: Annotated[int, msgspec.Meta(ge=1, le=2**53)]
    episodes: Count
    trees: Annotated[int, msgspec.Meta(ge=1, le=4096)]
    divider: Annotated[int, msgspec.Meta(ge=2, le=MAX_DIVIDER)]
    learner: Literal["exact", "histogram"]
    min_support: _Share
    held_out: _Share
    seed: Count


def save_mined_data(mined: MinedData, path: str | Path) -> None:
    """Write a mined file; it appears whole or not at all, and the same data give the same bytes.

    Args:
        mined: To write.
        path: It ends in `.mined`.

    Raises:
        InputError: If the path has another ending, or no folder.
        WorkError: If it cannot be written.
    """
    require(mined, MinedData, "what is saved must be MinedData", "call mine_on_cluster(...)")
    path = as_path(path, ending=ENDING)
    source = mined.trees[0].source
    document = {
        "format": _FORMAT,
        "version": _VERSION,
        "digest": source.digest,
        "steps": source.steps,
        "episodes": source.episodes,
        "trees": len(mined.trees),
        "divider": mined.divider,
        "learner": mined.trees[0].learner,
        "min_support": mined.min_support,
        "held_out": mined.share if mined.held_out else 0.0,
        "seed": mined.seed,
    }
    sample = io.BytesIO()
    write_parquet(mined.sample, sample)
    entries = {_DOCUMENT: json.dumps(document).encode(), _SAMPLE: sample.getvalue()}
    for name, array in _arrays(mined).items():
        written = io.BytesIO()
        np.lib.format.write_array(written, np.ascontiguousarray(array), allow_pickle=False)
        entries[f"{name}.npy"] = written.getvalue()
    with whole_file(path) as unfinished, zipfile.ZipFile(unfinished, "x") as archive:
        for name, content in entries.items():
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)


def load_mined_data(path: str | Path) -> MinedData:
    """Read a mined file.

    Args:
        path: Of the file.

    Returns:
        What it holds.

    Raises:
        InputError: If it is none, or damaged, or says of itself what does not agree.
    """
    path = Path(path)
    with naming(str(path)):
        try:
            content = limited_bytes(path)
        except FileNotFoundError as error:
            raise InputError("there is no such file; check its name") from error
        return read_mined_data(content)


def read_mined_data(content: bytes | memoryview) -> MinedData:
    """Read the content of a mined file; returns and errors as of `load_mined_data`."""
    with opened(content) as archive:
        document = _document(archive)
        entry = _entry(archive, _SAMPLE)
        require_memory(entry.file_size)
        sample = read_demonstrations(entry_content(archive, entry, entry.file_size), _SAMPLE)
        arrays = _read_arrays(archive)
    try:
        return _data(document, sample, arrays)
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError("its parts do not fit one another; mine it again") from error


def is_mined_file(path: str | Path) -> bool:
    """Whether a path is called as mined files are."""
    return Path(path).suffix.lower() == ENDING


def _arrays(mined: MinedData) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "histograms/borders": np.concatenate([one.borders for one in mined.histograms]),
        "histograms/counts": np.concatenate([one.counts for one in mined.histograms]),
        "histograms/sizes": np.array([len(one.borders) for one in mined.histograms]),
    }
    for index, tree in enumerate(mined.trees):
        at = f"trees/{index}"
        is_leaf = tree.feature == LEAF
        known = [
            (feature, one.splits)
            for feature, one in enumerate(tree.source.features)
            if one.splits is not None
        ]
        arrays |= {
            f"{at}/feature": tree.feature,
            f"{at}/threshold": tree.threshold,
            f"{at}/children_left": tree.children_left,
            f"{at}/children_right": tree.children_right,
            f"{at}/counts": np.where(is_leaf[:, None], tree.counts, 0),
            f"{at}/box": mined.boxes[index],
            f"{at}/splits/feature": _chained(
                [np.full(len(one.thresholds), feature) for feature, one in known], np.int64
            ),
            **{
                f"{at}/splits/{name}": _chained([getattr(one, name) for _, one in known], float)
                for name in ("thresholds", "below", "above")
            },
            f"{at}/splits/binary": np.array([f for f, one in known if one.binary], dtype=np.int64),
        }
        if mined.held_out:
            counts = mined.held_out[index]
            arrays |= {
                f"{at}/held_out/{name}": getattr(counts, name)
                for name in ("subject", "episode", "samples", "correct", "numbers", "lengths")
            }
    return arrays


def _chained(parts: Sequence[NDArray[Any]], dtype: Any) -> NDArray[Any]:
    return np.concatenate(parts).astype(dtype) if parts else np.zeros(0, dtype=dtype)


def _document(archive: zipfile.ZipFile) -> _MinedDocument:
    entry = _entry(archive, _DOCUMENT)
    try:
        document = parse_json(entry_content(archive, entry, _LONGEST))
        if isinstance(document, Mapping) and document.get("format") == _FORMAT:
            version = document.get("version")
            if isinstance(version, int) and version > _VERSION:
                raise InputError(
                    f"it is of version {version}, and this program reads {_VERSION}; update it"
                )
        return conformed(document, _MinedDocument)
    except (MisfitError, ValueError) as error:
        raise InputError(f"its {_DOCUMENT} is wrong: {error}; mine it again") from error


def _entry(archive: zipfile.ZipFile, name: str) -> zipfile.ZipInfo:
    try:
        return archive.getinfo(name)
    except KeyError as error:
        raise InputError(
            f"it is no mined file, as it holds no {name}; give one that sarl mine wrote"
        ) from error


def _read_arrays(archive: zipfile.ZipFile) -> dict[str, NDArray[Any]]:
    entries = arrays_in(archive)
    promises = {name: promise_of(archive, entry) for name, entry in entries.items()}
    require_memory(sum(entry.file_size for entry in entries.values()))
    arrays = {}
    for name, promise in promises.items():
        if promise.dtype.kind not in "if":
            raise InputError(f"its array {name!r} holds no numbers; mine it again")
        arrays[name] = array_of(archive, entries[name], promise)
    return arrays


def _data(
    document: _MinedDocument, sample: Demonstrations, arrays: Mapping[str, NDArray[Any]]
) -> MinedData:
    features = sample.features
    whole = Whole(document.digest, document.steps, document.episodes)
    sample = replace(sample, sample_of=whole, columns=())
    source = Source.of(sample)
    dimensions = label_dimensions(sample, document.divider)
    _require(document.trees == len(dimensions))
    trees, boxes, held_out = [], [], []
    for index, dimension in enumerate(dimensions):
        at = f"trees/{index}"
        structure = _structure(arrays, at, len(features))
        n = len(structure.feature)
        counts = _shaped(arrays[f"{at}/counts"], (n, dimension.n_labels), np.int64)
        inner = structure.feature != LEAF
        _require(bool((counts >= 0).all()) and not counts[inner].any())
        _require(int(counts.sum()) == document.steps)
        tree = tree_of_counts(
            structure,
            counts,
            sample,
            structure.apply(sample.observations),
            index,
            divider=document.divider,
            learner=document.learner,
            source=source.with_splits(_splits(arrays, at, len(features))),
        )
        trees.append(replace(tree, least_support=document.min_support))
        boxes.append(_shaped(arrays[f"{at}/box"], (4, n, len(features)), np.float64))
        if document.held_out:
            held_out.append(_episode_counts(arrays, f"{at}/held_out", tree))
    return MinedData(
        tuple(trees),
        sample,
        tuple(boxes),
        _histograms(arrays, len(features)),
        tuple(held_out),
        document.held_out,
        document.seed,
    )


def _require(fits: bool) -> None:
    """Refuse what cannot be: the caller makes a sentence of it."""
    if not fits:
        raise ValueError


def _shaped(array: NDArray[Any], shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    _require(array.shape == shape and array.dtype == dtype)
    return array


def _column(arrays: Mapping[str, NDArray[Any]], name: str, dtype: Any) -> NDArray[Any]:
    return _shaped(arrays[name], arrays[name].shape[:1], dtype)


def _structure(arrays: Mapping[str, NDArray[Any]], at: str, d: int) -> TreeStructure:
    feature = _column(arrays, f"{at}/feature", np.int64)
    n = len(feature)
    threshold = _shaped(arrays[f"{at}/threshold"], (n,), np.float64)
    left = _shaped(arrays[f"{at}/children_left"], (n,), np.int64)
    right = _shaped(arrays[f"{at}/children_right"], (n,), np.int64)
    is_leaf = feature == LEAF
    inner = np.flatnonzero(~is_leaf)
    _require(n > 0 and bool(((feature >= LEAF) & (feature < d)).all()))
    _require(bool((left[is_leaf] == LEAF).all() and (right[is_leaf] == LEAF).all()))
    children = np.concatenate([left[inner], right[inner]])
    # Each node but the root is the child of one before it: that is a tree, and no walk in circles.
    _require(np.array_equal(np.sort(children), np.arange(1, n)))
    _require(bool((left[inner] > inner).all() and (right[inner] > inner).all()))
    _require(bool(np.isfinite(threshold).all()))
    return TreeStructure(feature, threshold, left, right)


def _splits(arrays: Mapping[str, NDArray[Any]], at: str, d: int) -> list[Splits | None]:
    of = _column(arrays, f"{at}/splits/feature", np.int64)
    columns = [
        _shaped(arrays[f"{at}/splits/{name}"], of.shape, np.float64)
        for name in ("thresholds", "below", "above")
    ]
    binary = _column(arrays, f"{at}/splits/binary", np.int64).tolist()
    splits: list[Splits | None] = []
    for feature in range(d):
        mine = of == feature
        thresholds, below, above = (column[mine] for column in columns)
        _require(bool((np.diff(thresholds) > 0).all()))
        splits.append(Splits(thresholds, below, above, feature in binary) if mine.any() else None)
    return splits


def _histograms(arrays: Mapping[str, NDArray[Any]], d: int) -> tuple[FeatureHistogram, ...]:
    sizes = _shaped(arrays["histograms/sizes"], (d,), np.int64)
    _require(bool((sizes >= 0).all()))
    borders = _shaped(arrays["histograms/borders"], (int(sizes.sum()),), np.float64)
    counts = _shaped(arrays["histograms/counts"], (int(sizes.sum()) + d,), np.int64)
    return tuple(
        map(
            FeatureHistogram,
            np.split(borders, np.cumsum(sizes)[:-1]),
            np.split(counts, np.cumsum(sizes + 1)[:-1]),
        )
    )


def _episode_counts(arrays: Mapping[str, NDArray[Any]], at: str, tree: PolicyTree) -> EpisodeCounts:
    subject, episode, samples, correct, numbers, lengths = (
        _column(arrays, f"{at}/{name}", np.int64)
        for name in ("subject", "episode", "samples", "correct", "numbers", "lengths")
    )
    _require(len(subject) == len(episode) == len(samples) == len(correct))
    _require(len(numbers) == len(lengths))
    key = subject * len(numbers) + episode
    _require(bool((np.diff(key) > 0).all() and (samples > 0).all()))
    _require(bool(((subject >= 0) & (subject < tree.n_nodes)).all()))
    _require(bool(((episode >= 0) & (episode < len(numbers))).all()))
    _require(bool(((correct >= 0) & (correct <= samples)).all()))
    return EpisodeCounts(tree.n_nodes, subject, episode, samples, correct, numbers, lengths)
