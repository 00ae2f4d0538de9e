from __future__ import annotations

import json
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, mine_rules
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.language import sentence, share_text
from sarl_core.mining.rule_tree import recount
from tests.app.screens import (
    ROUTER,
    chosen_rules,
    errors,
    html,
    metrics,
    open_page,
    run_through,
    texts,
)

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet")
WALKER = load_demonstrations(DATA / "bipedal_walker.parquet")


def elsewhere(demonstrations: Demonstrations) -> Demonstrations:
    """The same pairs, and as many where the expert never was: far right, always pushing on."""
    far = demonstrations.observations + np.float32([10.0, 0.0, 0.0, 0.0])
    episodes = demonstrations.episodes
    return Demonstrations(
        np.concatenate([demonstrations.observations, far]),
        np.concatenate([demonstrations.actions, np.ones_like(demonstrations.actions)]),
        np.concatenate([episodes, episodes + int(episodes[-1]) + 1]),
        feature_names=tuple(feature.name for feature in demonstrations.features),
        label_names=[demonstrations.action_dimensions[0].labels],
        env_id=demonstrations.env_id,
    )


@pytest.fixture(scope="module")
def built() -> dict[str, RuleSet]:
    """Compact rules by their file's name."""
    walking = leaf_rules(grow_budgeted_trees(WALKER, max_rules=6, divider=3))
    rules = leaf_rules(grow_budgeted_trees(elsewhere(CARTPOLE), max_rules=8))
    return {"bipedal_walker_compact.json": walking, "cartpole_compact.json": rules}


