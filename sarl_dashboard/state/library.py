"""What visitors make, kept beyond their session: opened once, and doing without where it fails."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import ColumnRole
from sarl_core.demonstrations.shared import in_shared_memory
from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.library.contents import (
    add_demonstrations,
    add_edits,
    add_mined,
    add_rules,
    data_of,
    edits_of,
    rules_of,
)
from sarl_core.library.file_store import content_digest
from sarl_core.library.items import Item, Kind, as_id
from sarl_core.library.logs import add_log
from sarl_core.library.place import LibraryPlace, place_of, usual_author
from sarl_core.library.results import add_result
from sarl_core.limits import limited_bytes
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.editing.edits import Edit
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.rollouts.episode_files import episodes_from_json, episodes_to_json
from sarl_core.rollouts.episodes import Episodes
from sarl_dashboard import session
from sarl_dashboard.cache import cached
from sarl_dashboard.text import digest_of

if TYPE_CHECKING:
    from sarl_core.library import Library

_AMOUNT: dict[Kind, str] = {"episodes": "episodes", "improvement": "rounds", "study": "runs"}
"""How details call how much of some work is finished."""
_OPENED: dict[LibraryPlace, Library] = {}
_LOCK = Lock()
_WORKING_FOR: ContextVar[str] = ContextVar("working_for", default="")


def library() -> Library:
    """The library of this server, opened once for all visits.

    Raises:
        SarlError: If it cannot be opened.
    """
    # Loading what reads a database takes a third of a second, which a first look need not wait for.
    from sarl_core.library import Library

    place = place_of()
    with _LOCK:
        if place not in _OPENED:
            _OPENED[place] = Library(place)
        return _OPENED[place]


def author() -> str:
    """Who works here: who has signed in, where one has to; for work, who began it."""
    return _WORKING_FOR.get() or session.signed_in() or usual_author()


@contextmanager
def working_for(name: str) -> Iterator[None]:
    """Keep what is made in this thread as somebody's, who may have gone meanwhile."""
    token = _WORKING_FOR.set(name)
    try:
        yield
    finally:
        _WORKING_FOR.reset(token)


def is_id(text: str) -> bool:
    """Whether a text may be the id of something that is kept."""
    try:
        return as_id(text) == text
    except InputError:
        return False


def own_demonstrations() -> list[Item]:
    """The demonstrations in a visitor's list, the newest first; [] where there is no library."""
    return _own("demonstrations")


def own_rules() -> list[Item]:
    """The rule sets in a visitor's list, the newest first; [] where there is no library."""
    return _own("rules")


def _own(kind: Kind) -> list[Item]:
    try:
        return [] if place_of().is_new else library().items(author(), kind=kind)
    except (SarlError, OSError):
        return []


def standing_item(identifier: str) -> Item:
    """What is kept under an id.

    Raises:
        SarlError: If there is none, it was removed, or the library cannot be read.
    """
    item = library().item(identifier)
    if item.removed is not None:
        raise InputError(
            f"{item.name} was removed by {item.author}, who can bring it back on the page Library; "
            "ask for it, or choose something else"
        )
    return item


def stored_demonstrations(identifier: str) -> Demonstrations | MinedData:
    """Demonstrations that are kept, or what is left of some.

    Raises:
        SarlError: If there are none, they were removed, or cannot be read.
    """
    item = standing_item(identifier)
    stored = _read(item.id, item.digest)
    _ids()[_steps_digest(stored)] = item.id
    return stored


@cached(show_spinner="Reading the demonstrations …")
def _read(identifier: str, digest: str) -> Demonstrations | MinedData:
    opened = library()
    stored = data_of(opened, opened.item(identifier))
    return stored if isinstance(stored, MinedData) else in_shared_memory(stored)


def _steps_digest(data: Demonstrations | MinedData) -> str:
    """By what pages know them: they work on the steps that are here."""
    return data.sample.digest if isinstance(data, MinedData) else data.digest


def stored_rules(item: Item) -> RuleSet:
    """A rule set that is kept.

    Raises:
        SarlError: If it is something else, or cannot be read.
    """
    return _read_rules(item.id, item.digest)


@cached(show_spinner="Reading the rules …")
def _read_rules(identifier: str, digest: str) -> RuleSet:
    opened = library()
    return rules_of(opened, opened.item(identifier))


def stored_edits(item: Item, rule_set: RuleSet) -> tuple[Edit, ...]:
    """Edits that are kept.

    Args:
        item: The edits.
        rule_set: That they were made on.

    Raises:
        SarlError: If it is something else, or cannot be read.
    """
    return edits_of(library(), item, rule_set)


