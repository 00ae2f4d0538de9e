"""The first pass: what each piece holds, told in little, and what all of them hold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import (
    ActionDimension,
    Demonstrations,
    Feature,
)
from sarl_core.demonstrations.formats.columns import SINGLES, ColumnMap
from sarl_core.demonstrations.formats.mapping.roles import ROLE_WORDS
from sarl_core.demonstrations.formats.sets.table_set import renumbered
from sarl_core.demonstrations.recoding import recoded
from sarl_core.demonstrations.words import (
    columns_of_words,
    counted_as_they_come,
    indicators_of,
    spelled,
    words_of,
)
from sarl_core.errors import InputError, quoted
from sarl_core.mining.distributed.pieces import (
    Piece,
    Reading,
    read_piece,
    some_rows,
)

_MIX = np.uint64(0x9E3779B97F4A7C15)
_MOST = 2.0**64
_FEWEST = 2  # steps that are demonstrations
_OTHER = np.uint64(0xD1B54A32D192ED03)
"""So that two sums of keys say more than one."""

Keys = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class Survey:
    """What one piece holds.

    Attributes:
        head: Some of its steps, two or more: those that are in the sample, and the first ones.
        sampled: Which of them are, (k,).
        rows: How many steps the piece has.
        episodes: The numbers of its episodes, (e,), in the order in which they come.
        names: What they stand for, e words; () where they are those of the file.
        ends: The numbers of its first and its last step; None where no column numbers the steps.
        sums: Of the keys of all rows, two of them: whatever the order of the rows is.
        low: Least action in each dimension, (m,).
        high: Largest, likewise.
    """

    head: Demonstrations
    sampled: NDArray[np.bool_]
    rows: int
    episodes: NDArray[np.int64]
    names: tuple[str, ...]
    ends: tuple[int, int] | None
    sums: tuple[int, int]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def called(self, place: int) -> str:
        """One of its episodes, as its file has it."""
        return quoted(self.names[place]) if self.names else str(self.episodes[place])


@dataclass(frozen=True, eq=False)
class Placement:
    """How the steps of a piece become some of those of all.

    Attributes:
        template: Two steps, with the features and labels that all have.
        offsets: For each file what is added to the numbers of its episodes.
        held_out: Numbers of the episodes that are held out, ascending.
    """

    template: Demonstrations
    offsets: tuple[int, ...]
    held_out: NDArray[np.int64]

    def placed(self, piece: Demonstrations, file: int) -> Demonstrations:
        """A piece with the features, labels and episodes that all have.

        Args:
            piece: As it was read.
            file: The place of its file.

        Returns:
            The same steps.
        """
        whole = self.template
        arrays = _placed(piece, whole.features, whole.action_dimensions, self.offsets[file])
        return replace(whole, rewards=None, **arrays)


@dataclass(frozen=True, eq=False)
class Layout:
    """What all pieces have in common, and how each is brought into it.

    Attributes:
        sample: Some of all steps, with all labels and bounds there are.
        offsets: For each file what is added to the numbers of its episodes.
        steps: How many there are in all.
        episodes: Their numbers, (E,), ascending, with the offsets.
        digest: Fingerprint (32 hex digits) of all steps, in whatever order and files they stand.
    """

    sample: Demonstrations
    offsets: tuple[int, ...]
    steps: int
    episodes: NDArray[np.int64]
    digest: str

    def placement(self, held_out: NDArray[np.int64]) -> Placement:
        """What each piece needs to know of the others.

        Args:
            held_out: Numbers of episodes, ascending.

        Returns:
            Much less than the sample is.
        """
        first = np.arange(len(self.sample)) < _FEWEST
        return Placement(some_rows(self.sample, first), self.offsets, held_out)


def survey_piece(piece: Piece, reading: Reading, share: float) -> Survey | None:
    """Look at a piece.

    Args:
        piece: To read.
        reading: How.
        share: Of all rows that is to be in the sample.

    Returns:
        What it holds; None where that is nothing.
    """
    given = read_piece(piece, reading)
    if given is None:
        return None
    read, count, names = given
    keys = row_keys(read)
    chosen = keys < np.uint64(min(share * _MOST, _MOST - 2**12)) if share < 1.0 else keys >= 0
    chosen &= given.real
    some = chosen | (np.arange(len(read)) < _FEWEST)
    keys, actions, steps = keys[:count], read.action_columns[:count], read.steps
    numbers = read.episodes[read.episode_starts[read.episode_starts < count]]
    return Survey(
        head=some_rows(read, some),
        sampled=chosen[some],
        rows=count,
        episodes=numbers,
        names=tuple(names[number] for number in numbers.tolist()) if names else (),
        ends=(int(steps[0]), int(steps[count - 1]))
        if steps is not None and _says_steps(read)
        else None,
        sums=(_sum(keys), _sum(_mixed(keys ^ _OTHER))),
        low=tuple(actions.min(axis=0).tolist()),
        high=tuple(actions.max(axis=0).tolist()),
    )


def columns_of_head(head: Demonstrations) -> ColumnMap | None:
    """The columns that a piece was read by, for all others; None where files say them."""
    used = {role: word for role, word in ROLE_WORDS.items() if role in SINGLES}
    by_use: dict[str, list[str]] = {}
    for one in head.columns:
        by_use.setdefault(one.use, []).append(one.column)
    if not by_use or any("the file itself says so" in one.why for one in head.columns):
        return None
    return ColumnMap.of_roles(
        by_use.get("feature", []),
        by_use.get("action", []),
        {role: by_use[word][0] for role, word in used.items() if word in by_use},
    )


def layout_of(pieces: Sequence[Piece], surveys: Sequence[Survey]) -> Layout:
    """What all pieces hold together.

    Args:
        pieces: Of all files.
        surveys: Of these.

    Returns:
        What they have in common.

    Raises:
        InputError: If they cannot be brought together.
    """
    first = surveys[0].head
    features = _common_features(pieces, surveys)
    dimensions = [_common_dimension(index, pieces, surveys) for index in range(_width(first))]
    offsets = _offsets(pieces, surveys)
    _require_order(pieces, surveys, offsets)
    fields: dict[str, Any] = {
        "feature_names": tuple(one.name for one in features),
        "feature_units": tuple(one.unit for one in features),
        "indicators": tuple(one.indicator for one in features),
        "derived": first.derived,
        "action_names": tuple(one.name for one in dimensions),
        "env_id": first.env_id,
        "agent": first.agent,
        "seed": None,
        "notes": first.notes,
        "columns": first.columns,
    }
    if first.is_discrete:
        fields |= {
            "label_names": tuple(one.labels for one in dimensions),
            "label_first": tuple(one.first for one in dimensions),
            "label_codes": tuple(one.codes for one in dimensions),
        }
    else:
        fields |= {
            "action_low": tuple(one.low for one in dimensions),
            "action_high": tuple(one.high for one in dimensions),
            "bounds_from": dimensions[0].bounds_from,
        }
    derived = (*features, *first.features[len(first.observed) :])
    placed = [
        _placed(survey.head, derived, dimensions, offsets[piece.file])
        for piece, survey in zip(pieces, surveys, strict=True)
    ]
    joined = {
        name: np.concatenate([one[name] for one in placed])
        for name, values in placed[0].items()
        if values is not None
    }
    sampled = np.concatenate([survey.sampled for survey in surveys])
    if sampled.sum() >= _FEWEST:  # else all of a few rows are in it, by chance
        joined = {name: values[sampled] for name, values in joined.items()}
    # Where nothing numbers the steps, they stay in the order in which they stand in the files.
    steps = joined.get("steps", np.arange(len(joined["episodes"])))
    order = np.lexsort((steps, joined["episodes"]))
    joined = {name: values[order] for name, values in joined.items()}
    sample = Demonstrations(**(joined | fields))
    numbers = [
        survey.episodes + offsets[piece.file] for piece, survey in zip(pieces, surveys, strict=True)
    ]
    return Layout(
        sample,
        offsets,
        sum(survey.rows for survey in surveys),
        np.unique(np.concatenate(numbers)),
        _digest(sample, surveys),
    )


def episode_keys(episodes: Keys) -> Keys:
    """A number by chance for each episode, always the same for the same number of an episode."""
    return _mixed(episodes * _OTHER + _MIX)


def row_keys(demonstrations: Demonstrations) -> Keys:
    """A number by chance for each step, the same wherever the step stands.

    Args:
        demonstrations: N steps.

    Returns:
        Shape (N,).
    """
    keys = np.zeros(len(demonstrations), dtype=np.uint64)
    for column in _columns(demonstrations):
        keys = _mixed(keys + column)
    return keys


def _columns(demonstrations: Demonstrations) -> Iterator[Keys]:
    """What the steps are, as numbers; words by what they are, and not by where they are listed."""
    observed = demonstrations.observed
    worded = columns_of_words([one.indicator for one in observed])
    places = [place for several in worded.values() for place in several]
    for place in range(len(observed)):
        if place not in places:
            yield _bits(demonstrations.observations[:, place])
    for several in worded.values():
        indicators = [one for place in several if (one := observed[place].indicator) is not None]
        coded = spelled(demonstrations.observations[:, several], indicators)
        yield _of_words(coded.words)[coded.codes]
    for index, dimension in enumerate(demonstrations.action_dimensions):
        actions = demonstrations.action_columns[:, index]
        if dimension.kind == "discrete":
            yield _of_words(dimension.labels)[dimension.labels_of(actions)]
        else:
            yield _bits(actions)
    yield _bits(demonstrations.episodes)
    if _says_steps(demonstrations):
        assert demonstrations.steps is not None
        yield _bits(demonstrations.steps)


def _bits(values: NDArray[Any]) -> Keys:
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}").astype(np.uint64)


def _of_words(words: Sequence[str]) -> Keys:
    return np.array(
        [
            int.from_bytes(hashlib.blake2b(word.encode(), digest_size=8).digest(), "little")
            for word in words
        ],
        dtype=np.uint64,
    )


def _mixed(keys: Keys) -> Keys:
    """Numbers of which every bit depends on every bit of what is given (SplitMix64)."""
    keys = keys + _MIX
    keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return keys ^ (keys >> np.uint64(31))


def _sum(keys: Keys) -> int:
    return int(keys.sum(dtype=np.uint64))


def _digest(sample: Demonstrations, surveys: Sequence[Survey]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    sums = [sum(survey.sums[place] for survey in surveys) % 2**64 for place in range(2)]
    said = sample.metadata() | {"rows": sum(survey.rows for survey in surveys), "sums": sums}
    said.pop("notes")
    digest.update(json.dumps(said, sort_keys=True).encode())
    return digest.hexdigest()


def _width(head: Demonstrations) -> int:
    return len(head.action_dimensions)


def _common_features(pieces: Sequence[Piece], surveys: Sequence[Survey]) -> tuple[Feature, ...]:
    """The observed features of all pieces; of words each that occurs in any of them."""
    words: dict[str, set[str]] = {}
    for survey in surveys:
        indicators = [one.indicator for one in survey.head.observed]
        for column, places in columns_of_words(indicators).items():
            own = [one for place in places if (one := indicators[place]) is not None]
            words.setdefault(column, set()).update(words_of(own))

    def merged(head: Demonstrations) -> list[Feature]:
        features: list[Feature] = []
        done: set[str] = set()
        for one in head.observed:
            if one.indicator is None:
                features.append(one)
            elif one.indicator.column not in done:
                done.add(one.indicator.column)
                known = sorted(words[one.indicator.column])
                features += [
                    Feature(each.name, one.unit, each)
                    for each in indicators_of(one.indicator.column, known)
                ]
        return features

    features = merged(surveys[0].head)
    for piece, survey in zip(pieces, surveys, strict=True):
        theirs = merged(survey.head)
        if theirs != features:
            names, others = ({one.name for one in some} for some in (theirs, features))
            which = quoted(min(names ^ others, default=theirs[0].name))
            raise InputError(
                f"{piece.name} has other features than {pieces[0].name}, as {which}; say which "
                "columns are features: --column NAME=feature"
            )
    return tuple(features)


def _common_dimension(
    index: int, pieces: Sequence[Piece], surveys: Sequence[Survey]
) -> ActionDimension:
    """One action dimension with the labels, or the bounds, of all pieces."""
    first = surveys[0].head.action_dimensions[index]
    several = []
    for piece, survey in zip(pieces, surveys, strict=True):
        if _width(survey.head) != _width(surveys[0].head):
            raise InputError(
                f"{piece.name} has other actions than {pieces[0].name}; say which columns are "
                "actions: --column NAME=action"
            )
        own = survey.head.action_dimensions[index]
        if own.kind != first.kind:
            raise InputError(
                f"the actions {quoted(own.name)} look like labels in some of these files and "
                f"continuous in others, as {pieces[0].name} and {piece.name}; say which they are: "
                "--column NAME=action:labels, or action:continuous"
            )
        several.append(own)
    if first.kind == "interval":
        if first.bounds_from == "action space":
            return first
        return replace(
            first,
            low=min(survey.low[index] for survey in surveys),
            high=max(survey.high[index] for survey in surveys),
        )
    if all(own == first for own in several):
        return first
    codes: dict[str, set[int]] = {}
    for own in several:
        for label, action in zip(own.labels, own.actions, strict=True):
            codes.setdefault(label, set()).add(action)
    actions = [action for same in codes.values() for action in same]
    if len({*actions}) == len(codes) == len(actions):
        ordered = sorted((action, label) for label, (action,) in codes.items())
    else:  # words, which count from 0 in each piece
        ordered = list(enumerate(sorted(codes)))
    labels, numbers = tuple(label for _, label in ordered), tuple(action for action, _ in ordered)
    counts = numbers == tuple(range(numbers[0], numbers[0] + len(numbers)))
    return replace(first, labels=labels, first=numbers[0], codes=() if counts else numbers)


def _offsets(pieces: Sequence[Piece], surveys: Sequence[Survey]) -> tuple[int, ...]:
    """What to add to the numbers of episodes where those of each file begin again."""
    offsets = dict.fromkeys(range(pieces[-1].file + 1), 0)
    known = groupby(zip(pieces, surveys, strict=True), lambda one: one[0].file)
    files = {file: np.concatenate([survey.episodes for _, survey in same]) for file, same in known}
    numbers = np.concatenate(list(files.values()))
    named = bool(surveys[0].names)
    own = counted_as_they_come(numbers) if named else numbers  # as they are read in one memory
    placed = renumbered(own, list(map(len, files.values())))
    if placed is not own:
        first = 0
        for file, of_file in files.items():
            # Numbers that stand for words are numbers by chance: so are their neighbours.
            offsets[file] = file if named else int(placed[first] - own[first])
            first += len(of_file)
    return tuple(offsets.values())


def _require_order(
    pieces: Sequence[Piece], surveys: Sequence[Survey], offsets: Sequence[int]
) -> None:
    """Refuse an episode that comes back, or whose steps begin again, in another piece."""
    placed = [
        survey.episodes + offsets[piece.file] for piece, survey in zip(pieces, surveys, strict=True)
    ]
    for at, (before, after) in enumerate(pairwise(surveys), 1):
        if placed[at - 1][-1] != placed[at][0] or before.ends is None or after.ends is None:
            continue
        if after.ends[0] <= before.ends[1]:
            column = _column_of("step", after.head)
            raise InputError(
                f"{pieces[at].name}: {column} goes from {before.ends[1]} to {after.ends[0]} within "
                f"episode {after.called(0)}, which goes on from {pieces[at - 1].name}; sort the "
                "steps of each episode, or give another episode another name"
            )
    numbers = np.concatenate(placed)
    starts = np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1]))
    _, first = np.unique(numbers[starts], return_index=True)
    again = np.setdiff1d(np.arange(len(starts)), first)
    if len(again):
        begins = np.cumsum([0, *map(len, placed)])
        row = starts[again[0]]
        at = int(np.searchsorted(begins, row, side="right")) - 1
        raise InputError(
            f"{pieces[at].name}: {_column_of('episode', surveys[at].head)} comes back to "
            f"{surveys[at].called(int(row - begins[at]))} after another episode; keep the steps of "
            "an episode together"
        )


def _column_of(role: str, head: Demonstrations) -> str:
    """The column of a role, as sentences call it."""
    columns = [one.column for one in head.columns if one.use == ROLE_WORDS[role]]
    return f"column {quoted(columns[0] if columns else role)}"


def _placed(
    piece: Demonstrations,
    features: Sequence[Feature],
    dimensions: Sequence[ActionDimension],
    offset: int,
) -> dict[str, Any]:
    """The steps of a piece with common features and labels, and their own numbers of episodes."""
    same = recoded(piece, features, called="it")
    columns = np.array(same.action_columns)
    for index, (own, wanted) in enumerate(zip(piece.action_dimensions, dimensions, strict=True)):
        if wanted.kind == "discrete" and own != wanted:
            actions = dict(zip(wanted.labels, wanted.actions, strict=True))
            table = np.array([actions[label] for label in own.labels])
            columns[:, index] = table[own.labels_of(columns[:, index])]
    return {
        "observations": same.raw_observations,
        "actions": columns.reshape(-1) if piece.actions.ndim == 1 else columns,
        "episodes": same.episodes + offset,
        "steps": np.asarray(same.steps) if _says_steps(piece) else None,
    }


def _says_steps(demonstrations: Demonstrations) -> bool:
    """Whether a column numbers the steps; else they are counted from where the piece begins."""
    return any(one.use == ROLE_WORDS["step"] for one in demonstrations.columns)
