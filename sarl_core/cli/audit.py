"""The command that holds rules against a log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import path_of, read_demonstrations, sign_off_of
from sarl_core.cli.options import (
    ClusterAddress,
    Columns,
    Json,
    MissingName,
    ProjectionName,
    out_option,
    with_columns,
)
from sarl_core.cli.stand_ins import called, said
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.auditing.audit import Audit
    from sarl_core.auditing.comparison import LogComparison
    from sarl_core.auditing.growing import GrowingLog
    from sarl_core.auditing.guards import GuardCondition
    from sarl_core.auditing.numbers import AuditNumbers
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.demonstrations.formats.mapping.roles import Roles
    from sarl_core.demonstrations.formats.missing import Missing
    from sarl_core.explaining.words.sign_off import SignOff
    from sarl_core.mining.rule_set import RuleSet
    from sarl_core.progress import Progress
    from sarl_core.shielding.projection import Projection

_FAILED = 3  # a condition of --fail-on holds
_LISTED = 12
_LOOK_SECONDS = 1.0
_REST = 3  # times as long as reading took


@with_columns
def audit(
    rules: Annotated[
        Path, typer.Argument(metavar="RULES.json", help="The rules.", show_default=False)
    ],
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="What somebody did: demonstrations in any format that is read; several files are "
            "one log. With --cluster Parquet files, folders of them, or patterns.",
            show_default=False,
        ),
    ],
    columns: Columns,
    missing: MissingName = "drop",
    out: Annotated[
        Path | None,
        out_option(
            "Write audit.json, audit.html, steps.csv, rules.csv and episodes.csv into this "
            "folder; made if it is not there. With --cluster no steps.csv.",
            metavar="DIR",
        ),
    ] = None,
    fail_on: Annotated[
        list[str] | None,
        typer.Option(
            "--fail-on",
            metavar="CONDITION",
            show_default=False,
            help="Exit with 3 if this holds, as breaks>0.02 or coverage<50%; may be given several "
            "times. Measures: agreement, breaks, breaks_per_minute, breaks_per_thousand, coverage, "
            "drift, freedom, gaps, longest_run, missing_steps, near, outside, steps, time_gaps, "
            "worst_minute.",
        ),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare",
            metavar="LOG",
            show_default=False,
            help="Another log, as after a change: what differs from the first, with intervals.",
        ),
    ] = None,
    demonstrations: Annotated[
        Path | None,
        typer.Option(
            "--demonstrations",
            metavar="FILE",
            show_default="what the rules say of them",
            help="What the rules were mined from, to compare the log's distributions with.",
        ),
    ] = None,
    projection: ProjectionName = "centre",
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Go on while the log (lines of text) grows, with a line on standard error "
            "whenever it has; Ctrl-C ends with the answer.",
        ),
    ] = False,
    cluster: ClusterAddress = None,
    as_json: Json = False,
) -> None:
    """Hold rules against a log: where they were broken, how often, and whether it drifts.

    The log needs no environment. Features, actions and labels are matched by their names; of a
    column with another name say what it is: `--column "v=feature as own speed"`.

    Example: `python -m sarl_core audit data/rules/cartpole_compact.json
    data/demonstrations/cartpole.parquet --fail-on "breaks>0.02" --out audited`
    """
    if follow and cluster is not None:
        raise InputError(
            "--follow reads lines of text while they are written, and a cluster reads Parquet "
            "files; leave one of the two out"
        )
    if out is not None:
        terminal.check_folder(out)
    with terminal.working("Auditing") as advance:
        from sarl_core.auditing.audit import audit as against
        from sarl_core.auditing.comparison import LogComparison
        from sarl_core.auditing.guards import guard
        from sarl_core.auditing.matching import matched_states
        from sarl_core.explaining.exports.audit import audit_document
        from sarl_core.mining.rule_set import RuleSet

        guards = [guard(text) for text in fail_on or ()]
        rule_set = RuleSet.load(rules)
        sign_off = sign_off_of(rule_set)
        mined_from = None
        if demonstrations is not None:
            said = _said_of(demonstrations, columns)
            mined_from = read_demonstrations(demonstrations, None, said, missing)
            with _naming(demonstrations):  # what does not fit in them is no fault of the log
                matched_states(rule_set, mined_from, called="the demonstrations")

        def hold(path: Path | list[Path], steps: Demonstrations | None = None) -> Audit:
            with _naming(path):
                return against(
                    rule_set,
                    read_demonstrations(path, None, columns, missing) if steps is None else steps,
                    projection=projection,
                    demonstrations=mined_from,
                )

        held: AuditNumbers
        after: AuditNumbers | None
        stopped: InputError | None = None
        if cluster is not None:
            held, after = _held_on_cluster(
                rule_set,
                [logs, *([] if compare is None else [[compare]])],
                cluster,
                columns,
                missing,
                projection,
                mined_from,
                advance,
            )
        elif follow:
            from sarl_core.auditing.growing import GrowingLog

            if len(logs) > 1:
                raise InputError("--follow follows one log as it grows; give one file")
            growing = GrowingLog(logs[0], columns, missing)
            held, stopped = _followed(growing, partial(hold, logs[0]), guards)
            after = None if compare is None else hold(compare)
        else:
            held = hold(logs)
            after = None if compare is None else hold(compare)
        comparison = None if after is None else LogComparison(held, after)
        if out is not None:
            from sarl_core.explaining.exports.audit import save_audit

            save_audit(
                held,
                out,
                title=f"{path_of(logs, short=True)} against {called(rules, short=True)}",
                comparison=comparison,
                sign_off=sign_off,
            )
    if as_json:
        document = audit_document(held, comparison, sign_off)
        if guards:
            document["failed_on"] = [one.text for one in guards if one.holds(held)]
        terminal.print_json(document)
    else:
        _print(held, comparison, f"{path_of(logs)} against {called(rules)}", sign_off)
        if out is not None:
            without = (
                "" if cluster is None else " It has no steps.csv: the steps stay in the files."
            )
            terminal.print_lines([f"Wrote {out}.{without}"])
    if stopped is not None:
        raise stopped
    _guard(held, guards)


@contextmanager
def _naming(path: Path | list[Path]) -> Iterator[None]:
    """Let an error inside name the log that it is about."""
    try:
        yield
    except InputError as error:
        name = path_of(path if isinstance(path, list) else [path])
        raise InputError(_with_path(error, name)) from error


def _held_on_cluster(
    rule_set: RuleSet,
    logs: list[list[Path]],
    cluster: str,
    columns: Roles,
    missing: Missing,
    projection: Projection,
    demonstrations: Demonstrations | None,
    advance: Progress,
) -> tuple[AuditNumbers, AuditNumbers | None]:
    """Audit one log or two in Parquet files, on one cluster."""
    from sarl_core.auditing.distributed import audit_on_cluster
    from sarl_core.auditing.reference import reference_of
    from sarl_core.clusters import cluster as connected
    from sarl_core.demonstrations.formats.columns import stated
    from sarl_core.mining.distributed.pieces import Reading, parquet_paths
    from sarl_core.shielding.shield import Shield

    files = []
    for paths in logs:
        with _naming(paths):
            files.append(parquet_paths(paths))
    shield = Shield(rule_set, projection=projection)
    reference = None if demonstrations is None else reference_of(shield, demonstrations)
    reading = Reading(stated(columns), missing=missing)
    held: list[AuditNumbers] = []
    with connected(cluster) as client:
        for place, (paths, own) in enumerate(zip(logs, files, strict=True)):

            def progress(done: int, total: int, place: int = place) -> bool | None:
                return advance(place * total + done, len(logs) * total)

            with _naming(paths):
                held.append(
                    audit_on_cluster(client, shield, own, reading, reference, progress=progress)
                )
    return held[0], held[1] if len(held) > 1 else None


def _said_of(demonstrations: Path, columns: Roles) -> Roles:
    """What was said of a log's columns, if the demonstrations have any of them."""
    from sarl_core.demonstrations.formats import table_columns
    from sarl_core.demonstrations.formats.mapping.roles import TOGETHER

    said = {part for name in columns for part in (name, *name.split(TOGETHER))}
    return columns if said and said.intersection(table_columns(demonstrations)) else {}


