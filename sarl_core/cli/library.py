"""Commands around what is kept, and ``library:ID`` in the place of a file."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import stand_ins, terminal
from sarl_core.cli.options import Json, out_option
from sarl_core.errors import InputError, quoted

if TYPE_CHECKING:
    from sarl_core.library import Item, Library
    from sarl_core.library.items import Kind

_PREFIX = "library:"
_RULES, _BUNDLE = ".json", ".sarl"
_LISTED = 20  # rows or lines of a result

library = typer.Typer(
    name="library",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="What is kept: demonstrations, rule sets, results. `library:ID` stands for a file in "
    "every command. It is in your data directory, or where the environment variable "
    "`SARL_LIBRARY` says: a folder, or the address of a PostgreSQL database.",
)

_Name = Annotated[
    str | None,
    typer.Option("--name", show_default=False, help="What to call it; the name of the file."),
]
_Identifier = Annotated[str, typer.Argument(metavar="ID", show_default=False, help="As listed.")]


class CommandGroup(typer.core.TyperGroup):
    """Commands that take ``library:ID`` where they take a file."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As Typer does, with the files in the place of the ids."""
        stand_ins.put({})
        if args[:1] != ["library"]:
            args = _with_files(args)
        return super().parse_args(ctx, args)


def _with_files(arguments: Sequence[str]) -> list[str]:
    """Arguments, and options with their values, with the paths of files that are kept."""
    files: dict[str, Path] = {}
    changed, before = [], ""
    for argument in arguments:
        option, equals, value = (
            argument.partition("=") if argument.startswith("--") else ("", "", argument)
        )
        if value.startswith(_PREFIX):
            if (option or before) == "--out":
                raise InputError(
                    f"--out {value}: what is kept never changes; give the path of a file, and add "
                    "that with `library add`"
                )
            if value not in files:
                files[value] = _file_of(value)
            argument = f"{option}{equals}{files[value]}"
        changed.append(argument)
        before = argument
    stand_ins.put({path: name for name, path in files.items()})
    return changed


def _file_of(value: str) -> Path:
    from sarl_core.library.contents import annotated_file

    with _opened() as opened:  # what is put aside goes when the command ends
        item = opened.item(value)
        if item.removed is not None:
            raise InputError(
                f"{quoted(item.name)} was removed by {item.author}, who brings it back with "
                f"`sarl library remove {item.id} --undo`; until then name something else"
            )
        return annotated_file(opened, item, Path(tempfile.mkdtemp()))


@library.command("list")
def list_items(
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind", show_default=False, help="demonstrations, rules, result, note or log."
        ),
    ] = None,
    removed: Annotated[
        bool, typer.Option("--removed", help="What was removed and can be brought back.")
    ] = False,
    as_json: Json = False,
) -> None:
    """List what is kept, the newest first.

    Example: `python -m sarl_core library list --kind rules`
    """
    from sarl_core.library.items import KINDS

    wanted = None if kind is None else _checked_kind(kind, KINDS)
    opened = _opened()
    items = opened.items(kind=wanted, removed=removed)
    if as_json:
        terminal.print_json({"items": [item.document for item in items]})
        return
    if not items:
        terminal.print_lines([f"Nothing is kept in {opened.place.said}; `library add` does."])
        return
    terminal.print_table(
        ("id", "kind", "name", "author", "kept", "approved by"),
        [
            (
                item.id,
                item.kind,
                item.name,
                item.author,
                _time_text(item.created),
                ", ".join(one.author for one in item.approvals),
            )
            for item in items
        ],
    )
    usage = opened.usage(_author())
    if usage.warning:
        terminal.print_notes([usage.warning])


@library.command("show")
def show_item(identifier: _Identifier, as_json: Json = False) -> None:
    """Say all that is known of one thing.

    Example: `python -m sarl_core library show ID`
    """
    from sarl_core.library.results import note_text, note_writer, notes_about

    opened = _opened()
    item = opened.item(identifier)
    versions = opened.versions(item.id)
    notes = [(one, note_text(opened, one)) for one in notes_about(opened, item)]
    if as_json:
        paths = {one.role: str(opened.path(item, one.role)) for one in item.files}
        terminal.print_json(
            {
                **item.document,
                "paths": paths,
                "versions": [one.id for one in versions],
                "notes": [
                    {
                        "id": one.id,
                        "author": note_writer(one),
                        "created": one.created.isoformat(),
                        "text": text,
                    }
                    for one, text in notes
                ],
            }
        )
        return
    terminal.print_facts(_facts(opened, item, versions))
    if item.kind == "note":
        terminal.print_lines(["", note_text(opened, item)])
    if item.kind == "result":
        _print_result(opened, item)
    for one, text in notes:
        terminal.print_lines(["", f"{note_writer(one)}, {_time_text(one.created)}:", text])


