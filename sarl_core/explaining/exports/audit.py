"""An audit as files: one JSON document, tables by step, rule and episode, and a page to read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sarl_core.auditing.audit import Audit
from sarl_core.auditing.comparison import LogComparison
from sarl_core.auditing.drift import Moved
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.errors import InputError, WorkError
from sarl_core.explaining.html.table import Column, table_html
from sarl_core.explaining.tables.spreadsheet_cells import safe_cells
from sarl_core.explaining.templates import render, style_sheet
from sarl_core.explaining.words.audit import (
    audit_facts,
    comparison_text,
    drift_text,
    interval_text,
    stretch_text,
)
from sarl_core.explaining.words.sign_off import SignOff, approvals_document, sign_off_text
from sarl_core.files import whole_file
from sarl_core.mining.language import sentence, share_text

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup

_MOST_ROWS = 100  # of a table that is read


def save_audit(
    audit: AuditNumbers,
    folder: Path,
    *,
    title: str,
    comparison: LogComparison | None = None,
    sign_off: SignOff | None = None,
) -> None:
    """Write an audit into a folder: `audit.json`, `audit.html`, and tables as CSV.

    Args:
        audit: Rules against a log; where its steps are elsewhere, there is no table of them.
        folder: Made if it is not there; the folder above it has to be.
        title: Of the page.
        comparison: With another log, or None.
        sign_off: Who approved the rules; None to say nothing of it.

    Raises:
        InputError: If the folder cannot be made.
        WorkError: If a file cannot be written.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be made ({error.strerror}); choose another"
        ) from error
    document = audit_document(audit, comparison, sign_off)
    _write(folder / "audit.json", json.dumps(document, allow_nan=False, indent=1) + "\n")
    page = audit_html(audit, title=title, comparison=comparison, sign_off=sign_off)
    _write(folder / "audit.html", page)
    _write_table(audit.rule_table(), folder / "rules.csv")
    _write_table(audit.episodes, folder / "episodes.csv")
    if isinstance(audit, Audit):
        _write_table(audit.to_frame(), folder / "steps.csv")


def audit_document(
    audit: AuditNumbers, comparison: LogComparison | None = None, sign_off: SignOff | None = None
) -> dict[str, Any]:
    """An audit as JSON has it.

    Args:
        audit: Rules against a log.
        comparison: With another log, or None.
        sign_off: Who approved the rules; None where that is not known.

    Returns:
        `Audit.to_dict`, with `comparison` where there is one, and `approved`.
    """
    document = audit.to_dict()
    if comparison is not None:
        document["comparison"] = comparison.to_dict()
    return {**document, "approved": approvals_document(sign_off)}


def audit_html(
    audit: AuditNumbers,
    *,
    title: str,
    comparison: LogComparison | None = None,
    sign_off: SignOff | None = None,
) -> Markup:
    """A page without script that opens by itself.

    Args:
        audit: Rules against a log.
        title: Of the page.
        comparison: With another log, or None.
        sign_off: Who approved the rules; None to say nothing of it.

    Returns:
        The document.
    """
    return render(
        "documents/audit",
        title=title,
        sheet=style_sheet(),
        sign_off=sign_off_text(sign_off),
        facts=audit_facts(audit),
        stretches=[stretch_text(audit, one) for one in audit.worst],
        rules=broken_rules_html(audit),
        episodes=_episodes(audit),
        drift=drift_text(audit.drift),
        moved=moved_html(audit.drift.all, "now, and before"),
        compared="" if comparison is None else comparison_text(comparison),
        differences=""
        if comparison is None
        else moved_html(comparison.differences, "after, before"),
        notes=audit.notes,
    )


def broken_rules_html(audit: AuditNumbers) -> Markup:
    """The rules that were broken, the most often first, as a table.

    Args:
        audit: Rules against a log.

    Returns:
        HTML.
    """
    table = audit.rule_table()
    order = table["broken"].to_numpy().argsort(kind="stable")[::-1]
    rows = []
    for place in order[:_MOST_ROWS].tolist():
        row, held = table.iloc[place], audit.obeyed_by_rule[place]
        if not row["broken"]:
            break
        between = (
            "too few episodes"
            if held.interval is None
            else f"{share_text(held.interval.low)} to {share_text(held.interval.high)}"
        )
        rows.append(
            (
                row["name"],
                sentence(audit.rule_set[place], audit.rule_set, evidence=False),
                f"{row['broken']:,} of {row['applies']:,}",
                share_text(row["obeyed"]),
                between,
                f"{row['outside']:,}",
            )
        )
    in_force = (
        "to which it applies; of a rule that forbids, where none demands an action"
        if audit.rule_set.forbids
        else "in which it was the rule in force"
    )
    columns = (
        Column("Rule"),
        Column("It says", "w"),
        Column("Broken", "n", f"Steps that broke it, of those {in_force}"),
        Column("Obeyed", "n", "Mean over the episodes in which it applied"),
        Column("95 % interval", "n", "Over these episodes"),
        Column("Outside", "n", "Breaks in states that its data do not reach"),
    )
    return table_html(columns, rows, "Rules that were broken")


def _episodes(audit: AuditNumbers) -> Markup:
    table = audit.episodes.sort_values("broken", ascending=False, kind="stable").head(_MOST_ROWS)
    titles = ["Episode", "Steps", "With a rule", "Broken", "Longest run", "Near misses"]
    names = ["episode", "steps", "covered", "broken", "longest_run", "near"]
    if audit.time is not None:
        titles += ["Breaks a minute", "In the worst minute"]
        names += ["breaks_per_minute", "worst_minute"]
    columns = tuple(Column(title, "n") for title in titles)
    rows = [
        (
            str(row[0]),
            *(f"{value:,}" for value in row[1:6]),
            *(f"{value:.3g}" for value in row[6:]),
        )
        for row in table[names].itertuples(index=False)
    ]
    return table_html(columns, rows, "Episodes")


def moved_html(moved: tuple[Moved, ...], label: str) -> Markup:
    """Shares before and now with the intervals of their differences, those that differ first.

    Args:
        moved: Of a drift or a comparison.
        label: Which of the two is which, for those who do not see it.

    Returns:
        HTML.
    """
    ordered = sorted(moved, key=lambda one: (not one.drifted, -abs(one.now - one.before)))
    columns = (
        Column("What"),
        Column("Share of", "w"),
        Column("Before", "n"),
        Column("Now", "n"),
        Column("Difference in points", "n", "All intervals hold together with 95 % certainty"),
        Column(""),
    )
    rows = [
        (
            one.name,
            one.what,
            share_text(one.before),
            share_text(one.now),
            interval_text(one),
            "differs" if one.drifted else "",
        )
        for one in ordered[:_MOST_ROWS]
    ]
    return table_html(columns, rows, f"Shares {label}")


def _write(path: Path, text: str) -> None:
    with whole_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8", newline="\n")


def _write_table(table: pd.DataFrame, path: Path) -> None:
    """A table with many rows is written by pyarrow, which takes a tenth of the time."""
    import pyarrow
    from pyarrow import csv

    with whole_file(path) as unfinished:
        try:
            csv.write_csv(pyarrow.Table.from_pandas(safe_cells(table)), unfinished)
        except pyarrow.ArrowException as error:
            raise WorkError(f"{path} cannot be written ({error}); choose another place") from error
