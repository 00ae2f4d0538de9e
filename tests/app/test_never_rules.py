"""Rules that forbid, as a rule file brings them, on the pages."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, RuleSet, Shield, load_demonstrations
from sarl_core.explaining.colours import chip_colour, label_colour
from sarl_core.mining.never.never_rules import mine_never_rules
from sarl_core.mining.rule_set import rules_to_json
from sarl_core.shipped import DATA
from tests.app.screens import (
    ROUTER,
    chosen_rules,
    errors,
    html,
    metrics,
    open_page,
    page_file,
    run_through,
    texts,
    upload_rules,
)

PROBED = DATA / "rules" / "lunar_lander_never.json"


@pytest.fixture(scope="module")
def mined() -> RuleSet:
    lander = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    return mine_never_rules(lander, epsilon=0.05, supp_min=0.005)


def opened(page: str, rules: RuleSet | bytes, **query: str) -> AppTest:
    """A page in another visit, by the address that an upload leaves."""
    content = rules_to_json(rules).encode() if isinstance(rules, RuleSet) else rules
    before = open_page("library", data="lunar_lander")
    upload_rules(before, "never.json", content)
    assert not errors(before)
    app = AppTest.from_file(ROUTER, default_timeout=120)
    for name, value in {"data": "lunar_lander", "set": chosen_rules(before), **query}.items():
        app.query_params[name] = value
    app.run()
    app.switch_page(page_file(page)).run()
    assert not app.exception, app.exception
    return app


def test_a_link_opens_the_rules_with_the_way_through_the_tree(mined: RuleSet) -> None:
    app = opened("rules", mined)
    table = app.dataframe[0].value
    assert len(table) == len(mined)
    assert {action for (action,) in table["Action"]} == {
        f"never {name}" for name in mined.actions[0].label_names
    }
    chips = json.loads(app.dataframe[0].proto.columns)["Action"]["type_config"]["options"]
    colours = {chip["value"]: chip["color"] for chip in chips}
    assert colours["never fire left engine"] == chip_colour(label_colour(1))
    assert "then never do nothing: the expert did not in 97.5 % of 9,682 states" in html(app)
    assert "From the root to the rule" in html(app)
    app.selectbox(key="action").set_value("never fire main engine").run()
    kept = [rule for rule in mined if rule.forbids == (2,)]
    assert len(app.dataframe[0].value) == len(kept) < len(mined)


def test_rules_from_probes_say_what_the_expert_did_not_mend() -> None:
    app = opened("rules", PROBED.read_bytes())
    assert "after it the expert failed in 83 % of 430 states" in html(app)
    assert "Not of the trees that the chosen demonstrations grow" in texts(app)


def test_what_if_says_what_is_forbidden_and_what_is_left(mined: RuleSet) -> None:
    app = opened("what_if", mined)
    assert "Forbidden here: do nothing (R1). Left: fire left engine, fire main engine" in html(app)
    assert "Freedom 79 %." in html(app)


def test_a_replay_says_at_each_step_what_is_left(mined: RuleSet) -> None:
    app = run_through(opened("replay", mined, step="3"), "replay")
    assert "Forbidden here: " in html(app)
    assert 0 < int(metrics(app)["Freedom"].split()[0]) < 100


def test_comparing_them_with_rules_that_demand(mined: RuleSet) -> None:
    app = opened("difference", mined)
    assert not errors(app)
    assert "as on Thresholds" in texts(app)
    assert "never do nothing" in html(app)
    examples = next(one.value for one in app.dataframe if "Expert did" in one.value)
    assert examples.iloc[:, 2].str.startswith("never ").any()


def test_the_report_is_offered_for_rules_that_forbid(mined: RuleSet) -> None:
    app = opened("report", mined)
    assert not errors(app)
    assert [one.label for one in app.button if "report" in one.label.lower()]


def test_what_each_rule_is_worth_is_found_out(mined: RuleSet) -> None:
    app = opened("ablation", mined, ablation_episodes="2", most_rules="2")
    run_through(app, "ablation")
    table = next(one.value for one in app.dataframe if "Return without it" in one.value)
    assert all(action.startswith("never ") for (action,) in table["Action"])


def test_a_rule_of_a_file_is_switched_off(mined: RuleSet) -> None:
    app = opened("edit", mined)
    assert not errors(app)
    assert "Rules that forbid add up" in texts(app)
    before = metrics(app)["Freedom"]
    app.button(key="edit_switch").click().run()
    assert metrics(app)["Rules in force"] == str(len(mined) - 1)
    assert metrics(app)["Freedom"] != before


@pytest.mark.parametrize("page", ["episodes", "audit", "shield", "export", "library", "evidence"])
def test_the_other_pages_take_them(mined: RuleSet, page: str) -> None:
    assert not errors(opened(page, mined))


def test_the_states_of_an_episode_are_as_the_shield_has_them(mined: RuleSet) -> None:
    lander = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    first = lander.select([0])
    rules = Shield(mined).decide_batch(first.raw_observations, first.actions).rules
    covered = np.mean(rules >= 0)
    assert covered == 1.0
    assert "Some rule applies in 100 % of them" in texts(opened("episodes", mined))


def what_a_rule_says() -> None:
    """The part of the form on Edit that asks for it."""
    import streamlit as st

    from sarl_dashboard.views.edit import form

    form._says(form.Draft(), st.session_state["rules"])


@pytest.mark.parametrize("says", [(0, 2), 2])
def test_what_the_form_says_goes_with_the_action_that_knows_it(
    says: int | tuple[int, ...],
) -> None:
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (400, 1)).astype(np.float32)
    actions = np.stack([rng.integers(0, 3, 400), (states[:, 0] > 0).astype(int)], axis=1)
    rules = mine_never_rules(Demonstrations(states, actions, np.zeros(400)), epsilon=0.1)
    several = replace(
        rules.rules[0], id="manual.1", dimension=0, forbids=(0, 2), instead=(1,), action=1
    )
    app = AppTest.from_function(what_a_rule_says)
    app.session_state["rules"] = replace(rules, rules=(several, *rules.rules))
    app.session_state["draft0_action"] = says
    assert app.run().selectbox(key="draft0_action").value == says
    for dimension in (1, 0):  # the other has two labels, and no rule that forbids both
        app.selectbox(key="draft0_dimension").set_value(dimension).run()
        assert not app.exception, app.exception
        assert app.selectbox(key="draft0_action").value is None
