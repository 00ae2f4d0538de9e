"""Parquet files in pieces: some row groups of one file each, which one process reads at once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature, with_formulas
from sarl_core.demonstrations.fields import ColumnUse
from sarl_core.demonstrations.formats import vocabulary
from sarl_core.demonstrations.formats.arrow.parquet_file import MAGIC, is_text, refusing_damage
from sarl_core.demonstrations.formats.arrow.table import arrow_table
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.mapping.roles import ROLE_WORDS, Roles
from sarl_core.demonstrations.formats.missing import Missing, TooFewStepsError
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.recording import Recording, to_demonstrations
from sarl_core.demonstrations.formats.sets.file_set import files_in_folder, natural_order
from sarl_core.demonstrations.formats.sets.table_set import tables_among
from sarl_core.demonstrations.formats.tables import recording_from_table
from sarl_core.demonstrations.recoding import recoded
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory, table_memory

ROWS = 400_000
"""Of a piece, unless one row group has more."""
_FEWEST = 2
_ENDING = ".parquet"
_PATTERN = frozenset("*?[")
_TAIL = 8  # bytes at the end of a Parquet file, of which the first four say how long its footer is
_LOOKS, _LOOK = 16, 16_384  # places at which a file is looked at, and bytes of each


@dataclass(frozen=True)
class Piece:
    """Some row groups of a file.

    Attributes:
        path: Of the file, from the root.
        file: Its place among the files.
        first: Number of the first row group.
        groups: How many there are.
        rows: In them.
        mark: Of the file (`file_mark`).
    """

    path: str
    file: int
    first: int
    groups: int
    rows: int
    mark: str

    @property
    def name(self) -> str:
        """As sentences call it."""
        return Path(self.path).name


@dataclass(frozen=True)
class Reading:
    """How every piece is read.

    Attributes:
        columns: Which columns hold what, or what was said of some; None to go by their names.
        description: The environment, if known.
        missing: What becomes of steps without one of their values.
        formulas: What a person wants derived.
        features: That the states are to have; None for those which the piece has itself.
    """

    columns: ColumnMap | Roles | None = None
    description: EnvironmentDescription | None = None
    missing: Missing = "refuse"
    formulas: tuple[str, ...] = ()
    features: tuple[Feature, ...] | None = None


def parquet_paths(given: Sequence[str | Path]) -> list[Path]:
    """The files that paths, folders and patterns name.

    Args:
        given: As an argument has them.

    Returns:
        From the root, in their natural order, each once.

    Raises:
        InputError: If there is none, or one is no Parquet file; or a folder has other tables, too.
    """
    paths: list[Path] = []
    for path in map(Path, given):
        if path.is_dir():
            files = files_in_folder(path)
            if not any(map(_is_parquet, files.sizes)):
                raise InputError(f"{path}: this folder holds no Parquet file; give one that does")
            with naming(str(path)):
                paths += [path / name for name in tables_among(files)]
        elif not path.exists() and _PATTERN.intersection(str(path)):
            root = Path(path.anchor)
            named = list(root.glob(str(path.relative_to(root))))
            if not named:
                raise InputError(f"{path}: no file has a name of this pattern; check it")
            paths += named
        else:
            paths.append(path)
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file; check the path")
        if not _is_parquet(path.name):
            raise InputError(f"{path}: a cluster reads Parquet files; write it as one")
    return sorted({path.resolve() for path in paths}, key=lambda path: natural_order(str(path)))


def pieces_of(paths: Sequence[Path]) -> list[Piece]:
    """Cut files into pieces, by what stands at their ends; no row group is cut.

    Args:
        paths: Of `parquet_paths`.

    Returns:
        In the order of the files.

    Raises:
        InputError: If a file is damaged, has other columns than the first, or holds too much in
            one row group; or if there is no row at all.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    pieces: list[Piece] = []
    first: dict[str, str] = {}
    for place, path in enumerate(paths):
        with (
            naming(path.name),
            refusing_damage(),
            pa.OSFile(str(path)) as source,
            pq.ParquetFile(source) as file,
        ):
            mark = file_mark(source)
            kinds = {
                field.name: _kind(field.type)
                for field in file.schema_arrow
                # What a data frame wrote along, perhaps in one file and not in another.
                if not vocabulary.numbers_rows(field.name)
            }
            if not place:
                first = kinds
            _require_same(first, kinds, paths[0].name)
            sizes = [
                file.metadata.row_group(group).num_rows
                for group in range(file.metadata.num_row_groups)
            ]
            if sizes:
                require_memory(table_memory(max(sizes), len(file.schema_arrow), 0))
        for start, groups in _packed(sizes):
            rows = sum(sizes[start : start + groups])
            if start and rows < _FEWEST:  # they are no demonstrations by themselves
                last = pieces.pop()
                pieces.append(replace(last, groups=last.groups + groups, rows=last.rows + rows))
            else:
                pieces.append(Piece(str(path), place, start, groups, rows, mark))
    if not pieces:
        raise InputError("there are no steps in these files, only columns; give files with some")
    return pieces


