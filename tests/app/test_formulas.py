"""Formulas that a visitor writes on the page Names."""

from __future__ import annotations

from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules, save_demonstrations, with_formulas
from sarl_core.demonstrations.names import names_of, renamed
from tests.app.screens import ROUTER, errors, html, metrics, open_page, texts
from tests.app.test_demonstrations_page import upload
from tests.app.test_edit_page import draft
from tests.app.test_names_page import type_into

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CART = DATA / "cartpole.parquet"
TIME = "time to the edge [s] = cart_position / max(abs(cart_velocity), 0.1)"


def typed(app: AppTest, text: str) -> AppTest:
    """Type a formula, which is read at once."""
    (box,) = (one for one in app.text_input if (one.key or "").startswith("formula_"))
    box.set_value(text).run()
    assert not app.exception, app.exception
    return app


def added(app: AppTest, text: str) -> AppTest:
    """Type a formula and put it in force."""
    typed(app, text)
    assert not errors(app)
    app.button(key="formula_take").click().run()
    assert not app.exception, app.exception
    return app


def keys(app: AppTest) -> list[str]:
    return [button.key or "" for button in app.button]


def codes(app: AppTest) -> list[str]:
    """The formulas in force; before them the example, as long as none is typed."""
    return [str(one.value) for one in app.get("code")]


def formulas(app: AppTest) -> list[str]:
    return codes(app)[1:]


def test_a_formula_is_mined_with_on_every_page_and_is_removed() -> None:
    app = open_page("names", data="cartpole")
    typed(app, TIME)
    assert not errors(app)
    assert "time to the edge" in texts(app)
    assert "Least " in texts(app)  # its distribution, before it is in force
    assert "formula_remove_0" not in keys(app)
    app.button(key="formula_take").click().run()
    assert "formula_remove_0" in keys(app)
    assert "formula_take" not in keys(app)
    assert "**1 formula** among" in texts(app)  # beside every page

    expected = with_formulas(load_demonstrations(CART), [TIME])
    rules = mine_rules(expected, supp_min=0.005, conf_min=0.95)
    app.switch_page("thresholds.py").run()
    assert metrics(app)["Rules"] == f"{rules.rule_count:,}"
    app.switch_page("rules.py").run()
    assert "time to the edge" in " ".join(app.dataframe[0].value["When"])
    app.switch_page("demonstrations.py").run()
    assert metrics(app)["Features"] == "5"
    assert codes(app) == [TIME]

    app.switch_page("names.py").run()
    app.button(key="formula_remove_0").click().run()
    assert not app.exception
    assert "formula_remove_0" not in keys(app)
    app.switch_page("rules.py").run()
    assert "time to the edge" not in " ".join(app.dataframe[0].value["When"])


def test_a_formula_is_changed_and_two_stand_beside_each_other() -> None:
    app = added(open_page("names", data="cartpole"), TIME)
    added(app, "energy = cart_velocity * cart_velocity")
    assert "**2 formulas** among" in texts(app)
    app.button(key="formula_change_0").click().run()
    typed(app, TIME.replace("0.1", "0.5"))
    app.button(key="formula_take").click().run()
    assert not app.exception
    assert formulas(app) == [
        "cart_position / max(abs(cart_velocity), 0.5)",
        "cart_velocity * cart_velocity",
    ]
    app.button(key="formula_change_1").click().run()
    typed(app, "")
    assert not errors(app)
    assert app.button(key="formula_take").disabled
    app.button(key="formula_cancel").click().run()
    assert "formula_take" not in keys(app)
    app.button(key="formula_remove_0").click().run()
    assert formulas(app)[0] == "cart_velocity * cart_velocity"


def test_a_formula_that_never_changes_is_warned_of() -> None:
    app = typed(open_page("names", data="cartpole"), "five = 5")
    (warning,) = [one.value for one in app.warning]
    assert "'five' has the same value in every step, so no rule can use it" in warning
    assert not app.button(key="formula_take").disabled


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time", "is no feature; write its name (without"),
        (
            "rate = cart_velocty / 2",
            "'cart_velocty' (sign 1) is no feature; did you mean 'cart velocity'?",
        ),
        ("rate = cart velocity /", "the end (sign 16) stands where a number"),
        (f"rate = {'(' * 51}pole angle{')' * 51}", "lies more than 50 deep"),
        (f"rate = pole angle{' + 1' * 130}", "more than 500; shorten it"),
        ("pole angle = cart velocity * 2", "name 'pole angle' stands twice"),
        (
            "none = cart velocity * 0 / (cart velocity * 0)",
            "has no value in 15,000 steps, first in",
        ),
        ("rate = cart velocity > 2", "is a condition and no number"),
    ],
)
def test_what_is_no_formula_is_said_as_it_is_typed(text: str, says: str) -> None:
    app = typed(open_page("names", data="cartpole"), text)
    (error,) = errors(app)
    assert says in error
    assert app.button(key="formula_take").disabled
    typed(app, TIME)
    assert not errors(app)
    assert not app.button(key="formula_take").disabled


def test_a_second_formula_of_one_name_is_refused() -> None:
    app = added(open_page("names", data="cartpole"), TIME)
    typed(app, TIME)
    (error,) = errors(app)
    assert "'time to the edge' stands twice" in error


def test_units_that_do_not_fit_are_warned_of_and_no_more() -> None:
    app = typed(open_page("names", data="cartpole"), "odd = cart position + cart velocity")
    (warning,) = app.warning
    assert "adds m and m/s, which do not fit" in warning.value
    app.button(key="formula_take").click().run()
    assert "formula_remove_0" in keys(app)
    assert "adds m and m/s" in texts(app)


