"""What is kept is found, changed by its author alone, removed with undo, and never half there."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import create_engine, text

from sarl_core.errors import InputError, WorkError
from sarl_core.library import Item, Library, Quota, migrations, tables
from sarl_core.library import library as module
from sarl_core.library.items import as_id, new_id
from sarl_core.library.place import LibraryPlace, place_of

ROOT = Path(__file__).parents[2]


def note(library: Library, name: str = "a note", content: bytes = b"{}", **named) -> Item:
    named = {"author": "Ada", **named}
    return library.add("note", name, {"text": (content, ".json")}, **named)


def test_what_is_kept_is_what_was_given(library: Library, opened: Callable[..., Library]) -> None:
    first = note(library, content=b"one", details={"b": [1, None]}, command="make it", digest="d1")
    second = note(library, parent=first.id, came_from=[first.id], shared=True, content=b"two")
    again = opened()
    assert again.item(first.id) == first
    assert again.item(f"library:{second.id.upper()}") == second
    assert (first.lineage, second.lineage) == (first.id, first.id)
    assert again.versions(second.id) == [second, first]
    assert again.path(first).read_bytes() == b"one"
    assert again.path(second, "text").read_bytes() == b"two"
    assert first.details == {"b": [1, None]}
    assert again.with_digest("d1") == [first]
    assert again.with_digest("d1", kind="rules") == []


def test_lists_show_ones_own_things_and_what_is_shared(library: Library) -> None:
    mine = note(library, "mine")
    theirs = note(library, "theirs", author="Bob")
    open_ = note(library, "open", author="Bob", shared=True)
    rules = library.add("rules", "rules", {}, author="Ada")
    assert library.items("Ada") == [rules, open_, mine]
    assert library.items("Ada", kind="rules") == [rules]
    assert library.items("Bob") == [open_, theirs]
    assert library.items() == [rules, open_, theirs, mine]
    assert library.item(theirs.id) == theirs  # whoever has the id may look
    hidden = library.share(open_.id, author="Bob", shared=False)
    assert not hidden.shared
    assert library.items("Ada") == [rules, mine]


def test_removing_is_the_authors_and_can_be_undone(library: Library) -> None:
    item = note(library)
    for change in (library.remove, library.restore, library.share):
        with pytest.raises(InputError, match="is 'Ada''s, who alone may change that"):
            change(item.id, author="Bob")
    with pytest.raises(InputError, match="who alone may change"):
        library.rename(item.id, "other", author="Bob")
    assert library.remove(item.id, author="Ada").removed is not None
    assert library.items("Ada") == []
    assert [one.id for one in library.items("Ada", removed=True)] == [item.id]
    assert library.sweep() == 0
    assert library.path(library.item(item.id)).is_file()
    assert library.restore(item.id, author="Ada") == item
    assert library.rename(item.id, " another\n name ", author="Ada").name == "another name"


def test_more_can_be_said_of_a_thing_and_it_stays_what_it_is(library: Library) -> None:
    item = note(library, details={"a": 1, "b": 2})
    told = library.annotate(item.id, {"b": 3, "c": ["x"]}, author="Ada")
    assert told == library.item(item.id)
    assert told.details == {"a": 1, "b": 3, "c": ["x"]}
    assert told.files == item.files
    with pytest.raises(InputError, match="who alone may change"):
        library.annotate(item.id, {}, author="Bob")
    with pytest.raises(InputError, match="more than 1 MB"):
        library.annotate(item.id, {"x": "y" * 2**20}, author="Ada")


def test_what_was_removed_long_ago_is_gone_and_files_that_others_hold_stay(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone, stays = note(library, content=b"alone"), note(library, content=b"both")
    other = note(library, content=b"both")
    paths = [library.path(one) for one in (gone, other)]
    left_over = paths[0].parents[1] / "00" / f"{'0' * 32}.json"
    left_over.parent.mkdir()
    left_over.write_bytes(b"of who was killed")
    for one in (gone, other):
        library.remove(one.id, author="Ada")
    monkeypatch.setattr(module, "_UNDONE_FOR", timedelta(0))
    monkeypatch.setattr(module, "_LEFT_OVER_FOR", timedelta(hours=1))
    assert library.sweep() == 2
    assert [path.is_file() for path in paths] == [False, True]
    assert left_over.is_file()  # it is young: somebody may be about to speak of it
    os.utime(left_over, (0, time.time() - 7200))
    assert library.sweep() == 0
    assert not left_over.exists()
    assert library.items() == [stays]
    with pytest.raises(InputError, match=f"has nothing with the id {gone.id}"):
        library.item(gone.id)


def test_an_approval_holds_for_one_version(library: Library) -> None:
    item = note(library)
    library.approve(item.id, author="Eve", note="first words")
    approved = library.approve(item.id, author="Cid", note="seen")
    approved = library.approve(item.id, author="Eve", note="held against the logs")
    assert [(one.author, one.note) for one in approved.approvals] == [
        ("Cid", "seen"),
        ("Eve", "held against the logs"),
    ]
    assert note(library, parent=item.id).approvals == ()
    assert library.item(item.id) == approved
    library.remove(item.id, author="Ada")
    with pytest.raises(InputError, match="was removed; bring it back first"):
        library.approve(item.id, author="Eve")


def test_a_quota_is_told_before_it_is_reached(opened: Callable[..., Library]) -> None:
    library = opened(Quota(author=1_000, whole=1_500))
    note(library, content=b"x" * 880)
    assert library.usage("Ada").warning == ""
    with pytest.raises(InputError, match=r"more than the .* that Ada may keep"):
        note(library, content=b"y" * 200)
    note(library, content=b"x" * 880)  # the same file takes nothing
    note(library, content=b"y" * 60)
    assert library.usage("Ada").author == 940
    assert "what you keep takes" in library.usage("Ada").warning
    note(library, content=b"z" * 500, author="Bob")
    assert "what all keep takes" in library.usage("Bob").warning
    with pytest.raises(InputError, match="the library may keep"):
        note(library, content=b"w" * 100, author="Bob")
    removed = library.remove(library.items("Bob")[0].id, author="Bob")
    note(library, content=b"w" * 400, author="Bob")
    with pytest.raises(InputError, match="the library may keep"):
        library.restore(removed.id, author="Bob")


def test_two_writers_lose_nothing(place: LibraryPlace) -> None:
    def write(name: str) -> None:
        own = Library(place)
        for number in range(20):
            item = note(own, f"{name} {number}", content=name.encode())
            own.approve(shared.id, author=f"{name} {number}")
            own.remove(note(own, "passing", content=b"passing").id, author="Ada")
            own.share(item.id, author="Ada")
        own.close()

    library = Library(place)
    shared = note(library, "approved by all")
    with ThreadPoolExecutor(4) as writers:
        list(writers.map(write, "abcd"))
    names = [item.name for item in library.items()]
    assert sorted(names) == sorted(
        ["approved by all", *(f"{name} {number}" for name in "abcd" for number in range(20))]
    )
    assert len(library.item(shared.id).approvals) == 80
    library.close()


KILLED = """
import os, random, signal, sys, time
from sarl_core.library import Library
from sarl_core.library.place import LibraryPlace
from pathlib import Path

