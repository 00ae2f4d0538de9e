"""The rules in force are those that an address names, with their edits; else it is said."""

from __future__ import annotations

from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.library import Library
from sarl_core.library.contents import add_rules
from sarl_core.library.place import place_of, usual_author
from sarl_core.mining.rule_set import RuleSet, rules_to_json
from tests.app.screens import (
    ROUTER,
    chosen_rules,
    errors,
    open_page,
    texts,
    upload_rules,
)

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet")
FILTERED = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)
AT_THRESHOLDS, EDITED = "thresholds", "thresholds with edits"


def click(app: AppTest, key: str) -> None:
    app.button(key=key).click().run()
    assert not app.exception, app.exception


def address(app: AppTest) -> dict[str, str]:
    values = dict(app.query_params.items())
    return {name: one if isinstance(one, str) else one[0] for name, one in values.items()}


def edited(**query: str) -> AppTest:
    """The page Edit after a rule was switched off."""
    app = open_page("edit", data="cartpole", **query)
    click(app, "edit_switch")
    return app


def off(app: AppTest) -> list[str]:
    """Names of the rules that the page Rules shows as switched off."""
    return [name for name in app.dataframe[0].value["Rule"] if name.endswith(", off")]


def test_an_edit_is_in_force_on_every_page_and_for_whoever_has_the_link() -> None:
    app = edited()
    assert chosen_rules(app) == EDITED
    link = address(app)
    assert len(link["edits"]) == 26
    app.switch_page("rules.py").run()
    assert len(off(app)) == 1
    assert address(app)["edits"] == link["edits"]
    for page in ("rules", "export", "report", "what_if", "episodes", "audit"):
        other = open_page(page, **link)
        assert not errors(other)
        assert chosen_rules(other) == EDITED
    assert off(open_page("rules", **link)) == off(app)
    # Taken back by whoever opened it, it is still there for who made it.
    other = open_page("edit", **link)
    click(other, "undo")
    assert "edits" not in other.query_params
    assert off(open_page("rules", **link)) == off(app)


def test_edits_wait_while_other_rules_are_in_force() -> None:
    app = edited()
    named = address(app)["edits"]
    app.selectbox(key="_rules_choice").set_value(AT_THRESHOLDS).run()
    assert "edits" not in app.query_params
    app.switch_page("rules.py").run()
    assert not off(app)
    app.selectbox(key="_rules_choice").set_value("compact").run()
    assert address(app)["set"] == "compact"
    app.selectbox(key="_rules_choice").set_value(EDITED).run()
    assert address(app)["edits"] == named
    assert len(off(app)) == 1


def test_edits_of_one_divider_are_set_aside_with_it_and_come_back_with_it() -> None:
    app = open_page("edit", data="pendulum")
    click(app, "edit_switch")
    named = address(app)["edits"]
    app.switch_page("thresholds.py").run()
    app.slider(key="divider").set_value(5).run()
    assert chosen_rules(app) == AT_THRESHOLDS
    assert "edits" not in app.query_params
    app.slider(key="divider").set_value(2).run()
    assert address(app)["edits"] == named


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"data": "pendulum"}, "belong to other rules than those it names"),
        ({"left_out": "3"}, "belong to other rules than those it names"),
        ({"set": "compact"}, "belong to other rules than those it names"),
        ({"edits": "unkept"}, "could not be kept"),
        ({"edits": "a" * 26}, "has nothing with the id"),
        ({"edits": "nonsense"}, "no edits called 'nonsense'"),
        ({"set": "nonsense"}, "no rules called 'nonsense'"),
        ({"set": "a" * 26}, "has nothing with the id"),
        ({"set": "own file"}, "was not kept"),
        ({"wording": "a" * 26}, "has nothing with the id"),
        ({"wording": "nonsense"}, "no names called 'nonsense'"),
        ({"wording": "unkept"}, "could not be kept"),
    ],
)
def test_what_an_address_names_and_is_not_here_is_said_and_nothing_takes_its_place(
    changed: dict[str, str], said: str
) -> None:
    link = address(edited()) | changed
    for page in ("rules", "export", "replay"):
        app = open_page(page, **link)
        (sentence,) = errors(app)
        assert said in sentence
        assert "\n" not in sentence
        assert not app.dataframe
        assert not app.get("download_button")
    click(app, "go_on_without")
    assert not errors(app)


def test_edits_are_no_names_and_the_other_way_round() -> None:
    link = address(edited())
    (sentence,) = errors(open_page("rules", data="cartpole", wording=link["edits"]))
    assert "as names of data" in sentence
    app = open_page("rules", data="cartpole", set=link["edits"])
    (sentence,) = errors(app)
    assert "holds no rules" in sentence


