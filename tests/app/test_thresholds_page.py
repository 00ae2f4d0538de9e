from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules, threshold_landscape
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.language import share_text
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS
from sarl_dashboard.views.thresholds import maps
from tests.app.screens import ROUTER, metrics, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def expected(data: str, support: float, confidence: float, **more: float) -> dict[str, str]:
    demonstrations = load_demonstrations(DATA / f"{data}.parquet")
    rules = mine_rules(demonstrations, supp_min=support, conf_min=confidence, **more)  # type: ignore[arg-type]
    return {
        "Rules": f"{rules.rule_count:,}",
        "Mean length": f"{rules.mean_length:.1f}" if rules.rules else "–",
        "Coverage": share_text(rules.coverage, decimals=1),
        "Fidelity": share_text(rules.fidelity, decimals=1),
    }


def specs(app: AppTest) -> list[dict[str, object]]:
    return [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]


def set_support(app: AppTest, value: float) -> AppTest:
    app.select_slider(key="support").set_value(value).run()
    assert not app.exception
    return app


def test_the_maps_wait_for_the_numbers_at_the_first_visit_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(maps, "time", SimpleNamespace(sleep=waits.append))
    app = open_page("thresholds", data="cartpole")
    assert len(waits) == 1
    assert len(app.get("plotly_chart")) == 2
    app.run()
    assert len(waits) == 1


def test_a_fresh_visit_shows_the_filtered_setting() -> None:
    app = open_page("thresholds")
    assert app.select_slider(key="support").value == 0.005
    assert app.select_slider(key="confidence").value == 0.95
    assert metrics(app) == expected("lunar_lander", 0.005, 0.95)
    assert [slider.label for slider in app.select_slider] == [
        "Minimum support",
        "Minimum confidence",
    ]


def test_sliders_change_the_numbers_and_the_table() -> None:
    app = set_support(open_page("thresholds", data="cartpole"), 0.02)
    app.select_slider(key="confidence").set_value(0.9).run()
    assert metrics(app) == expected("cartpole", 0.02, 0.9)
    table = app.dataframe[0].value
    assert len(table) == int(metrics(app)["Rules"])
    whole = mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.02, conf_min=0.9)
    largest = sorted(whole.rules, key=lambda rule: -rule.samples)
    assert table["Rule"].tolist() == [whole.name_of(rule) for rule in largest]
    assert table["Support"].tolist() == [100 * rule.support for rule in largest]
    assert table["Confidence"].tolist() == [100 * rule.confidence for rule in largest]


def test_a_link_opens_what_it_says() -> None:
    app = open_page("thresholds", data="cartpole", support="0.0123", confidence="0.9012")
    assert app.select_slider(key="support").value == 0.0123
    assert app.select_slider(key="confidence").value == 0.9012
    assert metrics(app) == expected("cartpole", 0.0123, 0.9012)


@pytest.mark.parametrize(
    "query",
    [
        {"support": "abc", "confidence": "7"},
        {"support": "-1", "confidence": "nan"},
        {"layer": "zzz", "view": "", "grid": "1"},
        {"lift": "-3", "depth": "x", "divider": "99"},
    ],
)
def test_junk_in_a_link_falls_back_to_the_defaults(query: dict[str, str]) -> None:
    app = open_page("thresholds", **query)
    assert metrics(app) == expected("lunar_lander", 0.005, 0.95)


def test_named_settings_are_a_click_away() -> None:
    app = open_page("thresholds", data="cartpole", support="0.1", lift="1.5", depth="3")
    app.button(key="unfiltered").click().run()
    assert metrics(app) == expected("cartpole", 0.0, 1.0)
    app.button(key="filtered").click().run()
    assert metrics(app) == expected("cartpole", 0.005, 0.95)
    assert app.select_slider(key="support").value == 0.005


@pytest.mark.parametrize(
    "name", ["support_below", "support_above", "confidence_below", "confidence_above"]
)
def test_a_jump_changes_the_rules(name: str) -> None:
    app = open_page("thresholds", data="cartpole")
    before, goal = metrics(app), float(app.button(key=name).label)
    app.button(key=name).click().run()
    assert not app.exception
    assert app.select_slider(key=name.split("_")[0]).value == goal
    assert metrics(app) != before


