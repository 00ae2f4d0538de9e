"""The page Edit: a part of the tree that is regrown, and who else knows of it."""

from __future__ import annotations

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import PolicyTree, RuleSet, grow_policy_trees, load_demonstrations, mine_rules
from sarl_core.mining.editing.edits import Regrow
from sarl_core.mining.editing.regrowing import next_queries, regrown_trees, way_to
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import FILTERED, node_of
from sarl_core.mining.validation.holding_out import hold_out
from tests.app.screens import ROUTER, compare, errors, html, metrics, open_page, run_through, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet")
TREES = grow_policy_trees(CARTPOLE)
FEATURES = [feature.name for feature in CARTPOLE.features]
LIMITS = {"supp_min": 0.005, "conf_min": 0.95}
MINED = mine_rules(TREES, **LIMITS)
LARGEST = max(MINED.rules, key=lambda rule: rule.samples)
NODE = int(TREES[0].path(node_of(LARGEST))[-2])
QUERY = next(one for one in next_queries(TREES[0], NODE, CARTPOLE) if not one.current)
EDIT = Regrow(0, NODE, QUERY.feature, QUERY.threshold)
NEW = regrown_trees(TREES, [EDIT], CARTPOLE)
AFTER = mine_rules(NEW, **LIMITS)


def click(app: AppTest, key: str) -> None:
    app.button(key=key).click().run()
    assert not app.exception, app.exception


def keys(app: AppTest) -> list[str]:
    return [str(button.key) for button in app.button]


def queries(app: AppTest):
    return next(one.value for one in app.dataframe if "Gain" in one.value)


def opened(**more: str) -> AppTest:
    """The page at the part and the query, as a link has them."""
    return open_page("edit", data="cartpole", rule=LARGEST.id, regrow=EDIT.text, **more)


def rules_below(trees: tuple[PolicyTree, ...]) -> int:
    place = trees[0].place_of(NODE)
    assert place is not None
    return way_to(trees[0], place, FILTERED).rules[-1]


def test_the_table_says_what_each_query_would_do_and_one_is_taken_and_undone() -> None:
    app = open_page("edit", data="cartpole", rule=LARGEST.id)
    plain = metrics(app)
    table = queries(app)
    # The smallest part that the rule is of; as it is now stands first, the best others follow.
    offered = next_queries(TREES[0], NODE, CARTPOLE)
    assert len(table) == len(offered) == len(FEATURES)
    assert table["Condition"][0].endswith(" (now)")
    assert table["Gain"].tolist() == [query.gain for query in offered]
    assert [text.startswith(FEATURES[QUERY.feature]) for text in table["Condition"]][1]
    for row, trees, rules in ((0, TREES, MINED), (1, NEW, AFTER)):
        assert table["Rules below"][row] == rules_below(trees)
        assert table["Rules"][row] == len(rules)
        assert table["Mean length"][row] == pytest.approx(rules.mean_length)
        assert table["Coverage"][row] == pytest.approx(100 * rules.coverage)
        assert table["Fidelity"][row] == pytest.approx(100 * rules.fidelity)
    assert "Held out" not in table
    assert "take_query" not in keys(app)
    app = opened()
    assert f"instead of {rules_below(TREES)}" in texts(app)
    assert metrics(app) == plain  # it is not taken yet
    click(app, "take_query")
    assert app.session_state["_regrow"] == ""
    assert metrics(app)["Rules in force"] == str(len(AFTER))
    assert metrics(app)["Coverage"] == share_text(AFTER.coverage, decimals=1)
    assert metrics(app)["Fidelity"] == share_text(AFTER.fidelity, decimals=1)
    shown = app.dataframe[0].value
    assert shown["Kind"].tolist().count("regrown") == sum(rule.regrown for rule in AFTER.rules)
    assert sorted(shown["Decides"]) == sorted(rule.samples for rule in AFTER.rules)
    # The rule that was chosen is gone: one of the part takes its place, at the same node.
    assert app.session_state["_rule"] in {rule.id for rule in AFTER.rules if rule.regrown}
    assert queries(app)["Condition"][0].startswith(FEATURES[QUERY.feature])
    assert queries(app)["Condition"][0].endswith(" (now)")
    assert "take_query" not in keys(app)
    labels = [button.label.replace("\\", "") for button in app.button]
    (undo,) = [label for label in labels if label.startswith("Undo")]
    assert undo.startswith(f"Undo: regrow a part ({FEATURES[QUERY.feature]} ≤ ")
    click(app, "undo")
    assert metrics(app) == plain
    # What is undone is told as it was, with no digit more.
    labels = [button.label.replace("\\", "") for button in app.button]
    assert undo.replace("Undo", "Redo") in labels
    click(app, "redo")
    assert metrics(app)["Rules in force"] == str(len(AFTER))