def named_by_hand(name: str = "lean") -> AppTest:
    app = open_page("names", data="cartpole")
    rows = {2: {"Name": name}}
    app.session_state[app.data_editor[0].key] = {
        "edited_rows": rows,
        "added_rows": [],
        "deleted_rows": [],
    }
    app.run()
    app.run()  # the address follows
    return app


def test_names_of_shipped_data_are_in_the_link() -> None:
    app = named_by_hand()
    link = address(app)
    other = open_page("rules", **link)
    assert "lean" in " ".join(other.dataframe[0].value["When"])
    other.switch_page("names.py").run()
    click(other, "names_back")
    other.run()
    assert "wording" not in other.query_params
    assert "lean" in " ".join(open_page("rules", **link).dataframe[0].value["When"])
    (sentence,) = errors(open_page("rules", **(link | {"data": "pendulum"})))
    assert "belong to other data" in sentence


def test_a_file_is_kept_and_its_link_opens_it_until_it_is_removed(tmp_path: Path) -> None:
    app = open_page("rules", data="cartpole")
    rules = mine_rules(CARTPOLE, supp_min=0.002, conf_min=0.97)  # of no other test's file
    upload_rules(app, "mine.json", rules_to_json(rules).encode())
    link = address(app)
    other = open_page("rules", **link)
    assert len(other.dataframe[0].value) == len(rules)
    assert "mine.json" in other.selectbox(key="_rules_choice").options
    with Library(place_of()) as library:
        library.remove(link["set"], author=usual_author())
    (sentence,) = errors(open_page("rules", **link))
    assert "mine.json was removed by" in sentence


def test_a_kept_version_is_in_force_and_edited_as_itself() -> None:
    kept = RuleSet.load(DATA.parent / "rules" / "cartpole_compact.json")
    with Library(place_of()) as library:
        item = add_rules(library, kept, "the three", author=usual_author())
    app = open_page("edit", data="cartpole", set=item.id)
    assert "The rules of the three, 3 of them" in texts(app)
    click(app, "edit_switch")
    assert chosen_rules(app) == f"{item.id} with edits"
    app.switch_page("rules.py").run()
    assert len(off(app)) == 1
    assert not errors(app)


def test_where_nothing_can_be_kept_edits_are_in_force_for_the_visit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no library")
    monkeypatch.setenv("SARL_LIBRARY", str(blocked))
    app = edited()
    assert address(app)["edits"] == "unkept"
    assert any("for this visit only" in toast.value for toast in app.toast)
    app.switch_page("rules.py").run()
    assert len(off(app)) == 1
    assert not errors(app)
    upload_rules(app, "mine.json", rules_to_json(FILTERED).encode())
    assert address(app)["set"] == "own file"
    assert not errors(app)


def test_a_page_s_own_choice_that_is_not_here_is_said() -> None:
    app = open_page("export", data="cartpole", carry="nonsense")
    assert any("no rules called “nonsense”" in str(one.value) for one in app.warning)
    app.selectbox(key="carry").set_value("compact").run()
    assert not app.warning


def test_other_data_leave_rules_and_edits_that_are_not_theirs() -> None:
    app = open_page("rules", data="cartpole", set="compact", edits="a" * 26)
    assert errors(app)
    app.selectbox(key="_data_choice").set_value("pendulum").run()
    assert not errors(app)
    assert chosen_rules(app) == AT_THRESHOLDS
    assert not {"set", "edits"} & set(address(app))
    app = open_page("rules", data="cartpole", set="compact")
    app.query_params["data"] = "pendulum"  # by a link that names no rules
    app.run()
    assert not errors(app)
    assert chosen_rules(app) == AT_THRESHOLDS


def test_a_narrow_screen_is_told_which_rules_are_in_force() -> None:
    assert "Rules: " not in texts(open_page("rules", data="cartpole"))
    app = open_page("report", data="cartpole", set="compact")
    assert "Rules: Compact rules" in texts(app)


@pytest.mark.parametrize("page", ["edit", "shield", "episodes", "what_if"])
def test_rules_of_other_data_are_said_to_be_such(page: str) -> None:
    with Library() as library:
        item = add_rules(library, FILTERED, "of carts", author=usual_author())
    said = "speak of other features or actions than the chosen demonstrations"
    app = open_page(page, data="lunar_lander", set=item.id)
    assert [said in info.value for info in app.info].count(True) == 1
    assert not errors(app)
    assert said not in texts(open_page(page, data="cartpole", set=item.id))
