"""Pages that play episodes, with demonstrations that there is nothing to play in for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations
from sarl_core.demonstrations.formats import save_demonstrations
from tests.app.screens import errors, open_page, page_file, texts

NAMELESS = "These demonstrations name no environment, so "
FORM = {
    "replay": ("selectbox", "agent"),
    "shield": ("number_input", "episodes"),
    "ablation": ("selectbox", "rules"),
    "improve": ("selectbox", "expert"),
}


def nameless() -> Demonstrations:
    """What Cart Pole might be for somebody who has no simulator of it."""
    states = np.random.default_rng(0).normal(size=(200, 4)).astype(np.float32)
    actions = (states[:, 0] > 0).astype(np.int64)
    return Demonstrations(states, actions, np.repeat(np.arange(5), 40))


def uploaded(demonstrations: Demonstrations, folder: Path) -> AppTest:
    path = folder / "own.parquet"
    save_demonstrations(demonstrations, path)
    app = open_page("demonstrations", data="upload")
    app.file_uploader(key="upload_files").set_value([(path.name, path.read_bytes(), "")]).run()
    assert not errors(app)
    return app


def has(app: AppTest, widget: tuple[str, str]) -> bool:
    kind, key = widget
    return key in [one.key for one in getattr(app, kind)]


@pytest.mark.parametrize("page", FORM)
def test_without_an_environment_that_is_said_and_asked_for_before_any_form(
    page: str, tmp_path: Path
) -> None:
    app = uploaded(nameless(), tmp_path).switch_page(page_file(page)).run()
    assert not app.exception
    assert not errors(app)
    assert [info.value.startswith(NAMELESS) for info in app.info] == [True]
    assert [box.key for box in app.main.selectbox] == ["env"]
    assert not app.main.number_input
    assert [link.proto.label for link in app.get("page_link")] == ["Go to Audit"]
    app.selectbox(key="env").set_value("CartPole-v1").run()
    assert not app.exception
    assert NAMELESS not in texts(app)
    assert app.selectbox(key="env").value == "CartPole-v1"
    assert has(app, FORM[page])


def test_agents_learn_only_where_there_is_an_environment(tmp_path: Path) -> None:
    app = uploaded(nameless(), tmp_path)
    app.query_params["learn_view"] = "Your own"
    app.switch_page(page_file("learning")).run()
    assert [info.value.startswith(NAMELESS) for info in app.info] == [True]
    assert not app.main.number_input
    assert [link.proto.label for link in app.get("page_link")] == ["Go to Demonstrations"]


def test_an_environment_that_is_not_installed_is_named_with_the_reason(tmp_path: Path) -> None:
    elsewhere = replace(nameless(), env_id="Elsewhere-v3")
    app = uploaded(elsewhere, tmp_path).switch_page("shield.py").run()
    assert not errors(app)
    (info,) = app.info
    assert "Elsewhere-v3, is not to be had here, so nothing can be played" in info.value
    assert "Gymnasium knows no environment 'Elsewhere-v3'" in texts(app)
    assert not app.main.number_input


def test_an_environment_of_a_link_that_is_not_there_is_an_error_before_the_form() -> None:
    app = open_page("shield", data="cartpole", env="Nowhere-v9")
    (sentence,) = errors(app)
    assert "no environment 'Nowhere-v9'" in sentence
    assert not app.main.number_input
    app.selectbox(key="env").set_value("as demonstrated").run()
    assert not errors(app)
    assert has(app, FORM["shield"])


def test_with_an_environment_nothing_is_said() -> None:
    for page, widget in FORM.items():
        app = open_page(page, data="cartpole")
        assert "environment, so " not in texts(app)
        assert has(app, widget)


@pytest.mark.parametrize("page", FORM)
def test_without_demonstrations_one_is_sent_to_them(page: str) -> None:
    app = open_page(page, data="upload")
    assert not errors(app)
    assert "Nothing has been uploaded in this session" in texts(app)
    assert not app.main.number_input


def test_without_demonstrations_nobody_learns() -> None:
    app = open_page("learning", data="upload", learn_view="Your own")
    assert not errors(app)
    assert "Nothing has been uploaded in this session" in texts(app)


WORK = {  # the job's place, and choices that keep it at work for long
    "replay": ("replay", {"agent": "expert", "seed": "3"}),
    "shield": ("comparison", {"episodes": "2000"}),
    "ablation": ("ablation", {"episodes": "500"}),
    "improve": ("improve", {"rounds": "200", "round_episodes": "500"}),
}


@pytest.mark.parametrize("page", WORK)
def test_what_is_at_work_can_be_called_off_whatever_data_are_chosen_since(
    page: str, tmp_path: Path
) -> None:
    place, choices = WORK[page]
    app = uploaded(nameless(), tmp_path)
    mine = app.selectbox(key="_data_choice").value
    app.selectbox(key="_data_choice").set_value("lunar_lander").run()
    for name, value in choices.items():
        app.query_params[name] = value
    app.switch_page(page_file(page)).run()
    if f"cancel_{place}" not in [button.key for button in app.button]:
        app.button(key=f"run_{place}").click().run()
    app.selectbox(key="_data_choice").set_value(mine).run()
    assert NAMELESS in texts(app)
    app.button(key=f"cancel_{place}").click().run()
    assert not app.exception
    assert f"cancel_{place}" not in [button.key for button in app.button]


def test_what_is_at_work_can_be_called_off_where_nothing_is_chosen_any_more() -> None:
    app = open_page("shield", data="lunar_lander", episodes="2000")
    app.button(key="run_comparison").click().run()
    app.button_group(key="agents").set_value([]).run()
    assert "Choose at least one agent" in texts(app)
    app.button(key="cancel_comparison").click().run()
    assert "cancel_comparison" not in [button.key for button in app.button]
