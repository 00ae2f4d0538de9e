"""The page Edit: every edit, what it changes, undo and redo, files, and who else knows of it."""

from __future__ import annotations

import json
from pathlib import Path

from streamlit.testing.v1 import AppTest

from sarl_core import Shield, load_demonstrations, mine_rules
from sarl_core.library import Library
from sarl_core.mining.editing.edits import Add, apply
from sarl_core.mining.editing.manual_rules import Ask, manual_rule
from sarl_core.mining.language import share_text
from sarl_core.mining.rule_set import RuleSet, rules_from_json, rules_to_json
from sarl_core.mining.validation.holding_out import hold_out
from sarl_dashboard.text import in_full
from tests.app.screens import (
    ROUTER,
    errors,
    html,
    metrics,
    open_page,
    run_through,
    texts,
    upload_rules,
)

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet")
FEATURES = [feature.name for feature in CARTPOLE.features]
FILTERED = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)


def click(app: AppTest, key: str) -> None:
    app.button(key=key).click().run()
    assert not app.exception, app.exception


def draft(app: AppTest, name: str) -> str:
    """The key of a widget of the form, whichever draft it is."""
    keys = [widget.key for kind in (app.button, app.selectbox, app.number_input) for widget in kind]
    return next(key for key in keys if key.startswith("draft") and key.split("_", 1)[1] == name)


def warnings(app: AppTest) -> str:
    return "\n".join(str(one.value).replace("\\", "") for one in app.warning)


def labels(app: AppTest) -> list[str]:
    return [button.label.replace("\\", "") for button in app.button]


def table(app: AppTest):  # type: ignore[no-untyped-def]
    return app.dataframe[0].value


def differently(before: RuleSet, after: RuleSet) -> int:
    """On how many demonstrated states two shields say different things of some action."""
    said = []
    for rules in (before, after):
        found = Shield(rules).decide_batch(CARTPOLE.observations, CARTPOLE.actions).rules[:, 0]
        said.append([rules.rules[index].action if index >= 0 else None for index in found])
    return sum(one != other for one, other in zip(*said, strict=True))


def fill_in(app: AppTest, feature: str, sign: str, number: float, action: int) -> None:
    app.selectbox(key=draft(app, "feature_0")).set_value(FEATURES.index(feature))
    app.selectbox(key=draft(app, "sign_0")).select(sign)
    app.number_input(key=draft(app, "at_0")).set_value(number)
    app.selectbox(key=draft(app, "action")).set_value(action).run()
    assert not app.exception, app.exception


def test_each_edit_says_what_it_changes_and_every_step_is_undone() -> None:
    rule = max(FILTERED.rules, key=lambda one: one.samples)
    name = FILTERED.name_of(rule)
    app = open_page("edit", data="cartpole", rule=rule.id)
    plain = metrics(app)
    assert plain["Rules in force"] == str(len(FILTERED))
    assert plain["Coverage"] == share_text(FILTERED.coverage, decimals=1)
    assert plain["Fidelity"] == share_text(FILTERED.fidelity, decimals=1)
    assert table(app)["Decides"].tolist() == sorted(
        (r.samples for r in FILTERED.rules), reverse=True
    )
    click(app, "edit_switch")
    assert metrics(app)["Decided differently"] == f"{rule.samples:,}"
    assert metrics(app)["Rules in force"] == str(len(FILTERED) - 1)
    assert f"Undo: switch off {name}" in labels(app)
    assert f"{rule.samples:,} had a rule and now have none" in html(app)
    click(app, "edit_pin")
    assert table(app)["Kind"].tolist()[0] == "pinned"
    assert "Unpin" in labels(app)
    click(app, "undo")
    click(app, "undo")
    assert metrics(app) == plain
    assert f"Redo: switch off {name}" in labels(app)
    click(app, "redo")
    assert metrics(app)["Decided differently"] == f"{rule.samples:,}"
    # The thresholds move: the edit waits, and comes back with its rule.
    app.switch_page("thresholds.py").run()
    app.select_slider(key="confidence").set_value(0.5).run()
    app.switch_page("edit.py").run()
    assert metrics(app)["Decided differently"] == "0"
    assert "Undo: switch off a rule" in labels(app)  # that is not there now


