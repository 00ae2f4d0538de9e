"""Demonstrations and rule sets as things that are kept, and back."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import (
    load_demonstrations,
    read_demonstrations,
    save_demonstrations,
)
from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.explaining.words.sign_off import SignOff, sign_off_of
from sarl_core.library.annotations import annotated, is_annotated
from sarl_core.library.items import Item, Kind
from sarl_core.library.logs import log_content, log_file_name, log_roles, read_log
from sarl_core.library.place import place_of
from sarl_core.limits import limited_bytes
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.distributed.mined_files import (
    ENDING,
    is_mined_file,
    load_mined_data,
    read_mined_data,
    save_mined_data,
)
from sarl_core.mining.editing.edit_files import edits_from_json, edits_to_json
from sarl_core.mining.editing.edits import Edit
from sarl_core.mining.rule_set import RuleSet, rules_digest, rules_from_json

if TYPE_CHECKING:
    from sarl_core.library.library import Library

MAIN_FILES = {"demonstrations": ".parquet", "rules": ".json"}
"""Roles of the files that are demonstrations and rules, and their endings."""
_ZIP = b"PK\x03\x04"  # how a mined file begins, which may stand in the place of a Parquet file


def add_demonstrations(
    library: Library,
    demonstrations: Demonstrations,
    name: str,
    *,
    author: str,
    came_from: Sequence[str] = (),
    command: str = "",
) -> Item:
    """Keep demonstrations, with names, units and formulas.

    Args:
        library: Where.
        demonstrations: All of them.
        name: What they are called.
        author: Whose they are.
        came_from: Ids of what they were made of.
        command: That makes them again.

    Raises:
        InputError: As of `Library.add`.
        WorkError: If they cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "demonstrations.parquet"
        save_demonstrations(demonstrations, path)
        about = {
            "steps": len(demonstrations),
            "episodes": demonstrations.n_episodes,
            "environment": demonstrations.env_id,
        }
        return library.add(
            "demonstrations",
            name,
            {"demonstrations": (path, ".parquet")},
            author=author,
            digest=demonstrations.digest,
            came_from=came_from,
            command=command,
            details=about,
        )


def add_mined(
    library: Library,
    mined: MinedData,
    name: str,
    *,
    author: str,
    came_from: Sequence[str] = (),
) -> Item:
    """Keep what is left of demonstrations that were mined elsewhere, in their place.

    Args:
        library: Where.
        mined: All of it.
        name: What they are called.
        author: Whose they are.
        came_from: Ids of what they were made of.

    Raises:
        InputError: As of `Library.add`.
        WorkError: If it cannot be written.
    """
    whole = mined.sample.whole
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"demonstrations{ENDING}"
        save_mined_data(mined, path)
        return library.add(
            "demonstrations",
            name,
            {"demonstrations": (path, ENDING)},
            author=author,
            digest=whole.digest,
            came_from=came_from,
            details={
                "steps": whole.steps,
                "episodes": whole.episodes,
                "environment": mined.sample.env_id,
                "mined": mined.digest,
            },
        )


