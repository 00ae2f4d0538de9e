"""What a visitor makes outlives the visit, and what is not there is said and not replaced."""

from __future__ import annotations

import shlex
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.cli.app import main
from sarl_core.errors import InputError
from sarl_core.library import Library, Quota
from sarl_core.library.contents import add_rules, annotated_file, rules_of
from sarl_core.library.items import new_id
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_dashboard.state import library as state
from tests.app.screens import chosen_rules, errors, metrics, open_page, texts

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
ROWS = b"obs_speed,action,episode\n0.5,0,0\n1.5,1,0\n0.25,0,1\n2.5,1,1\n0.1,0,1\n"


def upload(app: AppTest, content: bytes = ROWS, name: str = "crane.csv") -> str:
    """What the address calls it then."""
    app.file_uploader(key="upload_files").set_value([(name, content, "text/csv")]).run()
    assert not app.exception
    assert not errors(app)
    return str(app.query_params["data"])


def test_an_upload_is_there_after_a_reload_with_its_names_and_formulas(tmp_path: Path) -> None:
    app = open_page("demonstrations")
    identifier = upload(app)
    app.switch_page("names.py").run()
    raw = app.session_state["_upload"]
    key = raw.digest[:8]
    app.text_input(key=f"formula_{key}").set_value("twice [m] = 2 * speed").run()
    app.button(key="formula_take").click().run()
    fresh = open_page("names", data=identifier)
    assert not errors(fresh)
    assert "twice" in texts(fresh)
    assert metrics(open_page("demonstrations", data=identifier))["Steps"] == "5"
    sidebar = fresh.selectbox(key="_data_choice")
    assert sidebar.value == identifier
    assert "crane.csv" in sidebar.options
    # A command that is given its id works with them, too.
    with Library() as library:
        path = annotated_file(library, library.item(identifier), tmp_path)
    assert [one.name for one in load_demonstrations(path).features] == ["speed", "twice"]


def test_two_files_of_one_name_are_told_apart() -> None:
    first = upload(open_page("demonstrations"))
    app = open_page("demonstrations")
    second = upload(app, ROWS.replace(b"0.5", b"0.75"))
    assert first != second
    labels = app.selectbox(key="_data_choice").options
    assert len([label for label in labels if label.startswith("crane.csv")]) == 2
    assert len(set(labels)) == len(labels)
    app.switch_page("thresholds.py").run()
    assert app.query_params["data"] == second
    assert app.selectbox(key="_data_choice").value == second


def test_the_same_file_is_kept_once() -> None:
    first = upload(open_page("demonstrations"))
    assert upload(open_page("demonstrations")) == first
    with Library() as library:
        assert len(library.items()) == 1


@pytest.mark.parametrize("page", ["demonstrations", "thresholds", "rules", "replay", "report"])
@pytest.mark.parametrize("missing", ["removed", "gone", "damaged", "words"])
def test_what_a_link_names_is_not_replaced_in_silence(page: str, missing: str, place: Path) -> None:
    identifier = upload(open_page("demonstrations"))
    says = {
        "removed": "was removed by Ada",
        "gone": "has nothing with the id",
        "damaged": "is missing from the library",
        "words": "There are no demonstrations called",
    }[missing]
    if missing == "removed":
        with Library() as library:
            library.remove(identifier, author="Ada")
    elif missing == "damaged":
        shutil.rmtree(place / "files")
    name = {"gone": new_id(), "words": "nonsense"}.get(missing, identifier)
    app = open_page(page, data=name)
    assert any(says in one for one in errors(app)), errors(app)
    assert metrics(app) == {}
    assert app.query_params["data"] == name


@pytest.mark.parametrize("named", [{"edits": "a" * 26}, {"set": "b" * 26}, {"edits": "x"}])
def test_a_page_without_its_data_has_its_title_and_its_sidebar(named: dict[str, str]) -> None:
    data = new_id()
    app = open_page("rules", data=data, **named)
    assert [one.value for one in app.title] == ["Rules"]
    assert any("has nothing with the id" in one for one in errors(app))
    assert app.selectbox(key="_data_choice").value == data
    app.switch_page("library.py").run()
    assert [one.value for one in app.title] == ["Library"]
    assert not errors(app)
    for name, value in named.items():
        assert app.query_params[name] == value


def test_the_list_stands_where_a_link_names_nothing_that_is_here() -> None:
    upload(open_page("demonstrations"))
    for named, says in ((new_id(), "has nothing with the id"), ("nonsense", "is no id")):
        app = open_page("library", item=named)
        assert any(says in one for one in errors(app)), errors(app)
        assert "crane.csv" in app.dataframe[0].value["Name"].tolist()
        assert "kept for this visit only" not in texts(app)


