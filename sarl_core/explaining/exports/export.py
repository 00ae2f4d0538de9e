"""Rule sets for other programs and for reading, every rule, never cut short.

CSV is written here; the other formats have files of their own and are found from here.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.errors import InputError, require
from sarl_core.explaining.exports.program import require_rules
from sarl_core.explaining.tables.spreadsheet_cells import safe_cell
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.files import as_path, whole_file
from sarl_core.mining.action_words import says_label
from sarl_core.mining.editing.rounding import Rounding, merged_rules, rounded_rules
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import Wording, counted
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet, exact_texts
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid, Shield

FORMATS = (".json", ".csv", ".md", ".py", ".c", ".onnx")
"""What a rule set is carried away as: endings of file names."""
CSV_COLUMNS = (
    "id",
    "dimension",
    "action",
    "rule",
    "conditions",
    "support",
    "confidence",
    "lift",
    "joint_support",
    "samples",
    "length",
    "merged_length",
    "enabled",
    "origin",
    "pinned",
    *(f"held_out_{name}" for name in HeldOut._fields),
)

_AT_ONCE = 50_000  # states that are decided in one go: the records of a million take hundreds of MB
_NOT_TRIED = (None,) * len(HeldOut._fields)


class Prepared(NamedTuple):
    """Rules as they are to be carried away.

    Attributes:
        rule_set: Rounded and merged as was asked.
        rounding: What became of each threshold; None where none was to be rounded.
        changed: Demonstrated pairs that the rounded rules decide differently, by the shield's own
            count; 0 where none was to be rounded.
        notes: What is to be said of how rules and demonstrations were matched, as clauses.
    """

    rule_set: RuleSet
    rounding: Rounding | None = None
    changed: int = 0
    notes: tuple[str, ...] = ()


class Exported(NamedTuple):
    """What `export_rules` did.

    Attributes:
        vectors: Where the test vectors are.
        prepared: The rules as they were written.
    """

    vectors: Path
    prepared: Prepared


def prepare(
    rule_set: RuleSet, *, merged: bool = False, demonstrations: Demonstrations | None = None
) -> Prepared:
    """Round and merge rules, as asked.

    Args:
        rule_set: The rules.
        merged: Whether several conditions on one feature become one interval.
        demonstrations: Round the thresholds to what changes no decision on these; None for not.

    Returns:
        The rules, and what rounding did.

    Raises:
        InputError: If there are no rules, or the demonstrations are for other features or actions.
    """
    require_rules(rule_set)
    notes: tuple[str, ...] = ()
    rounding, changed = None, 0
    if demonstrations is not None:
        must = "what thresholds are rounded on must be Demonstrations"
        require(demonstrations, Demonstrations, must, "load them: load_demonstrations(path)")
        demonstrations = recoded(
            demonstrations, rule_set.source.features, called="the demonstrations"
        )
        rule_set, notes = rules_for(rule_set, demonstrations)
        rounding = rounded_rules(rule_set, demonstrations)
        changed = decisions_changed(rule_set, rounding.rule_set, demonstrations)
        rule_set = rounding.rule_set
    return Prepared(merged_rules(rule_set) if merged else rule_set, rounding, changed, notes)


def decisions_changed(before: RuleSet, after: RuleSet, demonstrations: Demonstrations) -> int:
    """Count the demonstrated pairs that two rule sets decide differently.

    Args:
        before: Rules.
        after: As many, in the same order.
        demonstrations: N states with the actions taken in them.

    Returns:
        Pairs for which the rule in force or the executed action differs in some dimension.

    Raises:
        InputError: If the demonstrations have another number of action dimensions.
    """
    dimensions = demonstrations.action_columns.shape[1]
    if dimensions != len(before.actions):
        raise InputError(
            f"the rules are for {counted(len(before.actions), 'action dimension')} and the "
            f"demonstrations have {dimensions}; choose demonstrations of the rules' environment"
        )
    shields = (Shield(before), Shield(after))
    changed = 0
    for start in range(0, len(demonstrations), _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        states, actions = demonstrations.observations[rows], demonstrations.action_columns[rows]
        one, other = (shield.decide_batch(states, actions) for shield in shields)
        differs = (one.rules != other.rules) | (one.executed != other.executed)
        changed += int(np.count_nonzero(differs.any(axis=1)))
    return changed


def export_content(
    rule_set: RuleSet,
    suffix: str,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
    sign_off: SignOff | None = None,
) -> bytes:
    """A rule set in one of the formats.

    Args:
        rule_set: The rules.
        suffix: One of `FORMATS`.
        projection: What a continuous action that breaks a rule becomes; for code.
        on_invalid: What becomes of a step whose state is no state, or whose action is none; for
            code.
        sign_off: Who approved these very rules; said in all but .json and .csv, which hold rules
            and nothing else. None to say nothing.

    Returns:
        The content of the file.

    Raises:
        InputError: If the format is not known, there are no rules, or code is asked of rules none
            of which is switched on.
        WorkError: If a package is missing that the format needs.
    """
    require_rules(rule_set)
    if suffix == ".onnx":
        from sarl_core.explaining.exports.onnx_model import rules_to_onnx

        return rules_to_onnx(rule_set, projection, on_invalid, sign_off)
    # A file may have brought half of a pair that UTF-8 cannot write.
    text = _text(rule_set, suffix, projection, on_invalid, sign_off)
    return text.encode("utf-8", errors="replace")


def export_vectors(
    rule_set: RuleSet, projection: Projection = "centre", on_invalid: OnInvalid = "raise"
) -> bytes:
    """Test vectors for a rule set, as CSV.

    Args:
        rule_set: As it was exported.
        projection: As it was exported.
        on_invalid: As it was exported.

    Returns:
        The content of the file that stands beside the export.

    Raises:
        InputError: If there are no rules, or none is switched on.
    """
    from sarl_core.explaining.exports.vectors import make_vectors, vectors_to_csv

    return vectors_to_csv(make_vectors(rule_set, projection, on_invalid)).encode()


def vectors_name(name: str) -> str:
    """What the file of test vectors is called.

    Args:
        name: Of the exported file.

    Returns:
        As "shield.c.vectors.csv".
    """
    return f"{name}.vectors.csv"


def export_rules(
    rule_set: RuleSet,
    path: str | Path,
    *,
    merged: bool = False,
    demonstrations: Demonstrations | None = None,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
) -> Exported:
    """Write rules for other programs or for reading, and test vectors beside them.

    Args:
        rule_set: The rules.
        path: Its ending says the format: .json, .csv, .md, .py, .c or .onnx.
        merged: Whether several conditions on one feature become one interval.
        demonstrations: Round the thresholds to what changes no decision on these; None for not.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.

    Returns:
        Where the test vectors are, and what rounding did.

    Raises:
        InputError: If the format is not known, there are no rules, code is asked of rules none of
            which is switched on, the demonstrations are for other features or actions, or the
            folder does not exist.
        WorkError: If it cannot be written to, or a package is missing that the format needs.
    """
    prepared = prepare(rule_set, merged=merged, demonstrations=demonstrations)
    return Exported(save_export(prepared, path, projection, on_invalid), prepared)


def save_export(
    prepared: Prepared,
    path: str | Path,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
    sign_off: SignOff | None = None,
) -> Path:
    """Write rules that are ready to be carried away, and test vectors beside them.

    Args:
        prepared: As `prepare` gives them.
        path: As of `export_rules`.
        projection: As of `export_rules`.
        on_invalid: As of `export_rules`.
        sign_off: As of `export_content`.

    Returns:
        Where the test vectors are.

    Raises:
        InputError: As of `export_rules`.
        WorkError: As of `export_rules`.
    """
    path, rule_set = as_path(path), prepared.rule_set
    content = export_content(rule_set, path.suffix.lower(), projection, on_invalid, sign_off)
    vectors = export_vectors(rule_set, projection, on_invalid)
    beside = path.with_name(vectors_name(path.name))
    for place, data in ((beside, vectors), (path, content)):
        with whole_file(place) as unfinished:
            unfinished.write_bytes(data)
    return beside


def _text(
    rule_set: RuleSet,
    suffix: str,
    projection: Projection,
    on_invalid: OnInvalid,
    sign_off: SignOff | None,
) -> str:
    if suffix == ".json":
        from sarl_core.mining.rule_set import rules_to_json

        return rules_to_json(rule_set)
    if suffix == ".csv":
        return rules_to_csv(rule_set)
    if suffix == ".md":
        from sarl_core.explaining.exports.markdown import rules_to_markdown

        return rules_to_markdown(rule_set, sign_off)
    if suffix == ".py":
        from sarl_core.explaining.exports.code_python import rules_to_python

        return rules_to_python(rule_set, projection, on_invalid, sign_off)
    if suffix == ".c":
        from sarl_core.explaining.exports.code_c import rules_to_c

        return rules_to_c(rule_set, projection, on_invalid, sign_off)
    raise InputError(f"the format {suffix!r} is none of {', '.join(FORMATS)}; choose one of them")


def rules_to_csv(rule_set: RuleSet) -> str:
    """A rule set as CSV.

    Args:
        rule_set: Any number of rules.

    Returns:
        A header and one line a rule; `conditions` holds the queries in path order with their
        thresholds at full precision, `rule` the sentence with rounded numbers.
    """
    lines = [_csv_line(CSV_COLUMNS)]
    wording = Wording(rule_set)
    for rule, conditions in zip(rule_set.rules, exact_texts(rule_set), strict=True):
        dimension = rule_set.actions[rule.dimension]
        held_out = rule.held_out
        cells = (
            safe_cell(rule.id),
            safe_cell(dimension.name),
            safe_cell(says_label(rule, dimension)),
            safe_cell(wording.sentence(rule, evidence=False)),
            safe_cell(conditions),
            repr(rule.support),
            repr(rule.confidence),
            repr(rule.lift),
            repr(rule.joint_support),
            str(rule.samples),
            str(rule.length),
            str(wording.merged_length(rule)),
            "yes" if rule.enabled else "no",
            rule.origin,
            "yes" if rule.pinned else "no",
            *("" if one is None else str(one) for one in held_out or _NOT_TRIED),
        )
        lines.append(_csv_line(cells))
    return "".join(lines)


def _csv_line(cells: Sequence[str]) -> str:
    """Cells as a line of CSV, as `csv` writes it."""
    line = ",".join(cells)
    if any(sign in line for sign in '"\r\n'):
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow(cells)
        return text.getvalue()
    if line.count(",") >= len(cells):  # some stand in a cell, which is kept together
        line = ",".join(f'"{cell}"' if "," in cell else cell for cell in cells)
    return f"{line}\n"
