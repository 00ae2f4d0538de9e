"""The order of the pages, what each is called, and where one goes on from it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from sarl_dashboard.components.journey.next_step import NEXT
from tests.app.screens import ROUTER, open_page

TITLES = {
    re.search(r'^st\.title\("(.+)"\)', path.read_text(), re.MULTILINE)[1]: str(
        path.relative_to(ROUTER.parent)
    )
    for path in sorted(ROUTER.parent.rglob("*.py"))
    if path != ROUTER
}
SECTIONS = {
    "Start": ["Overview"],
    "1 Data": ["Demonstrations", "Names", "Episodes"],
    "2 Rules": ["Thresholds", "Rules", "Evidence"],
    "3 Understand and change": ["What if", "Edit", "Compare"],
    "4 Try the shield": ["Replay", "Measure", "Worth of each rule", "Audit"],
    "5 Hand over": ["Report", "Export", "Library"],
    "Research": ["Improve", "Learning", "Paper"],
}


def next_links(app: AppTest) -> list[str]:
    return [link.proto.label for link in app.get("page_link") if link.proto.label[:5] == "Next:"]


def test_pages_stand_in_sections_in_the_order_of_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []

    def navigation(sections, **options):
        drawn.append(
            {
                name: [page.title for page in pages if page.visibility == "visible"]
                for name, pages in sections.items()
            }
        )
        return real(sections, **options)

    real = st.navigation
    monkeypatch.setattr(st, "navigation", navigation)
    open_page("overview")
    assert drawn[0] == SECTIONS
    assert list(drawn[0]) == list(SECTIONS)


def test_every_page_is_followed_by_another() -> None:
    assert set(NEXT) == set(TITLES)
    for title, (file, _) in NEXT.items():
        assert file in TITLES.values()
        assert file != TITLES[title]


@pytest.mark.parametrize("title", ["Overview", "Episodes", "Compare", "Replay", "Learning"])
def test_a_page_ends_with_the_step_that_follows(title: str) -> None:
    """That of Replay too, where nothing was run yet."""
    app = open_page(Path(TITLES[title]).stem, data="cartpole")
    (label,) = next_links(app)
    assert label[6:].casefold() == NEXT[title][1].casefold()


def test_a_page_without_data_sends_one_to_them_and_no_further() -> None:
    assert next_links(open_page("rules", data="upload")) == []


def test_an_address_of_before_takes_along_all_that_it_says() -> None:
    shields = ["no shield", "compact"]
    app = AppTest.from_file(ROUTER, default_timeout=120)
    app.query_params["shields"] = shields
    # Where no page is known yet, the name of the file is the address: here the one of before.
    app.switch_page("shield.py").run()
    assert app.title[0].value == "Measure"
    assert app.query_params["shields"] == shields


@pytest.mark.parametrize("title", TITLES)
def test_a_page_says_in_one_sentence_under_its_title_what_it_answers(title: str) -> None:
    page = ast.parse((ROUTER.parent / TITLES[title]).read_text())
    calls = [
        statement.value
        for statement in page.body
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call)
    ]
    shown = [call for call in calls if ast.unparse(call.func) in ("st.title", "st.caption")]
    assert [ast.unparse(call.func) for call in shown[:2]] == ["st.title", "st.caption"]
    subtitle = ast.literal_eval(shown[1].args[0])
    assert re.findall(r"[.?!](?= |$)", subtitle) == ["."]
    assert subtitle.endswith(".")