def test_another_node_on_the_way_is_another_part() -> None:
    app = open_page("edit", data="cartpole", rule=LARGEST.id)
    (box,) = [one for one in app.selectbox if str(one.key).startswith("regrow_node_")]
    assert box.options[0] == f"The root: all 15,000 states, {len(MINED)} rules below"
    assert box.value == len(box.options) - 1
    box.set_value(0).run()
    assert not app.exception
    assert app.session_state["_part"] == "0"
    offered = next_queries(TREES[0], 0, CARTPOLE)
    assert queries(app)["Gain"].tolist() == [query.gain for query in offered]
    assert set(queries(app)["Rules below"]) == set(queries(app)["Rules"])


def test_other_edits_stay_and_the_part_is_kept_while_thresholds_move() -> None:
    app = opened()
    click(app, "take_query")
    click(app, "edit_switch")
    chosen = app.session_state["_rule"]
    assert metrics(app)["Rules in force"] == str(len(AFTER) - 1)
    assert app.dataframe[0].value["On"].tolist().count(False) == 1
    app.switch_page("thresholds.py").run()
    app.select_slider(key="confidence").set_value(0.5).run()
    app.switch_page("edit.py").run()
    # At these thresholds the tree is cut above the node.
    assert "1 regrown part lies below a rule at these thresholds" in texts(app)
    assert metrics(app)["Decided differently"] == "0"
    app.switch_page("thresholds.py").run()
    app.select_slider(key="confidence").set_value(0.95).run()
    app.switch_page("edit.py").run()
    assert "lies below a rule" not in texts(app)
    shown = app.dataframe[0].value
    off = shown["Rule"][shown["On"].tolist().index(False)]
    assert AFTER.name_of(next(rule for rule in AFTER.rules if rule.id == chosen)) == off


def test_other_pages_take_the_regrown_rules() -> None:
    app = opened()
    click(app, "take_query")
    app.switch_page("replay.py").run()
    app.selectbox(key="rules").select("edited")
    app.selectbox(key="agent").select("novice").run()
    run_through(app, "replay")
    assert not errors(app)
    rules = app.session_state["_replay"].rule_set
    assert isinstance(rules, RuleSet)
    assert [(one.id, one.conditions, one.action) for one in rules.rules] == [
        (one.id, one.conditions, one.action) for one in AFTER.rules
    ]
    assert all(rule.box is not None for rule in rules.rules)
    app.switch_page("difference.py").run()
    compare(app, "before the edits", "edited")
    assert not app.exception
    assert not errors(app)


def test_the_way_of_a_state_is_shown_in_the_tree_that_the_rules_are_of() -> None:
    query = next(one for one in next_queries(TREES[0], 0, CARTPOLE) if not one.current)
    whole = Regrow(0, 0, query.feature, query.threshold)
    app = open_page("edit", data="cartpole", part="0", regrow=whole.text)
    click(app, "take_query")
    assert set(app.dataframe[0].value["Kind"]) == {"regrown"}
    app.switch_page("what_if.py").run()
    app.selectbox(key="take").set_value("a random covered state").run()
    assert not app.exception
    assert not errors(app)
    assert "Its way through the tree" in html(app)


def test_what_a_query_does_on_episodes_held_out_stands_beside_it() -> None:
    split = hold_out(CARTPOLE, 0.2, seed=3)
    app = open_page("edit", data="cartpole", holdout="0.2", holdout_seed="3")
    table = queries(app)
    assert table["Held out"].notna().all()
    assert table["Rules"][0] == len(mine_rules(split.mined, **LIMITS))
    assert not app.exception


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"0.{NODE}:1:0.123", "none of those offered here"),
        ("0.999999:0:0.1", "a node that is not there"),
        ("7.0:0:0.1", "no action dimension 7"),
        ("rules", "says no part to regrow"),
    ],
)
def test_a_link_to_a_query_that_is_not_there_says_so(text: str, words: str) -> None:
    app = open_page("edit", data="cartpole", rule=LARGEST.id, regrow=text)
    (warning,) = app.warning
    assert words in str(warning.value).replace("\\", "")
    assert "take_query" not in keys(app)


def test_rules_without_a_tree_say_so() -> None:
    app = open_page("edit", data="cartpole", set="compact")
    assert "Only rules at the thresholds have a tree" in texts(app)
    app = open_page("edit", data="cartpole", support="0", confidence="0.1")
    assert "Choose a mined rule that lies below a node" in texts(app)


def test_intervals_of_several_dimensions_are_regrown() -> None:
    app = open_page("edit", data="lunar_lander_continuous")
    table = queries(app)
    assert table["Condition"][0].endswith(" (now)")
    (box,) = [one for one in app.selectbox if str(one.key).startswith("regrow_node_")]
    box.set_value(0).run()
    assert len(queries(app)) > 1
    assert not app.exception


def test_of_many_states_a_query_is_tried_once_it_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sarl_dashboard.views.edit.part.MOST_GROWN", 10)
    app = open_page("edit", data="cartpole", rule=LARGEST.id)
    assert queries(app)["Rules"].notna().tolist() == [True, False, False, False]
    assert "what a condition does is seen once it is chosen" in texts(app)
    app = opened()
    assert queries(app)["Rules"].notna().tolist() == [True, True, False, False]
    click(app, "take_query")
    assert metrics(app)["Rules in force"] == str(len(AFTER))