def keep(data: Demonstrations | MinedData, name: str) -> str:
    """Keep what was uploaded, and remember where.

    Args:
        data: Read and checked.
        name: Of the file.

    Returns:
        Its id.

    Raises:
        SarlError: If it cannot be kept.
    """
    item = upload_item(data, name)
    _ids()[_steps_digest(data)] = item.id
    _say_room(library())
    return item.id


def upload_item(data: Demonstrations | MinedData, name: str) -> Item:
    """Keep what was uploaded; for work beside the page too.

    Args:
        data: Read and checked.
        name: Of the file.

    Returns:
        What is kept; where its author keeps the same already, that.

    Raises:
        SarlError: If it cannot be kept.
    """
    opened = library()
    steps = data.sample if isinstance(data, MinedData) else data
    mined = data.digest if isinstance(data, MinedData) else ""
    known = [
        one
        for one in opened.with_digest(steps.whole.digest, kind="demonstrations")
        if (one.author, one.details.get("mined", "")) == (author(), mined)
    ]
    if known:
        return known[0]
    if isinstance(data, MinedData):
        return add_mined(opened, data, name, author=author())
    return add_demonstrations(opened, data, name, author=author())


def details_of(demonstrations: Demonstrations) -> Mapping[str, Any]:
    """What is said of demonstrations that are kept; {} of others."""
    identifier = _ids().get(demonstrations.digest)
    if identifier is None:
        return {}
    try:
        return library().item(identifier).details
    except SarlError:
        return {}


def is_own(demonstrations: Demonstrations) -> bool:
    """Whether demonstrations are kept and are the visitor's, who may say more of them."""
    identifier = _ids().get(demonstrations.digest)
    try:
        return identifier is not None and library().item(identifier).author == author()
    except SarlError:
        return False


def keep_names(details: Mapping[str, Any]) -> Item:
    """Keep names and formulas of data that are not the visitor's, for a link.

    Args:
        details: What they are of, and what was given.

    Raises:
        SarlError: If they cannot be kept.
    """
    digest = digest_of(json.dumps(details, sort_keys=True).encode())
    for known in library().with_digest(digest, kind="names"):
        if known.author == author():
            return known
    return library().add("names", "names", {}, author=author(), digest=digest, details=details)


def keep_log(content: bytes, name: str, roles: Mapping[str, ColumnRole]) -> Item:
    """Keep a log that was uploaded; where its author keeps the same, that is it.

    Args:
        content: Of the file.
        name: Of the file.
        roles: What was said of its columns.

    Raises:
        SarlError: If it cannot be read or kept.
    """
    opened = library()
    item = add_log(opened, content, name, author=author(), roles=roles)
    _say_room(opened)
    return item


def stored_log(identifier: str) -> Item:
    """A log that is kept.

    Raises:
        SarlError: If there is none, it was removed, or is something else.
    """
    if not is_id(identifier):
        raise InputError(
            f"there is no log called {quoted(identifier)}; check the address, or upload the log "
            "again"
        )
    return linked_item(identifier, "log", "a log")


def linked_item(identifier: str, kind: Kind, said: str) -> Item:
    """What a link names.

    Args:
        identifier: In the address.
        kind: That it has to be of.
        said: The same as a sentence says it.

    Raises:
        SarlError: If there is none, it was removed, or is something else.
    """
    item = standing_item(identifier)
    if item.kind != kind:
        raise InputError(
            f"what the address names as {said}, {quoted(item.name)}, is something else; check the "
            "address"
        )
    return item


def stored_episodes(digest: str) -> Episodes | None:
    """Episodes that this author has run before; None where there are none, or no library.

    Args:
        digest: Of everything that they depend on.
    """
    with suppress(SarlError):
        for files in stored_work("episodes", digest):
            path = files["episodes"]
            return episodes_from_json(limited_bytes(path), name="what is kept of the episodes")
    return None


def keep_episodes(episodes: Episodes, name: str, digest: str) -> None:
    """Keep episodes in the place of the fewer ones that were kept before.

    Args:
        episodes: All that have been run.
        name: What they are called.
        digest: Of everything that they depend on.

    Raises:
        SarlError: If they cannot be kept.
    """
    content = {"episodes": (episodes_to_json(episodes).encode(), ".json")}
    keep_work("episodes", name, digest, content, len(episodes))


def stored_work(kind: Kind, digest: str) -> Iterator[dict[str, Path]]:
    """The files of work that this author has finished before, by their roles.

    Args:
        kind: Of the work.
        digest: Of everything that it depends on.

    Yields:
        Once, or not at all.

    Raises:
        SarlError: If the library cannot be read, or a file is missing.
    """
    for item in _own_work(kind, digest)[:1]:
        yield {one.role: library().path(item, one.role) for one in item.files}