def test_another_name_changes_no_formula_and_no_edit() -> None:
    app = added(open_page("names", data="cartpole"), TIME)
    type_into(app, 0, {0: {"Name": "place (m)"}, 1: {"Name": "speed"}})
    assert not errors(app)
    assert formulas(app)[0] == "'place (m)' / max(abs(speed), 0.1)"
    added(app, "haste = speed * speed")
    app.switch_page("rules.py").run()
    assert "time to the edge" in " ".join(app.dataframe[0].value["When"])
    app.switch_page("names.py").run()
    type_into(app, 0, {2: {"Name": "haste"}})
    (error,) = errors(app)
    assert "stands twice" in error
    app.button(key="names_back").click().run()
    assert formulas(app) == [
        "cart_position / max(abs(cart_velocity), 0.1)",
        "cart velocity * cart velocity",
    ]
    assert not errors(app)


def test_formulas_of_a_file_are_listed_and_can_be_removed(tmp_path: Path) -> None:
    made = with_formulas(load_demonstrations(CART), [TIME, "lean [rad] = abs(pole_angle)"])
    save_demonstrations(made, tmp_path / "made.parquet")
    content = (tmp_path / "made.parquet").read_bytes()
    app = upload(open_page("demonstrations"), ("made.parquet", content))
    app.switch_page("names.py").run()
    assert formulas(app)[1] == "abs(pole_angle)"
    app.button(key="formula_remove_1").click().run()
    app.button(key="formula_remove_0").click().run()
    app.switch_page("rules.py").run()
    rules = mine_rules(load_demonstrations(CART), supp_min=0.005, conf_min=0.95)
    assert len(app.dataframe[0].value) == len(rules.rules)


@pytest.mark.parametrize(
    "data", ["lunar_lander", "cartpole", "pendulum", "bipedal_walker", "driving"]
)
def test_the_example_of_each_data_set_can_be_taken_as_it_is(data: str) -> None:
    app = open_page("names", data=data)
    (example,) = codes(app)
    app.button(key="formula_example").click().run()
    assert not errors(app)
    assert not app.warning
    assert not app.button(key="formula_take").disabled
    assert example.split(" = ")[0].split(" [")[0] in texts(app)


def test_an_infinite_formula_is_drawn_where_it_is_finite() -> None:
    app = added(
        open_page("names", data="driving"), "far = 1 / max(20 - time to collision ahead, 0)"
    )
    assert "Infinite in 52 % of the steps" in texts(app).replace("\N{NO-BREAK SPACE}", " ")
    assert "largest infinite" in texts(app)
    app.switch_page("demonstrations.py").run()
    assert not app.exception
    assert "Infinite in 52 %" in texts(app).replace("\N{NO-BREAK SPACE}", " ")
    for page in ("rules", "episodes", "evidence", "what_if", "edit", "difference", "export"):
        app.switch_page(f"{page}.py").run()
        assert not app.exception, (page, app.exception)


def test_a_long_chain_of_operations_is_read_and_mined_with(tmp_path: Path) -> None:
    short = renamed(
        cart := load_demonstrations(CART), names_of(cart)._replace(features=tuple("xyzw"))
    )
    save_demonstrations(short, tmp_path / "short.parquet")
    content = (tmp_path / "short.parquet").read_bytes()
    app = upload(open_page("demonstrations"), ("short.parquet", content))
    app.switch_page("names.py").run()
    added(app, f"many = {'+'.join(['z'] * 200)}")
    app.switch_page("thresholds.py").run()
    app.toggle(key="_combinations").set_value(True).run()
    assert not app.exception
    assert "many" in html(open_rules(app)) + " ".join(app.dataframe[0].value["When"])


def open_rules(app: AppTest) -> AppTest:
    app.switch_page("rules.py").run()
    assert not app.exception
    return app


def test_a_rule_by_hand_asks_about_a_formula() -> None:
    app = added(open_page("names", data="cartpole"), TIME)
    app.switch_page("edit.py").run()
    place = app.selectbox(key=draft(app, "feature_0"))
    assert place.options[-1] == "time to the edge (s)"
    place.set_value(4)
    app.selectbox(key=draft(app, "sign_0")).select("above")
    app.number_input(key=draft(app, "at_0")).set_value(1.0)
    app.selectbox(key=draft(app, "action")).set_value(1).run()
    assert "If the time to the edge is above 1 s, then push right." in texts(app)
    app.button(key=draft(app, "save")).click().run()
    assert not app.exception
    made = with_formulas(load_demonstrations(CART), [TIME])
    applies = made.observations[:, 4] > 1.0
    assert 0 < applies.sum() < len(made)
    decides = dict(
        zip(app.dataframe[0].value["Kind"], app.dataframe[0].value["Decides"], strict=True)
    )
    assert decides["manual"] == applies.sum()
    # It belongs to the rules with this formula, whatever the formula is called.
    app.switch_page("names.py").run()
    app.button(key="formula_change_0").click().run()
    typed(app, TIME.replace("time to the edge", "time left"))
    app.button(key="formula_take").click().run()
    app.switch_page("edit.py").run()
    assert "time left > 1 s" in " ".join(app.dataframe[0].value["When"])
    app.switch_page("names.py").run()
    app.button(key="formula_remove_0").click().run()
    app.switch_page("edit.py").run()
    assert not app.exception
    assert "manual" not in list(app.dataframe[0].value["Kind"])
    app.switch_page("names.py").run()
    added(app, TIME)
    app.switch_page("edit.py").run()
    assert "manual" in list(app.dataframe[0].value["Kind"])