def test_a_rule_by_hand_is_previewed_added_moved_changed_and_removed() -> None:
    app = open_page("edit", data="cartpole")
    fill_in(app, "pole angle", "above", 0.0, 0)
    by_hand = manual_rule(FILTERED, [Ask("pole angle", ">", 0.0)], rule_id="manual.1", action=0)
    after = apply(FILTERED, [Add(by_hand)])
    states = CARTPOLE.observations[:, 2] > 0
    words = texts(app)
    assert f"It would decide {int(states.sum()):,} of {len(CARTPOLE):,}" in words
    assert f"did as it says in {int((CARTPOLE.actions[states] == 0).sum()):,} of them" in words
    assert f"{differently(FILTERED, after):,} of {len(CARTPOLE):,}" in words
    assert metrics(app)["Decided differently"] == "0"  # it is not there yet
    click(app, draft(app, "save"))
    assert metrics(app)["Decided differently"] == f"{differently(FILTERED, after):,}"
    own = f"R{len(FILTERED) + 1}"
    assert (table(app)["Rule"][0], table(app)["Kind"][0]) == (own, "manual")
    overruled = app.dataframe[1].value
    assert overruled["States"].sum() == int(metrics(app)["Conflicts"].replace(",", ""))
    assert set(overruled["Rule"]) == {own}
    # A second one, and the order.
    fill_in(app, "pole angle", "above", 0.0, 1)
    click(app, draft(app, "save"))
    second = f"R{len(FILTERED) + 2}"
    assert table(app)["Rule"].tolist()[:2] == [own, second]
    assert table(app)["Action"].tolist()[:2] == [["push left"], ["push right"]]
    click(app, "edit_up")
    assert table(app)["Rule"].tolist()[:2] == [second, own]
    assert table(app)["Action"].tolist()[:2] == [["push right"], ["push left"]]
    assert table(app)["Decides"].tolist()[:2] == [int(states.sum()), 0]
    click(app, "change_rule")
    assert f"Change {second}" in [header.value for header in app.header]
    app.number_input(key=draft(app, "at_0")).set_value(0.05).run()
    click(app, draft(app, "save"))
    assert any(label.startswith(f"Undo: change {second}") for label in labels(app))
    assert table(app)["Decides"][0] == int((CARTPOLE.observations[:, 2] > 0.05).sum())
    click(app, "edit_remove")
    assert table(app)["Kind"].tolist()[:2] == ["manual", "mined"]
    assert "Undo: remove a rule" in labels(app)


def test_what_is_wrong_with_a_rule_is_said_and_nothing_is_lost() -> None:
    app = open_page("edit", data="cartpole")
    click(app, "edit_switch")
    fill_in(app, "pole angle", "above", 2.0, 0)
    click(app, draft(app, "more"))
    app.selectbox(key=draft(app, "feature_1")).set_value(FEATURES.index("pole angle"))
    app.selectbox(key=draft(app, "sign_1")).select("at most")
    app.number_input(key=draft(app, "at_1")).set_value(1.0).run()
    assert "'pole angle' cannot be above 2 and at most 1" in warnings(app)
    assert app.button(key=draft(app, "save")).disabled
    # Elsewhere and back: the edit and what was filled in are still there.
    app.switch_page("rules.py").run()
    assert "switched off" in texts(app).lower()
    app.switch_page("edit.py").run()
    assert any(label.startswith("Undo: switch off") for label in labels(app))
    assert "cannot be above 2 and at most 1" in warnings(app)
    click(app, draft(app, "fewer_0"))
    click(app, draft(app, "fewer_1"))
    assert "Without conditions the rule applies always" in warnings(app)
    assert not app.button(key=draft(app, "save")).disabled


def test_new_names_leave_a_half_filled_rule_about_the_same_feature() -> None:
    app = open_page("edit", data="cartpole")
    app.selectbox(key=draft(app, "feature_0")).set_value(2)
    app.number_input(key=draft(app, "at_0")).set_value(0.1).run()
    app.switch_page("names.py").run()
    key = app.data_editor[0].key
    rows = {0: {"Name": "pole angle"}, 2: {"Name": "lean", "Unit": "turns"}}
    app.session_state[key] = {"edited_rows": rows, "added_rows": [], "deleted_rows": []}
    app.run()
    assert not errors(app)
    app.switch_page("edit.py").run()
    box = app.selectbox(key=draft(app, "feature_0"))
    assert box.options[box.index] == "lean (turns)"
    assert app.number_input(key=draft(app, "at_0")).value == 0.1
    app.selectbox(key=draft(app, "action")).set_value(1).run()
    click(app, draft(app, "save"))
    assert "lean is above 0.1" in texts(app).replace("**", "") or "lean > 0.1" in str(
        table(app).iloc[0].tolist()
    )
    click(app, "change_rule")
    assert app.selectbox(key=draft(app, "feature_0")).value == 2


