"""The page Audit: a log against the rules, two logs, and what is no log of theirs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import audit, load_demonstrations, mine_rules
from sarl_core.library import Item, Library
from tests.app.screens import ROUTER, errors, html, metrics, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def upload(path: Path) -> tuple[str, bytes, str]:
    return path.name, path.read_bytes(), "application/octet-stream"


def test_a_log_is_held_against_the_rules() -> None:
    app = open_page("audit", data="cartpole", support="0.01", confidence="0.9")
    assert "Upload a log" in texts(app)
    app.file_uploader(key="log_file").set_value(upload(DATA / "cartpole.parquet"))
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
    shown = re.search(r"Step (\d+) of episode (\d+)", texts(app))
    assert shown is not None
    rows = np.flatnonzero(demonstrations.episodes == int(shown[2]))
    app.query_params["log_row"] = str(rows[int(shown[1]) + 3])
    app.run()
    assert f"Step {int(shown[1]) + 3} of episode {shown[2]}" in texts(app)
    app.number_input(key="_log_row").set_value(int(rows[int(shown[1]) + 4])).run()
    assert f"Step {int(shown[1]) + 4} of episode {shown[2]}" in texts(app)
    app.query_params["log_row"] = str(rows[0] - 1)  # of another episode
    app.run()
    assert shown[0] in texts(app)
    app.file_uploader(key="other_log_file").set_value(upload(DATA / "cartpole.parquet"))
    app.run()
    assert "Nothing shows that the two logs differ" in texts(app)


def test_a_log_of_something_else_is_refused() -> None:
    app = open_page("audit", data="cartpole")
    app.file_uploader(key="log_file").set_value(upload(DATA / "pendulum.parquet"))
    app.run()
    (sentence,) = errors(app)
    assert "the rules ask about 4 features and the log has no cart position" in sentence


def address(app: AppTest) -> dict[str, str]:
    """What the address says."""
    values = {name: app.query_params[name] for name in app.query_params}
    return {name: one if isinstance(one, str) else one[0] for name, one in values.items()}


def logs() -> list[Item]:
    with Library() as library:
        return library.items("Ada", kind="log")


def test_a_log_is_kept_at_once_and_its_answer_is_there_again_from_the_link() -> None:
    app = open_page("audit", data="cartpole", support="0.01", confidence="0.9")
    app.file_uploader(key="log_file").set_value(upload(DATA / "cartpole.parquet")).run()
    app.file_uploader(key="other_log_file").set_value(upload(DATA / "cartpole.parquet")).run()
    (item,) = logs()  # the same twice
    assert (item.name, item.details["steps"]) == ("cartpole.parquet", 15_000)
    link = address(app)
    assert (link["log"], link["other_log"]) == (item.id, item.id)
    again = open_page("audit", **link)
    assert not errors(again)
    assert metrics(again) == metrics(app)
    assert "Nothing shows that the two logs differ" in texts(again)
    app.button(key="keep_audit").click().run()
    with Library() as library:
        (kept,) = library.items("Ada", kind="result")
        assert item.id in kept.came_from
    again.button(key="leave_other_log").click().run()
    assert "two logs differ" not in texts(again)
    assert "other_log" not in address(again)


def table(folder: Path) -> tuple[str, bytes, str]:
    """A log with columns that nobody could know."""
    log = load_demonstrations(DATA / "cartpole.parquet").select(range(2))
    columns = dict(zip("abcd", log.observations.T, strict=True))
    frame = pd.DataFrame({"run": log.episodes, **columns, "what": log.actions})
    path = folder / "lab.csv"
    frame.to_csv(path, index=False)
    return upload(path)


def test_what_was_said_of_the_columns_is_kept_with_the_log(tmp_path: Path) -> None:
    app = open_page("audit", data="cartpole", support="0.01", confidence="0.9")
    app.file_uploader(key="log_file").set_value(table(tmp_path)).run()
    app.toggle(key="log_map_columns").set_value(True).run()
    app.multiselect(key="log_map_observations").set_value(list("abcd")).run()
    app.multiselect(key="log_map_actions").set_value(["what"]).run()
    app.selectbox(key="log_map_episode").set_value("run").run()
    app.button(key="log_map_read").click().run()
    assert "the log has no cart position, cart velocity, pole angle" in errors(app)[0]
    assert "say which column is which in the form for the columns" in errors(app)[0]
    app.toggle(key="log_map_columns").set_value(False).run()
    features = load_demonstrations(DATA / "cartpole.parquet").feature_names
    field = {name: f"log_map_feature called {name}" for name in features}
    for name, column in zip(features, "aacd", strict=True):
        app.selectbox(key=field[name]).set_value(column).run()
    assert app.selectbox(key=field[features[0]]).value is None  # a column is one feature
    assert app.selectbox(key=field[features[0]]).options == list("abcd")
    app.selectbox(key=field[features[0]]).set_value("a").run()
    app.selectbox(key=field[features[1]]).set_value("b").run()
    app.button(key="log_map_read").click().run()
    assert not errors(app)
    assert metrics(app)["Steps"]
    (mapped,) = (item for item in logs() if item.id == address(app)["log"])
    assert mapped.details["columns"] == {
        "a": "feature as cart position",
        "b": "feature as cart velocity",
        "c": "feature as pole angle",
        "d": "feature as pole angular velocity",
        "run": "episode",
        "what": "action:labels",
    }
    again = open_page("audit", **address(app))
    assert not errors(again)
    assert metrics(again) == metrics(app)
    again.toggle(key="log_map_columns").set_value(True).run()
    assert again.selectbox(key=field[features[0]]).value == "a"
    again.button(key="log_map_read").click().run()
    assert metrics(again) == metrics(app)


def test_another_log_with_the_columns_of_the_first_is_kept_as_they_were_read(
    tmp_path: Path,
) -> None:
    log = load_demonstrations(DATA / "cartpole.parquet").select(range(2))
    columns = dict(zip(log.feature_names, log.observations.T, strict=True))
    frame = pd.DataFrame({"run": log.episodes, **columns, "cmd": log.actions})
    app = open_page("audit", data="cartpole", support="0.01", confidence="0.9")
    for number, key in enumerate(("log", "other_log")):
        path = tmp_path / f"{key}.csv"
        frame.iloc[number:].to_csv(path, index=False)
        app.file_uploader(key=f"{key}_file").set_value(upload(path)).run()
        if key == "log":
            assert errors(app)  # which column is the action, a person has to say
            app.button(key="log_map_read").click().run()
    assert not errors(app)
    link, before = address(app), texts(app)
    assert sorted(item.name for item in logs()) == ["log.csv", "other_log.csv"]
    again = open_page("audit", **link)
    assert not errors(again)
    assert metrics(again) == metrics(app)
    assert "Whether the two logs differ" in before
    assert "Whether the two logs differ" in texts(again)
    app.button(key="keep_audit").click().run()
    with Library() as library:
        (kept,) = library.items("Ada", kind="result")
    assert {item.id for item in logs()} <= set(kept.came_from)


@pytest.mark.parametrize(
    ("named", "sentence"),
    [
        ("nonsense", "no log called 'nonsense'"),
        ("a" * 26, "has nothing with the id"),
        ("demonstrations", "as a log, 'cartpole.parquet', is something else"),
        ("removed", "was removed by Ada"),
        ("missing file", "is missing from the library"),
    ],
)
def test_a_log_that_is_not_here_is_said_with_what_to_do(
    place: Path, named: str, sentence: str
) -> None:
    app = open_page("audit", data="cartpole")
    app.file_uploader(key="log_file").set_value(upload(DATA / "cartpole.parquet")).run()
    (item,) = logs()
    if named == "demonstrations":
        own = open_page("demonstrations", data="upload")
        own.file_uploader(key="upload_files").set_value([upload(DATA / "cartpole.parquet")]).run()
        named = address(own)["data"]
    elif named == "removed":
        with Library() as library:
            library.remove(item.id, author="Ada")
        named = item.id
    elif named == "missing file":
        with Library() as library:
            library.path(item).unlink()
        named = item.id
    app = open_page("audit", data="cartpole", log=named)
    (said,) = errors(app)
    assert sentence in said
    assert not metrics(app)
    app.button(key="go_on_without_log").click().run()
    assert not errors(app)
    assert "Upload a log" in texts(app)
    assert "log" not in address(app)


def test_a_log_stands_in_the_library_and_leads_to_the_audit() -> None:
    app = open_page("audit", data="cartpole")
    app.file_uploader(key="log_file").set_value(upload(DATA / "cartpole.parquet")).run()
    (item,) = logs()
    page = open_page("library", item=item.id)
    assert not errors(page)
    (link,) = (one for one in page.get("page_link") if one.proto.page == "audit")
    assert link.proto.query_string == f"log={item.id}"


def test_what_cannot_be_read_is_not_kept() -> None:
    app = open_page("audit", data="cartpole")
    app.file_uploader(key="log_file").set_value(("log.csv", b"nothing", "text/csv")).run()
    assert len(errors(app)) == 1
    assert logs() == []
    assert "log" not in address(app)


def test_actions_of_other_names_are_named_in_the_form(tmp_path: Path) -> None:
    log = load_demonstrations(DATA / "lunar_lander_continuous.parquet").select(range(2))
    columns = dict(zip(log.feature_names, log.observations.T, strict=True))
    first, second = (dimension.name for dimension in log.action_dimensions)
    done = {"action_u": log.actions[:, 0], "action_w": log.actions[:, 1]}
    path = tmp_path / "lab.csv"
    pd.DataFrame({"run": log.episodes, **columns, **done}).to_csv(path, index=False)
    app = open_page("audit", data="lunar_lander_continuous")
    app.file_uploader(key="log_file").set_value(upload(path)).run()
    assert f"the log has no {first}, {second}" in errors(app)[0]
    field = app.selectbox(key=f"log_map_action called {first}")
    assert field.options == ["action_u", "action_w"]
    field.set_value("action_u").run()
    app.selectbox(key=f"log_map_action called {second}").set_value("action_w").run()
    app.button(key="log_map_read").click().run()
    assert not errors(app)
    again = open_page("audit", **address(app))
    assert not errors(again)
    assert metrics(again) == metrics(app)