@pytest.fixture
def compact(built: dict[str, RuleSet], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RuleSet:
    """Compact rules for the cart pole, some of which no demonstrated state reaches."""
    for name, rules in built.items():
        rules.save(tmp_path / name)
    monkeypatch.setattr("sarl_dashboard.state.rule_files.RULES_FOLDER", tmp_path)
    return RuleSet.load(tmp_path / "cartpole_compact.json")


def counted_here(rules: RuleSet) -> RuleSet:
    return leaf_rules(recount(rules, CARTPOLE))


def numbers(rules: RuleSet) -> dict[str, str]:
    return {
        "Rules": f"{len(rules):,}",
        "Mean length": f"{rules.mean_length:.1f}",
        "Coverage": share_text(rules.coverage, decimals=1),
        "Fidelity": share_text(rules.fidelity, decimals=1),
    }


def in_force(app: AppTest) -> bool:
    return chosen_rules(app) == "compact"


# --- Thresholds --------------------------------------------------------------------------------


def test_the_compact_rules_are_a_click_away_and_counted_here(compact: RuleSet) -> None:
    app = open_page("thresholds", data="cartpole")
    assert not in_force(app)
    assert "--mark-ring: none" not in html(app)
    app.button(key="compact").click().run()
    assert not app.exception
    assert metrics(app) == numbers(counted_here(compact))
    assert metrics(app)["Coverage"] == "100 %"
    assert app.query_params["set"] == "compact"
    assert in_force(app)
    assert "--mark-ring: none" in html(app)
    assert "no cell is marked" in texts(app)
    table = app.dataframe[0].value
    assert len(table) == len(compact)
    assert table["States"].tolist() == sorted(
        (rule.samples for rule in counted_here(compact).rules), reverse=True
    )
    unreached = sum(not rule.samples for rule in counted_here(compact).rules)
    assert unreached
    assert "reached by no demonstrated state" in texts(app)
    assert table["Confidence"].isna().sum() == unreached


def leave_by(app: AppTest, way: str) -> None:
    if way in ("support", "confidence"):
        app.select_slider(key=way).set_value({"support": 0.02, "confidence": 0.9}[way]).run()
    elif way in ("lift", "depth"):
        app.slider(key=way).set_value({"lift": 1.5, "depth": 6}[way]).run()
    else:
        app.button(key=way).click().run()
    assert not app.exception


@pytest.mark.parametrize(
    ("way", "wanted"),
    [
        ("support", {"supp_min": 0.02}),
        ("confidence", {"conf_min": 0.9}),
        ("lift", {"lift_min": 1.5}),
        ("depth", {"max_depth": 6}),
        ("filtered", {}),
        ("unfiltered", {"supp_min": 0.0, "conf_min": 1.0}),
    ],
)
def test_whatever_moves_the_thresholds_goes_back_to_them(
    compact: RuleSet, way: str, wanted: dict[str, float]
) -> None:
    app = open_page("thresholds", data="cartpole", set="compact")
    assert in_force(app)
    leave_by(app, way)
    settings = {"supp_min": 0.005, "conf_min": 0.95} | wanted
    assert metrics(app) == numbers(mine_rules(CARTPOLE, **settings))  # type: ignore[arg-type]
    assert not in_force(app)
    assert "set" not in app.query_params
    assert "--mark-ring: none" not in html(app)


def test_a_jump_goes_back_to_the_thresholds(compact: RuleSet) -> None:
    app = open_page("thresholds", data="cartpole", set="compact")
    goal = float(app.button(key="support_above").label)
    leave_by(app, "support_above")
    assert app.select_slider(key="support").value == goal
    assert metrics(app) == numbers(mine_rules(CARTPOLE, supp_min=goal, conf_min=0.95))
    assert not in_force(app)


def test_trade_offs_and_surfaces_know_the_compact_rules(compact: RuleSet) -> None:
    app = open_page(
        "thresholds", data="cartpole", set="compact", view="3-D", details="Best trade-offs"
    )
    specs = [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]
    assert [len(spec["data"]) for spec in specs[:2]] == [1, 1]  # no dot on the surfaces
    ring = next(trace for trace in specs[2]["data"] if trace.get("name") == "chosen")
    assert ring["x"] == [len(compact)]
    assert ring["y"] == [1.0]


def test_one_action_of_several_is_looked_at_alone(compact: RuleSet) -> None:
    app = open_page("thresholds", data="bipedal_walker", set="compact")
    every = int(metrics(app)["Rules"])
    name = WALKER.action_dimensions[1].name
    app.selectbox(key="dimension").set_value(name).run()
    assert 0 < int(metrics(app)["Rules"]) <= 6 < every
    assert len(app.dataframe[0].value) == int(metrics(app)["Rules"])
    app.slider(key="divider").set_value(3).run()
    assert not in_force(app)


def test_of_several_compact_sets_each_is_a_click_away() -> None:
    """The shipped ones: three rules about one feature, and two rules about two."""
    app = open_page("thresholds", data="cartpole")
    for key, name, title, count in (
        ("combined", "compact, two features", "Compact rules, two features", 2),
        ("compact", "compact", "Compact rules", 3),
    ):
        app.button(key=key).click().run()
        assert not app.exception
        assert app.query_params["set"] == name
        assert chosen_rules(app) == name
        assert title in app.selectbox(key="_rules_choice").options
        assert metrics(app)["Rules"] == str(count)
    assert "few_combined" not in [button.key for button in app.button]


# --- Rules -------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", ["rules", "what_if", "export", "edit", "episodes", "evidence"])
def test_rules_about_two_features_are_in_force_on_every_page(page: str) -> None:
    app = open_page(page, data="cartpole", set="compact, two features")
    assert not errors(app)
    assert chosen_rules(app) == "compact, two features"
    if page == "export":
        assert app.selectbox(key="carry").value == "in force"
        assert "pole angle plus 0.27 s of pole angular velocity" in app.code[0].value
    if page == "edit":
        assert "The chosen demonstrations are of something else" not in texts(app)
        assert metrics(app)["Fidelity"].endswith("%")
    if page in ("rules", "what_if"):
        assert "pole angle plus 0.27 s of pole angular velocity" in html(app) + texts(app)


def test_a_compact_rule_is_explained_on_the_chosen_demonstrations(compact: RuleSet) -> None:
    here = counted_here(compact)
    rule = max(here.rules, key=lambda one: one.samples)
    app = open_page("rules", data="cartpole", set="compact", rule=rule.id)
    assert len(app.dataframe[0].value) == len(compact)
    assert escape(sentence(rule, here)) in html(app)
    shipped = next(one for one in compact.rules if one.id == rule.id)
    assert shipped.samples != rule.samples or shipped.support != rule.support
    words = texts(app)
    assert f"Over the {compact.source.steps:,} pairs that the compact set was built from" in words
    assert f"support {share_text(shipped.support)}" in words
    assert html(app).count("<tr") == (1 + 1 + rule.length) + (1 + min(10, rule.samples))
    assert html(app).count("<figure>") == len(rule.bounds)
    assert "The tree around the rule: " in html(app)
    app.button_group(key="tree").set_value("Whole tree").run()
    assert not app.exception
    assert len(app.get("plotly_chart")) == 1


def test_a_rule_that_no_demonstrated_state_reaches_says_so(compact: RuleSet) -> None:
    here = counted_here(compact)
    rule = next(one for one in here.rules if not one.samples)
    app = open_page("rules", data="cartpole", set="compact", rule=rule.id, tree="Around this rule")
    assert "No demonstrated state reaches this rule" in texts(app)
    assert escape(sentence(rule, here, evidence=False)) in html(app)
    assert "so did the expert" not in html(app)
    assert len(app.get("plotly_chart")) == 1
    assert html(app).count("<figure>") == len(rule.bounds)
    assert len(app.dataframe) == 1
    assert html(app).count("<tr") == 1 + 1 + rule.length


def test_a_link_to_compact_rules_that_are_not_there_says_so_and_shows_no_others(
    compact: RuleSet,
) -> None:
    app = open_page("rules", data="lunar_lander", set="compact")
    (said,) = errors(app)
    assert said.startswith("There are no rules called 'compact' for Lunar Lander")
    assert not app.dataframe
    app.button(key="go_on_without").click().run()
    assert not errors(app)
    assert app.dataframe
    assert "set" not in app.query_params
    assert "compact" not in [
        button.key for button in open_page("thresholds", data="pendulum").button
    ]


@pytest.mark.parametrize("page", ["thresholds", "rules"])
def test_compact_rules_that_cannot_be_read_are_said_and_nothing_takes_their_place(
    compact: RuleSet, tmp_path: Path, page: str
) -> None:
    file = tmp_path / "cartpole_compact.json"
    file.write_text(file.read_text()[:100])
    app = open_page(page, data="cartpole", set="compact")
    (sentence_shown,) = errors(app)
    assert "\n" not in sentence_shown
    assert not app.dataframe
    app.button(key="go_on_without").click().run()
    filtered = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)
    if page == "thresholds":
        assert metrics(app) == numbers(filtered)
    else:
        assert len(app.dataframe[0].value) == len(filtered)


