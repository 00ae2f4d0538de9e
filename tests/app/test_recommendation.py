"""The thresholds that the page Thresholds recommends."""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, load_demonstrations
from sarl_core.explaining.words.cross_fit import no_recommendation_text, recommendation_sentences
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import CrossFit, cross_fit
from sarl_core.mining.validation.recommendation import Recommendation, recommended
from tests.app.screens import ROUTER, metrics, open_page, texts
from tests.app.test_elsewhere import CART, until
from tests.app.test_thresholds_page import expected, specs

pytestmark = pytest.mark.usefixtures("elsewhere")


@cache
def grown() -> tuple[tuple[PolicyTree, ...], CrossFit]:
    """The trees of the page, and those without each fold."""
    data = load_demonstrations(CART)
    return grow_policy_trees(data), cross_fit(data)


def best(**limits: float) -> Recommendation:
    found = recommended(*grown(), **limits)
    assert found is not None
    return found


def keys(app: AppTest) -> list[str]:
    return [button.key for button in app.button]


def test_it_says_what_it_would_take_and_takes_it() -> None:
    app = open_page("thresholds", data="cartpole")
    until(app, "mined without it, they are right in")
    found = best()
    assert recommendation_sentences(found) in texts(app)
    app.button(key="use_recommended").click().run()
    assert not app.exception
    at = found.thresholds
    assert app.select_slider(key="support").value == at.support
    assert app.select_slider(key="confidence").value == at.confidence
    assert metrics(app) == expected("cartpole", at.support, at.confidence)
    assert metrics(app)["Rules"] == str(found.rules)
    assert app.button(key="use_recommended").disabled
    assert app.button(key="use_recommended").label == "In force"
    app.button(key="filtered").click().run()
    assert not app.button(key="use_recommended").disabled


def test_lift_and_depth_are_limits_of_it_too() -> None:
    app = open_page("thresholds", data="cartpole", depth="3")
    until(app, "mined without it, they are right in")
    found = best(max_depth=3)
    assert recommendation_sentences(found) in texts(app)
    app.button(key="use_recommended").click().run()
    assert metrics(app)["Rules"] == str(found.rules)


def test_it_is_marked_among_the_trade_offs() -> None:
    app = open_page("thresholds", data="cartpole", details="Best trade-offs")
    until(app, "mined without it, they are right in")
    assert "the diamond the one recommended above" in texts(app)
    traces = {trace.get("name"): trace for trace in specs(app)[-1]["data"]}
    assert traces["recommended"]["x"] == [best().rules]


def test_compact_rules_in_force_need_no_thresholds() -> None:
    app = open_page("thresholds", data="cartpole")
    until(app, "mined without it, they are right in")
    app.button(key="compact").click().run()
    assert "use_recommended" not in keys(app)


@pytest.mark.parametrize("episodes", [4, 1])
def test_too_few_episodes_are_said_and_offer_no_button(episodes: int) -> None:
    rng = np.random.default_rng(0)
    few = Demonstrations(
        rng.normal(size=(600, 2)).astype(np.float32),
        rng.integers(0, 2, 600),
        np.arange(600) * episodes // 600,
    )
    open_page("thresholds", data="cartpole")
    cache = sys.modules["sarl_dashboard.cache"]
    visit = cache.Visit()
    cache._VISITS.add(visit)
    visit.bring(few.digest)
    app = AppTest.from_file(ROUTER, default_timeout=120)
    app.session_state["_upload"] = few
    app.query_params["data"] = "upload"
    app.query_params["support"] = "0"
    app.run()
    app.switch_page("thresholds.py").run()
    until(app, no_recommendation_text(episodes))
    assert "use_recommended" not in keys(app)
    cache._end(visit)
