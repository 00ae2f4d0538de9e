from __future__ import annotations

from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.exports.code_c import rules_to_c
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.mining.editing.rounding import merged_rules, rounded_rules
from sarl_core.mining.rule_set import rules_to_json
from tests.app.screens import ROUTER, errors, html, metrics, open_page, texts, upload_rules

DATA = ROUTER.parents[1] / "data" / "demonstrations"


def filtered(name: str) -> RuleSet:
    demonstrations = load_demonstrations(DATA / f"{name}.parquet")
    rules = mine_rules(demonstrations, supp_min=0.005, conf_min=0.95)
    return rounded_rules(rules, demonstrations).rule_set


def code(app: AppTest) -> str:
    return str(app.get("code")[0].value)


def labels(app: AppTest) -> list[str]:
    return [button.proto.label for button in app.get("download_button")]


def test_the_rules_in_force_are_rounded_and_no_decision_changes() -> None:
    app = open_page("export", data="cartpole")
    rules = filtered("cartpole")
    found = metrics(app)
    assert found["Decisions changed"] == "0"
    assert int(found["Thresholds rounded"]) > 0
    threshold = rules.rules[0].conditions[0].threshold
    assert f'"threshold": {threshold!r}' in code(app)
    assert "The first 150 of" in texts(app)
    assert labels(app) == ["Download .json", "Test vectors"]


def test_c_is_shown_as_it_is_downloaded() -> None:
    app = open_page("export", data="cartpole", format="C", merged="true")
    rules = merged_rules(filtered("cartpole"))
    assert code(app).strip() == rules_to_c(rules, sign_off=SignOff()).strip()


def test_a_model_says_what_goes_in_and_out() -> None:
    app = open_page("export", data="pendulum", format="ONNX", projection="clip")
    assert "`proposed` (B, 1) float32" in texts(app)
    assert app.selectbox(key="projection").value == "clip"


def test_rules_by_features_are_drawn_a_page_at_a_time() -> None:
    app = open_page(
        "export", data="cartpole", support="0", confidence="1", carry_view="Rules by features"
    )
    assert html(app).count('<td class="a"') == 50
    assert labels(app) == ["HTML, all rules", "PNG, this page"]
    app.number_input(key="matrix_page").set_value(31).run()
    assert 0 < html(app).count('<td class="a"') < 50
    # Other rules have fewer pages.
    app.session_state["support"], app.session_state["confidence"] = 0.0005, 0.97
    app.run()
    assert not app.exception
    assert 0 < html(app).count('<td class="a"') <= 50


def test_an_empty_set_is_refused_in_one_sentence() -> None:
    app = open_page("export", data="cartpole", support="0.9", confidence="1")
    (error,) = errors(app)
    assert error.startswith("The rule set has no rules, so there is nothing to export;")
    assert not app.get("download_button")


def test_rules_of_other_features_are_refused_and_go_without_rounding() -> None:
    app = open_page("export", data="cartpole")
    upload_rules(app, "rules.json", rules_to_json(filtered("pendulum")).encode())
    (error,) = errors(app)
    assert "ask about 3 features and the demonstrations have 4" in error
    assert "Or switch rounding off" in error
    app.toggle(key="rounded").set_value(False).run()
    assert not errors(app)
    assert '"env_id": "Pendulum-v1"' in code(app)