def test_lift_and_depth_need_no_new_tree() -> None:
    app = open_page("thresholds", data="lunar_lander", support="0")
    app.slider(key="lift").set_value(2.0).run()
    app.slider(key="depth").set_value(6).run()
    assert metrics(app) == expected("lunar_lander", 0.0, 0.95, lift_min=2.0, max_depth=6)


def test_maps_hold_every_cell_of_the_grid() -> None:
    app = open_page("thresholds", data="cartpole")
    app.button_group(key="grid").set_value("Paper's grid").run()
    trees = grow_policy_trees(load_demonstrations(DATA / "cartpole.parquet"))
    landscape = threshold_landscape(trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)
    points = specs(app)[0]["data"][1]["customdata"]  # type: ignore[index]
    assert [cell[2] for cell in points] == landscape.rule_count.ravel().tolist()


def test_coverage_fidelity_and_surfaces_are_a_switch_away() -> None:
    app = open_page("thresholds", data="cartpole", layer="Coverage and fidelity")
    assert "Fidelity: share of those where the rule is right" in texts(app)
    app.button_group(key="view").set_value("3-D").run()
    assert [spec["data"][0]["type"] for spec in specs(app)[:2]] == ["surface"] * 2  # type: ignore[index]
    set_support(app, 0.01)
    assert metrics(app) == expected("cartpole", 0.01, 0.95)


def test_the_divider_is_there_only_for_continuous_actions() -> None:
    assert not [slider for slider in open_page("thresholds").slider if slider.key == "divider"]
    app = open_page("thresholds", data="pendulum")
    assert app.slider(key="divider").label == "Divider"
    app.slider(key="divider").set_value(5).run()
    assert metrics(app) == expected("pendulum", 0.005, 0.95, divider=5)


def test_trade_offs_are_drawn() -> None:
    app = open_page("thresholds", data="cartpole", details="Best trade-offs")
    assert "No other thresholds give fewer rules" in texts(app)
    front = specs(app)[-1]["data"][0]  # type: ignore[index]
    assert len(front["customdata"]) > 10
    (by_name,) = (one for one in app.selectbox if one.label == "Point of the figure")
    assert len(by_name.options) == len(front["customdata"])
    by_name.select_index(0).run()
    assert metrics(app)["Rules"] == by_name.options[0].split()[0]


def test_no_rule_is_said_with_what_to_do() -> None:
    app = open_page("thresholds", support="0.9", confidence="1")
    assert metrics(app)["Rules"] == "0"
    assert "Lower the minimum support" in texts(app)


def test_without_an_upload_the_page_says_what_to_do() -> None:
    app = open_page("thresholds", data="upload")
    assert "Nothing has been uploaded" in texts(app)
    assert not app.select_slider


def test_the_jumps_say_what_they_are() -> None:
    app = open_page("thresholds", data="cartpole")
    assert [caption.value for caption in app.caption].count("next change") == 2
    app = open_page("thresholds", data="cartpole", support="0", confidence="0")
    assert app.button(key="support_below").label == "none"
    assert app.button(key="support_below").disabled


def test_the_learner_is_chosen_and_said_and_in_the_link() -> None:
    app = open_page("thresholds", data="cartpole")
    assert any("Learner: exact" in one.value for one in app.caption)
    app.selectbox(key="_learner_choice").set_value("histogram").run()
    assert not app.exception
    assert any("Learner: histogram" in one.value for one in app.caption)
    trees = grow_policy_trees(load_demonstrations(DATA / "cartpole.parquet"), learner="histogram")
    rules = mine_rules(trees, supp_min=0.005, conf_min=0.95)
    assert metrics(app)["Rules"] == f"{rules.rule_count:,}"
    assert app.query_params["learner"] == "histogram"
    linked = open_page("thresholds", data="cartpole", learner="histogram")
    assert metrics(linked) == metrics(app)
    assert "Learner: exact" in str(
        [one.value for one in open_page("thresholds", learner="x").caption]
    )
