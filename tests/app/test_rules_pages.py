"""The page Rules with more rules than a browser is sent at once."""

from __future__ import annotations

import json

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.mining.action_words import action_text
from sarl_core.mining.language import conditions_text
from sarl_core.mining.rules import Rule
from sarl_core.shipped import DATA
from tests.app.screens import open_page, texts

ROWS = 400
UNFILTERED = {"data": "cartpole", "support": "0", "confidence": "1"}


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    return mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)


@pytest.fixture(scope="module")
def ordered(rules: RuleSet) -> list[Rule]:
    """As the table has them first."""
    return sorted(rules, key=lambda rule: -rule.samples)


@pytest.fixture(autouse=True)
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    open_page("rules", data="cartpole")  # finds the modules of the page
    monkeypatch.setattr("sarl_dashboard.views.rules.table.PAGE_ROWS", ROWS)


def names(app: AppTest) -> list[str]:
    return list(app.dataframe[0].value["Rule"])


def chosen_row(app: AppTest) -> list[int]:
    proto = app.dataframe[0].proto
    told = json.loads(proto.selection_state or proto.selection_default)
    return list(told["selection"]["rows"])


def page(app: AppTest) -> int:
    return int(app.session_state["rules_page"])


def turn(app: AppTest, number: int) -> AppTest:
    app.session_state["rules_page"] = number
    return app.run()


def test_a_page_of_the_rules_is_sent_and_the_others_can_be_turned_to(
    rules: RuleSet, ordered: list[Rule]
) -> None:
    app = open_page("rules", **UNFILTERED)
    assert len(rules) > 3 * ROWS
    assert names(app) == [rules.name_of(rule) for rule in ordered[:ROWS]]
    assert f"Rows 1 to {ROWS}." in texts(app)
    turn(app, 2)
    assert names(app) == [rules.name_of(rule) for rule in ordered[ROWS : 2 * ROWS]]
    # The rule that was looked at stays, though the page has no row for it.
    assert chosen_row(app) == []
    assert f"of {len(rules):,} rules" not in texts(app)
    turn(app, 4)
    assert names(app) == [rules.name_of(rule) for rule in ordered[3 * ROWS :]]


def test_a_link_opens_the_page_of_its_rule_or_the_one_it_names(
    rules: RuleSet, ordered: list[Rule]
) -> None:
    rule = ordered[2 * ROWS + 7]
    app = open_page("rules", rule=rule.id, **UNFILTERED)
    assert page(app) == 3
    assert chosen_row(app) == [7]
    app = open_page("rules", rule=rule.id, rules_page="2", **UNFILTERED)
    assert names(app)[0] == rules.name_of(ordered[ROWS])
    assert chosen_row(app) == []
    for junk in ("999", "0", "many"):
        app = open_page("rules", rules_page=junk, **UNFILTERED)
        assert names(app)[0] == rules.name_of(ordered[0])


def test_the_next_rule_turns_the_page_where_it_stands_on_another(ordered: list[Rule]) -> None:
    app = open_page("rules", rule=ordered[ROWS - 1].id, **UNFILTERED)
    assert (page(app), chosen_row(app)) == (1, [ROWS - 1])
    app.button(key="next").click().run()
    assert app.query_params["rule"] == ordered[ROWS].id
    assert (page(app), chosen_row(app)) == (2, [0])
    app.button(key="previous").click().run()
    assert (page(app), chosen_row(app)) == (1, [ROWS - 1])


def test_another_search_begins_with_its_first_page(rules: RuleSet, ordered: list[Rule]) -> None:
    app = turn(open_page("rules", **UNFILTERED), 3)
    app.selectbox(key="action").select("push right").run()
    right = [rule for rule in ordered if rule.action == 1]
    assert names(app) == [rules.name_of(rule) for rule in right[:ROWS]]
    app.text_input(key="search").set_value("PUSH pole 0.12").run()
    found = [
        rule
        for rule in right
        if all(
            word in f"{conditions_text(rule, rules)} {action_text(1, rules.actions[0])}"
            for word in ("push", "pole", "0.12")
        )
    ]
    assert 0 < len(found) < len(right)
    assert names(app) == [rules.name_of(rule) for rule in found[:ROWS]]
    assert f"{len(found):,} of {len(rules):,} rules match." in texts(app)
    app.text_input(key="search").set_value(rules.name_of(right[0]).lower()).run()
    assert rules.name_of(right[0]) in names(app)
    assert "order" not in [box.key for box in app.selectbox]


@pytest.mark.parametrize(
    ("order", "measure"),
    [
        ("shortest first", lambda rule: rule.length),
        ("longest first", lambda rule: -rule.length),
    ],
)
def test_all_pages_are_in_the_order_that_is_chosen(
    rules: RuleSet, ordered: list[Rule], order: str, measure: object
) -> None:
    app = turn(open_page("rules", **UNFILTERED), 3)
    app.selectbox(key="order").select(order).run()
    wanted = [rules.name_of(rule) for rule in sorted(ordered, key=measure)]
    assert names(app) == wanted[:ROWS]
    assert names(turn(app, 2)) == wanted[ROWS : 2 * ROWS]


def test_an_order_comes_with_a_link(rules: RuleSet, ordered: list[Rule]) -> None:
    app = open_page("rules", order="longest first", **UNFILTERED)
    assert names(app)[0] == rules.name_of(max(ordered, key=lambda rule: rule.length))


def test_few_rules_have_one_page_and_no_order() -> None:
    app = open_page("rules", data="cartpole")
    assert "rules_page" not in app.session_state
    assert "order" not in [box.key for box in app.selectbox]
    assert "The most support first." in texts(app)
