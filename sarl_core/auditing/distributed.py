"""Rules held against Parquet files on a cluster: two passes over parts of whole episodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing import near
from sarl_core.auditing.clock import steps_in_episodes
from sarl_core.auditing.counts import LogCounts, counts_of, together
from sarl_core.auditing.matching import matched_log, matched_states
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.auditing.parts import (
    LogPart,
    episode_column,
    gaps_note,
    parts_of,
    read_part,
    runs_of,
    segments_of,
)
from sarl_core.auditing.reference import LogSample, Reference, drift_of, reference_of
from sarl_core.auditing.steps import Yardsticks, held_steps
from sarl_core.clusters import cluster as connected
from sarl_core.clusters import saying_losses, worked_out
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.columns import Columns, stated
from sarl_core.demonstrations.formats.missing import Missing, StepGaps, gaps_together
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.errors import InputError, require
from sarl_core.mining.distributed.pieces import (
    Piece,
    Reading,
    parquet_paths,
    pieces_of,
    some_rows,
)
from sarl_core.mining.distributed.survey import (
    Keys,
    Placement,
    Survey,
    columns_of_head,
    layout_of,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import Progress, report
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

_STEPS = 1_000  # of the progress
_HEAD = 2  # steps that say what a part holds
_MORE = 4  # times as many steps as are needed are drawn at first: some may lack a value


@dataclass(frozen=True, eq=False)
class PartSurvey:
    """What one part holds.

    Attributes:
        survey: As of a piece; None where every step lacks something.
        sample: Some of its steps.
        keys: Of these, (k,).
        medians: How long the steps of its episodes last, as of `clock.steps_in_episodes`.
        timed: How many such steps each has.
        gaps: How many steps lack something.
        is_rewarded: Whether they have rewards.
        notes: On how it was read; the one on gaps is None.
    """

    survey: Survey | None
    sample: Demonstrations | None
    keys: Keys
    medians: NDArray[np.float64]
    timed: NDArray[np.int64]
    gaps: StepGaps
    is_rewarded: bool
    notes: tuple[str | None, ...]

    @property
    def rows(self) -> int:
        """Its steps, without those that lack something."""
        return 0 if self.survey is None else self.survey.rows


def audit_files(
    rule_set: RuleSet,
    paths: str | Path | Sequence[str | Path],
    cluster: str,
    *,
    columns: Columns | None = None,
    missing: Missing = "refuse",
    projection: Projection = "centre",
    demonstrations: Demonstrations | None = None,
    progress: Progress | None = None,
) -> AuditNumbers:
    """Hold rules against a log in Parquet files that no single memory holds, on a cluster of Dask.

    The numbers are those of `audit` of the same log in one memory, however it is cut into files
    and however many workers there are.

    Args:
        rule_set: The rules.
        paths: Files, folders of them, or patterns as `fleet/*.parquet`; the workers see them under
            the same paths.
        cluster: The address of a scheduler, as "tcp://scheduler:8786"; or "local:2" for two
            processes of this machine, "local:2:4GB" with so much memory each.
        columns: As of `load_demonstrations`.
        missing: Likewise.
        projection: As of `audit`.
        demonstrations: Likewise.
        progress: Given how far it is; may stop it.

    Returns:
        The numbers; the steps stay where they are.

    Raises:
        InputError: If a file, or the cluster, cannot be used, or the log is of other features,
            units, actions or labels than the rules.
        WorkError: If the cluster cannot go on, or the extra "cluster" is not installed.
        CancelledError: If the caller wants no more.
    """
    require(rule_set, RuleSet, "the rules must be a RuleSet", "load one: load_rules(path)")
    require(cluster, str, "the cluster must be text", "give its address, or local:2")
    shield = Shield(rule_set, projection=projection)
    reference = None if demonstrations is None else reference_of(shield, demonstrations)
    files = parquet_paths([paths] if isinstance(paths, (str, Path)) else list(paths))
    reading = Reading(stated(columns), missing=missing)
    with connected(cluster) as client:
        return audit_on_cluster(client, shield, files, reading, reference, progress=progress)


def audit_on_cluster(
    client: Any,
    shield: Shield,
    files: Sequence[Path],
    reading: Reading,
    reference: Reference | None = None,
    *,
    progress: Progress | None = None,
) -> AuditNumbers:
    """Hold rules against files on a cluster that is connected.

    Args:
        client: A ``distributed.Client``.
        shield: With the rules in force.
        files: Of `parquet_paths`.
        reading: How they are read.
        reference: Of the demonstrations; None to go by what the rules say of them.
        progress: Given how far it is; may stop it.

    Returns:
        The numbers.

    Raises:
        InputError: As of `audit_files`.
        WorkError: Likewise.
        CancelledError: Likewise.
    """

    def advance(share: float) -> None:
        report(progress, round(share * _STEPS), _STEPS)

    rule_set = shield.rule_set
    with saying_losses():
        advance(0.0)
        parts = _parts(client, files, reading, lambda share: advance(0.1 * share))
        surveys, reading = _surveyed(
            client,
            parts,
            reading,
            near.SAMPLE if reference is None else 0,
            lambda share: advance(0.1 + 0.4 * share),
        )
        known = [
            (Piece(part.segments[0].path, 0, 0, 0, survey.rows, ""), survey.survey)
            for part, survey in zip(parts, surveys, strict=True)
            if survey.survey is not None
        ]
        if not known:
            raise InputError(_nothing_left(surveys))
        layout = layout_of([piece for piece, _ in known], [survey for _, survey in known])
        placement = layout.placement(np.zeros(0, dtype=np.int64))
        yardsticks = _sample(rule_set, surveys, placement).yardsticks(rule_set, reference)
        rows = [survey.rows for survey in surveys]
        before = np.cumsum([0, *rows]).tolist()
        futures = [
            client.submit(count_part, part, reading, placement, shield, yardsticks, first, steps)
            for part, first, steps in zip(parts, before, rows, strict=False)
            if steps
        ]
        counted = client.gather(worked_out(futures, lambda share: advance(0.5 + 0.5 * share)))
        advance(1.0)
    counts = together([one for one, _ in counted])
    notes = (*_notes(surveys), *(note for _, own in counted for note in own))
    return AuditNumbers(
        rule_set=rule_set,
        counts=counts,
        looked_at=yardsticks.every,
        step_seconds=yardsticks.step_seconds,
        drift=drift_of(rule_set, counts, reference),
        notes=tuple(dict.fromkeys(notes)),
    )


def survey_part(part: LogPart, reading: Reading, share: float) -> PartSurvey:
    """Look at a part.

    Args:
        part: To read.
        reading: How.
        share: Of all steps that is to be in the sample.

    Returns:
        What it holds.
    """
    read = read_part(part, reading)
    steps = read.steps
    if steps is None:
        nothing = np.zeros(0)
        return PartSurvey(
            None,
            None,
            nothing.astype(np.uint64),
            nothing,
            nothing.astype(np.int64),
            read.gaps,
            read.is_rewarded,
            read.notes,
        )
    keys = near.sample_keys(steps)
    head = np.arange(len(steps)) < _HEAD
    # What is drawn beside them is no sample by itself: demonstrations have two steps or more.
    drawn = head | (keys <= np.uint64(min(share * 2.0**64, 2.0**64 - 2.0**12)))
    if share >= 1.0:
        drawn[:] = True
    values = steps.action_columns
    return PartSurvey(
        Survey(
            head=some_rows(steps, head),
            sampled=np.zeros(_HEAD, dtype=np.bool_),
            rows=len(steps),
            episodes=steps.episodes[steps.episode_starts],
            names=(),  # the numbers of its episodes are those in the whole log
            ends=None,
            sums=(0, 0),
            low=tuple(values.min(axis=0).tolist()),
            high=tuple(values.max(axis=0).tolist()),
        ),
        some_rows(steps, drawn) if share else None,
        keys[drawn],
        *steps_in_episodes(steps),
        read.gaps,
        read.is_rewarded,
        read.notes,
    )


def count_part(
    part: LogPart,
    reading: Reading,
    placement: Placement,
    shield: Shield,
    yardsticks: Yardsticks,
    before: int,
    rows: int,
) -> tuple[LogCounts, tuple[str, ...]]:
    """Hold rules against a part.

    Args:
        part: To read.
        reading: How.
        placement: What all parts have in common.
        shield: With the rules in force.
        yardsticks: Of the whole log.
        before: Steps of the log that stand before it.
        rows: Steps that it had when it was surveyed.

    Returns:
        What is counted, and notes on how log and rules were matched.
    """
    read = read_part(part, reading).steps
    with naming(part.name):
        if read is None or len(read) != rows:
            raise InputError("it has changed since the work began; begin anew")
        log = replace(placement.placed(read, 0), steps=read.steps, times=read.times)
        matched = matched_log(shield.rule_set, log)
        held = held_steps(shield, log, matched, yardsticks, before=before)
        return counts_of(held, yardsticks.quarters, before=before), matched.notes


def _parts(
    client: Any, files: Sequence[Path], reading: Reading, advance: Callable[[float], None]
) -> list[LogPart]:
    """The light pass: the column of the episodes alone."""
    segments = segments_of(pieces_of(files))
    column = client.submit(episode_column, segments[0], reading).result()
    futures = [client.submit(runs_of, segment, column) for segment in segments]
    runs = client.gather(worked_out(futures, advance))
    return parts_of(segments, runs, column, files)


def _surveyed(
    client: Any,
    parts: Sequence[LogPart],
    reading: Reading,
    size: int,
    advance: Callable[[float], None],
) -> tuple[list[PartSurvey], Reading]:
    """The first pass. How the first part is understood, all others are read."""
    total = sum(part.rows for part in parts)
    share = min(1.0, _MORE * size / total)
    while True:
        first = client.submit(survey_part, parts[0], reading, share).result()
        chosen = reading
        if reading.columns is None and first.survey is not None:
            chosen = replace(reading, columns=columns_of_head(first.survey.head))
        futures = [client.submit(survey_part, part, chosen, share) for part in parts[1:]]
        surveys = [first, *client.gather(worked_out(futures, advance))]
        steps = sum(survey.rows for survey in surveys)
        drawn = sum(len(survey.keys) for survey in surveys)
        if share in (0.0, 1.0) or drawn >= min(size, steps) + _HEAD * len(parts):
            return surveys, chosen
        share = min(1.0, _MORE * share)  # nearly all steps lack a value


def _sample(rule_set: RuleSet, surveys: Sequence[PartSurvey], placement: Placement) -> LogSample:
    """What all surveys say of the whole log; only the states of a sample need be at hand."""
    states = [np.zeros((0, len(rule_set.source.features)), dtype=np.float32)]
    keys = [np.zeros(0, dtype=np.uint64)]
    for survey in surveys:
        if survey.sample is not None:
            states.append(matched_states(rule_set, placement.placed(survey.sample, 0))[0])
            keys.append(survey.keys)
    return LogSample(
        sum(survey.rows for survey in surveys),
        np.concatenate(states),
        np.concatenate(keys),
        np.concatenate([survey.medians for survey in surveys]),
        np.concatenate([survey.timed for survey in surveys]),
    )


def _notes(surveys: Sequence[PartSurvey]) -> list[str]:
    """What is said of how all parts were read, as of one."""
    gaps = gaps_together([survey.gaps for survey in surveys])
    of_gaps = gaps_note(gaps, surveys[0].is_rewarded)
    notes = dict.fromkeys(note for survey in surveys for note in survey.notes)
    return [of_gaps if note is None else note for note in notes]


def _nothing_left(surveys: Sequence[PartSurvey]) -> str:
    where = gaps_together([survey.gaps for survey in surveys]).where
    return f"{where}, so no step would be left; leave out the columns that are empty instead"