def test_the_list_stands_where_the_file_of_one_thing_is_missing(place: Path) -> None:
    with Library() as library:
        rules = mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0, conf_min=1)
        identifier = add_rules(library, rules, "mine", author="Ada").id
    shutil.rmtree(place / "files")
    app = open_page("library", item=identifier)
    assert any("is missing from the library" in one for one in errors(app)), errors(app)
    assert "Bring what was exported elsewhere" in [one.label for one in app.expander]
    assert "kept for this visit only" not in texts(app)


def test_without_a_library_everything_else_works(place: Path) -> None:
    place.write_text("a file where the folder should be")
    app = open_page("demonstrations")
    assert upload(app) == "upload"
    assert metrics(app)["Steps"] == "5"
    assert [one.value for one in app.toast][-1:] != []
    app.switch_page("library.py").run()
    assert any("cannot be made" in one for one in errors(app))
    assert "kept for this visit only" in texts(app)


def test_a_place_that_cannot_be_looked_into_leaves_the_lists_empty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refused(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refused)  # a folder's mode stops nobody who is root
    assert state.own_demonstrations() == state.own_rules() == []


def test_a_link_opens_one_thing_and_its_author_changes_it() -> None:
    identifier = upload(open_page("demonstrations"))
    app = open_page("library", item=identifier)
    assert "5 steps, 2 episodes" in texts(app)
    assert f"library:{identifier}" in texts(app)
    app.text_input(key=f"name_{identifier}").set_value("the crane").run()
    app.toggle(key=f"share_{identifier}").set_value(True).run()
    with Library() as library:
        item = library.item(identifier)
        assert (item.name, item.shared) == ("the crane", True)
    app.text_input(key=f"name_{identifier}").set_value(" ").run()
    assert any("needs a name" in one for one in errors(app))
    app.button(key="library_open").click().run()
    assert app.query_params["data"] == identifier
    assert "the crane" in app.selectbox(key="_data_choice").options
    app.button(key="library_remove").click().run()
    assert not app.exception
    assert "can be brought back below" in texts(app)
    with Library() as library:
        assert library.item(identifier).removed is not None


def test_who_is_not_the_author_may_look(monkeypatch: pytest.MonkeyPatch) -> None:
    identifier = upload(open_page("demonstrations"))
    monkeypatch.setenv("SARL_AUTHOR", "Bob")
    app = open_page("library", item=identifier)
    keys = {button.key for button in app.button}
    assert "library_open" in keys
    assert "library_remove" not in keys
    assert not app.toggle
    assert metrics(open_page("demonstrations", data=identifier))["Steps"] == "5"


def test_things_are_listed_renamed_shared_opened_removed_and_brought_back() -> None:
    assert "Nothing is kept yet" in texts(open_page("library"))
    identifier = upload(open_page("demonstrations"))
    with Library() as library:
        library.add("note", "Bob's", {}, author="Bob")
        library.add("note", "of all", {}, author="Bob", shared=True)
    app = open_page("library")
    (table,) = app.dataframe
    assert table.value["Name"].tolist() == ["of all", "crane.csv"]
    assert table.value["Author"].tolist() == ["Bob", "you"]
    assert table.value["About"].tolist() == ["", "5 steps, 2 episodes"]
    with Library() as library:
        item = library.rename(identifier, "crane", author="Ada")
        assert item.name == "crane"
        library.remove(identifier, author="Ada")
    app.run()
    assert app.dataframe[0].value["Name"].tolist() == ["of all"]
    app.button(key=f"restore_{identifier}").click().run()
    assert app.dataframe[0].value["Name"].tolist() == ["of all", "crane"]


def test_a_bundle_is_brought_and_a_wrong_one_refused(tmp_path: Path) -> None:
    from sarl_core.library.bundles import export_bundle

    with Library(tmp_path / "other") as other:
        item = other.add("note", "from afar", {}, author="Bob")
        export_bundle(other, [item.id], tmp_path / "x.sarl")
    app = open_page("library")
    content = (tmp_path / "x.sarl").read_bytes()
    app.file_uploader(key="library_file").set_value(("x.sarl", content, "")).run()
    assert not errors(app)
    assert app.dataframe[0].value["Name"].tolist() == ["from afar"]
    app.file_uploader(key="library_file").set_value(("y.sarl", content[:-30], "")).run()
    assert any("y.sarl" in one for one in errors(app))
    with Library() as library, pytest.raises(InputError):
        library.item(new_id())


def ticked(app: AppTest) -> list[int]:
    """The rows of the list that are chosen in it."""
    return list(app.session_state["library_table"]["selection"]["rows"])