def add_rules(
    library: Library,
    rule_set: RuleSet,
    name: str,
    *,
    author: str,
    parent: str = "",
    came_from: Sequence[str] = (),
    edits: Sequence[Edit] = (),
    command: str = "",
    shared: bool = False,
) -> Item:
    """Keep a rule set, as it is written into a rule file.

    Args:
        library: Where.
        rule_set: Whole, with every edit.
        name: What it is called.
        author: Whose it is.
        parent: Id of the version that it was made from.
        came_from: Ids of the demonstrations that it was mined from.
        edits: That were made on what was mined; they are part of the rules already.
        command: That makes it again.
        shared: Whether it stands in everybody's list.

    Raises:
        InputError: As of `Library.add`.
        WorkError: If it cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rules.json"
        rule_set.save(path)
        about = {"rules": len(rule_set), "environment": rule_set.source.env_id}
        files: dict[str, tuple[Path | bytes, str]] = {"rules": (path, ".json")}
        if edits:
            files["edits"] = (edits_to_json(edits).encode(), ".json")
            about["edits"] = len(edits)
        return library.add(
            "rules",
            name,
            files,
            author=author,
            digest=rules_digest(rule_set),
            parent=parent,
            came_from=came_from,
            command=command,
            details=about,
            shared=shared,
        )


def add_edits(
    library: Library,
    edits: Sequence[Edit],
    base: str,
    *,
    author: str,
    made_on: str = "",
) -> Item:
    """Keep edits, so that a link can name them; where their author keeps the same, that is it.

    Args:
        library: Where.
        edits: The oldest first.
        base: What tells the rules that they were made on.
        author: Who made them.
        made_on: What those rules are, in words.

    Raises:
        InputError: As of `Library.add`.
        WorkError: If they cannot be written.
    """
    content = edits_to_json(edits).encode()
    digest = blake2b(base.encode() + b"\0" + content, digest_size=16).hexdigest()
    for known in library.with_digest(digest, kind="edits"):
        if known.author == author:
            return known
    count = len(edits)
    return library.add(
        "edits",
        f"{count} edit{'s' if count != 1 else ''}",
        {"edits": (content, ".json")},
        author=author,
        digest=digest,
        details={"base": base, "edits": count} | ({"made_on": made_on} if made_on else {}),
    )


def edits_of(library: Library, item: Item, rule_set: RuleSet) -> tuple[Edit, ...]:
    """The edits that are kept.

    Args:
        library: Where they are.
        item: The edits.
        rule_set: That they were made on.

    Raises:
        InputError: If it is something else, or its file is missing or damaged.
    """
    path = file_of(library, item, "edits")
    return edits_from_json(limited_bytes(path), rule_set, name=f"what is kept as {item.id}")


def data_of(library: Library, item: Item) -> Demonstrations | MinedData:
    """The demonstrations that are kept, or what is left of some, as they were when added.

    Raises:
        InputError: If it is something else, or its file is missing or damaged.
    """
    path = file_of(library, item, "demonstrations")
    return load_mined_data(path) if is_mined_file(path) else load_demonstrations(path)


def demonstrations_of(library: Library, item: Item) -> Demonstrations:
    """The demonstrations that are kept; of a mined file the sample.

    Raises:
        InputError: If it is something else, or its file is missing or damaged.
    """
    data = data_of(library, item)
    return data.sample if isinstance(data, MinedData) else data


def annotated_file(library: Library, item: Item, folder: Path) -> Path:
    """The file that a command takes in the place of a thing.

    Args:
        library: Where it is.
        item: The thing.
        folder: Where a file may be made.

    Returns:
        Its main file; of demonstrations that were given names or formulas, and of a log of whose
        columns something was said, one in the folder, which has these.

    Raises:
        InputError: If it has no one file, it is missing, or what was given does not fit.
        WorkError: If it cannot be written.
    """
    path = file_of(library, item)
    if item.kind == "log" and (roles := log_roles(item)):
        log = read_log(log_content(library, item), log_file_name(item), roles)
        save_demonstrations(log, folder / f"{item.id}.parquet")
        return folder / f"{item.id}.parquet"
    if item.kind != "demonstrations" or not is_annotated(item.details):
        return path
    data = data_of(library, item)
    try:
        demonstrations = annotated(demonstrations_of(library, item), item.details)
    except (InputError, KeyError, TypeError) as error:
        raise InputError(
            f"the names and formulas that were given to {quoted(item.name)} do not fit it "
            f"({error}); give them anew on the page Names, or use its file {path}"
        ) from error
    if isinstance(data, MinedData):
        path = folder / f"{item.id}{ENDING}"
        save_mined_data(data.renamed(demonstrations), path)
        return path
    path = folder / f"{item.id}.parquet"
    save_demonstrations(demonstrations, path)
    return path


def sources_of(library: Library, rule_set: RuleSet) -> list[str]:
    """Ids of the demonstrations that rules say they were mined from, as far as they are here.

    Args:
        library: Where to look.
        rule_set: The rules.

    Returns:
        One, or none.

    Raises:
        WorkError: If the library cannot be read.
    """
    source = rule_set.source
    same = library.with_digest(source.digest, kind="demonstrations")
    if same:
        return [same[0].id]
    for item in library.items(kind="demonstrations"):
        details = item.details
        size = (details.get("steps"), details.get("episodes"))
        if size == (source.steps, source.episodes) and is_annotated(details):
            with suppress(SarlError, KeyError, TypeError):
                demonstrations = annotated(demonstrations_of(library, item), details)
                if demonstrations.digest == source.digest:
                    return [item.id]
    return []


def rules_of(library: Library, item: Item) -> RuleSet:
    """The rule set that is kept.

    Raises:
        InputError: If it is something else, or its file is missing or damaged.
    """
    return RuleSet.load(file_of(library, item, "rules"))


def rules_sign_off(library: Library, digest: str) -> SignOff:
    """Who approved rules as they stand, whatever file they came in.

    Args:
        library: Where that is known.
        digest: Of the rules with every edit, as of `rules_digest`.

    Returns:
        Of all times that it holds these very rules.

    Raises:
        WorkError: If it cannot be read.
    """
    items = library.with_digest(digest, kind="rules")
    if not items:
        return SignOff()
    return sign_off_of(approval for item in items for approval in item.approvals)


def sign_off_at_hand(rule_set: RuleSet) -> SignOff:
    """Who approved rules as they stand, by the library of this machine; none is made for it.

    Args:
        rule_set: With every edit.

    Returns:
        Nobody where there is no library.

    Raises:
        SarlError: If there is one and it cannot be read.
        OSError: If its place cannot be looked into.
    """
    from sarl_core.library.database import is_there
    from sarl_core.library.library import Library

    place = place_of()
    if not is_there(place):
        return SignOff()
    with Library(place) as library:
        return rules_sign_off(library, rules_digest(rule_set))


def digest_of_files(kind: Kind, files: Mapping[str, bytes]) -> str | None:
    """The digest of demonstrations or rules, worked out of their files.

    Args:
        kind: What they are.
        files: Contents by role.

    Returns:
        As `add_demonstrations` and `add_rules` write it down; None of other things.

    Raises:
        InputError: If a file is missing, or cannot be read.
    """
    if kind not in MAIN_FILES:
        return None
    if kind not in files:
        raise InputError(f"it holds no {kind}; export it again")
    content = files[kind]
    if kind == "rules":
        return rules_digest(rules_from_json(content, name="the rule file"))
    if content.startswith(_ZIP):
        return read_mined_data(content).sample.whole.digest
    return read_demonstrations(content, f"demonstrations{MAIN_FILES[kind]}").digest


def file_of(library: Library, item: Item, role: str | None = None) -> Path:
    """The file of a thing as it was kept.

    Args:
        library: Where it is.
        item: The thing.
        role: What the file has to be; the main one of its kind where not given.

    Raises:
        InputError: If it holds no such file, or it is missing.
    """
    wanted = role or (item.kind if item.kind in MAIN_FILES else None)
    if role is not None and all(one.role != role for one in item.files):
        raise InputError(f"{quoted(item.name)} is {_SAID[item.kind]} and holds no {role}")
    return library.path(item, wanted)


_SAID = {
    "demonstrations": "demonstrations",
    "rules": "a rule set",
    "result": "a result",
    "note": "a note",
    "log": "a log",
    "edits": "edits of rules",
    "names": "names given to data",
    "episodes": "finished episodes",
    "improvement": "what came of improving rules",
    "study": "a study of learning",
}
