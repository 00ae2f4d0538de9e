"""The rules as dots, in the place of the table."""

from __future__ import annotations

import json
import sys
from html import escape
from types import SimpleNamespace
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core.mining.language import sentence
from tests.app.screens import html, open_page, texts
from tests.app.test_rules_page import mined

PLOT = {"show": "Scatter plot", "data": "cartpole"}
MANY = {"support": "0.001", "confidence": "0.9"}


def figure(app: AppTest) -> dict[str, Any]:
    (chart,) = [one for one in app.get("plotly_chart") if "rule_scatter" in one.proto.id]
    spec: dict[str, Any] = json.loads(chart.proto.spec)
    return spec


def dots(app: AppTest) -> list[str]:
    """Ids of the first rules of all dots."""
    return list(dict.fromkeys(row[0] for row in figure(app)["data"][0]["customdata"]))


def test_the_table_comes_first_and_the_plot_takes_its_place() -> None:
    app = open_page("rules", data="cartpole", **MANY)
    assert len(app.dataframe) == 1
    app.button_group(key="show").set_value("Scatter plot").run()
    assert not app.exception
    assert not app.dataframe
    rules = mined("cartpole", 0.001, 0.9)
    ordered = sorted(rules.rules, key=lambda one: -one.samples)
    assert f"{rules.rule_count} rules. Click a dot" in texts(app)
    assert set(dots(app)) <= {rule.id for rule in ordered}
    assert escape(sentence(ordered[0], rules)) in html(app)
    mark = figure(app)["data"][1]
    assert (mark["x"], mark["y"]) == ([ordered[0].support], [ordered[0].confidence])
    assert "push left" in html(app)


def test_a_link_brings_the_axes_and_the_rule() -> None:
    rules = mined("cartpole", 0.001, 0.9)
    rule = rules.rules[3]
    app = open_page("rules", **PLOT, **MANY, across="Lift", upwards="Length", rule=rule.id)
    layout = figure(app)["layout"]
    assert layout["xaxis"]["title"]["text"] == "Lift"
    assert layout["yaxis"]["title"]["text"] == "Length"
    mark = figure(app)["data"][1]
    assert (mark["x"], mark["y"]) == ([rule.lift], [rule.length])
    app.selectbox(key="across").select("Merged length").run()
    assert figure(app)["layout"]["xaxis"]["title"]["text"] == "Merged length"
    assert escape(sentence(rule, rules)) in html(app)


def test_nonsense_in_a_link_falls_back_to_support_and_confidence() -> None:
    layout = figure(open_page("rules", **PLOT, across="zzz", upwards="Held out"))["layout"]
    assert layout["xaxis"]["title"]["text"] == "Support"
    assert layout["yaxis"]["title"]["text"] == "Confidence"


def test_search_and_action_narrow_the_dots() -> None:
    app = open_page("rules", **PLOT, **MANY)
    rules = mined("cartpole", 0.001, 0.9)
    app.selectbox(key="action").select("push right").run()
    right = {rule.id for rule in rules.rules if rule.action == 1}
    assert set(dots(app)) <= right
    assert f"{len(right)} of {rules.rule_count} rules match" in texts(app)
    app.text_input(key="search").set_value("no such thing").run()
    assert "No rule matches the search" in texts(app)


def test_what_cannot_be_seen_is_said() -> None:
    app = open_page("rules", **PLOT, **MANY, across="Length", upwards="Length")
    assert "A larger dot is several rules" in texts(app)
    assert "The rule below is 1 of " in texts(app)
    held = open_page(
        "rules", **PLOT, **MANY, holdout="0.2", across="Held out", upwards="Lower bound"
    )
    assert figure(held)["layout"]["yaxis"]["title"]["text"] == "Lower bound"
    assert "of which one of the two numbers is not known" in texts(held)


def test_several_action_dimensions_have_a_legend_each() -> None:
    app = open_page("rules", data="lunar_lander_continuous", show="Scatter plot")
    assert "Circles:" in html(app)
    assert "Circles:" not in html(open_page("rules", **PLOT))


def test_no_rule_is_said_with_what_to_do() -> None:
    app = open_page("rules", **PLOT, support="0.9", confidence="1")
    assert "so there is no rule" in texts(app)
    assert not app.get("plotly_chart")


@pytest.mark.parametrize("packed", [list, lambda row: dict(enumerate(row))])
def test_a_click_opens_a_rule_and_another_the_next_of_its_dot(
    packed: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_page("rules", **PLOT)  # the page's modules are there from now on
    view = sys.modules["sarl_dashboard.views.rules.scatter"]
    rules = [SimpleNamespace(id=name) for name in "abc"]
    two = [view.RuleDot(0.0, 0.0, tuple(rules[:2])), view.RuleDot(1.0, 1.0, tuple(rules[2:]))]
    chosen = ["c"]
    state: dict[str, Any] = {}
    monkeypatch.setattr(view, "st", SimpleNamespace(session_state=state))
    monkeypatch.setattr(view, "set_url_choice", lambda _, value: chosen.append(value))

    def click(*points: dict[str, Any]) -> None:
        state["rule_scatter"] = SimpleNamespace(selection=SimpleNamespace(points=list(points)))
        view.pick_dot(two, chosen[-1])

    click()  # nothing was clicked so far
    click({"customdata": packed(["a"])})
    click()  # takes the selection back, and means the dot all the same
    click({"customdata": packed(["a"])})
    click({"customdata": packed(["c"])})
    assert chosen == ["c", "a", "b", "a", "c"]
