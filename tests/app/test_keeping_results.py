"""What pages work out is kept with the address that opens it as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core.library import Item, Library
from sarl_core.library.results import add_result
from tests.app.screens import errors, open_page, run_through, texts

pytestmark = pytest.mark.usefixtures("place")


def results() -> list[Item]:
    with Library() as library:
        return library.items("Ada", kind="result")


def test_a_comparison_is_kept_once_and_shown_in_the_library() -> None:
    app = open_page("shield", data="cartpole", agents="novice", episodes="2", first_seed="8000")
    run_through(app, "comparison")
    for _ in range(2):
        app.button(key="keep_comparison").click().run()
        assert not errors(app)
    (item,) = results()
    page = open_page("library", item=item.id)
    assert not errors(page)
    assert "comparison-CartPole-v1-8000" in texts(page)
    assert [len(table.value) for table in page.dataframe][-1] == 3  # a line a shield


def test_a_replay_is_kept_as_its_film() -> None:
    app = run_through(open_page("replay", data="cartpole", seed="100003"), "replay")
    app.button(key="keep_replay").click().run()
    assert not errors(app)
    (item,) = results()
    assert item.files[0].ending == ".gif"


@pytest.mark.parametrize(
    ("address", "offered"),
    [
        ("measure?data=cartpole&episodes=2", True),
        ("javascript:alert(1)", False),
        ("//elsewhere.example/?a", False),
        ("https://elsewhere.example/a?b", False),
        ("measure?a=<script>", False),
    ],
)
def test_an_address_leads_to_a_page_of_this_dashboard_alone(
    address: str, offered: bool, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with Library() as library:
        item = add_result(library, tmp_path / "a.csv", author="Ada", address=address)
    page = open_page("library", item=item.id)
    links = [link.proto.url for link in page.get("link_button")]
    assert (f"./{address}" in links) == offered
    assert len(links) == offered
