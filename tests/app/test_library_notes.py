"""Results are shown as what they are, notes as text, and a note is written on the page."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image
from streamlit.testing.v1 import AppTest

from sarl_core.library import Item, Library
from sarl_core.library.bundles import export_bundle, import_bundle
from sarl_core.library.results import add_note, add_result, note_text, notes_about
from sarl_dashboard.views.library import contents
from tests.app.screens import errors, html, open_page, texts

SCRIPT = "<script>alert(1)</script> *not* `so`"


@pytest.fixture
def rules() -> Item:
    from sarl_core import RuleSet
    from sarl_core.library.contents import add_rules

    data = Path(__file__).parents[2] / "data" / "rules" / "cartpole_combined.json"
    with Library() as library:
        return add_rules(library, RuleSet.load(data), "two rules", author="Ada")


def result_page(tmp_path: Path, name: str, content: bytes, about: tuple[str, ...] = ()) -> AppTest:
    path = tmp_path / name
    path.write_bytes(content)
    with Library() as library:
        item = add_result(library, path, author="Ada", about=about)
    return open_page("library", item=item.id)


def downloads(app: AppTest) -> list[str]:
    return [button.proto.label for button in app.get("download_button")]


def plain(app: AppTest) -> list[str]:
    """What is shown as text that is nothing but text."""
    return [str(one.value) for one in app.text]


def test_a_table_is_a_table(tmp_path: Path) -> None:
    app = result_page(tmp_path, "a.csv", b"agent,return\n<b>novice</b>,22\n")
    assert not errors(app)
    table = app.dataframe[-1].value
    assert table.to_dict("list") == {"agent": ["<b>novice</b>"], "return": ["22"]}
    assert "Download .csv" in downloads(app)
    app = result_page(tmp_path, "b.csv", b"x,x\n1,2\n")
    assert app.dataframe[-1].value.columns.tolist() == ["x (0)", "x (1)"]


def test_a_document_is_text(tmp_path: Path) -> None:
    app = result_page(tmp_path, "a.json", b'{"x": "<script>alert(1)</script>"}')
    assert app.code[0].value == '{\n "x": "<script>alert(1)</script>"\n}'
    assert "Download .json" in downloads(app)


def test_a_page_is_carried_away_and_not_opened_here(tmp_path: Path) -> None:
    app = result_page(tmp_path, "a.html", b"<p>words of the page</p><script>alert(1)</script>")
    assert "words of the page" not in html(app) + texts(app)
    assert not app.get("iframe")
    assert "Download .html" in downloads(app)


def test_a_picture_is_shown_and_a_damaged_one_is_not(tmp_path: Path) -> None:
    out = io.BytesIO()
    Image.new("P", (4, 4)).save(out, format="GIF")
    app = result_page(tmp_path, "a.gif", out.getvalue())
    assert len(app.get("image")) == 1
    app = result_page(tmp_path, "b.gif", b"GIF89a and nothing more")
    assert not app.exception
    assert not app.get("image")
    assert "cannot be shown" in texts(app)
    assert "Download .gif" in downloads(app)


def test_a_film_that_is_too_large_is_carried_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = b"\x00\x00\x00\x20ftypisom"
    assert result_page(tmp_path, "a.mp4", film).get("video")
    monkeypatch.setattr(contents, "_LARGEST", 10)
    app = result_page(tmp_path, "a.mp4", film)
    assert not app.get("video")
    assert "too large to be shown" in texts(app)
    assert "Download .mp4" in downloads(app)


def test_a_result_leads_to_what_it_is_about_and_back(tmp_path: Path, rules: Item) -> None:
    app = result_page(tmp_path, "a.csv", b"x\n1\n", (rules.id,))
    identifier = app.query_params["item"]
    app.button(key=f"source_{rules.id}").click().run()
    assert app.query_params["item"] == rules.id
    app.button(key=f"result_{identifier}").click().run()
    assert app.query_params["item"] == identifier


def test_results_of_others_stay_theirs(tmp_path: Path, rules: Item) -> None:
    (tmp_path / "a.csv").write_bytes(b"x\n1\n")
    with Library() as library:
        theirs = add_result(library, tmp_path / "a.csv", author="Bob", about=[rules.id])
    app = open_page("library", item=rules.id)
    assert f"result_{theirs.id}" not in {button.key for button in app.button}
    with Library() as library:
        library.share(theirs.id, author="Bob")
    app.run()
    assert f"result_{theirs.id}" in {button.key for button in app.button}


def test_a_note_is_written_and_stands_beneath(rules: Item) -> None:
    with Library() as library:
        add_note(library, "Late by a step.", author="Bob", about=[rules.id])
    app = open_page("library", item=rules.id)
    assert "Late by a step." in plain(app)
    assert any(button.label.startswith("Bob, ") for button in app.button)
    app.text_area(key=f"note_{rules.id}").set_value(SCRIPT).run()
    app.button(key="library_note").click().run()
    assert not app.exception
    assert not errors(app)
    assert plain(app)[-2:] == ["Late by a step.", SCRIPT]
    assert "<script>" not in html(app)
    assert app.text_area(key=f"note_{rules.id}").value == ""
    with Library() as library:
        note = notes_about(library, rules)[-1]
        assert (note.author, note.came_from) == ("Ada", (rules.id,))
        assert note_text(library, note) == SCRIPT
    app.button(key=f"note_item_{note.id}").click().run()
    assert app.query_params["item"] == note.id
    assert SCRIPT in plain(app)


def test_a_note_of_only_spaces_is_refused_and_stays_to_be_written(rules: Item) -> None:
    app = open_page("library", item=rules.id)
    app.text_area(key=f"note_{rules.id}").set_value("  \n ").run()
    app.button(key="library_note").click().run()
    assert any("note needs some words" in one for one in errors(app))
    with Library() as library:
        assert notes_about(library, rules) == []


def test_a_missing_file_is_said_in_its_place(tmp_path: Path) -> None:
    app = result_page(tmp_path, "a.csv", b"x\n1\n")
    with Library() as library:
        library.path(library.items()[0]).unlink()
    app.run()
    assert any("is missing from the library" in one for one in errors(app))
    assert "library_remove" in {button.key for button in app.button}


def test_a_note_that_was_brought_along_is_of_whoever_wrote_it(
    rules: Item, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Library() as library:
        add_note(library, "Why so few?", author="Eve", about=[rules.id])
        export_bundle(library, [rules.id], tmp_path / "rules.sarl")
    with Library(tmp_path / "there") as there:
        import_bundle(there, tmp_path / "rules.sarl", author="Ada")
        assert [one.author for one in notes_about(there, rules)] == ["Ada"]
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "there"))
    app = open_page("library", item=rules.id)
    assert "Why so few?" in plain(app)
    assert any(button.label.startswith("Eve, ") for button in app.button)
