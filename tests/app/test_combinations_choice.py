from __future__ import annotations

from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules, with_combinations
from sarl_core.mining.language import share_text
from sarl_core.mining.validation.holding_out import hold_out
from tests.app.screens import ROUTER, errors, html, metrics, open_page, texts

CARTPOLE = ROUTER.parents[1] / "data" / "demonstrations" / "cartpole.parquet"
SIDEBAR = "Combinations** of two features on"


def switched(app: AppTest) -> AppTest:
    app.toggle(key="_combinations").set_value(not app.toggle(key="_combinations").value).run()
    assert not app.exception
    return app


def test_the_switch_is_in_the_address_and_goes_with_the_visitor() -> None:
    app = open_page("thresholds", data="cartpole")
    without = metrics(app)
    assert not app.toggle(key="_combinations").value
    assert SIDEBAR not in texts(app)
    switched(app)
    assert app.query_params["combine"] == "every"
    assert SIDEBAR in texts(app)
    combined = with_combinations(load_demonstrations(CARTPOLE))
    rules = mine_rules(combined, supp_min=0.005, conf_min=0.95)
    assert metrics(app) != without
    assert metrics(app)["Rules"] == f"{rules.rule_count:,}"
    assert metrics(app)["Coverage"] == share_text(rules.coverage, decimals=1)
    assert f"Rules may ask about {len(combined.derived)} combinations" in texts(app)
    app.switch_page("rules.py").run()
    assert not app.exception
    assert app.query_params["combine"] == "every"
    assert SIDEBAR in texts(app)
    app.switch_page("thresholds.py").run()
    assert app.toggle(key="_combinations").value
    switched(app)
    assert "combine" not in app.query_params
    assert metrics(app) == without


def test_a_link_says_which_features_are_combined() -> None:
    app = open_page("thresholds", data="cartpole", combine="3,2")
    assert app.multiselect(key="_combined_features").value == [2, 3]
    pairs = [("pole angle", "pole angular velocity")]
    combined = with_combinations(load_demonstrations(CARTPOLE), pairs=pairs)
    rules = mine_rules(combined, supp_min=0.005, conf_min=0.95)
    assert metrics(app)["Rules"] == f"{rules.rule_count:,}"
    app.multiselect(key="_combined_features").set_value([0, 1, 2]).run()
    assert app.query_params["combine"] == "0,1,2"
    app.multiselect(key="_combined_features").set_value([]).run()
    assert app.query_params["combine"] == "every"


def test_features_are_chosen_one_after_the_other() -> None:
    app = open_page("thresholds", data="cartpole", combine="every")
    app.multiselect(key="_combined_features").set_value([2]).run()
    assert app.query_params["combine"] == "every"
    assert app.multiselect(key="_combined_features").value == [2]
    assert "Until there is a second one, all are combined." in texts(app)
    app.multiselect(key="_combined_features").set_value([2, 3]).run()
    assert app.query_params["combine"] == "2,3"
    assert "Until there is a second one" not in texts(app)


def test_a_link_that_means_nothing_combines_nothing() -> None:
    for text in ("some", "2", "1,x", "-1,2"):
        app = open_page("thresholds", data="cartpole", combine=text)
        assert not app.toggle(key="_combinations").value
        assert SIDEBAR not in texts(app)


def test_features_that_are_not_there_are_said_in_a_sentence() -> None:
    app = open_page("thresholds", data="cartpole", combine="50,51")
    assert not errors(app)
    assert any("no two features that could be combined" in one.value for one in app.warning)
    assert metrics(app)["Rules"] == metrics(open_page("thresholds", data="cartpole"))["Rules"]


def test_held_out_episodes_have_no_say_in_what_is_combined() -> None:
    app = open_page("rules", data="cartpole", combine="every", holdout="0.2", holdout_seed="3")
    split = hold_out(load_demonstrations(CARTPOLE), 0.2, seed=3)
    rules = mine_rules(with_combinations(split.mined), supp_min=0.005, conf_min=0.95)
    table = app.dataframe[0].value
    assert sorted(table["States"].tolist()) == sorted(rule.samples for rule in rules.rules)


def test_a_rule_shows_its_combination_and_the_demonstrations_stay_as_they_were() -> None:
    app = open_page("rules", data="cartpole", combine="every")
    page = html(app)
    table = app.dataframe[0].proto
    assert table.row_height > open_page("rules", data="cartpole").dataframe[0].proto.row_height
    assert "What it asks of two features together" in page
    assert "data:image/svg+xml" in page
    assert "What it asks of two features together" not in html(open_page("rules", data="cartpole"))
    plain = open_page("demonstrations", data="cartpole")
    combined = open_page("demonstrations", data="cartpole", combine="every")
    charts = [[one.proto.spec for one in app.get("plotly_chart")] for app in (plain, combined)]
    assert charts[0] == charts[1]
    assert html(combined) == html(plain)
    assert " plus " not in texts(combined)