@library.command("export")
def export_items(
    identifiers: Annotated[
        list[str], typer.Argument(metavar="ID...", show_default=False, help="As listed.")
    ],
    out: Annotated[Path, out_option("A .sarl file.")],
    as_json: Json = False,
) -> None:
    """Write things, with all that they came from and the notes, into one file to carry elsewhere.

    Example: `python -m sarl_core library export ID --out rules.sarl`
    """
    terminal.check_output(out, (_BUNDLE,))
    from sarl_core.library.bundles import export_bundle

    _tell(export_bundle(_opened(), identifiers, out), f"is in {out}", as_json)


@library.command("import")
def import_file(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            show_default=False,
            help="What `library export` wrote, demonstrations, or a rule file.",
        ),
    ],
    name: _Name = None,
    as_json: Json = False,
) -> None:
    """Keep what was exported, demonstrations, or a rule file.

    Example: `python -m sarl_core library import data/rules/cartpole_compact.json`
    """
    from sarl_core.library.bundles import import_bundle

    opened = _opened()
    if file.suffix.lower() == _BUNDLE:
        if name is not None:
            raise InputError("what was exported has names; leave --name out")
        items = import_bundle(opened, file, author=_author())
    elif file.suffix.lower() == _RULES:
        items = [_add_rules(opened, file, name, ())]
    else:
        items = [_add_demonstrations(opened, file, name, ())]
    _tell(items, "is kept", as_json)


