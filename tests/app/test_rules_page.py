from __future__ import annotations

import json
import sys
from html import escape
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, PolicyTree, RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.html.rule_examples import examples_html
from sarl_core.explaining.html.tree import place_html
from sarl_core.mining.language import sentence
from sarl_core.mining.rules import Rule
from tests.app.screens import ROUTER, html, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def mined(data: str, support: float, confidence: float) -> RuleSet:
    return mine_rules(
        load_demonstrations(DATA / f"{data}.parquet"), supp_min=support, conf_min=confidence
    )


def test_all_rules_are_there_the_most_general_first() -> None:
    app = open_page("rules", data="cartpole", support="0", confidence="1")
    rules = mined("cartpole", 0.0, 1.0)
    table = app.dataframe[0].value
    assert len(table) == rules.rule_count
    assert table["States"].tolist() == sorted((r.samples for r in rules.rules), reverse=True)


@pytest.mark.parametrize("data", ["cartpole", "lunar_lander", "pendulum"])
def test_the_rule_of_a_link_is_explained(data: str) -> None:
    rules = mined(data, 0.005, 0.95)
    rule = rules.rules[-1]
    app = open_page("rules", data=data, rule=rule.id)
    assert f"<h2>{escape(sentence(rule, rules))}</h2>" in html(app)
    assert f"{rules.name_of(rule)} ·" in html(app)
    examples = min(10, rule.samples)
    assert html(app).count("<tr") == (1 + 1 + rule.length) + (1 + examples)
    assert "this is the rule" in html(app)
    assert html(app).count("<figure>") == len(rule.bounds)
    assert html(app).count('<i class="dot end"') == 1
    assert not app.get("plotly_chart")
    whole = open_page("rules", data=data, rule=rule.id, tree="Whole tree")
    (chart,) = whole.get("plotly_chart")
    lit = [t for t in json.loads(chart.proto.spec)["data"] if t.get("name") == "path"]
    assert len(lit[0]["marker"]["size"]) == rule.length + 1


def test_a_rule_that_is_not_in_force_gives_way_to_the_largest() -> None:
    app = open_page("rules", data="cartpole", rule="nonsense")
    rules = mined("cartpole", 0.005, 0.95)
    assert escape(sentence(max(rules.rules, key=lambda one: one.samples), rules)) in html(app)


def test_search_and_action_narrow_the_table() -> None:
    app = open_page("rules", data="cartpole", support="0", confidence="1")
    app.text_input(key="search").set_value("cart POSITION push left").run()
    found = app.dataframe[0].value
    assert 0 < len(found) < mined("cartpole", 0.0, 1.0).rule_count
    assert found["When"].str.contains("cart position").all()
    app.text_input(key="search").set_value("").run()
    app.selectbox(key="action").select("push right").run()
    assert {tuple(value) for value in app.dataframe[0].value["Action"]} == {("push right",)}
    app.text_input(key="search").set_value("no such thing").run()
    assert "No rule matches the search" in texts(app)


def test_the_table_fits_the_screen_the_name_and_the_action_first() -> None:
    table = open_page("rules", data="cartpole").dataframe[0]
    names = list(table.value)
    assert names[:3] == ["Rule", "Action", "When"]
    columns = json.loads(table.proto.columns)
    assert set(names) <= set(columns)
    widths = [columns[name]["width"] for name in names]
    assert sum(widths) <= 970  # of 1008 pixels; the boxes for choosing a row take the rest


def test_one_condition_is_no_conditions() -> None:
    words = html(open_page("rules", data="cartpole", support="0.05", confidence="0.7"))
    assert "1 condition on 1 feature" in words
    assert "1 conditions" not in words
    assert "quer" not in words


def test_the_tree_is_seen_around_the_rule_first_and_as_a_whole_when_asked_for() -> None:
    app = open_page("rules", data="cartpole")
    assert "The tree around the rule: " in html(app)
    assert "zoom" not in texts(app)
    app.button_group(key="tree").set_value("Whole tree").run()
    assert not app.exception
    assert "The tree around the rule: " not in html(app)
    assert len(app.get("plotly_chart")) == 1
    assert "to zoom" in texts(app)


def chosen_row(app: AppTest) -> list[int]:
    """The selected row, as the browser is told."""
    proto = app.dataframe[0].proto
    told = json.loads(proto.selection_state or proto.selection_default)
    return list(told["selection"]["rows"])