def test_rules_are_kept_as_versions_and_approved_one_by_one() -> None:
    app = open_page("export", data="cartpole")
    app.text_input(key="keep_name").set_value("for the crane").run()
    app.button(key="keep_rules").click().run()
    assert not errors(app)
    app.button(key="keep_rules").click().run()  # the same is kept once
    with Library() as library:
        (first,) = library.items(kind="rules")
    assert first.name == "for the crane"
    app.toggle(key="rounded").set_value(False).run()
    app.button(key="keep_rules").click().run()
    with Library() as library:
        second, _ = library.items(kind="rules")
        assert second.parent == first.id
        assert len(rules_of(library, second)) == len(rules_of(library, first))
    app = open_page("library", item=first.id)
    app.text_area(key=f"approval_{first.id}").set_value("held against the logs").run()
    app.button(key="library_approve").click().run()
    today = datetime.now(UTC)
    said = f"Approved by Ada on {today.day} {today:%B %Y}: held against the logs."
    assert said in texts(app)
    assert ticked(app) == [1]
    app.button(key=f"version_{second.id}").click().run()
    assert app.query_params["item"] == second.id
    assert ticked(app) == [0]
    assert "Approved by" not in texts(app)


def test_what_is_kept_of_edited_rules_knows_its_edits_and_its_parent_and_is_put_in_force() -> None:
    app = open_page("edit", data="cartpole")
    app.button(key="edit_switch").click().run()
    counted = f"{metrics(app)['Rules in force']} rules for CartPole-v1"
    assert app.text_input(key="keep_name").value == counted
    app.text_input(key="keep_name").set_value("without one").run()
    app.button(key="keep_rules").click().run()
    assert not errors(app)
    with Library() as library:
        (first,) = library.items("Ada", kind="rules")
        assert first.details["edits"] == 1
        assert {one.role for one in first.files} == {"edits", "rules"}
    page = open_page("library", item=first.id, data="lunar_lander")
    assert "1 edit" in texts(page)
    page.button(key="library_in_force").click().run()
    assert not errors(page)
    assert chosen_rules(page) == first.id
    # With the data that they are from, though these are shipped and so nothing in the library.
    assert page.selectbox(key="_data_choice").value == "cartpole"
    # Edited once more and kept again, it is a version of the first.
    again = open_page("edit", data="cartpole", set=first.id)
    again.button(key="edit_pin").click().run()
    again.text_input(key="keep_name").set_value("with a pin").run()
    again.button(key="keep_rules").click().run()
    with Library() as library:
        second = next(one for one in library.items("Ada", kind="rules") if one.id != first.id)
        assert (second.parent, second.lineage) == (first.id, first.lineage)
    page = open_page("library", item=second.id)
    compared = [link.proto.query_string for link in page.get("page_link")]
    assert any(first.id in text and second.id in text for text in compared)
    both = open_page("difference", data="cartpole", sets=f"{first.id}|{second.id}")
    assert not errors(both)
    (overview,) = (
        one for one in both.get("html") if "What each rule set comes to" in one.proto.body
    )
    assert overview.proto.body.count("<tr><td") == 2


def test_what_is_kept_for_a_link_alone_opens_and_offers_nothing() -> None:
    app = open_page("edit", data="cartpole")
    app.button(key="edit_switch").click().run()
    identifier = app.query_params["edits"]
    identifier = identifier if isinstance(identifier, str) else identifier[0]
    page = open_page("library", item=identifier)
    assert not page.exception
    assert "Kept for a link" in texts(page)


@pytest.mark.parametrize("merged", ["true", "false"])
def test_the_commands_of_kept_rules_make_them_again(
    merged: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = (DATA / "pendulum.parquet").read_bytes()
    identifier = upload(open_page("demonstrations"), content, "swing.parquet")
    app = open_page("export", data=identifier, divider="4", support="0.01", merged=merged)
    app.button(key="keep_rules").click().run()
    with Library() as library:
        (item,) = library.items("Ada", kind="rules")
    monkeypatch.chdir(tmp_path)
    for line in item.command.splitlines():
        words = shlex.split(line)
        assert words[:3] == ["python", "-m", "sarl_core"]
        assert main(words[3:]) == 0
    assert rules_digest(RuleSet.load(tmp_path / "exported.json")) == item.digest


def test_that_a_quota_is_near_is_told_where_something_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    app = open_page("demonstrations")
    upload(app)
    assert not any("remove what" in toast.value for toast in app.toast)
    used = state.library().usage("Ada").author
    monkeypatch.setattr(state.library(), "quota", Quota(author=round(2.05 * used)))
    upload(app, ROWS.replace(b"0.25", b"0.75"), "crane_2.csv")
    assert any("remove what is no longer needed" in toast.value for toast in app.toast)