def test_what_is_to_be_typed_is_code_and_what_files_hold_is_not() -> None:
    assert in_full("run `pip install onnx`, or leave it") == "Run `pip install onnx`, or leave it."
    said = in_full("the column 'a`b`' is $x$; give what `evaluate --json` printed (`learn`)")
    assert r"'a\`b\`' is \$x\$" in said
    assert said.endswith(r"give what `evaluate --json` printed (`learn`).")
    assert in_full("write `<b>`") == r"Write \`&lt;b&gt;\`."


def test_a_rule_file_is_edited_and_one_that_is_none_loses_nothing(tmp_path: Path) -> None:
    given = apply(
        FILTERED,
        [Add(manual_rule(FILTERED, [Ask("pole angle", ">", 0.1)], rule_id="manual.1", action=1))],
    )
    app = open_page("edit", data="cartpole")
    content = rules_to_json(given).encode()
    upload_rules(app, "mine.json", content)
    assert table(app)["Kind"].tolist()[0] == "manual"
    assert "The rules of mine.json" in texts(app)
    app.query_params["rule"] = "manual.1"
    app.run()
    click(app, "edit_remove")
    assert "manual" not in table(app)["Kind"].tolist()
    upload_rules(app, "torn.json", b"{")
    (sentence,) = errors(app)
    assert "torn.json is not JSON" in sentence
    assert "give a rule file that `mine` wrote" in app.error[0].value  # as code
    assert "manual" not in table(app)["Kind"].tolist()
    click(app, "undo")
    assert table(app)["Kind"].tolist()[0] == "manual"


def test_an_edited_file_speaks_by_the_names_given_to_the_data() -> None:
    app = open_page("names", data="cartpole")
    rows = {2: {"Name": "lean"}}
    app.session_state[app.data_editor[0].key] = {
        "edited_rows": rows,
        "added_rows": [],
        "deleted_rows": [],
    }
    app.run()
    app.switch_page("edit.py").run()
    content = rules_to_json(FILTERED).encode()
    upload_rules(app, "mine.json", content)
    when = " ".join(table(app)["When"])
    assert "lean" in when
    assert "pole angle " not in when


def test_rules_of_something_else_are_counted_on_random_states() -> None:
    app = open_page("edit", data="pendulum")
    content = rules_to_json(FILTERED).encode()
    upload_rules(app, "cart.json", content)
    assert not app.exception
    assert "counted on random states" in html(app)
    assert metrics(app)["Fidelity"] == "–"
    click(app, "edit_switch")
    assert int(metrics(app)["Decided differently"].replace(",", "")) > 0


def test_the_file_holds_the_edits_and_others_can_choose_them() -> None:
    app = open_page("edit", data="cartpole")
    assert "edited" not in open_page("replay", data="cartpole").selectbox(key="rules").options
    click(app, "edit_switch")
    click(app, "edit_pin")
    off = table(app)["Rule"][0]
    button = next(one for one in app.get("download_button") if one.proto.id.count("edited_file"))
    assert button is not None
    app.switch_page("shield.py").run()
    assert "edited" in app.button_group(key="shields").options
    app.switch_page("replay.py").run()
    app.selectbox(key="rules").select("edited")
    app.selectbox(key="agent").select("novice").run()
    run_through(app, "replay")
    assert not errors(app)
    assert f"{len(FILTERED):,} rules (edited)" in texts(app)
    app.switch_page("difference.py").run()
    assert app.multiselect(key="_sets_choice").value == ["before the edits", "edited"]
    rows = app.dataframe[1].value
    assert rows["Rule"].tolist() == [off]
    assert rows["Change"].tolist() == ["switched off; pinned"]
    app.switch_page("edit.py").run()
    click(app, "undo")
    click(app, "undo")
    app.switch_page("shield.py").run()
    assert "edited" not in app.button_group(key="shields").options


