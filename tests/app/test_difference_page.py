"""The page Compare: any two rule sets, counted by two shields."""

from __future__ import annotations

import re
from itertools import product

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Shield, load_demonstrations, mine_rules
from sarl_core.mining.language import share_text
from sarl_core.mining.rule_set import rules_to_json
from tests.app.screens import ROUTER, compare, errors, html, open_page, texts, upload_rules

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
        assert title.startswith(f"in force: {words[row]}; unfiltered: {words[column]}; ")
        assert cell == (f"{count:,}" if count else "")
    examples = app.dataframe[0].value
    assert len(examples) == min(50, different)
    shown = examples[["In force says", "Unfiltered says"]]
    assert (shown.iloc[:, 0] != shown.iloc[:, 1]).all()
    rules = app.dataframe[1].value
    counts = rules["What"].value_counts()
    assert counts.get("added", 0) - counts.get("removed", 0) == len(FINE) - len(COARSE)
    app.button_group(key="kind").set_value("added").run()
    assert set(app.dataframe[1].value["What"]) == {"added"}


def test_a_set_that_was_compared_before_shows_the_same_again() -> None:
    app = open_page("difference", data="cartpole", sets="filtered|unfiltered")
    first, rules = html(app), app.dataframe[1].value
    for second in ("compact", "unfiltered"):
        compare(app, "filtered", second)
        assert (html(app) == first) == (second == "unfiltered")
        assert app.dataframe[1].value.equals(rules) == (second == "unfiltered")


def overview(app: AppTest, label: str = "What each rule set comes to") -> list[dict[str, str]]:
    """A table of all sets; the first says what each of them comes to."""
    (table,) = re.findall(rf'aria-label="{label}".*?</table>', html(app), flags=re.DOTALL)
    heads = re.findall(r"<th scope[^>]*>(.*?)</th>", table)
    rows = re.findall(r"<tr>(<td.*?)</tr>", table)
    return [dict(zip(heads, re.findall(r"<td[^>]*>(.*?)</td>", row), strict=True)) for row in rows]


def test_a_set_and_one_like_it() -> None:
    app = open_page("difference", data="cartpole", sets="filtered|at the thresholds")
    assert "decide none" in texts(app)
    assert not app.dataframe


def test_one_set_is_none_to_compare() -> None:
    app = open_page("difference", data="cartpole", sets="filtered")
    assert "at least two rule sets" in texts(app)
    assert not app.dataframe


def test_five_sets_are_held_against_each_other_and_two_are_looked_at_closely() -> None:
    names = ["unfiltered", "filtered", "compact", "compact, two features", "at the thresholds"]
    app = open_page("difference", data="cartpole", sets="|".join(names))
    assert not errors(app)
    lines = overview(app)
    assert [line["Rule set"] for line in lines] == names
    filtered = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)
    counts = [len(FINE), len(filtered), 3, 2, len(filtered)]
    assert [line["Rules"] for line in lines] == [f"{count:,}" for count in counts]
    assert lines[1]["Coverage"] == share_text(filtered.coverage)
    different = [a != b for a, b in zip(said(FINE), said(filtered), strict=True)]
    share = share_text(sum(different) / len(different), decimals=1)
    against = overview(app, "How often two of the rule sets decide differently")
    assert [line["Rule set"] for line in against] == names[1:]
    assert against[0]["unfiltered"] == share
    assert against[0]["filtered"] == ""  # itself
    assert against[-1]["filtered"] == "0 %"
    assert "Filtered says" in " ".join(app.dataframe[0].value)
    app.selectbox(key="against").set_value("compact").run()
    assert "Compact says" in " ".join(app.dataframe[0].value)


def test_a_file_is_compared_and_one_for_something_else_is_refused() -> None:
    app = open_page("difference", data="cartpole")
    pendulum = mine_rules(
        load_demonstrations(DATA / "pendulum.parquet"), supp_min=0.1, conf_min=0.8
    )
    upload_rules(app, "far.json", rules_to_json(pendulum).encode())
    (sentence,) = errors(app)
    assert "different features" in sentence
    upload_rules(app, "fine.json", rules_to_json(FINE).encode())
    assert not errors(app)
    (kept,) = [name for name in app.multiselect(key="_sets_choice").options if "fine" in name]
    assert kept == "fine.json"
    identifier = app.query_params["set"]
    compare(app, "filtered", str(identifier))
    assert "fine.json says" in html(app)


@pytest.mark.parametrize("name", ["nonsense", "a" * 26])
def test_a_link_to_rules_that_are_not_there_says_so(name: str) -> None:
    app = open_page("difference", data="cartpole", sets=f"filtered|unfiltered|{name}")
    assert not app.exception
    assert "There are no rules called" in texts(app) or "has nothing with the id" in texts(app)
    assert "decide" in texts(app)


def test_one_action_of_several_at_a_time() -> None:
    app = open_page("difference", data="bipedal_walker", sets="filtered|unfiltered")
    names = app.selectbox(key="decided").options
    assert len(names) == 4
    app.selectbox(key="decided").set_value(names[1]).run()
    assert not app.exception
    assert "action" not in app.query_params


def test_every_rule_set_that_is_offered_is_explained() -> None:
    app = open_page("difference", data="lunar_lander")
    choice = app.multiselect(key="_sets_choice")
    assert len(choice.options) > 5
    for name in choice.options:
        assert f"{name[0].upper()}{name[1:]}: " in choice.help


def test_no_rules_are_no_set_to_compare() -> None:
    app = open_page("difference", data="cartpole", sets="none|unfiltered|filtered")
    assert "“none” is no rule set" in texts(app)
    assert app.dataframe


def test_rules_that_are_switched_off_count_for_nothing() -> None:
    app = open_page("edit", data="cartpole")
    app.button(key="edit_switch").click().run()
    app.switch_page("difference.py").run()
    before, after = overview(app)
    rules = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95).rules
    lengths = sorted(rule.length for rule in rules)
    assert before["Mean length"] == f"{sum(lengths) / len(lengths):.1f}"
    assert int(after["Rules"]) == int(before["Rules"]) - 1
    others = [f"{(sum(lengths) - one) / (len(lengths) - 1):.1f}" for one in lengths]
    assert after["Mean length"] in others
