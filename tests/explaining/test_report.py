from __future__ import annotations

import dataclasses
import re
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sarl_core import (
    Demonstrations,
    Environment,
    InputError,
    RuleSet,
    load_demonstrations,
    mine_rules,
    with_formulas,
)
from sarl_core.explaining.report.comparison import Result
from sarl_core.explaining.report.provenance import mining_command
from sarl_core.explaining.report.report import Wishes, make_report
from sarl_core.explaining.report.rule_set_card import read_card
from sarl_core.explaining.report.tally import Share, tally
from sarl_core.explaining.words.cross_fit import judged_sentence, parting_text
from sarl_core.mining.editing.rounding import merged_rules, rounded_rules
from sarl_core.mining.language import share_text
from sarl_core.mining.rule_set import rules_digest
from sarl_core.mining.rules import UNFILTERED
from sarl_core.mining.validation.cross_fitting import cross_fit
from sarl_core.mining.validation.holding_out import hold_out, with_held_out

DATA = Path(__file__).parents[2] / "data"
PLAIN = {"frames": 0}
HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>{{ 7*7 }}"
VOID = {"meta", "img", "br", "rect", "line", "circle"}


class Page(HTMLParser):
    """What a browser would make of a report."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")


@pytest.fixture(scope="module")
def rules(cart: Demonstrations) -> RuleSet:
    return mine_rules(cart, supp_min=0.005, conf_min=0.95)


def named(demonstrations: Demonstrations, text: str) -> Demonstrations:
    """The same, with a text in every place where a name may stand."""
    d = demonstrations.observations.shape[1]
    return dataclasses.replace(
        demonstrations,
        feature_names=tuple(f"{text} {index}" for index in range(d)),
        feature_units=(text,) * d,
        action_names=(text,),
        label_names=(tuple(f"{text} {label}" for label in range(2)),),
        agent=text,
        env_id=text,
        notes=(text,),
    )


def test_a_report_is_one_file_that_asks_for_nothing(cart: Demonstrations, rules: RuleSet) -> None:
    wishes = {"frames": 1, "in_full": 3, "episodes": 2}
    report = make_report(rules, cart, **wishes)
    page = Page(report.html)
    assert not {"script", "link", "iframe", "object", "form"} & {tag for tag, _ in page.tags}
    for tag, attributes in page.tags:
        for name, value in attributes.items():
            assert not name.startswith("on")
            if name in ("src", "href"):
                assert (value or "").startswith("data:image/png;base64," if tag == "img" else "#")
    assert "url(" not in report.html
    assert "@import" not in report.html
    images = [attributes for tag, attributes in page.tags if tag == "img"]
    assert len(images) == report.pictures >= 2
    assert all(attributes["alt"] for attributes in images)
    # They may be printed on the page after their rule, so they name it.
    within, named = "", []
    for tag, attributes in page.tags:
        within = attributes["id"] or "" if tag == "article" else within
        if attributes.get("class") == "frames":
            named.append((within, (attributes["aria-label"] or "").split()[-1]))
    assert len(named) >= 2
    assert all(rule == told.replace("R", "rule-") for rule, told in named)
    assert all(f"Example states of {told}" in page.text for _, told in named)
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    targets = {(a["href"] or "")[1:] for tag, a in page.tags if tag == "a"}
    assert targets <= set(ids)
    assert make_report(rules, cart, **wishes).html == report.html


def test_headings_do_not_skip_a_level(cart: Demonstrations, two_torques: Demonstrations) -> None:
    for data in (cart, two_torques):
        found = mine_rules(data, supp_min=0.05, conf_min=0.9)
        page = Page(make_report(found, data, **PLAIN).html)
        levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h\d", tag)]
        assert levels[0] == 1
        assert levels.count(1) == 1
        assert all(after <= before + 1 for before, after in pairwise(levels))


def test_counts_are_those_of_the_data(cart: Demonstrations, rules: RuleSet) -> None:
    text = Page(make_report(rules, cart, **PLAIN).html).text
    covered = np.zeros(len(cart), dtype=bool)
    for rule in rules.rules:
        inside = np.ones(len(cart), dtype=bool)
        for feature, op, threshold in rule.conditions:
            column = cart.observations[:, feature].astype(np.float64)
            inside &= column <= threshold if op == "<=" else column > threshold
        right = int((cart.actions[inside].reshape(-1) == rule.action).sum())
        assert f"{right:,} of {int(inside.sum()):,} states" in text
        covered |= inside
    assert f"{int(covered.sum()):,} of 15,000 demonstrated states" in text


def test_the_plane_holds_what_mining_gives(cart: Demonstrations, rules: RuleSet) -> None:
    html = make_report(rules, cart, **PLAIN).html
    plane = html.split('<table class="plane">')[1].split("</table>")[0]
    supports = [float(value) for value in re.findall(r'<th scope="col">([\d.]+)</th>', plane)]
    rows = re.findall(r'<tr><th scope="row">([\d.]+)</th>(.*?)</tr>', plane, flags=re.S)
    assert supports == [0, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20]
    assert [float(confidence) for confidence, _ in rows] == [100, 99, 95, 90, 80, 70, 60, 50]
    for confidence, cells in rows[1:4]:
        counts = [int(count.replace(",", "")) for count in re.findall(r">([\d,]+)</td>", cells)]
        for support, count in list(zip(supports, counts, strict=True))[2:5]:
            mined = mine_rules(cart, supp_min=support / 100, conf_min=float(confidence) / 100)
            assert len(mined) == count
    (chosen,) = re.findall(r'class="chosen" aria-label="(.*?)"', plane)
    assert chosen == f"{len(rules)}, chosen"


def test_names_from_files_are_only_ever_text(cart: Demonstrations) -> None:
    data = named(cart, HOSTILE)
    found = mine_rules(data, supp_min=0.005, conf_min=0.95)
    result = Result(HOSTILE, HOSTILE, 1, 2, 3, 1.0, 1.0, 1.0, 0.0, 2.0, 0.5, 0.5, None)
    report = make_report(
        found,
        data,
        rules_name=HOSTILE,
        demonstrations_name=HOSTILE,
        commands=(HOSTILE,),
        card={"chosen_by": HOSTILE, "reported_on": HOSTILE, "command": HOSTILE},
        comparison=(result,),
    )
    page = Page(report.html)
    assert not {"script", "img"} & {tag for tag, _ in page.tags}
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert "<script>" in page.text
    assert "{{ 7*7 }}" in page.text
    assert page.text.count("alert(1)") > 20
    assert "There are no pictures of states" in page.text


def test_of_a_large_set_some_stand_in_full_and_the_rest_in_a_table(cart: Demonstrations) -> None:
    found = mine_rules(cart, supp_min=0.0, conf_min=1.0)
    report = make_report(found, cart, **PLAIN, in_full=20)
    page = Page(report.html)
    assert report.in_full == 20
    assert sum(a.get("class") == "rule" for tag, a in page.tags if tag == "article") == 20
    assert f"There are {len(found):,} rules" in page.text
    ids = {a["id"] for _, a in page.tags if (a.get("id") or "").startswith("rule-")}
    assert ids == {f"rule-{number}" for number in range(1, len(found) + 1)}
    assert len(report.html) < 3_000_000
    shown = [int(n.replace(",", "")) for n in re.findall(r"\(([\d,]+) states?\)", page.text)][:20]
    assert shown == sorted((rule.samples for rule in found.rules), reverse=True)[:20]


def test_continuous_actions_in_several_dimensions(two_torques: Demonstrations) -> None:
    found = mine_rules(two_torques, supp_min=0.05, conf_min=0.8, divider=12)
    page = Page(make_report(found, two_torques, **PLAIN, in_full=4).html)
    assert "divided into 12 equal intervals" in page.text
    assert {"hip", "knee"} <= {word.strip() for word in page.words}
    for dimension in range(2):
        count = int((tally(found, two_torques).rules[:, dimension] >= 0).sum())
        assert f"{count:,} of 600 demonstrated states" in page.text


def test_without_a_rule_the_report_says_so(cart: Demonstrations) -> None:
    empty = mine_rules(cart, supp_min=0.9, conf_min=1.0)
    assert len(empty) == 0
    assert "There is no rule" in Page(make_report(empty, cart).html).text


def test_compact_rules_are_told_by_their_budget_and_their_card() -> None:
    path = DATA / "rules" / "lunar_lander_compact.json"
    data = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    card = read_card(path)
    assert card is not None
    rule_set = RuleSet.load(path)
    page = Page(make_report(rule_set, data, **PLAIN, card=card).html)
    assert f"The budget was {card['budget']:,} rules" in page.text
    assert f"{card['reported']['mean']:.0f}" in page.text
    assert f"made from these states and more, {rule_set.source.steps:,} states" in page.text
    assert "plane" not in {a.get("class") for tag, a in page.tags if tag == "table"}


def test_an_environment_that_cannot_be_had_leaves_a_report_without_pictures(
    cart: Demonstrations, rules: RuleSet
) -> None:
    for env_id, reason in (
        ("Nowhere-v9", "Nowhere-v9"),
        ("antigravity:CartPole-v1", "names a module to import"),
        ("", "do not say which environment"),
        ("Acrobot-v1", "4 features"),
    ):
        data = dataclasses.replace(cart, env_id=env_id)
        source = dataclasses.replace(rules.source, env_id=env_id, digest=data.digest)
        found = dataclasses.replace(rules, source=source)
        report = make_report(found, data, episodes=1)
        assert reason in report.without
        assert report.pictures == 0
        assert report.without in Page(report.html).text
    with pytest.raises(InputError, match="Nowhere-v9"):
        make_report(rules, cart, env_id="Nowhere-v9")


def test_held_out_episodes_stand_beside_what_was_mined(cart: Demonstrations) -> None:
    split = hold_out(cart, 0.3, seed=1)
    found = with_held_out(mine_rules(split.mined, supp_min=0.005, conf_min=0.95), split.held_out)
    assert tally(found, cart).split
    text = Page(make_report(found, cart, **PLAIN).html).text
    assert f"read off from {split.mined.n_episodes} episodes of these" in text
    for rule in found.rules:
        held = rule.held_out
        assert held is not None
        assert f"{held.correct:,} of {held.samples:,} state" in text
    assert "of this report's demonstrations" not in text
    assert not tally(found, split.held_out).split


def test_other_features_and_actions_are_refused_in_one_sentence(
    cart: Demonstrations, rules: RuleSet, two_torques: Demonstrations
) -> None:
    other = dataclasses.replace(cart, feature_names=("a", "b", "c", "d"), env_id="")
    three = dataclasses.replace(cart, label_names=(("x", "y", "z"),))
    continuous = dataclasses.replace(
        cart,
        actions=cart.actions.astype(np.float32).reshape(-1, 1),
        label_names=None,
        label_first=None,
    )
    for data, words in (
        (two_torques, "4 features and the demonstrations have 3"),
        (other, "'cart position' in the rules and 'a'.*a, b, c, d"),
        (three, "2 values in the rules and 3"),
        (continuous, "continuous"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            make_report(rules, data, **PLAIN)
        assert "\n" not in str(caught.value)


def test_of_one_environment_the_report_speaks_as_the_demonstrations_do(
    cart: Demonstrations, rules: RuleSet
) -> None:
    data = dataclasses.replace(
        cart, feature_names=("a", "b", "tilt", "d"), label_names=(("left!", "right!"),)
    )
    assert data.env_id == rules.source.env_id
    html = make_report(rules, data, **PLAIN).html
    text = Page(html).text
    assert "the tilt is" in text
    assert "right!" in text
    assert "pole angle" not in text
    assert rules_digest(rules) in text  # of the rules as they came


def test_only_a_command_that_makes_these_rules_is_printed(
    cart: Demonstrations, rules: RuleSet
) -> None:
    mined = mining_command(
        rules, "rules.json", "cart.parquet", cart, env=Environment("CartPole-v1")
    )
    assert mined is not None
    assert "--setting filtered --env CartPole-v1 --out rules.json" in mined
    wishes = PLAIN | {"commands": (mined, "python -m sarl_core report rules.json")}
    text = Page(make_report(rules, cart, **wishes).html).text
    assert mined in text
    assert "These commands make the rules and this file again" in text
    changed = (
        rounded_rules(rules, cart).rule_set,
        merged_rules(mine_rules(cart, supp_min=0.001, conf_min=0.99)),
        dataclasses.replace(rules, rules=rules.rules[1:]),
        dataclasses.replace(rules, actions=(dataclasses.replace(rules.actions[0], name="x"),)),
    )
    for rule_set in changed:
        assert rule_set.rules != rules.rules or rule_set.actions != rules.actions
        text = Page(make_report(rule_set, cart, **wishes).html).text
        assert "sarl_core mine" not in text
        assert "This command makes this file again" in text


@pytest.mark.parametrize("wrong", [{"frames": 13}, {"in_full": -1}, {"episodes": 0}, {"seed": -1}])
def test_what_no_report_can_hold_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(InputError, match="give one from"):
        Wishes(**wrong)


def test_of_nothing_there_is_no_share() -> None:
    assert np.isnan(Share(0, 0).value)


def test_what_rules_were_made_from_has_no_interval_and_other_episodes_have(
    cart: Demonstrations,
) -> None:
    mined, other = hold_out(cart, 0.3)
    rules = with_held_out(mine_rules(mined, supp_min=0.005, conf_min=0.95), other)
    text = Page(make_report(rules, cart, **PLAIN).html).text
    for rule in rules.rules:
        told = rule.held_out
        assert f"{rule.correct:,} of {rule.samples:,} states" in text
        assert f"{told.correct:,} of {told.samples:,} states" in text
        assert told.episodes >= 5
        assert (
            f"{share_text(told.share)} of its states in an episode of episodes kept aside, which "
            f"it was not made from, on average over {told.episodes} episodes between "
            f"{share_text(told.low)[:-2]} and {share_text(told.high)} is what that can tell; "
            f"of all together: {told.correct:,} of {told.samples:,} states"
        ) in text
    # Of what they were mined from alone, nothing of that kind is said.
    plain = Page(make_report(mine_rules(cart, supp_min=0.005, conf_min=0.95), cart, **PLAIN).html)
    assert "of its states in an episode" not in plain.text


def test_rules_of_other_demonstrations_are_judged_by_episodes(cart: Demonstrations) -> None:
    first, rest = hold_out(cart, 0.5)
    rules = mine_rules(first, supp_min=0.02, conf_min=0.95)
    told = with_held_out(rules, rest).rules[0].held_out
    text = Page(make_report(rules, rest, **PLAIN).html).text
    assert f"{told.correct:,} of {told.samples:,} states" in text
    assert f"on average over {told.episodes} episodes between {share_text(told.low)[:-2]}" in text


def test_rules_that_know_few_episodes_are_doubted(cart: Demonstrations) -> None:
    rules = mine_rules(cart, supp_min=0.0, conf_min=1.0)
    few = sum(
        len(np.unique(cart.episodes[rule.applies(cart.observations)])) < 5 for rule in rules.rules
    )
    assert 0 < few < len(rules)
    text = Page(make_report(rules, cart, **PLAIN).html).text
    assert f"{few:,} rules have their states in fewer than 5 of the 30 episodes" in text


@pytest.mark.parametrize("content", ["[]", "{", "\x00", "[" * 100_000])
def test_a_card_that_is_none_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "rules.card.json").write_text(content)
    with pytest.raises(InputError, match="card"):
        read_card(tmp_path / "rules.json")


def test_a_card_with_odd_values_is_told_as_far_as_it_goes(cart: Demonstrations) -> None:
    path = DATA / "rules" / "cartpole_compact.json"
    odd = {"budget": "many", "rounds": 3, "reported": {"mean": float("nan")}, "refined": "yes"}
    page = Page(make_report(RuleSet.load(path), cart, **PLAIN, card=odd).html)
    assert "The budget" not in page.text


def test_what_rules_are_worth_elsewhere_stands_below_what_they_are_here(
    cart: Demonstrations,
) -> None:
    rules = mine_rules(cart, supp_min=0.0, conf_min=1.0)
    found = cross_fit(cart).at(UNFILTERED)
    text = Page(make_report(rules, cart, **PLAIN).html).text
    assert judged_sentence(found) in text
    assert parting_text(1.0, found) in text
    # Rules that were changed cannot be mined again without an episode.
    some = dataclasses.replace(rules, rules=rules.rules[1:])
    assert "mined without it" not in Page(make_report(some, cart, **PLAIN).html).text


def test_formulas_are_listed_and_an_infinite_value_is_said_in_words():
    formulas = [
        "time & all [s] = cart_position / max(abs(cart_velocity), 0.1)",
        "far = 1 / max(abs(pole_angle) - 0.05, 0)",
    ]
    made = with_formulas(
        load_demonstrations(DATA / "demonstrations" / "cartpole.parquet"), formulas
    )
    rules = mine_rules(made, supp_min=0.05, conf_min=0.9)
    text = Page(make_report(rules, made, **PLAIN).html).text
    assert "by formulas that a person wrote:" in text
    for formula in formulas:
        assert formula in text
    assert re.search(r"far [\d.]+ infinite infinite", text)


def test_a_formula_that_is_infinite_somewhere_has_a_bar_all_the_same(cart: Demonstrations) -> None:
    formula = "way = (pole angle + 0.3 * pole angular velocity) / max(cart velocity, 0)"
    data = with_formulas(cart, [formula])
    assert np.isinf(data.observations).any()
    rules = mine_rules(data, supp_min=0.002, conf_min=0.8)
    assert any(one.feature == 4 for rule in rules for one in rule.conditions)
    html = make_report(rules, data, **PLAIN).html
    assert "nan%" not in html
    assert "inf%" not in html