place = LibraryPlace(sys.argv[1], Path(sys.argv[2]), "here")
times, draw = int(sys.argv[3]), random.Random(0)
for run in range(times):
    written, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(written)
        own = Library(place)
        for number in range(10_000):
            os.write(write, b".")
            content = f"{run} {number} ".encode() * 20_000
            item = own.add("note", "n", {"text": (content, ".txt")}, author="a")
            own.approve(item.id, author="a")
            if number % 3 == 0:
                own.remove(item.id, author="a")
    os.close(write)
    # Of four, one is killed while it opens the library or adds the first, the others later.
    for _ in range(run % 4):
        os.read(written, 1)
    time.sleep(draw.uniform(0.0, 0.02))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(written)
    library = Library(place)
    items = library.items() + library.items(removed=True)
    for item in items:
        path = library.path(item)
        assert path.stat().st_size == item.size
    library.close()
print(len(items))
"""


def test_a_process_that_is_killed_leaves_a_library_that_opens(place: LibraryPlace) -> None:
    times = 40 if place.is_folder else 20
    arguments = [place.address, str(place.folder), str(times)]
    result = subprocess.run(
        [sys.executable, "-c", KILLED, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) > times / 2
    with Library(place) as library:
        assert library.sweep() == 0


def test_a_missing_file_is_said_by_name(library: Library) -> None:
    item = note(library, "the crane")
    path = library.path(item)
    path.write_bytes(b"longer than before")
    with pytest.raises(InputError, match=r"of 'the crane' has 18 bytes and should have 2"):
        library.path(item)
    path.unlink()
    with pytest.raises(InputError, match=f"{path.name} of 'the crane' is missing"):
        library.path(item)
    assert library.items() == [item]
    assert note(library).files == item.files  # and is there again
    assert library.path(item).is_file()


def test_of_an_interrupted_addition_nothing_stands_in_the_list(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(WorkError, match="No space left on device"):
            note(library)
    assert library.items() == []
    assert not [path for path in library.place.folder.rglob("*") if ".json" in path.name]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"name": " \n "}, "needs a name"),
        ({"name": "x" * 201}, "201 characters"),
        ({"author": ""}, "an author needs a name"),
        ({"parent": new_id()}, "has nothing with the id"),
        ({"details": {"x": "y" * 2**20}}, "more than 1 MB"),
    ],
)
def test_what_cannot_be_kept_is_refused(library: Library, wrong, says) -> None:
    with pytest.raises(InputError, match=says):
        note(library, **wrong)
    assert library.items() == []


@pytest.mark.parametrize("wrong", ["", "x", "library:", "0" * 26, "a" * 27, "../" * 9, "ä" * 26])
def test_what_is_no_id_is_refused(library: Library, wrong: str) -> None:
    with pytest.raises(InputError, match="is no id of a library"):
        library.item(wrong)


def test_ids_cannot_be_guessed() -> None:
    drawn = {new_id() for _ in range(1_000)}
    assert len(drawn) == 1_000
    assert {as_id(one) for one in drawn} == drawn


@pytest.mark.parametrize("by_steps", [False, True])
def test_the_steps_lead_to_the_tables(place: LibraryPlace, by_steps: bool) -> None:
    if place.is_folder:
        place.folder.mkdir(parents=True, exist_ok=True)
    engine = create_engine(place.address)
    if by_steps:  # as of a library that has taken none of them yet
        with engine.begin() as connection:
            tables.versions.create(connection)
    Library(place).close()
    with engine.connect() as connection:
        context = MigrationContext.configure(connection)
        assert context.get_current_revision() == tables.NEWEST
        assert compare_metadata(context, tables.metadata) == []
    engine.dispose()
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    assert ScriptDirectory.from_config(config).get_heads() == [tables.NEWEST]


def test_a_library_of_a_newer_version_is_refused_and_stays(
    library: Library, place: LibraryPlace
) -> None:
    engine = create_engine(place.address)
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(InputError, match="was made by a newer version"):
        Library(place)
    with engine.begin() as connection:
        connection.execute(text(f"UPDATE alembic_version SET version_num = '{tables.NEWEST}'"))
    engine.dispose()
    Library(place).close()


def test_two_that_open_it_first_make_it_once(place: LibraryPlace) -> None:
    with ThreadPoolExecutor(4) as openers:
        for library in openers.map(lambda _: Library(place), range(4)):
            assert library.items() == []
            library.close()


def test_what_is_no_library_is_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "library.sqlite3").write_bytes(b"something else" * 100)
    with pytest.raises(InputError, match="lies a file that is no library"):
        Library(tmp_path)
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(WorkError, match="cannot be made"):
        Library(file)
    with pytest.raises(InputError, match="neither a folder nor PostgreSQL"):
        Library("mysql://host/database")
    with pytest.raises(InputError, match="cannot be read"):
        Library("postgresql://host:port/database")
    with pytest.raises(WorkError, match="cannot be used") as told:
        Library("postgresql://ada:secret@127.0.0.1:1/none")
    assert "secret" not in str(told.value)


def test_a_folder_is_new_until_there_is_a_library(tmp_path: Path) -> None:
    place = place_of(tmp_path)
    assert place.is_new
    assert not list(tmp_path.iterdir())
    Library(place).close()
    assert not place.is_new
    assert not place_of("postgresql://ada@host/database").is_new


def test_where_it_is_can_be_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "here"))
    assert place_of().folder == tmp_path / "here"
    monkeypatch.delenv("SARL_LIBRARY")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert place_of().folder == tmp_path / "data" / "sarl-explorer" / "library"
    assert not (tmp_path / "data").exists()
    monkeypatch.setenv("SARL_LIBRARY_FILES", str(tmp_path / "files"))
    address = place_of("postgres://ada:secret@host/database")
    assert address == LibraryPlace(
        "postgresql+psycopg://ada:secret@host/database",
        tmp_path / "files",
        "postgresql://ada:***@host/database",
    )
