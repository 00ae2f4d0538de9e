"""Parquet files in parts of whole episodes, which one process reads at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.arrow.parquet_file import is_text
from sarl_core.demonstrations.formats.arrow.table import arrow_table
from sarl_core.demonstrations.formats.mapping.roles import ROLE_WORDS
from sarl_core.demonstrations.formats.metadata import KEY
from sarl_core.demonstrations.formats.missing import StepGaps
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.recording import gaps_in, to_demonstrations
from sarl_core.demonstrations.formats.sets.table_set import one_set_note, renumbered
from sarl_core.demonstrations.formats.tables import recording_from_table
from sarl_core.demonstrations.requirements import EXACT, require_order, whole_numbers
from sarl_core.demonstrations.words import (
    counted_as_they_come,
    numbered_episodes,
    numbered_note,
)
from sarl_core.errors import InputError, quoted
from sarl_core.limits import READ_LIMIT, read_limit, table_memory
from sarl_core.mining.distributed import pieces
from sarl_core.mining.distributed.pieces import Piece, Reading, opened_file

_FEWEST = 2  # steps that are demonstrations
_SMALL = 8  # so small a share of the rows of a piece is no part: hardly any might be complete


class EpisodeRuns(NamedTuple):
    """The episodes of some rows, as their column has them.

    Attributes:
        values: What each is called: numbers, or words; (e,).
        lengths: Its rows, (e,).
    """

    values: NDArray[Any]
    lengths: NDArray[np.int64]


@dataclass(frozen=True)
class Segment:
    """Some rows of a file.

    Attributes:
        path: Of the file, from the root.
        first: The first row, from 0.
        rows: How many.
        mark: Of the file.
    """

    path: str
    first: int
    rows: int
    mark: str

    @property
    def name(self) -> str:
        """As sentences call it."""
        return Path(self.path).name


@dataclass(frozen=True, eq=False)
class LogPart:
    """Whole episodes, one after the other, in one file or in several.

    Attributes:
        segments: Where their rows stand.
        described: What the first file of all says besides, as it stands there; None for nothing.
        column: The column that says to which episode a row belongs.
        episodes: What they are called, (e,).
        lengths: Their rows, (e,).
        is_named: Whether they are numbered by their names in that column.
        numbering: The note on how they were numbered; "" where they have the column's numbers.
        notes: What else is said of the files, in the first part alone.
        is_first: Whether it is that.
    """

    segments: tuple[Segment, ...]
    described: bytes | None
    column: str
    episodes: NDArray[np.int64]
    lengths: NDArray[np.int64]
    is_named: bool
    numbering: str
    notes: tuple[str, ...]
    is_first: bool

    @property
    def rows(self) -> int:
        """In all its segments."""
        return int(self.lengths.sum())

    @property
    def name(self) -> str:
        """As sentences call it; rows of a part are counted from where it begins."""
        first, last = self.segments[0], self.segments[-1]
        begins = f", from row {first.first + 1}" if first.first else ""
        ends = f", to {last.name}" if last.path != first.path else ""
        return f"{first.name}{begins}{ends}"


class PartRead(NamedTuple):
    """A part that was read.

    Attributes:
        steps: Of its episodes; None where all of them lack something.
        gaps: How many lack something and were left out.
        is_rewarded: Whether its steps have rewards.
        notes: On how it was read; the one on gaps is None.
    """

    steps: Demonstrations | None
    gaps: StepGaps
    is_rewarded: bool
    notes: tuple[str | None, ...]


def gaps_note(gaps: StepGaps, is_rewarded: bool) -> str:
    """What is said of steps that were left out, of a part or of a whole log."""
    return gaps.note + ", and returns lack their rewards" * is_rewarded


def segments_of(pieces_of_files: Sequence[Piece]) -> list[Segment]:
    """Where the rows of pieces stand.

    Args:
        pieces_of_files: Of `pieces.pieces_of`.

    Returns:
        One entry each.
    """
    segments: list[Segment] = []
    for _, same in groupby(pieces_of_files, lambda piece: piece.file):
        first = 0
        for piece in same:
            segments.append(Segment(piece.path, first, piece.rows, piece.mark))
            first += piece.rows
    return segments


def episode_column(segment: Segment, reading: Reading) -> str:
    """The column that says to which episode a row belongs.

    Args:
        segment: Of a file that this process can open.
        reading: How it is read.

    Returns:
        Its name.

    Raises:
        InputError: If there is none, or it is a part of another one.
    """
    table = _rows_of(segment)
    with naming(segment.name):
        read = recording_from_table(arrow_table(table), reading.columns, reading.description)
        used = [one.column for one in read.columns if one.use == ROLE_WORDS["episode"]]
        column = used[0] if used else ""
        if not column:
            raise InputError(
                "no column says to which episode a row belongs, and files are cut anywhere; number "
                "the episodes, or say which column does: --column NAME=episode"
            )
        if column not in table.schema.names:
            raise InputError(
                f"the episodes stand within another column, as {quoted(column)}; write them as a "
                "column of their own"
            )
        return column


def runs_of(segment: Segment, column: str) -> EpisodeRuns:
    """The episodes of some rows, by one of their columns alone.

    Args:
        segment: Of a file that this process can open.
        column: That says to which episode a row belongs.

    Returns:
        One entry each; the last may go on in the next segment.

    Raises:
        InputError: If the column is empty in a row, or holds neither numbers nor words.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    held = _rows_of(segment, [column]).column(0)
    with naming(segment.name):
        if held.null_count:
            row = segment.first + int(pc.index(pc.is_null(held), True).as_py())
            raise InputError(
                f"column {column!r} is empty in row {row + 1}; mend or remove that row"
            )
        if is_text(held.type):
            texts = pc.dictionary_encode(pc.cast(held, pa.large_string())).unify_dictionaries()
            codes = np.concatenate([chunk.indices.to_numpy() for chunk in texts.chunks])
            words = np.array(texts.chunk(0).dictionary.to_pylist(), dtype=np.object_)
            starts = _starts(codes)
            return EpisodeRuns(words[codes[starts]], np.diff(np.append(starts, len(codes))))
        if pa.types.is_decimal(held.type):
            held = pc.cast(held, pa.float64())
        values = held.to_numpy()
        if values.dtype.kind not in "biuf":
            raise InputError(
                f"column {column!r} holds {quoted(str(held.type))}, which says no episode; number "
                "the episodes, or give them names"
            )
        starts = _starts(values)
        return EpisodeRuns(values[starts], np.diff(np.append(starts, len(values))))


