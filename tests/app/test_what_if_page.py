"""What if: one state, and what the shield would do in it."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from xml.etree import ElementTree

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, Shield, load_demonstrations, mine_rules
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import rules_to_json
from tests.app.screens import ROUTER, html, open_page, run_through, texts, upload_rules

DATA = ROUTER.parents[1] / "data"
COVERED, UNCOVERED = "a random covered state", "a random uncovered state"


def the_state(app: AppTest, features: int) -> np.ndarray:
    sliders = {slider.key: slider.value for slider in app.slider}
    return np.array([sliders[f"x{index}"] for index in range(features)], dtype=np.float32)


def table(app: AppTest, column: str) -> list[str]:
    """A column of the table that has it."""
    for found in re.findall(r"<table>.*?</table>", html(app), re.DOTALL):
        rows = [
            ["".join(cell.itertext()) for cell in row]
            for row in ElementTree.fromstring(found).iter("tr")
        ]
        if column in rows[0]:
            return [row[rows[0].index(column)] for row in rows[1:]]
    raise AssertionError(f"no table has a column {column}")


def said(app: AppTest) -> str:
    """What is written in HTML, without its tags."""
    return unescape(re.sub(r"<[^>]*>", "", html(app)))


def test_a_state_a_rule_and_what_would_change_the_decision() -> None:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)
    app = open_page("what_if", data="lunar_lander", support="0", confidence="1", number="7")
    middle = np.median(demonstrations.observations, axis=0).astype(np.float32)
    assert the_state(app, 8).tolist() == middle.tolist()

    app.selectbox(key="take").set_value(COVERED).run()
    state = the_state(app, 8)
    assert (state == demonstrations.observations).all(axis=1).any()
    shield = Shield(rules)
    for wanted, action in (("do nothing", 0), ("fire main engine", 2)):
        app.selectbox(key="a0").set_value(wanted).run()
        decision = shield.decide(state, action)
        rule = rules.rules[decision.rules[0]]
        assert f"{rules.name_of(rule)}. {sentence(rule, rules)}" in said(app)
        assert ("Changed by the rules" in said(app)) == decision.intervened
        assert len(table(app, "The state has")) == len(rule.bounds)

    # The first row says the least change: beyond it another action is executed, before it not.
    app.button(key="another").click().run()
    assert app.number_input(key="number").value == 8
    state = the_state(app, 8)
    now = shield.decide(state, 2).executed
    exact = np.float32(table(app, "From exactly")[0].split()[0])
    words = table(app, "If")[0]
    names = [feature.name for feature in demonstrations.features]
    feature = max((name for name in names if name in words), key=len)
    moved = state.copy()
    moved[names.index(feature)] = exact
    assert shield.decide(moved, 2).executed != now
    moved[names.index(feature)] = np.nextafter(exact, state[names.index(feature)])
    assert shield.decide(moved, 2).executed == now

    # What a link says is what is shown.
    app.slider(key="x0").set_value(0.25).run()
    assert the_state(app, 8)[0] == np.float32(0.25)


def test_many_features_and_dimensions_stay_usable() -> None:
    app = open_page("what_if", data="bipedal_walker", take=COVERED, number="1")
    app.button(key="take_it").click().run()
    assert len([slider for slider in app.slider if slider.key.startswith("x")]) == 24
    assert [expander.label for expander in app.expander] == ["16 more features"]
    assert len([slider for slider in app.slider if slider.key.startswith("a")]) == 4
    app.selectbox(key="dimension").select_index(2).run()
    assert not app.exception
    assert html(app).count('<div class="row" role="img"') == 24
    assert html(app).count('aria-label="The tree around the rule: ') == 1


@pytest.mark.parametrize("take", [UNCOVERED, "a step of the replay"])
def test_a_state_that_cannot_be_had_is_said_and_nothing_is_lost(take: str) -> None:
    app = open_page("what_if", data="cartpole", set="compact", x1="0.5")
    before = the_state(app, 4).tolist()
    assert before[1] == 0.5
    app.selectbox(key="take").set_value(take).run()
    reasons = {
        UNCOVERED: "these rules cover every state",
        "a step of the replay": "Run one on the Replay page",
    }
    assert reasons[take] in texts(app)
    assert the_state(app, 4).tolist() == before
    app.selectbox(key="outside").set_value("abstain").run()
    keeps = any(rule.box for rule in RuleSet.load(DATA / "rules" / "cartpole_compact.json").rules)
    assert ("keeps no data boxes" in texts(app)) == (not keeps)


def test_without_rules_or_data_the_page_says_what_to_do() -> None:
    assert "No rule is in force" in texts(
        open_page("what_if", data="cartpole", support="0.9", confidence="1")
    )
    assert "Nothing has been uploaded" in texts(open_page("what_if", data="upload"))


def test_a_step_of_the_replay_is_taken_and_outside_its_data_it_says_so() -> None:
    app = open_page(
        "replay", data="cartpole", agent="novice", rules="unfiltered", outside="abstain"
    )
    run_through(app, "replay")
    assert "a rule was broken outside the data" in texts(app)
    order = app.session_state["_replay"]
    assert order.shield.outside == "abstain"
    app.switch_page("what_if.py").run()
    app.selectbox(key="take").set_value("a step of the replay").run()
    app.number_input(key="number").set_value(3).run()
    assert app.selectbox(key="outside").value == "abstain"
    assert not app.info


def test_edited_rules_of_a_file_are_followed_in_a_table_and_light_no_foreign_path() -> None:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    mined = mine_rules(demonstrations, supp_min=0.005, conf_min=0.95)
    named = [replace(rule, id=f"kept {at}") for at, rule in enumerate(mined.rules)]
    content = rules_to_json(replace(mined, rules=tuple(named))).encode()
    app = open_page("edit", data="cartpole")
    upload_rules(app, "mine.json", content)
    app.button(key="edit_pin").click().run()
    app.switch_page("what_if.py").run()
    app.selectbox(key="take").set_value(COVERED).run()
    assert not app.exception, app.exception
    assert "Its way through the rules" in said(app)
    (table_shown,) = [
        part.proto.body for part in app.get("html") if 'class="sarl-lit"' in part.proto.body
    ]
    assert re.search(r">R\d+: ", table_shown)
    # In another environment they say nothing, and no others take their place.
    app.query_params["data"] = "lunar_lander"
    app.run()
    assert not app.exception, app.exception
    assert "speak of other features or actions" in texts(app)
    assert "Its way through" not in html(app)


def test_compact_rules_abstain_where_the_shield_does() -> None:
    shipped = RuleSet.load(DATA / "rules" / "cartpole_compact.json")
    assert all(rule.box is not None for rule in shipped.rules)
    app = open_page(
        "what_if", data="cartpole", set="compact", outside="abstain", take=COVERED, number="1"
    )
    demonstrations = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    low, high = demonstrations.observations.min(axis=0), demonstrations.observations.max(axis=0)
    shield, acting = Shield(shipped, outside="abstain"), Shield(shipped)
    rng = np.random.default_rng(0)
    states = rng.uniform(low, high, (400, 4))
    found = next(
        row
        for row in states.astype(np.float32)
        if shield.decide(row, 0).outside and acting.decide(row, 0).intervened
    )
    for index, value in enumerate(found.tolist()):
        app.slider(key=f"x{index}").set_value(value)
    app.run()
    state = the_state(app, 4)
    decision = shield.decide(state, 0)
    assert decision.outside
    assert not decision.intervened
    assert "keeps no data boxes" not in texts(app)
    words = said(app)
    assert "Outside this rule's data" in words
    assert "is executed, as the agent wants" in words


def test_a_name_with_signs_of_markdown_is_read_aloud_as_it_is() -> None:
    def page() -> None:
        from sarl_core.shielding.sampling import Span
        from sarl_dashboard.views.what_if.slider import span_slider

        for name in ("speed (m/s)", "own_speed*2"):
            span_slider(name, Span(0.0, 1.0, 2.0), name)

    app = AppTest.from_function(page).run()
    assert [slider.label for slider in app.slider] == ["speed (m/s)", "own_speed*2"]
    assert [one.value for one in app.markdown] == [r":small[own\_speed\*2]"]