def _followed(
    growing: GrowingLog, hold: Callable[[Demonstrations], Audit], guards: list[GuardCondition]
) -> tuple[Audit, InputError | None]:
    """Audit a log again and again while it grows, until Ctrl-C or until it cannot be read on."""
    from sarl_core.mining.language import share_text

    held: Audit | None = None
    try:
        while True:
            began = time.monotonic()
            if (steps := growing.read()) is not None:
                held = hold(steps)
                failed = [one.text for one in guards if one.holds(held)]
                terminal.print_notes(
                    [
                        f"{held.steps:,} steps, {held.broken:,} broken "
                        f"({share_text(held.broken / held.steps)})"
                        + "".join(f"; {text} holds" for text in failed)
                    ]
                )
            # All is read again, so that a long log is read less often.
            time.sleep(max(_LOOK_SECONDS, _REST * (time.monotonic() - began)))
    except KeyboardInterrupt:
        if held is None:
            raise
        return held, None
    except InputError as error:  # it was rotated, or a new line is none of the log
        if held is None:
            raise
        return held, error


def _with_path(error: InputError, path: str) -> str:
    text = said(str(error))
    return text if path in text else f"{path}: {text}"


def _guard(held: AuditNumbers, guards: list[GuardCondition]) -> None:
    """End with a code of its own where a condition holds."""
    failed = [one for one in guards if one.holds(held)]
    terminal.print_notes(
        f"{one.text} counts as if it held: {one.measure} is not known"
        if math.isnan(one.value(held))
        else f"{one.text} holds: {one.measure} is {one.value(held):.6g}"
        for one in failed
    )
    if failed:
        raise typer.Exit(_FAILED)


