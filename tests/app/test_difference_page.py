"""The page Compare: any two rule sets, counted by two shields."""

from __future__ import annotations

import re
from itertools import product

from sarl_core import Shield, load_demonstrations, mine_rules
from sarl_core.mining.rule_set import rules_to_json
from tests.app.screens import ROUTER, errors, html, open_page, texts

DATA = ROUTER.parents[1] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet")
COARSE = mine_rules(CARTPOLE, supp_min=0.05, conf_min=0.8)
FINE = mine_rules(CARTPOLE, supp_min=0.0, conf_min=1.0)


def said(rules):  # type: ignore[no-untyped-def]
    found = Shield(rules).decide_batch(CARTPOLE.observations, CARTPOLE.actions).rules[:, 0]
    return [rules.rules[index].action if index >= 0 else 2 for index in found.tolist()]


def test_two_sets_are_compared_on_the_demonstrations() -> None:
    app = open_page("difference", data="cartpole", support="0.05", confidence="0.8")
    one, other = said(COARSE), said(FINE)
    different = sum(a != b for a, b in zip(one, other, strict=True))
    assert f"decide {different:,} of {len(CARTPOLE):,} demonstrated states" in texts(app)
    assert re.search(r"\d\N{NO-BREAK SPACE}%\) differently", texts(app))  # kept on one line
    (table,) = (part for part in app.get("html") if 'class="sarl-confusion"' in part.proto.body)
    counted = re.findall(r'<td title="([^"]*)"[^>]*>([\d,]*)</td>', table.proto.body)
    assert len(counted) == 9
    words = ("push left", "push right", "no rule")
    for (title, cell), (row, column) in zip(counted, product(range(3), repeat=2), strict=True):
        count = sum((a, b) == (row, column) for a, b in zip(one, other, strict=True))
        assert title.startswith(f"at the thresholds: {words[row]}; unfiltered: {words[column]}; ")
        assert cell == (f"{count:,}" if count else "")
    examples = app.dataframe[0].value
    assert len(examples) == min(50, different)
    shown = examples[["At the thresholds says", "Unfiltered says"]]
    assert (shown.iloc[:, 0] != shown.iloc[:, 1]).all()
    rules = app.dataframe[1].value
    counts = rules["What"].value_counts()
    assert counts.get("added", 0) - counts.get("removed", 0) == len(FINE) - len(COARSE)
    app.button_group(key="kind").set_value("added").run()
    assert set(app.dataframe[1].value["What"]) == {"added"}


def test_a_set_that_was_compared_before_shows_the_same_again() -> None:
    app = open_page("difference", data="cartpole", first="filtered", second="unfiltered")
    first, rules = html(app), app.dataframe[1].value
    for second in ("compact", "unfiltered"):
        app.selectbox(key="second").set_value(second).run()
        assert (html(app) == first) == (second == "unfiltered")
        assert app.dataframe[1].value.equals(rules) == (second == "unfiltered")


def test_a_set_and_itself() -> None:
    app = open_page("difference", data="cartpole", first="filtered", second="filtered")
    assert "decide none" in texts(app)
    assert len(app.dataframe) == 0


def test_an_own_file_is_asked_for_and_one_for_something_else_is_refused() -> None:
    app = open_page("difference", data="cartpole", first="filtered", second="own file")
    assert "No rule file has been uploaded" in texts(app)
    pendulum = mine_rules(
        load_demonstrations(DATA / "pendulum.parquet"), supp_min=0.1, conf_min=0.8
    )
    content = rules_to_json(pendulum).encode()
    app.file_uploader(key="second_file").set_value(("far.json", content, "application/json"))
    app.run()
    (sentence,) = errors(app)
    assert "different features" in sentence
    content = rules_to_json(FINE).encode()
    app.file_uploader(key="second_file").set_value(("fine.json", content, "application/json"))
    app.run()
    assert not errors(app)
    assert "fine.json says" in html(app)


def test_one_action_of_several_at_a_time() -> None:
    app = open_page("difference", data="bipedal_walker", first="filtered", second="unfiltered")
    names = app.button_group(key="decided").options
    assert len(names) == 4
    app.button_group(key="decided").set_value(names[1]).run()
    assert not app.exception
    assert "action" not in app.query_params


def test_every_rule_set_that_is_offered_is_explained() -> None:
    app = open_page("difference", data="lunar_lander")
    choice = app.selectbox(key="first")
    assert len(choice.options) > 5
    for name in choice.options:
        assert f"{name[0].upper()}{name[1:]}: " in choice.help