def test_the_form_offers_every_action_of_every_dimension() -> None:
    app = open_page("edit", data="bipedal_walker")
    app.selectbox(key=draft(app, "dimension")).set_value(2)
    app.selectbox(key=draft(app, "action")).set_value(1)
    app.number_input(key=draft(app, "at_0")).set_value(0.0).run()
    assert not app.exception
    click(app, draft(app, "save"))
    assert table(app)["Kind"][0] == "manual"
    assert json.loads(json.dumps(errors(app))) == []


def test_nothing_to_edit_leaves_room_for_a_rule_by_hand() -> None:
    app = open_page("edit", data="cartpole", support="1", confidence="1")
    assert "No rule is in force at these thresholds" in texts(app)
    fill_in(app, "pole angle", "at most", 0.0, 0)
    click(app, draft(app, "save"))
    assert table(app)["Kind"].tolist() == ["manual"]
    assert table(app)["Rule"].tolist() == ["R1"]
    assert rules_from_json(rules_to_json(FILTERED)) == FILTERED


def edited_in(app: AppTest) -> RuleSet:
    """Add a rule by hand, and take the edited set as other pages have it."""
    app.switch_page("edit.py").run()
    fill_in(app, "pole angle", "above", 0.0, 1)
    click(app, draft(app, "save"))
    app.switch_page("replay.py").run()
    app.selectbox(key="rules").select("edited")
    app.selectbox(key="agent").select("novice").run()
    run_through(app, "replay")
    found = app.session_state["_replay"].rule_set
    assert isinstance(found, RuleSet)
    return found


def test_a_rule_by_hand_is_tried_on_what_this_visitor_held_out() -> None:
    split = hold_out(CARTPOLE, 0.2, seed=3)
    # Another visitor mines from the same episodes, but leaves the others out altogether.
    away = ",".join(map(str, sorted(set(split.held_out.episodes.tolist()))))
    plain = edited_in(open_page("demonstrations", data="cartpole", left_out=away))
    assert all(rule.held_out is None for rule in plain.rules)
    tried = edited_in(open_page("demonstrations", data="cartpole", holdout="0.2", holdout_seed="3"))
    assert plain.source.digest == tried.source.digest == split.mined.digest
    assert [rule.id for rule in tried.rules if rule.held_out is None] == []
    (by_hand,) = [rule for rule in tried.rules if rule.origin == "manual"]
    leaning = split.held_out.observations[:, 2] > 0
    right = split.held_out.actions[leaning] == 1
    assert by_hand.held_out is not None
    assert by_hand.held_out[:2] == (int(leaning.sum()), int(right.sum()))
    own = split.mined.observations[split.mined.observations[:, 2] > 0]
    assert by_hand.box is not None
    assert by_hand.box.most == tuple(own.max(axis=0).tolist())


def test_the_page_says_where_edits_are_that_nobody_kept_as_rules() -> None:
    app = open_page("edit", data="cartpole")
    assert "The address of this page holds these edits" not in texts(app)
    click(app, "edit_switch")
    assert "The address of this page holds these edits" in texts(app)
    with Library() as library:
        item = library.item("".join(app.query_params["edits"]))
    assert item.details["made_on"] == "At the thresholds, Cart Pole"


def test_what_a_rule_of_a_file_does_is_counted_in_the_states_at_hand() -> None:
    lander = load_demonstrations(DATA / "lunar_lander.parquet")
    rules = RuleSet.load(DATA.parent / "rules" / "lunar_lander_few_combined.json")
    (column,) = Shield(rules).rules_in_force(lander.observations).T  # of one action dimension
    for place, rule in enumerate(rules):
        decided = column == place
        right = (lander.actions[decided] == rule.action).mean()
        assert rule.samples != decided.sum()  # it was built from other states
        said = (
            f"decides {decided.sum():,} demonstrated states, and the expert did as it says in "
            f"{share_text(right)} of them"
        )
        app = open_page("edit", data="lunar_lander", set="fewest, two features", rule=rule.id)
        assert said in texts(app)
        assert f"{share_text(rule.confidence)} of {rule.samples:,} states" not in texts(app)