def _print(
    held: AuditNumbers, comparison: LogComparison | None, title: str, sign_off: SignOff | None
) -> None:
    from sarl_core.cli.answers.summaries import print_notes
    from sarl_core.explaining.words.audit import (
        audit_facts,
        comparison_text,
        drift_text,
        interval_text,
        stretch_text,
    )
    from sarl_core.explaining.words.sign_off import sign_off_text
    from sarl_core.mining.language import share_text

    terminal.print_lines([title, *([sign_off_text(sign_off)] if sign_off else []), ""])
    terminal.print_facts(audit_facts(held))
    table = held.rule_table()
    broken = table[table["broken"] > 0].sort_values("broken", ascending=False)
    if len(broken):
        terminal.print_table(
            ("rule", "applies", "broken", "obeyed, by episodes", "95 % interval", "outside"),
            [
                (
                    row["name"],
                    f"{row['applies']:,}",
                    f"{row['broken']:,}",
                    share_text(row["obeyed"]),
                    "too few episodes"
                    if row["obeyed_low"] != row["obeyed_low"]
                    else f"{share_text(row['obeyed_low'])} to {share_text(row['obeyed_high'])}",
                    f"{row['outside']:,}",
                )
                for row in broken.head(_LISTED).to_dict("records")
            ],
        )
        if len(broken) > _LISTED:
            terminal.print_lines([f"and {len(broken) - _LISTED} more rules that were broken"])
    terminal.print_lines(stretch_text(held, one) for one in held.worst[:3])
    terminal.print_lines(["", drift_text(held.drift)])
    if comparison is not None:
        terminal.print_lines(["", comparison_text(comparison)])
        differing = [one for one in comparison.differences if one.drifted]
        terminal.print_table(
            ("share", "of", "before", "after", "difference in points"),
            [
                (one.name, one.what, *map(share_text, (one.before, one.now)), interval_text(one))
                for one in (*comparison.differences[:4], *differing[:_LISTED])
            ],
        )
    print_notes(held.notes)