@pytest.mark.parametrize("kind", ["cut", "leaves of no tree"])
def test_rules_that_are_no_leaves_of_a_tree_are_in_force_with_the_numbers_of_their_file(
    compact: RuleSet, tmp_path: Path, kind: str
) -> None:
    rules = replace(compact, rules=compact.rules[:2])
    if kind == "cut":
        rules = mine_rules(elsewhere(CARTPOLE), supp_min=0.005, conf_min=0.95)
    rules.save(tmp_path / "cartpole_compact.json")
    app = open_page("rules", data="cartpole", set="compact")
    assert not errors(app)
    table = app.dataframe[0].value
    assert table["States"].tolist() == sorted((one.samples for one in rules), reverse=True)
    assert "its numbers are those of its file" in texts(app)


# --- Replay ------------------------------------------------------------------------------------


def test_compact_rules_are_replayed_where_there_are_some(compact: RuleSet) -> None:
    app = open_page("replay", data="cartpole", rules="compact", agent="novice", seed="3")
    assert app.selectbox(key="rules").value == "compact"
    run_through(app, "replay")
    assert not errors(app)
    assert f"{len(compact):,} rules (compact)" in texts(app)
    assert metrics(app)["Covered"] == "100 %"
    assert "compact" not in open_page("replay", data="pendulum").selectbox(key="rules").options


def test_two_rules_about_two_features_keep_a_novice_s_pole_up() -> None:
    query = {"rules": "compact, two features", "agent": "novice", "seed": "3"}
    app = open_page("replay", data="cartpole", **query)
    run_through(app, "replay")
    assert not errors(app)
    assert "2 rules (compact, two features)" in texts(app)
    assert metrics(app)["Covered"] == "100 %"


def test_a_browser_that_has_not_heard_of_a_choice_does_not_undo_it(compact: RuleSet) -> None:
    app = open_page("thresholds", data="cartpole", set="compact")
    assert in_force(app)
    app.select_slider(key="confidence").set_value(0.8).run()
    assert not in_force(app)
    # Asked for before the answer to the first move arrived, so with the address from before it.
    app.query_params["set"] = "compact"
    app.select_slider(key="confidence").set_value(0.9).run()
    assert not in_force(app)
    assert "set" not in app.query_params
    # Chosen once more, they are in force, and a late address does not take them away either.
    app.button(key="compact").click().run()
    assert app.query_params["set"] == "compact"
    del app.query_params["set"]
    app.run()
    assert in_force(app)
    # A link from another page means what it says.
    app.select_slider(key="confidence").set_value(0.8).run()
    app.switch_page("rules.py").run()
    app.query_params["set"] = "compact"
    app.switch_page("thresholds.py").run()
    assert in_force(app)