def test_buttons_go_from_rule_to_rule_in_the_order_of_the_table() -> None:
    rules = mined("cartpole", 0.005, 0.95)
    ordered = sorted(rules.rules, key=lambda one: -one.samples)
    app = open_page("rules", data="cartpole")
    assert app.button(key="previous").disabled
    for place in range(1, len(ordered)):
        app.button(key="next").click().run()
        assert escape(sentence(ordered[place], rules)) in html(app)
        assert app.query_params["rule"] == ordered[place].id
        assert chosen_row(app) == [place]
        assert not app.button(key="previous").disabled
    assert app.button(key="next").disabled
    for place in reversed(range(len(ordered) - 1)):
        app.button(key="previous").click().run()
        assert escape(sentence(ordered[place], rules)) in html(app)
        assert chosen_row(app) == [place]
    assert app.button(key="previous").disabled
    assert "rule" not in app.query_params


def test_what_the_buttons_lead_to_is_made_before_they_are_pressed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: dict[str, list[object]] = {"around": [], "examples": []}

    def place(tree: PolicyTree, cut: object, node: int, **rest: Any) -> str:
        made["around"].append(node)
        return place_html(tree, cut, node, **rest)  # type: ignore[arg-type]

    def examples(demonstrations: Demonstrations, tree: PolicyTree, rule: Rule) -> str:
        made["examples"].append(rule.id)
        return examples_html(demonstrations, tree, rule)

    open_page("rules", data="cartpole")  # the page's modules are there from now on
    monkeypatch.setattr(sys.modules["sarl_dashboard.components.tree_picture"], "place_html", place)
    monkeypatch.setattr(sys.modules["sarl_dashboard.views.rules.rule"], "examples_html", examples)
    sys.modules["sarl_dashboard.cache"].RESULTS.clear()
    rules = mined("cartpole", 0.005, 0.95)
    ordered = [rule.id for rule in sorted(rules.rules, key=lambda one: -one.samples)]
    app = open_page("rules", data="cartpole")
    assert made["examples"] == ordered[:2]
    for place_in_table in (1, 2):
        app.button(key="next").click().run()
        # It was there already, and now the one behind it is.
        assert made["examples"] == ordered[: place_in_table + 2]
    app.button(key="previous").click().run()
    assert made["examples"] == ordered[:4]
    assert len(made["around"]) == len(set(made["around"])) == 4


def test_buttons_and_the_selected_row_follow_the_search() -> None:
    rules = mined("cartpole", 0.005, 0.95)
    ordered = sorted(rules.rules, key=lambda one: -one.samples)
    right = [one for one in ordered if one.action == 1]
    app = open_page("rules", data="cartpole", rule=right[1].id)
    app.selectbox(key="action").select("push right").run()
    assert chosen_row(app) == [1]
    app.button(key="previous").click().run()
    assert escape(sentence(right[0], rules)) in html(app)
    assert app.button(key="previous").disabled
    app.selectbox(key="action").select("push left").run()
    # It stays, though the table has no row for it.
    assert escape(sentence(right[0], rules)) in html(app)
    assert chosen_row(app) == []
    assert app.button(key="previous").disabled
    app.button(key="next").click().run()
    assert escape(sentence(next(one for one in ordered if one.action == 0), rules)) in html(app)
    assert chosen_row(app) == [0]


def test_the_whole_set_can_be_taken_away() -> None:
    app = open_page("rules", data="cartpole")
    assert [button.proto.label for button in app.get("download_button")] == [
        "JSON",
        "CSV",
        "Text",
    ]


def test_no_rule_is_said_with_what_to_do() -> None:
    app = open_page("rules", data="cartpole", support="0.9", confidence="1")
    assert "so there is no rule" in texts(app)
    assert not app.dataframe


def test_the_rule_always_is_explained() -> None:
    app = open_page("rules", data="lunar_lander", support="0.5", confidence="0.2")
    assert "<h2>Always " in html(app)
    assert "This rule has no conditions" in texts(app)
    assert html(app).count("<figure>") == 0


def test_the_sidebar_says_what_is_in_force() -> None:
    app = open_page(
        "rules",
        data="pendulum",
        support="0.01",
        confidence="0.9",
        divider="4",
        lift="1.5",
        depth="7",
    )
    words = texts(app)
    for part in ("**0.01**", "**0.9**", "Divider **4**", "**1.5**", "Depth at most **7**"):
        assert part in words


def test_without_an_upload_the_page_says_what_to_do() -> None:
    assert "Nothing has been uploaded" in texts(open_page("rules", data="upload"))


def test_a_lower_bound_is_only_offered_where_rules_have_one() -> None:
    without = open_page("rules", data="cartpole")
    assert not without.number_input
    held_out = open_page("rules", data="cartpole", holdout="0.2")
    assert [one.label for one in held_out.number_input] == ["Lower bound at least"]
