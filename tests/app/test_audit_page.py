"""The page Audit: a log against the rules, two logs, and what is no log of theirs."""

from __future__ import annotations

from pathlib import Path

from sarl_core import audit, load_demonstrations, mine_rules
from tests.app.screens import ROUTER, errors, html, metrics, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def upload(path: Path) -> tuple[str, bytes, str]:
    return path.name, path.read_bytes(), "application/octet-stream"


def test_a_log_is_held_against_the_rules() -> None:
    app = open_page("audit", data="cartpole", support="0.01", confidence="0.9")
    assert "Upload a log" in texts(app)
    app.file_uploader(key="log").set_value(upload(DATA / "cartpole.parquet"))
    app.run()
    assert not app.exception
    demonstrations = load_demonstrations(DATA / "cartpole.parquet")
    held = audit(mine_rules(demonstrations, supp_min=0.01, conf_min=0.9), demonstrations)
    assert metrics(app)["Broken"] == f"{held.broken:,}"
    worst = held.worst[0]
    assert f"episode {worst.episode}, from step {worst.step}" in texts(app)
    episode = held.episodes.sort_values("broken", ascending=False, kind="stable").iloc[0]
    assert app.selectbox(key="log_episode").value == (
        f"{episode['episode']:.0f} ({episode['broken']:.0f} breaks)"
    )
    assert "– **broken**" in texts(app)
    assert "Asked on the way" in html(app)
    links = [link.proto.page for link in app.get("page_link")]
    assert {"rules", "what_if"} <= set(links)
    app.file_uploader(key="other_log").set_value(upload(DATA / "cartpole.parquet"))
    app.run()
    assert "Nothing shows that the two logs differ" in texts(app)


def test_a_log_of_something_else_is_refused() -> None:
    app = open_page("audit", data="cartpole")
    app.file_uploader(key="log").set_value(upload(DATA / "pendulum.parquet"))
    app.run()
    (sentence,) = errors(app)
    assert "the rules ask about 4 features and the log has no cart position" in sentence
