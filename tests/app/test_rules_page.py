from __future__ import annotations

import json

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.language import sentence
from tests.app.screens import ROUTER, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def mined(data: str, support: float, confidence: float) -> RuleSet:
    return mine_rules(
        load_demonstrations(DATA / f"{data}.parquet"), supp_min=support, conf_min=confidence
    )


def html(app: AppTest) -> str:
    return "\n".join(part.proto.body for part in app.get("html"))


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
    assert sentence(rule, rules) in texts(app)
    assert f"Rule {rule.id} ·" in texts(app)
    assert html(app).count("<tr") == 1 + 1 + rule.length
    assert "this is the rule" in html(app)
    charts = app.get("plotly_chart")
    assert len(charts) == 1 + rule.merged_length
    lit = [t for t in json.loads(charts[0].proto.spec)["data"] if t.get("name") == "path"]
    assert len(lit[0]["marker"]["size"]) == rule.length + 1
    examples = app.dataframe[1].value
    assert len(examples) == min(10, rule.samples)


def test_a_rule_that_is_not_in_force_gives_way_to_the_largest() -> None:
    app = open_page("rules", data="cartpole", rule="nonsense")
    rules = mined("cartpole", 0.005, 0.95)
    assert sentence(max(rules.rules, key=lambda one: one.samples), rules) in texts(app)


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


def test_the_table_fits_the_screen_the_action_first() -> None:
    table = open_page("rules", data="cartpole").dataframe[0]
    names = list(table.value)
    assert names[:2] == ["Action", "When"]
    columns = json.loads(table.proto.columns)
    assert set(names) <= set(columns)
    widths = [columns[name]["width"] for name in names]
    assert sum(widths) <= 970  # of 1008 pixels; the boxes for choosing a row take the rest


def test_one_condition_is_no_conditions() -> None:
    words = texts(open_page("rules", data="cartpole", support="0.05", confidence="0.7"))
    assert "1 condition on 1 feature" in words
    assert "1 conditions" not in words
    assert "quer" not in words


def test_the_tree_can_be_seen_around_the_rule() -> None:
    app = open_page("rules", data="cartpole")
    whole = json.loads(app.get("plotly_chart")[0].proto.spec)
    app.button_group(key="tree").set_value("Around this rule").run()
    around = json.loads(app.get("plotly_chart")[0].proto.spec)
    assert not whole["layout"].get("annotations")
    assert around["layout"]["annotations"]


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
    assert "Always " in texts(app)
    assert "This rule has no conditions" in texts(app)
    assert len(app.get("plotly_chart")) == 1


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