def file_mark(source: Any) -> str:
    """What tells a Parquet file from one that was put in its place.

    Its size, its end, which says of each column of each row group where it lies and what is least
    and largest in it, and what stands at some places: a single other value may go unnoticed. When
    the file was written says nothing: workers may each have a copy.

    Args:
        source: The opened ``pyarrow.OSFile``.

    Returns:
        A digest.
    """
    size = source.size()
    source.seek(max(size - _TAIL, 0))
    tail = source.read()
    footer = min(int.from_bytes(tail[:4], "little"), size) if tail.endswith(MAGIC) else 0
    digest = hashlib.blake2b(str(size).encode(), digest_size=16)
    for start in (*range(0, size, max(size // _LOOKS, _LOOK)), max(size - _TAIL - footer, 0)):
        source.seek(start)
        digest.update(source.read(_LOOK if start < size - _TAIL - footer else None))
    return digest.hexdigest()


@contextmanager
def opened_file(path: str, mark: str = "") -> Iterator[Any]:
    """A Parquet file that was there when the work began.

    Args:
        path: Of the file.
        mark: That it had then; "" where that is not known.

    Yields:
        A ``pyarrow.parquet.ParquetFile`` that gives texts by their dictionary.

    Raises:
        InputError: If it is gone, damaged, or another one.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with refusing_damage(), pa.OSFile(path) as source:
            if mark and file_mark(source) != mark:
                raise InputError("it has changed since the work began; begin anew")
            texts = [
                field.name for field in pq.ParquetFile(source).schema_arrow if is_text(field.type)
            ]
            yield pq.ParquetFile(source, read_dictionary=texts)
    except InputError as error:
        if Path(path).is_file():
            raise
        raise InputError("it is gone since the work began; put it back, and begin anew") from error


class PieceSteps(NamedTuple):
    """What a piece holds.

    Attributes:
        steps: At least two, as demonstrations are.
        own: How many of them, from the first, are steps of the piece: where it has one alone, a
            copy stands behind that.
        names: What the numbers of its episodes stand for; {} where they are those of the file.
    """

    steps: Demonstrations
    own: int
    names: Mapping[int, str]

    @property
    def real(self) -> NDArray[np.bool_]:
        """Which are, (N,)."""
        return np.arange(len(self.steps)) < self.own


def read_piece(piece: Piece, reading: Reading) -> PieceSteps | None:
    """Read a piece.

    Args:
        piece: Of a file that this process can open.
        reading: How.

    Returns:
        Its steps, of which the first and the last may belong to episodes that go on elsewhere; None
        where each lacks a value, and such steps are left out.

    Raises:
        InputError: If it cannot be read, or holds something wrong; it names the file.
    """
    with naming(piece.name):
        with opened_file(piece.path, piece.mark) as file:
            groups = list(range(piece.first, piece.first + piece.groups))
            table = file.read_row_groups(groups, use_threads=False)
        recording = recording_from_table(arrow_table(table), reading.columns, reading.description)
        named = _name_column(recording.columns, table.schema)
        names: dict[int, str] = {}
        if named:
            table, names = _with_numbers(table, named)
            recording = recording_from_table(
                arrow_table(table), reading.columns, reading.description
            )
        del table
        if recording.episodes is None:
            raise InputError(
                "no column says to which episode a row belongs, and files are cut anywhere; number "
                "the episodes, or say which column does: --column NAME=episode"
            )
        count = len(recording.actions)
        if count == 1:
            recording = _doubled(recording, 0)
        try:
            read = to_demonstrations(recording, reading.description, reading.missing, names)
        except TooFewStepsError as error:
            if not len(error.left) or count == 1:
                return None
            recording, count = _doubled(recording, int(error.left[0])), 1
            read = to_demonstrations(recording, reading.description, reading.missing, names)
        if reading.formulas:
            read = with_formulas(read, reading.formulas)
        if reading.features is not None:
            read = recoded(read, reading.features, called="it")
        return PieceSteps(read, 1 if count == 1 else len(read), names)


def _doubled(recording: Recording, row: int) -> Recording:
    """One step of a piece, and a copy of it as another episode."""

    def twice(values: Any) -> Any:
        return None if values is None else np.asarray(values)[[row, row]]

    names = ["observations", "actions", "missing_actions", "steps", "rewards"]
    names += ["terminated", "truncated", "times", "rows"]
    episodes = twice(recording.episodes).astype(np.int64)
    return replace(
        recording,
        episodes=episodes + np.array([0, 1]),
        **{name: twice(getattr(recording, name)) for name in names},
    )


def some_rows(demonstrations: Demonstrations, rows: NDArray[np.bool_]) -> Demonstrations:
    """Some steps of demonstrations.

    Args:
        demonstrations: N steps.
        rows: Which, (N,); at least one.

    Returns:
        Those, in their present order.
    """

    def chosen(values: Any) -> Any:
        return None if values is None else np.asarray(values)[rows]

    names = ("actions", "episodes", "steps", "rewards", "terminated", "truncated", "times")
    return replace(
        demonstrations,
        observations=demonstrations.raw_observations[rows],
        **{name: chosen(getattr(demonstrations, name)) for name in names},
    )


def _name_column(columns: Sequence[ColumnUse], schema: Any) -> str:
    """The column that calls episodes by words; "" where none does."""
    called = [one.column for one in columns if one.use == ROLE_WORDS["episode"]]
    words = called and called[0] in schema.names and is_text(schema.field(called[0]).type)
    return called[0] if words else ""


def _with_numbers(table: Any, column: str) -> tuple[Any, dict[int, str]]:
    """A table whose episodes have numbers for names, the same in every piece; and these names."""
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.dictionary_encode(pc.cast(table.column(column), pa.large_string()))
    whole = texts.unify_dictionaries().combine_chunks()
    whole = whole.chunk(0) if isinstance(whole, pa.ChunkedArray) else whole
    words = whole.dictionary.to_pylist()
    numbers = list(map(_number, words))
    place = table.schema.get_field_index(column)
    coded = pa.array(numbers, pa.int64()).take(whole.indices)
    return table.set_column(place, column, coded), dict(zip(numbers, words, strict=True))


def _number(text: str) -> int:
    """A number by chance, of those that a float holds exactly."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little") >> 11


def _is_parquet(name: str) -> bool:
    return name.lower().endswith(_ENDING)


def _packed(sizes: Sequence[int]) -> Iterable[tuple[int, int]]:
    """Row groups one after the other, so many that they have about the rows of a piece."""
    before = 0
    piece = []
    for size in sizes:
        piece.append(before // ROWS)
        before += size
    start = 0
    for _, same in groupby(piece):
        groups = len(list(same))
        if any(sizes[start : start + groups]):
            yield start, groups
        start += groups


def _kind(kind: Any) -> str:
    """What a column holds, as far as it matters whether all files agree."""
    import pyarrow as pa

    if pa.types.is_dictionary(kind):
        return _kind(kind.value_type)
    if is_text(kind):
        return "words"
    if pa.types.is_boolean(kind):
        return "true and false"
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return "numbers"
    return str(kind)


def _require_same(first: dict[str, str], kinds: dict[str, str], called: str) -> None:
    """Refuse a file with other columns than the first one."""
    for name in first:
        if name not in kinds:
            raise InputError(
                f"it has no column {quoted(name)}, and {called} has; give files of the same columns"
            )
    for name, kind in kinds.items():
        if name not in first:
            raise InputError(
                f"it has a column {quoted(name)}, and {called} has none; give files of the same "
                "columns"
            )
        if kind != first[name]:
            raise InputError(
                f"its column {quoted(name)} holds {kind}, and that of {called} {first[name]}; "
                "write it alike in all files"
            )