@library.command("add")
def add_file(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            show_default=False,
            help="A result (.csv, .json, .html, .gif, .mp4, .png), a note (.txt, .md), a log, "
            "demonstrations, or a rule file.",
        ),
    ],
    kind: Annotated[
        str,
        typer.Option(
            "--kind",
            show_default=False,
            help="What it is: result, note, log, rules or demonstrations.",
        ),
    ],
    name: _Name = None,
    about: Annotated[
        list[str] | None,
        typer.Option(
            "--about",
            metavar="ID",
            show_default=False,
            help="What it is about, or was made of. May be given several times.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Keep a file, and what it is about: a result of work, a note, rules, demonstrations.

    Example: `python -m sarl_core library add audit.json --kind result --about ID`
    """
    from sarl_core.library.items import KINDS, UNLISTED
    from sarl_core.library.logs import add_log
    from sarl_core.library.results import (
        add_note,
        add_result,
        file_content,
        note_of_file,
        standing_ids,
    )

    opened, author = _opened(), _author()
    kind = _checked_kind(kind, [one for one in KINDS if one not in UNLISTED])
    came_from = standing_ids(opened, about or ())
    if kind == "result":
        item = add_result(opened, file, name or "", author=author, about=came_from)
    elif kind == "note":
        text, ending = note_of_file(file), file.suffix.lower()
        item = add_note(opened, text, name or "", author=author, about=came_from, ending=ending)
    elif kind == "log":
        item = add_log(opened, file_content(file), file.name, author=author, about=came_from)
        item = item if name is None else opened.rename(item.id, name, author=author)
    elif kind == "rules":
        item = _add_rules(opened, file, name, came_from)
    else:
        item = _add_demonstrations(opened, file, name, came_from)
    _tell([item], "is kept", as_json)


@library.command("remove")
def remove_item(
    identifier: _Identifier,
    undo: Annotated[bool, typer.Option("--undo", help="Bring it back.")] = False,
    as_json: Json = False,
) -> None:
    """Take something out of the list; for 30 days `--undo` brings it back.

    Example: `python -m sarl_core library remove ID`
    """
    opened, author = _opened(), _author()
    if undo:
        _tell([opened.restore(identifier, author=author)], "is back", as_json)
        return
    item = opened.remove(identifier, author=author)
    opened.sweep()
    _tell([item], "is removed; --undo brings it back", as_json)


@library.command("approve")
def approve_item(
    identifier: _Identifier,
    note: Annotated[str, typer.Option("--note", help="What you say to it.")] = "",
    as_json: Json = False,
) -> None:
    """Approve something by your name; any change of it makes a version that is not approved.

    Example: `python -m sarl_core library approve ID --note "Held against the logs of March."`
    """
    author = _author()
    _tell([_opened().approve(identifier, author=author, note=note)], "is approved", as_json)


def _print_result(opened: Library, item: Item) -> None:
    """The beginning of a table or a document; of a picture or a page its path says enough."""
    from sarl_core.library.results import result_view

    view = result_view(opened.path(item), _LISTED)
    if view.rows:
        terminal.print_table(view.rows[0], view.rows[1:])
    if view.lines:
        terminal.print_lines(["", *view.lines])
    if view.more:
        terminal.print_lines(["and more; the file holds all of it"])


def _add_rules(opened: Library, file: Path, name: str | None, about: Sequence[str]) -> Item:
    """Keep a rule file, of the demonstrations that are named or that it says it was mined from."""
    from sarl_core.library.contents import add_rules, sources_of
    from sarl_core.mining.rule_set import RuleSet

    rules = RuleSet.load(file)
    came_from = about or sources_of(opened, rules)
    return add_rules(opened, rules, name or file.stem, author=_author(), came_from=came_from)


def _add_demonstrations(
    opened: Library, file: Path, name: str | None, about: Sequence[str]
) -> Item:
    from sarl_core.cli.inputs import is_mined_file
    from sarl_core.demonstrations.formats import load_demonstrations
    from sarl_core.library.contents import add_demonstrations, add_mined

    if is_mined_file(file):
        from sarl_core.mining.distributed.mined_files import load_mined_data

        mined = load_mined_data(file)
        return add_mined(opened, mined, name or file.stem, author=_author(), came_from=about)
    demonstrations = load_demonstrations(file)
    return add_demonstrations(
        opened, demonstrations, name or file.stem, author=_author(), came_from=about
    )


def _checked_kind(text: str, kinds: Sequence[Kind]) -> Kind:
    for kind in kinds:
        if text == kind:
            return kind
    raise InputError(f"--kind {text} is no kind of thing; choose from {', '.join(kinds)}")


def _time_text(time: datetime) -> str:
    return time.astimezone().strftime("%Y-%m-%d %H:%M")


def _opened() -> Library:
    from sarl_core.library import Library

    return Library()


def _author() -> str:
    from sarl_core.library.place import usual_author

    return usual_author()


def _tell(items: Sequence[Item], what: str, as_json: bool) -> None:
    if as_json:
        terminal.print_json({"items": [item.document for item in items]})
    else:
        terminal.print_lines(f"{item.name} ({item.kind}) {what}: {item.id}" for item in items)


def _facts(opened: Library, item: Item, versions: Sequence[Item]) -> list[tuple[str, str]]:
    facts = [
        ("name", item.name),
        ("kind", item.kind),
        ("author", item.author),
        ("kept", item.created.astimezone().strftime("%Y-%m-%d %H:%M:%S")),
        ("digest", item.digest),
        ("command", item.command),
        *(
            (key.replace("_", " "), _detail_text(value))
            for key, value in item.details.items()
            if key not in _FOR_MACHINES
        ),
        *((_OF[item.kind], _source_text(opened, one)) for one in item.came_from),
        *(
            (
                "approved by",
                f"{one.author}, {_time_text(one.created)}{f': {one.note}' if one.note else ''}",
            )
            for one in item.approvals
        ),
        *(("file", str(opened.path(item, one.role))) for one in item.files),
    ]
    if item.removed is not None:
        facts.append(("removed", item.removed.astimezone().strftime("%Y-%m-%d %H:%M:%S")))
    others = [one for one in versions if one.id != item.id]
    facts += [("other version", f"{one.id}, {one.created:%Y-%m-%d %H:%M}") for one in others]
    return [(name, value) for name, value in facts if value]


_FOR_MACHINES = ("base",)  # a key that tells rules apart; what they are is said beside it


def _detail_text(value: object) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{key}: {_detail_text(one)}" for key, one in value.items())
    if isinstance(value, list):
        return ", ".join(map(_detail_text, value))
    return "" if value is None else str(value)


_OF = {"demonstrations": "made of", "rules": "made of", "result": "about", "note": "about"}


def _source_text(opened: Library, identifier: str) -> str:
    """What a thing came from, which may be removed for good or have stayed elsewhere."""
    try:
        return f"{opened.item(identifier).name}, {identifier}"
    except InputError:
        return f"{identifier}, which is not here"
