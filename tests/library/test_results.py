"""Results and notes are kept with what they are about, and are what they say they are."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from sarl_core import Shield, load_rules
from sarl_core.errors import InputError
from sarl_core.library import Item, Library, Quota
from sarl_core.library.bundles import export_bundle, import_bundle
from sarl_core.library.items import new_id
from sarl_core.library.results import (
    LONGEST_NOTE,
    add_note,
    add_result,
    note_of_file,
    note_text,
    notes_about,
    result_view,
)
from sarl_core.studies.certificate import certify
from sarl_core.studies.certificate_files import save_certificate

DATA = Path(__file__).parents[2] / "data"
GIF = b"GIF89a\x01\x00\x01\x00\x80\x00\x00\x00\x00\x00\xff\xff\xff,\x00\x00\x00\x00\x01\x00\x01\x00"
CONTENTS = {
    "a.csv": b"agent,return\nnovice,22\n",
    "b.json": b'{"steps": 3, "share": NaN}',
    "c.html": b"<!doctype html><p>x",
    "d.gif": GIF,
    "e.png": b"\x89PNG\r\n\x1a\n....",
    "f.MP4": b"\x00\x00\x00\x20ftypisom",
}


@pytest.fixture
def rules(library: Library) -> Item:
    return library.add("rules", "two rules", {}, author="Ada")


@pytest.mark.parametrize("name", CONTENTS)
def test_a_result_is_kept_as_it_is(
    library: Library, rules: Item, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(CONTENTS[name])
    item = add_result(library, path, author="Ada", about=[f"library:{rules.id}", rules.id])
    assert (item.kind, item.name, item.came_from) == ("result", path.stem, (rules.id,))
    assert item.details == {"file_name": name}
    assert library.path(item).read_bytes() == CONTENTS[name]
    assert library.with_digest(item.digest) == [item]
    assert library.made_of(rules.id) == library.made_of(rules.id, kind="result") == [item]
    assert library.made_of(item.id) == []


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.c", b"int x;", "ends in '.c' and a result in one of .csv"),
        ("a", b"x", "ends in ''"),
        ("a.csv", b"", "is empty"),
        ("a.json", b"{", "is no JSON"),
        ("a.json", b"\xff\xff", "is no JSON"),
        ("a.gif", b"<html>", "is no GIF"),
        ("a.png", b"\x89PN", "is no PNG"),
        ("a.mp4", b"ftyp", "is no MP4"),
        ("a.csv", None, "cannot be read"),
    ],
)
def test_what_is_no_result_is_refused(
    library: Library, tmp_path: Path, name: str, content: bytes | None, says: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        add_result(library, path, author="Ada")
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert library.items() == []


def test_what_it_is_about_has_to_be_there(library: Library, rules: Item) -> None:
    for about, says in (("x", "is no id"), (new_id(), "has nothing with the id")):
        with pytest.raises(InputError, match=says):
            add_note(library, "words", author="Ada", about=[about])
    library.remove(rules.id, author="Ada")
    with pytest.raises(InputError, match="was removed; bring it back first"):
        add_note(library, "words", author="Ada", about=[rules.id])


def test_what_is_too_large_is_refused(opened: Callable[..., Library], tmp_path: Path) -> None:
    library = opened(Quota(author=1_000))
    (tmp_path / "a.csv").write_bytes(b"x" * 2_000)
    with pytest.raises(InputError, match=r"more than the .* that Ada may keep"):
        add_result(library, tmp_path / "a.csv", author="Ada")
    with pytest.raises(InputError, match=r"more than the .* that Ada may keep"):
        add_note(library, "x" * 2_000, author="Ada")
    assert library.items() == []


def test_notes_stand_with_what_they_are_about(library: Library, rules: Item) -> None:
    other = library.add("rules", "others", {}, author="Ada")
    first = add_note(library, "# Late by\ta step\n\nSeen twice.\n", author="Bob", about=[rules.id])
    second = add_note(library, "<b>Not</b> any more.", author="Ada", about=[rules.id, other.id])
    assert (first.name, second.name) == ("Late by a step", "<b>Not</b> any more.")
    assert notes_about(library, rules) == [first, second]
    assert notes_about(library, other) == [second]
    assert note_text(library, first) == "# Late by\ta step\n\nSeen twice."
    assert note_text(library, second) == "<b>Not</b> any more."
    library.remove(first.id, author="Bob")
    assert notes_about(library, rules) == [second]


@pytest.mark.parametrize("text", ["", "  \n\t ", "\x00\x1b"])
def test_a_note_without_words_is_refused(library: Library, text: str) -> None:
    with pytest.raises(InputError, match="a note needs some words"):
        add_note(library, text, author="Ada")


def test_a_note_has_an_end_and_a_name(library: Library) -> None:
    with pytest.raises(InputError, match="100,001 characters"):
        add_note(library, "x" * (LONGEST_NOTE + 1), author="Ada")
    long = add_note(library, "x" * LONGEST_NOTE, author="Ada")
    assert len(long.name) == 80
    assert len(note_text(library, long)) == LONGEST_NOTE
    assert add_note(library, "##\nx", author="Ada").name == "a note"
    half = add_note(library, "half of a pair: \ud800", author="Ada")
    assert note_text(library, half) == "half of a pair: ?"


def test_a_terminal_is_told_nothing_but_text(library: Library, tmp_path: Path) -> None:
    note = add_note(library, "red \x1b[31m\x07", author="Ada")
    assert note_text(library, note) == "red  [31m"
    table = tmp_path / "a.csv"
    table.write_bytes(b"a,b\n\x1b[2J,1\n")
    assert result_view(table, 5).rows == (("a", "b"), (" [2J", "1"))


def test_a_file_of_a_note_is_text(tmp_path: Path) -> None:
    path = tmp_path / "note.md"
    path.write_bytes("\ufeffgrün".encode())
    assert note_of_file(path) == "grün"
    path.write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(InputError, match="is no text in UTF-8"):
        note_of_file(path)
    with pytest.raises(InputError, match=r"ends in '\.gif' and a note in one of \.md, \.txt"):
        note_of_file(tmp_path / "note.gif")
    with pytest.raises(InputError, match="cannot be read"):
        note_of_file(tmp_path / "none.txt")


def test_the_beginning_of_a_result_is_read(tmp_path: Path) -> None:
    table = tmp_path / "a.csv"
    table.write_text("a,b\n1\n2,3,4\n5,6\n")
    view = result_view(table, 2)
    assert view.rows == (("a", "b"), ("1", ""), ("2", "3"))
    assert view.more
    assert not result_view(table, 3).more
    document = tmp_path / "b.json"
    document.write_text('{"x": [1, "é"], "y": NaN}')
    view = result_view(document, 3)
    assert view.lines == ("{", ' "x": [', "  1,")
    assert view.more
    assert json.loads("\n".join(result_view(document, 99).lines))["x"] == [1, "é"]
    document.write_text("no longer JSON")
    assert result_view(document, 3).lines == ("no longer JSON",)
    (tmp_path / "c.html").write_text("<p>")
    assert result_view(tmp_path / "c.html", 3).lines == ()
    table.write_text('a,"' + "x" * 200_000)  # a cell longer than the reader takes
    assert result_view(table, 3).lines[0].startswith('a,"x')
    with pytest.raises(InputError, match="cannot be read"):
        result_view(tmp_path / "none.csv", 3)


def test_a_result_travels_with_what_it_is_about(
    library: Library, rules: Item, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_bytes(CONTENTS["a.csv"])
    about = library.add("note", "of it", {}, author="Ada")
    result = add_result(library, tmp_path / "a.csv", author="Ada", about=[about.id])
    note = add_note(library, "seen", author="Ada", about=[result.id])
    export_bundle(library, [note.id], tmp_path / "x.sarl")
    with Library(tmp_path / "there") as there:
        import_bundle(there, tmp_path / "x.sarl", author="Bob")
        again = there.item(result.id)
        assert there.path(again).read_bytes() == CONTENTS["a.csv"]
        assert [one.id for one in notes_about(there, again)] == [note.id]


def test_a_certificate_is_a_result_that_says_what_it_certifies(
    library: Library, tmp_path: Path
) -> None:
    rules = Shield(load_rules(DATA / "rules" / "cartpole_compact.json"))
    path = tmp_path / "certificate.json"
    save_certificate(certify("CartPole-v1", "novice", rules, at_most=0.2), path)
    item = add_result(library, path, author="Ada")
    verdict = "Certified with 95 % certainty: at most 20 % of the episodes fail."
    assert item.details["certificate"] == verdict
    assert ("verdict", verdict) in result_view(library.path(item), 20).rows
    document = json.loads(path.read_text()) | {"failures": 1}
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="does not hold together"):
        add_result(library, path, author="Ada")
    assert result_view(path, 5).lines  # as it stands
