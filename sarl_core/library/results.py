"""Results and notes as things that are kept: what work left, and what people say of things."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from sarl_core.documents import parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.explaining.words.certificate import certificate_facts, verdict_text
from sarl_core.files import as_path
from sarl_core.library.file_store import content_digest
from sarl_core.library.items import Item
from sarl_core.limits import limited_bytes
from sarl_core.studies.certificate import Certificate
from sarl_core.studies.certificate_files import FORMAT, certificate_from

if TYPE_CHECKING:
    from sarl_core.library.library import Library

RESULT_ENDINGS = (".csv", ".gif", ".html", ".json", ".mp4", ".png")
NOTE_ENDINGS = (".md", ".txt")
LONGEST_NOTE = 100_000  # characters
_RESULT, _NOTE = "result", "note"
_BEGINNINGS = {
    ".gif": (0, b"GIF8"),
    ".png": (0, b"\x89PNG\r\n\x1a\n"),
    ".mp4": (4, b"ftyp"),
}
_NAME = 80  # characters of a note that it is called by
_LOOKED_AT = 2**22  # bytes of a file that is looked into


@dataclass(frozen=True)
class ResultView:
    """The beginning of a result, as far as people read it.

    Attributes:
        rows: Of a table, its headings first; each as long as the first.
        lines: Of a text.
        more: Whether there is more than this.
    """

    rows: tuple[tuple[str, ...], ...] = ()
    lines: tuple[str, ...] = ()
    more: bool = False


def add_result(
    library: Library,
    path: str | Path,
    name: str = "",
    *,
    author: str,
    about: Sequence[str] = (),
    address: str = "",
) -> Item:
    """Keep a file that work left: a table, an answer, a report, a picture, a certificate.

    Args:
        library: Where.
        path: With one of `RESULT_ENDINGS`.
        name: What it is called; as the file is where not given.
        author: Whose it is.
        about: Ids of what it is about.
        address: Of the page of the dashboard that shows it, as "measure?data=cartpole".

    Returns:
        What is kept.

    Raises:
        InputError: If the file cannot be read, is empty, is none of these, or is a certificate
            that does not hold together; or as of `Library.add`.
        WorkError: If it cannot be written.
    """
    path = as_path(path)
    ending = path.suffix.lower()
    if ending not in RESULT_ENDINGS:
        raise InputError(
            f"{path} ends in {quoted(ending)} and a result in one of {', '.join(RESULT_ENDINGS)}; "
            "give such a file, or choose another kind"
        )
    digest, size = content_digest(path)
    if not size:
        raise InputError(f"{path} is empty; give the file of a result")
    _require_form(path, ending)
    certificate = _certificate_of(path, name=str(path)) if ending == ".json" else None
    verdict = {} if certificate is None else {"certificate": verdict_text(certificate)}
    return library.add(
        "result",
        name or path.stem,
        {_RESULT: (path, ending)},
        author=author,
        digest=digest,
        came_from=standing_ids(library, about),
        details={"file_name": path.name, **({"address": address} if address else {}), **verdict},
    )


def add_note(
    library: Library,
    text: str,
    name: str = "",
    *,
    author: str,
    about: Sequence[str] = (),
    ending: str = ".txt",
) -> Item:
    """Keep what somebody says, of things or by itself.

    Args:
        library: Where.
        text: At most `LONGEST_NOTE` characters.
        name: What it is called; by its first line where not given.
        author: Whose it is.
        about: Ids of what it is about.
        ending: One of `NOTE_ENDINGS`.

    Returns:
        What is kept.

    Raises:
        InputError: If nothing is said, or too much; or as of `Library.add`.
        WorkError: If it cannot be written.
    """
    lines = _seen(text).strip().splitlines()
    if not lines:
        raise InputError("a note needs some words; write them")
    if len(text) > LONGEST_NOTE:
        raise InputError(
            f"the note has {len(text):,} characters, more than {LONGEST_NOTE:,}; shorten it, or "
            "keep it as several"
        )
    first = " ".join(lines[0].lstrip("# ").split()) or "a note"
    content = text.encode("utf-8", errors="replace")
    return library.add(
        "note",
        name or (first if len(first) <= _NAME else f"{first[: _NAME - 1]}…"),
        {_NOTE: (content, ending)},
        author=author,
        digest=content_digest(content)[0],
        came_from=standing_ids(library, about),
    )


def note_of_file(path: str | Path) -> str:
    """The text of a file that is to be kept as a note.

    Args:
        path: With one of `NOTE_ENDINGS`.

    Returns:
        What stands in it.

    Raises:
        InputError: If it is no such file, cannot be read, or is no text in UTF-8.
    """
    path = as_path(path)
    if path.suffix.lower() not in NOTE_ENDINGS:
        raise InputError(
            f"{path} ends in {quoted(path.suffix)} and a note in one of {', '.join(NOTE_ENDINGS)}; "
            "give such a file, or choose another kind"
        )
    try:
        return file_content(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8; save it as such") from error


def note_text(library: Library, item: Item) -> str:
    """What a note says, without signs that cannot be seen.

    Args:
        library: Where it is.
        item: A note.

    Returns:
        Lines of text, which is to be shown as such and never as HTML.

    Raises:
        InputError: If its file is missing.
    """
    if not item.files:
        return ""
    content = library.path(item).read_bytes()[: 4 * LONGEST_NOTE]
    return _seen(content.decode("utf-8", errors="replace")).strip()


def result_view(path: Path, most: int) -> ResultView:
    """What stands in a table or a JSON document, as text.

    Args:
        path: Of a result.
        most: Rows or lines.

    Returns:
        Nothing of other files.

    Raises:
        InputError: If it cannot be read.
    """
    if path.suffix not in (".csv", ".json"):
        return ResultView()
    try:
        with path.open("rb") as file:
            content, rest = file.read(_LOOKED_AT), file.read(1)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror or error}); bring it back from a backup"
        ) from error
    text = content.decode("utf-8-sig", errors="replace")
    if path.suffix == ".json":
        with suppress(InputError):  # else it is said as it stands
            if not rest and (certificate := _certificate_of(path, name="it")) is not None:
                facts = certificate_facts(certificate)
                return ResultView(rows=(("what", "value"), *facts)[: most + 1])
        if not rest:
            with suppress(ValueError):  # else it is said as it stands
                text = json.dumps(parse_json(content, finite=False), indent=1, ensure_ascii=False)
        lines = _seen(text).splitlines()
        return ResultView(lines=tuple(lines[:most]), more=bool(rest) or len(lines) > most)
    try:
        rows = list(islice(csv.reader(io.StringIO(text, newline="")), most + 2))
    except csv.Error:
        lines = _seen(text).splitlines()
        return ResultView(lines=tuple(lines[:most]), more=bool(rest) or len(lines) > most)
    width = len(rows[0]) if rows else 0
    table = [tuple([*map(_seen, row), *[""] * width][:width]) for row in rows[: most + 1]]
    return ResultView(rows=tuple(table), more=bool(rest) or len(rows) > most + 1)


def notes_about(library: Library, item: Item) -> list[Item]:
    """The notes that were written to a thing, the first first.

    Raises:
        WorkError: If the library cannot be read.
    """
    return library.made_of(item.id, kind="note")[::-1]


def note_writer(note: Item) -> str:
    """Who wrote a note; whose it is here may have brought it from elsewhere."""
    return str(note.details.get("made_by", note.author))


def standing_ids(library: Library, identifiers: Sequence[str]) -> list[str]:
    """Ids as they are written down.

    Args:
        library: Where what they name has to be.
        identifiers: Each with "library:" before it or without.

    Returns:
        Each once.

    Raises:
        InputError: If one is no id, or names nothing that is there.
    """
    items = [library.item(one) for one in identifiers]
    for item in items:
        if item.removed is not None:
            raise InputError(f"{quoted(item.name)} was removed; bring it back first")
    return list(dict.fromkeys(item.id for item in items))


def _certificate_of(path: Path, *, name: str) -> Certificate | None:
    """What a file certifies; None where it is no certificate.

    Raises:
        InputError: If it is one that does not hold together.
    """
    try:
        document = parse_json(file_content(path), finite=False)
    except ValueError:
        return None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        return None
    return certificate_from(document, name=name)


def _require_form(path: Path, ending: str) -> None:
    """Refuse what is not what its name says: it would be found out by whoever opens it."""
    if ending == ".json":
        try:
            parse_json(file_content(path), finite=False)
        except ValueError as error:
            raise InputError(f"{path} is no JSON ({error}); write it again") from error
    elif ending in _BEGINNINGS:
        place, wanted = _BEGINNINGS[ending]
        with path.open("rb") as file:
            beginning = file.read(place + len(wanted))
        if beginning[place:] != wanted:
            raise InputError(f"{path} is no {ending[1:].upper()}; write it again")


def file_content(path: Path) -> bytes:
    """What is in a file that somebody names.

    Raises:
        InputError: If it cannot be read.
    """
    try:
        return limited_bytes(path)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror or error}); give a file that can"
        ) from error


def _seen(text: str) -> str:
    """Text without what a terminal would take for more than text."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else " " for sign in text)