def parts_of(
    segments: Sequence[Segment], runs: Sequence[EpisodeRuns], column: str, files: Sequence[Path]
) -> list[LogPart]:
    """Cut files into parts of whole episodes, each with about the rows of a piece.

    Args:
        segments: Of all files.
        runs: Of each.
        column: That says to which episode a row belongs.
        files: All of them.

    Returns:
        In the order of the files.

    Raises:
        InputError: If the rows of an episode do not stand together, its number is none, or an
            episode is too large for one process.
    """
    lengths = np.concatenate([one.lengths for one in runs])
    rows = np.cumsum(lengths) - lengths
    numbers, is_named, numbering = _numbered(segments, runs, column, rows)
    begins = _starts(numbers)
    numbers, rows = numbers[begins], rows[begins]
    require_order(numbers, None, (f"column {column!r}", ""), rows)
    ends = np.append(rows, lengths.sum())
    lengths = np.diff(ends)
    described, width = _said_of(files[0])
    _require_room(numbers, lengths, width)
    cuts = _cuts(np.searchsorted(rows, _bounds(segments)).tolist(), ends)
    notes = (one_set_note([path.as_posix() for path in files]),) if len(files) > 1 else ()
    return [
        LogPart(
            segments=_within(segments, int(ends[begin]), int(ends[end])),
            described=described,
            column=column,
            episodes=numbers[begin:end],
            lengths=lengths[begin:end],
            is_named=is_named,
            numbering=numbering(int(begins[begin])),
            notes=() if begin else notes,
            is_first=not begin,
        )
        for begin, end in pairwise(cuts)
    ]


def read_part(part: LogPart, reading: Reading) -> PartRead:
    """Read a part.

    Args:
        part: Of files that this process can open.
        reading: How.

    Returns:
        Its steps, under the numbers of its episodes.

    Raises:
        InputError: If it cannot be read, or holds something wrong; it names the file.
    """
    import pyarrow as pa

    tables = [_rows_of(segment) for segment in part.segments]
    with naming(part.name):
        table = _joined(tables)
        del tables
        said = None if part.described is None else {KEY: part.described}
        table = table.replace_schema_metadata(said)
        numbers = np.repeat(part.episodes, part.lengths)
        place = table.schema.get_field_index(part.column)
        if not part.is_named:
            table = table.set_column(place, part.column, pa.array(numbers))
        opened = arrow_table(table)
        recording = recording_from_table(opened, reading.columns, reading.description)
        del table, opened
        if recording.rows is not None:
            numbers = numbers[recording.rows]
        recording = replace(recording, episodes=numbers, notes=_notes(part, recording.notes))
        if not part.is_first:
            recording = replace(recording, metadata=replace(recording.metadata, notes=()))
        gaps, rewarded = gaps_in(recording, reading.missing), recording.rewards is not None
        if gaps.lacking == gaps.rows and reading.missing == "drop":
            return PartRead(None, gaps, rewarded, (*recording.notes, None))
        steps = to_demonstrations(recording, reading.description, reading.missing)
        note = gaps_note(gaps, rewarded) if gaps.lacking else None
        notes = tuple(None if one == note else one for one in steps.notes)
        return PartRead(steps, gaps, rewarded, notes)