def keep_work(
    kind: Kind,
    name: str,
    digest: str,
    files: Mapping[str, tuple[Path | bytes, str]],
    amount: int,
) -> None:
    """Keep finished work, so that a link to it opens it; in the place of less of the same.

    Args:
        kind: Of the work.
        name: What it is called.
        digest: Of everything that it depends on.
        files: By their roles, and the endings of their names.
        amount: How much of it is finished.

    Raises:
        SarlError: If it cannot be kept.
    """
    before = _own_work(kind, digest)
    if any(item.details.get(_AMOUNT[kind], 0) >= amount for item in before):
        return
    details = {_AMOUNT[kind]: amount}
    library().add(kind, name, files, author=author(), digest=digest, details=details)
    for item in before:
        library().remove(item.id, author=author())


def _own_work(kind: Kind, digest: str) -> list[Item]:
    return [item for item in library().with_digest(digest, kind=kind) if item.author == author()]


def annotate(demonstrations: Demonstrations, details: Mapping[str, Any]) -> None:
    """Say more of demonstrations, where they are the visitor's own and kept."""
    identifier = _ids().get(demonstrations.digest)
    if identifier is None:
        return
    try:
        item = library().item(identifier)
        if item.author == author():
            library().annotate(identifier, details, author=author())
    except SarlError as error:
        say_once(error)


def say_once(problem: SarlError) -> None:
    """Let it be said in a visit, once, that what is made stays in it."""
    if st.session_state.get("_library_problem") != str(problem):
        st.session_state["_library_problem"] = st.session_state["_library_unsaid"] = str(problem)


def say() -> None:
    """Say what is to be said: where a page runs as a whole, for what a part of it says is lost."""
    if problem := st.session_state.pop("_library_unsaid", ""):
        st.toast(
            f"What you make is kept for this visit only: {problem}.", icon=":material/inventory_2:"
        )


def _ids() -> dict[str, str]:
    """Ids of kept demonstrations by their digest, of this visit."""
    return cast("dict[str, str]", st.session_state.setdefault("_kept_ids", {}))


def keep_rule_file(rule_set: RuleSet, name: str) -> Item:
    """Keep the rules of an uploaded file; where its author keeps the same of that name, that is it.

    Raises:
        SarlError: If they cannot be kept.
    """
    opened = library()
    for known in opened.with_digest(rules_digest(rule_set), kind="rules"):
        if (known.author, known.name) == (author(), name):
            return known
    return add_rules(opened, rule_set, name, author=author())


def keep_edits(edits: Sequence[Edit], base: str, made_on: str) -> Item:
    """Keep edits, for a link.

    Args:
        edits: The oldest first.
        base: What tells the rules that they were made on.
        made_on: The same in words.

    Raises:
        SarlError: If they cannot be kept.
    """
    return add_edits(library(), edits, base, author=author(), made_on=made_on)


def keep_rules(
    rule_set: RuleSet,
    name: str,
    demonstrations: Demonstrations,
    *,
    edits: Sequence[Edit] = (),
    parent: str = "",
    command: str = "",
) -> Item:
    """Keep a rule set as it stands, as a new version.

    Args:
        rule_set: With every edit.
        name: What it is called.
        demonstrations: That it is about.
        edits: That were made on the rules before.
        parent: Id of the version that it was made from; the one that was kept before it in this
            visit where not given.
        command: That makes the rules again.

    Returns:
        What is kept; where its author keeps the same already, that.

    Raises:
        SarlError: If it cannot be kept.
    """
    opened, digest = library(), rules_digest(rule_set)
    for known in opened.with_digest(digest, kind="rules"):
        if known.author == author():
            return known
    before = cast("dict[str, str]", st.session_state.setdefault("_kept_rules", {}))
    raw = _ids().get(demonstrations.digest)
    item = add_rules(
        opened,
        rule_set,
        name,
        author=author(),
        parent=parent or before.get(demonstrations.digest, ""),
        came_from=[raw] if raw else [],
        edits=edits,
        command=command,
    )
    before[demonstrations.digest] = item.id
    _say_room(opened)
    return item


def keep_result(content: bytes, file: str, about: Sequence[str], address: str) -> Item:
    """Keep what work left; where its author keeps the same, that is it.

    Args:
        content: Of the file.
        file: Its name.
        about: Ids of what it is about.
        address: Of the page that shows it.

    Raises:
        SarlError: If it cannot be kept.
    """
    opened = library()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / file
        path.write_bytes(content)
        digest, _ = content_digest(path)
        for known in opened.with_digest(digest, kind="result"):
            if known.author == author() and known.details.get("address", "") == address:
                return known
        item = add_result(opened, path, author=author(), about=about, address=address)
    _say_room(opened)
    return item


def _say_room(opened: Library) -> None:
    """Say that a quota is near, before it is reached."""
    if warning := opened.usage(author()).warning:
        st.toast(f"{warning[0].upper()}{warning[1:]}.", icon=":material/database:")
