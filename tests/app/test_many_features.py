"""What if with hundreds of features: a bounded number of sliders, and a way to all the others."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, Shield, mine_rules
from sarl_core.demonstrations.formats import save_demonstrations
from sarl_dashboard.views.what_if.features import FIRST, MANY, PAGE_SLIDERS
from tests.app.screens import errors, html, open_page

FEATURES = 60


@pytest.fixture(scope="module")
def demonstrations() -> Demonstrations:
    states = np.random.default_rng(0).normal(size=(400, FEATURES)).astype(np.float32)
    return Demonstrations(
        states,
        (states[:, 40] + states[:, 41] > 0).astype(np.int64),
        np.repeat(np.arange(4), 100),
        feature_names=[f"sensor {place:02d}" for place in range(FEATURES)],
    )


@pytest.fixture
def app(demonstrations: Demonstrations, tmp_path: Path) -> AppTest:
    path = tmp_path / "wide.parquet"
    save_demonstrations(demonstrations, path)
    app = open_page("demonstrations", data="upload", support="0", confidence="1")
    app.get("file_uploader")[0].upload(path.name, path.read_bytes(), "application/octet-stream")
    app.run()
    app.switch_page("what_if.py").run()
    return app


def drawn(app: AppTest) -> list[int]:
    return [int(one.key[1:]) for one in app.slider if re.fullmatch(r"x\d+", one.key)]


def test_some_sliders_are_drawn_those_that_matter_first(
    app: AppTest, demonstrations: Demonstrations
) -> None:
    assert not errors(app)
    features = drawn(app)
    assert FIRST < len(features) <= MANY + PAGE_SLIDERS < FEATURES
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)
    middle = np.median(demonstrations.observations, axis=0).astype(np.float32)
    place = int(Shield(rules).rules_in_force(middle[None])[0, 0])
    assert {one.feature for one in rules[place].bounds} <= set(features)
    bars = html(app)
    assert all(f"sensor {at:02d}" in bars for at in features)


def test_the_others_are_searched_for_and_what_was_chosen_stays(app: AppTest) -> None:
    far = next(place for place in range(FEATURES - 1, 0, -1) if place not in drawn(app))
    app.text_input(key="what_if_search").set_value(f"{far}").run()
    assert far in drawn(app)
    slider = app.slider(key=f"x{far}")
    moved = slider.max * 0.5
    slider.set_value(moved).run()
    app.text_input(key="what_if_search").set_value("").run()
    assert far not in drawn(app)
    # It has no widget now, and counts all the same; the address says so.
    assert app.query_params["further"] in (f"{far}:{moved}", [f"{far}:{moved}"])
    app.text_input(key="what_if_search").set_value(f"{far}").run()
    assert app.slider(key=f"x{far}").value == moved
    assert "further" not in app.query_params


def test_every_page_is_turned_to(app: AppTest) -> None:
    reached = set(drawn(app))
    for page in range(2, -(-FEATURES // PAGE_SLIDERS) + 1):
        app.session_state["what_if_page"] = page
        app.run()
        reached |= set(drawn(app))
    assert reached == set(range(FEATURES))


def test_an_address_may_say_anything_of_other_features(app: AppTest) -> None:
    far = next(place for place in range(FEATURES - 1, 0, -1) if place not in drawn(app))
    app.query_params["further"] = f"{far}:nan~{far}:x~-1:2~999999:1~a:b~:~{'9' * 30}:1"
    app.run()
    assert not errors(app)
    assert not app.exception