def _rows_of(segment: Segment, columns: list[str] | None = None) -> Any:
    """Rows of a file as a ``pyarrow.Table``, by the row groups that hold them."""
    with naming(segment.name), opened_file(segment.path, segment.mark) as file:
        about = file.metadata
        sizes = [about.row_group(group).num_rows for group in range(about.num_row_groups)]
        ends = np.cumsum(sizes)
        end = segment.first + segment.rows
        first = int(np.searchsorted(ends, segment.first, side="right"))
        last = int(np.searchsorted(ends, end))
        groups = list(range(first, last + 1))
        table = file.read_row_groups(groups, columns=columns, use_threads=False)
        return table.slice(segment.first - int(ends[first]) + sizes[first], segment.rows)


def _joined(tables: Sequence[Any]) -> Any:
    """Rows of several files; numbers may be of several types, and columns in another order."""
    import pyarrow as pa
    import pyarrow.compute as pc

    first = tables[0].schema
    if all(table.schema.equals(first) for table in tables):
        return pa.concat_tables(tables)

    def plain(table: Any) -> Any:
        table = table.select(first.names)
        for place, field in enumerate(table.schema):
            if is_text(field.type):
                texts = pc.dictionary_encode(pc.cast(table.column(place), pa.large_string()))
                table = table.set_column(place, field.name, texts)
        return table

    return pa.concat_tables([plain(table) for table in tables], promote_options="permissive")


def _notes(part: LogPart, notes: tuple[str, ...]) -> tuple[str, ...]:
    """The notes of a part, with those on all files in the first part alone."""
    if part.is_named:
        notes = tuple(note for note in notes if part.is_first or note != part.numbering)
    elif part.is_first and part.numbering:
        notes = (*notes, part.numbering)
    return (*part.notes, *notes)


def _starts(values: NDArray[Any]) -> NDArray[np.int64]:
    """Where a value differs from the one before it, the first place among them."""
    differs = np.append(True, values[1:] != values[:-1])
    return np.flatnonzero(differs)


def _numbered(
    segments: Sequence[Segment], runs: Sequence[EpisodeRuns], column: str, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], bool, Callable[[int], str]]:
    """The numbers of the episodes of runs, as reading at once gives them.

    Returns:
        The numbers, whether they stand for names, and the note on them of a part that begins with
        a run.
    """
    values = np.concatenate([one.values for one in runs])
    called = f"column {column!r}"
    worded = values.dtype.kind == "O"
    own = counted_as_they_come(values) if worded else values
    by_file = groupby(zip(segments, runs, strict=True), lambda one: one[0].path)
    numbers = renumbered(own, [sum(len(one.values) for _, one in same) for _, same in by_file])
    if worded and numbers is own:
        return numbers, True, lambda run: numbered_note(called, repr(values[run]))
    if numbers.dtype.kind in "iu" and not (
        -EXACT <= int(numbers.min()) <= int(numbers.max()) <= EXACT
    ):
        counted, note = numbered_episodes(numbers, called, str(numbers[0]))
        return counted, False, lambda _: note
    return whole_numbers(numbers, len(numbers), called, rows), False, lambda _: ""


def _said_of(path: Path) -> tuple[bytes | None, int]:
    """What a file says besides, and its number of columns."""
    with naming(path.name), opened_file(str(path)) as file:
        schema = file.schema_arrow
        return (schema.metadata or {}).get(KEY.encode()), len(schema.names)


def _require_room(numbers: NDArray[np.int64], lengths: NDArray[np.int64], width: int) -> None:
    """Refuse an episode that one process could not hold."""
    longest = int(np.argmax(lengths))
    limit = read_limit()
    if table_memory(int(lengths[longest]), width, 0) > limit:
        raise InputError(
            f"episode {numbers[longest]} has {lengths[longest]:,} steps, and one process reads all "
            f"of an episode, which would take more than the {limit / 2**30:g} GiB of memory that "
            "it may; write it as several episodes, or set the environment variable "
            f"{READ_LIMIT} to more"
        )


def _bounds(segments: Sequence[Segment]) -> list[int]:
    """Rows of the log from which parts begin, about."""
    bounds, before, since = [0], 0, 0
    for segment in segments:
        if since and since + segment.rows > pieces.ROWS:
            bounds.append(before)
            since = 0
        since += segment.rows
        before += segment.rows
    return bounds


def _cuts(cuts: Sequence[int], ends: NDArray[np.int64]) -> list[int]:
    """Places of episodes at which parts begin, and the end; a small rest goes with those before."""
    last = len(ends) - 1
    enough = [0]
    for cut in (*cuts, last):
        if ends[cut] - ends[enough[-1]] >= max(pieces.ROWS // _SMALL, _FEWEST):
            enough.append(cut)
    if enough[-1] != last:
        enough[max(len(enough) - 1, 1) :] = [last]
    return enough


def _within(segments: Sequence[Segment], first: int, end: int) -> tuple[Segment, ...]:
    """The rows of a log from a first one on, file by file."""
    inside: list[Segment] = []
    before = 0
    for segment in segments:
        begins, ends = max(first, before), min(end, before + segment.rows)
        if begins < ends:
            own = replace(segment, first=segment.first + begins - before, rows=ends - begins)
            if inside and inside[-1].path == own.path:
                last = inside.pop()
                own = replace(last, rows=last.rows + own.rows)
            inside.append(own)
        before += segment.rows
    return tuple(inside)
