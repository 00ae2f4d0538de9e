"""``report.json``: everything that was found, with every seed and version.

One JSON object:

- ``format``: "sarl-paper"; ``version``: 2.
- ``by_chance``: how many claims would agree by chance, in words; empty if it is known of none.
- ``studies``: one object for each figure or table that was finished, by its name ("2" to "7",
  "table-1", ...), of
    - ``place`` and ``title``: as "Figure 2" and "Number of rules";
    - ``quick``: true if it was run with ``--quick``, whose numbers mean little;
    - ``command``: that makes it again;
    - ``made``: the day; ``seconds``: how long it took;
    - ``settings``: what it was run with, under ``seeds`` every seed;
    - ``inputs``: for each environment the digests of its ``recordings`` by number and of its
      ``experts`` by name;
    - ``versions``: of Python and the packages that matter;
    - ``files``: ``table`` (CSV, every single value), ``page`` (HTML) and ``picture`` (PNG);
    - ``numbers``: what sums the table up, by environment, arm or rule set;
    - ``claims``: a list, each with ``paper`` (what it says), ``where``, ``ours`` (what we found),
      ``verdict`` ("agrees", "partly", "does not agree" or "cannot be judged"), ``decided_by`` (the
      rule that decided), ``numbers`` (what it was decided on), ``by_chance`` (how often it would
      agree by chance, 0 to 1, or null) and ``constructed`` (why it holds whatever is demonstrated;
      empty if it may fail).

Claims follow from the tables alone and are worked out again whenever one of these changes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypedDict

from msgspec import Meta, Struct, to_builtins

from sarl_core.documents import MisfitError, Number, conformed, parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.files import whole_file
from sarl_core.limits import limited_bytes
from sarl_core.paper.chance import chance_text
from sarl_core.paper.verdicts import Claim

FORMAT, VERSION = "sarl-paper", 2
REPORT = "report.json"
MAX_BYTES = 20_000_000

# A report shall not point at files elsewhere.
FileName = Annotated[str, Meta(pattern=r"^(?!\.{1,2}$)[^/\\\0]+$")]


class Files(TypedDict):
    """Names of a study's files by their kind."""

    table: FileName
    page: FileName
    picture: FileName


class Entry(Struct, frozen=True, forbid_unknown_fields=True):
    """What one study found; the fields are those of the file.

    Attributes:
        place: As "Figure 2".
        title: What it shows.
        quick: Whether its numbers mean little.
        command: Makes it again.
        made: The day.
        seconds: How long it took.
        settings: What it was run with.
        inputs: Digests of what it was run on.
        versions: Of Python and packages.
        files: Names of its files by their kind.
        numbers: What sums it up.
        claims: The paper's and ours.
    """

    place: str
    title: str
    quick: bool
    command: str
    made: str
    seconds: Number
    settings: Mapping[str, Any]
    inputs: Mapping[str, Any]
    versions: Mapping[str, str]
    files: Files
    numbers: Mapping[str, Any]
    claims: tuple[Claim, ...]


@dataclass(frozen=True)
class PaperReport:
    """What was found so far.

    Attributes:
        studies: By name, in the order of the paper.
    """

    studies: Mapping[str, Entry] = field(default_factory=dict)


def write_report(report: PaperReport, folder: Path) -> None:
    """Write the report; it appears whole or not at all.

    Args:
        report: To write.
        folder: Where to.

    Raises:
        WorkError: If it cannot be written.
    """
    with whole_file(folder / REPORT) as unfinished:
        text = json.dumps(report_document(report), indent=1, ensure_ascii=False, allow_nan=False)
        unfinished.write_text(text + "\n", encoding="utf-8")


def report_document(report: PaperReport) -> dict[str, Any]:
    """The report for JSON.

    Args:
        report: Any.

    Returns:
        As the module says; numbers that are not finite are null.
    """
    studies = {name: to_builtins(entry) for name, entry in report.studies.items()}
    claims = [claim for entry in report.studies.values() for claim in entry.claims]
    document: dict[str, Any] = _plain(
        {
            "format": FORMAT,
            "version": VERSION,
            "by_chance": chance_text(claims),
            "studies": studies,
        }
    )
    return document


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    return value


def read_report(folder: Path) -> PaperReport | None:
    """Read a report.

    Args:
        folder: Where it lies.

    Returns:
        The report; None where there is none.

    Raises:
        InputError: If it cannot be read, or is not what `write_report` writes.
    """
    path = folder / REPORT
    try:
        if not path.exists():
            return None
        return parse_report(parse_json(limited_bytes(path, MAX_BYTES)))
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror or error}); choose another folder"
        ) from error
    except (ValueError, InputError) as error:
        raise InputError(
            f"{path} is no report of this program ({error}); delete it or choose another folder"
        ) from error


def parse_report(document: Any) -> PaperReport:
    """A report from its JSON document.

    Args:
        document: What was parsed.

    Returns:
        The report.

    Raises:
        ValueError: If anything is not as the module says.
    """
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ValueError(f"its format is not {FORMAT}")
    if document.get("version") != VERSION:
        raise ValueError(f"its version is {quoted(document.get('version'))} and not {VERSION}")
    studies = {}
    for name, entry in conformed(document, _ReportDocument).studies.items():
        try:
            studies[name] = conformed(entry, Entry)
        except MisfitError as error:
            raise MisfitError(error.what, f"study {quoted(name)}", *error.place) from error
    return PaperReport(studies)


class _ReportDocument(Struct):
    studies: dict[str, Any]
