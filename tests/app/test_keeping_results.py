"""What pages work out is kept with the address that opens it as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core.library import Item, Library
from sarl_core.library.results import add_result
from sarl_dashboard.jobs.improving import outcome_cache
from sarl_dashboard.jobs.queue import queue
from tests.app.screens import errors, metrics, open_page, run_through, texts


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


def restarted() -> None:
    """Forget what a server's process remembers of its work, as a new one would."""
    outcome_cache().clear()


IMPROVE = {
    "data": "cartpole",
    "max_rules": "4",
    "rounds": "2",
    "round_episodes": "3",
    "validation": "2",
}


def test_an_improvement_is_kept_with_its_rules_and_there_again_after_a_restart(
    place: Path,
) -> None:
    app = run_through(open_page("improve", **IMPROVE), "improve")
    before = metrics(app)
    assert before["Mean return"]
    for _ in range(2):
        app.button(key="keep_improvement").click().run()
        assert not errors(app)
    (item,) = results()
    with Library() as library:
        rules, *_ = (library.item(one) for one in item.came_from)
        (data,) = (library.item(one) for one in rules.came_from)
        assert (rules.kind, data.kind) == ("rules", "demonstrations")
        assert "aggregate" in rules.command
        assert len(library.items("Ada")) == 3
    restarted()
    again = open_page("improve", **IMPROVE)
    assert metrics(again) == before
    assert again.button(key="run_improve").disabled
    assert "The settings have changed" not in texts(again)
    other = open_page("improve", **IMPROVE | {"rounds": "1"})
    assert not metrics(other)
    assert not errors(open_page("library", item=item.id))
    # What is damaged of it can be run again.
    restarted()
    for path in (place / "files").glob("*/*.json"):
        path.write_bytes(b"{")
    again = open_page("improve", **IMPROVE)
    assert not errors(again)
    assert not again.button(key="run_improve").disabled


def test_states_that_need_a_demonstration_are_kept_and_there_again() -> None:
    asked = {"data": "cartpole", "expert": "nobody", "round_episodes": "3", "support": "0.2"}
    app = run_through(open_page("improve", **asked), "improve")
    app.button(key="keep_gaps").click().run()
    (item,) = results()
    assert item.files[0].ending == ".csv"
    restarted()
    again = open_page("improve", **asked)
    assert again.dataframe[0].value.equals(app.dataframe[0].value)


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
    queue.cache_clear()  # of what other tests began there may be addresses, too
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with Library() as library:
        item = add_result(library, tmp_path / "a.csv", author="Ada", address=address)
    page = open_page("library", item=item.id)
    links = [link.proto.url for link in page.get("link_button")]
    assert (f"./{address}" in links) == offered
    assert len(links) == offered
