"""The command that carries rules away: into other programs, and onto paper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_demonstrations, sign_off_of
from sarl_core.cli.options import (
    Columns,
    EnvOfFile,
    Json,
    MissingName,
    OnInvalidName,
    ProjectionName,
    out_option,
    with_columns,
    with_environment,
)
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.explaining.exports.export import Prepared
    from sarl_core.mining.rule_set import RuleSet

_ENDINGS = (".json", ".csv", ".md", ".py", ".c", ".onnx")
_MOST_THRESHOLDS = 5


@with_environment
@with_columns
def export(
    rules: Annotated[
        Path, typer.Argument(metavar="RULES.json", help="The rule file.", show_default=False)
    ],
    columns: Columns,
    out: Annotated[
        Path,
        out_option(
            "A .json (rule file), .csv, .md, .py, .c or .onnx file; test vectors are written "
            "beside it."
        ),
    ],
    merged: Annotated[
        bool,
        typer.Option("--merged", help="Make several conditions on one feature one interval."),
    ] = False,
    rounded: Annotated[
        bool,
        typer.Option(
            "--rounded",
            help="Round thresholds to the fewest digits that change no decision on "
            "--demonstrations.",
        ),
    ] = False,
    demonstrations: Annotated[
        Path | None,
        typer.Option(
            "--demonstrations",
            metavar="FILE",
            show_default=False,
            help="The data that --rounded may not decide differently.",
        ),
    ] = None,
    env: EnvOfFile = None,
    projection: ProjectionName = "centre",
    on_invalid: OnInvalidName = "raise",
    missing: MissingName = "refuse",
    as_json: Json = False,
) -> None:
    """Write rules as code or for reading, with test vectors at every threshold.

    Example: `python -m sarl_core export rules.json --out shield.c --rounded --demonstrations
    data/demonstrations/lunar_lander.parquet`
    """
    terminal.check_output(out, _ENDINGS)
    if rounded != (demonstrations is not None):
        raise InputError(
            "give --demonstrations, on which no decision may change, with --rounded"
            if rounded
            else "--demonstrations are for --rounded; give both, or neither"
        )
    with terminal.working("Exporting"):
        from sarl_core.explaining.exports.export import prepare, save_export
        from sarl_core.mining.rule_set import RuleSet

        rule_set = RuleSet.load(rules)
        given = (
            None
            if demonstrations is None
            else read_demonstrations(demonstrations, env, columns, missing)
        )
        prepared = prepare(rule_set, merged=merged, demonstrations=given)
        sign_off = sign_off_of(prepared.rule_set)  # rounded or merged they are other rules
        vectors = save_export(prepared, out, projection, on_invalid, sign_off)
        notes = (*(given.notes if given is not None else ()), *prepared.notes)
    if as_json:
        from sarl_core.explaining.words.sign_off import approvals_document

        document = _document(prepared, out, vectors)
        approved = approvals_document(sign_off)
        terminal.print_json({**document, "notes": list(notes), "approved": approved})
    else:
        from sarl_core.cli.answers.summaries import print_notes
        from sarl_core.explaining.words.sign_off import sign_off_text

        terminal.print_lines(_lines(prepared, out, vectors))
        terminal.print_lines([sign_off_text(sign_off)] if sign_off else [])
        print_notes(notes)


def _document(prepared: Prepared, out: Path, vectors: Path) -> dict[str, Any]:
    rounding = prepared.rounding
    return {
        "file": str(out),
        "vectors": str(vectors),
        "rules": len(prepared.rule_set),
        "rounding": None
        if rounding is None
        else {
            "decisions_changed": prepared.changed,
            "rounded": rounding.rounded,
            "kept": [
                {
                    "dimension": prepared.rule_set.actions[one.dimension].name,
                    "feature": prepared.rule_set.source.features[one.feature].name,
                    "threshold": one.threshold,
                    "rules": list(one.rules),
                    "why": one.why,
                }
                for one in rounding.unrounded
            ],
        },
    }


def _lines(prepared: Prepared, out: Path, vectors: Path) -> list[str]:
    from sarl_core.mining.language import counted

    lines = [
        f"Wrote {out}: {counted(len(prepared.rule_set), 'rule')}.",
        f"Wrote {vectors}: states at every threshold, and what the shield decides there.",
    ]
    rounding = prepared.rounding
    if rounding is None:
        return lines
    lines.append(
        f"{counted(rounding.rounded, 'threshold')} became shorter; on the demonstrations "
        f"{counted(prepared.changed, 'decision')} changed."
    )
    if rounding.unrounded:
        lines.append(f"{counted(len(rounding.unrounded), 'threshold')} stayed:")
        lines += [
            f"  {_unrounded(one, prepared.rule_set)}"
            for one in rounding.unrounded[:_MOST_THRESHOLDS]
        ]
        if len(rounding.unrounded) > _MOST_THRESHOLDS:
            lines.append(
                f"  and {len(rounding.unrounded) - _MOST_THRESHOLDS:,} more; --json lists them all."
            )
    return lines


def _unrounded(threshold: Any, rule_set: RuleSet) -> str:
    from sarl_core.decimals import decimal_text
    from sarl_core.demonstrations.splits import written_threshold

    name = rule_set.source.features[threshold.feature].name
    # What tells all states apart as it does: as a double it may have digits that tell nothing.
    return f"{name} {decimal_text(written_threshold(threshold.threshold, None))} ({threshold.why})"
