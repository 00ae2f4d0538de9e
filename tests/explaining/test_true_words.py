"""The words of a rule are true of the demonstrated states it applies to, and of no others."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sarl_core import Demonstrations, Rule, RuleSet, grow_policy_trees, mine_rules
from sarl_core.decimals import digits_across, digits_telling, rounded_text
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.figures.tree import path_queries
from sarl_core.explaining.html.lit_path import lit_path_table
from sarl_core.explaining.report.report import make_report
from sarl_core.explaining.state_path import PathFinder
from sarl_core.explaining.tables.rule_evidence import example_columns
from sarl_core.explaining.words.what_if import condition_views
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.envelope import with_splits
from sarl_core.mining.language import conditions_text, number_text, sentence
from sarl_core.mining.rule_set import rules_digest, rules_from_json, rules_to_json
from sarl_core.mining.rules import node_of
from sarl_core.rendering.replay import sentences

# --- what a reader understands -----------------------------------------------------------------

_NUMBER = r"(-?\d+(?:\.\d+)?(?:e[+-]\d+)?)"
_IN_WORDS = (
    (rf"the (.+) is above {_NUMBER}(?: .+)?", "above"),
    (rf"the (.+) is at most {_NUMBER}(?: .+)?", "at most"),
    (rf"the (.+) is between {_NUMBER} and {_NUMBER}(?: .+)?", "between"),
    (r"there is (no )?(.+)", "contact"),
)
_IN_SIGNS = (
    (rf"{_NUMBER} < (.+) ≤ {_NUMBER}(?: .+)?", "within"),
    (rf"(.+) > {_NUMBER}(?: .+)?", "above"),
    (rf"(.+) ≤ {_NUMBER}(?: .+)?", "at most"),
    (r"(no )?(left leg contact|contact force)", "contact"),
)

Read = Callable[[str], NDArray[np.bool_]]


def reader(
    forms: Sequence[tuple[str, str]], demonstrations: Demonstrations
) -> Callable[[str], NDArray[np.bool_]]:
    """Understands one condition as a person does: which demonstrated states it is true of."""
    columns = {
        feature.name: demonstrations.observations[:, place].astype(np.float64)
        for place, feature in enumerate(demonstrations.features)
    }

    def read(text: str) -> NDArray[np.bool_]:
        for form, kind in forms:
            found = re.fullmatch(form, text)
            if found is None:
                continue
            one, two, *more = found.groups()
            match kind:
                case "above":
                    return columns[one] > float(two)
                case "at most":
                    return columns[one] <= float(two)
                case "between":
                    return (columns[one] > float(two)) & (columns[one] <= float(more[0]))
                case "within":
                    return (columns[two] > float(one)) & (columns[two] <= float(more[0]))
                case "contact":
                    return columns[two] == (0.0 if one else 1.0)
        raise AssertionError(text)

    return read


def told(parts: Sequence[str], read: Read, count: int) -> NDArray[np.bool_]:
    """The demonstrated states that all parts of a sentence are true of."""
    holds = np.ones(count, dtype=np.bool_)
    for part in parts:
        holds &= read(part)
    return holds


def in_words(text: str) -> list[str]:
    """The conditions of a sentence."""
    if text.startswith("Always"):
        return []
    said = re.fullmatch(r"If (.+), then .+", text)
    assert said is not None
    return re.split(r", (?=the |there )| and (?=the |there )", said.group(1))


# --- demonstrations of any scale ---------------------------------------------------------------

NAMES = ("temp", "time", "left leg contact", "contact force")
UNITS = ("K", "", "", "")

_OFFSETS = st.one_of(
    st.sampled_from([0.0, 293.0, 1.7e9, -40.0, 1e-9, 1e28, -1e28, 1e-30, 16777216.0, 0.5]),
    st.floats(-1e9, 1e9, width=32),
)
_SCALES = st.sampled_from([1e-9, 1e-3, 0.37, 1.0, 1234.5, 1e9, 1e27])


@st.composite
def columns(draw: st.DrawFn, count: int) -> NDArray[np.float32]:
    """One feature: spread around an offset, or neighbouring 32-bit numbers."""
    offset = np.float32(draw(_OFFSETS))
    kind = draw(st.sampled_from(["spread", "neighbours", "binary", "unit"]))
    picks = np.array(draw(st.lists(st.integers(-40, 40), min_size=count, max_size=count)))
    if kind == "binary":
        return (picks > 0).astype(np.float32)
    if kind == "unit":
        return (np.abs(picks) / 40).astype(np.float32)
    if kind == "spread":
        return (offset + picks * draw(_SCALES)).astype(np.float32)
    values = [offset]
    for _ in range(80):
        values.append(np.nextafter(values[-1], np.float32(np.inf)))
    return np.array(values, dtype=np.float32)[picks + 40]


@st.composite
def demonstrations_of_any_scale(draw: st.DrawFn) -> Demonstrations:
    count = draw(st.integers(8, 40))
    states = np.stack([draw(columns(count)) for _ in NAMES], axis=1)
    actions = np.array(draw(st.lists(st.integers(0, 2), min_size=count, max_size=count)))
    episodes = np.repeat([0, 1], [count // 2, count - count // 2])
    return Demonstrations(states, actions, episodes, feature_names=NAMES, feature_units=UNITS)


def mined_sets(demonstrations: Demonstrations) -> list[RuleSet]:
    trees = grow_policy_trees(demonstrations)
    return [
        mine_rules(trees, supp_min=0.0, conf_min=0.0),
        mine_rules(trees, supp_min=0.02, conf_min=0.8),
        mine_rules(demonstrations, supp_min=0.0, conf_min=1.0),
        leaf_rules(trees),
    ]


def applies_to(rule: Rule, demonstrations: Demonstrations) -> list[bool]:
    return rule.applies(demonstrations.observations).tolist()


@given(demonstrations_of_any_scale())
def test_a_sentence_read_back_selects_the_states_of_the_rule(
    demonstrations: Demonstrations,
) -> None:
    words, signs = (reader(forms, demonstrations) for forms in (_IN_WORDS, _IN_SIGNS))
    count = len(demonstrations)
    for mined in mined_sets(demonstrations):
        # A file keeps what its sentences need, and a person may have no demonstrations at hand.
        for rule_set in (mined, rules_from_json(rules_to_json(mined))):
            describe = sentences(rule_set)
            for place, rule in enumerate(rule_set.rules):
                own = applies_to(rule, demonstrations)
                said = sentence(rule, rule_set, evidence=False)
                assert told(in_words(said), words, count).tolist() == own, said
                table = conditions_text(rule, rule_set)
                parts = [] if table == "always" else table.split(" and ")
                assert told(parts, signs, count).tolist() == own, table
                drawn = describe(place)
                assert told(in_words(drawn), words, count).tolist() == own, drawn


@given(demonstrations_of_any_scale(), st.integers(0, 10**6))
def test_a_condition_and_the_value_beside_it_agree(
    demonstrations: Demonstrations, pick: int
) -> None:
    (tree,) = grow_policy_trees(demonstrations)
    rule_set = leaf_rules([tree])
    # Between two demonstrated states, where no sentence was made to be true.
    states = demonstrations.observations
    rng = np.random.default_rng(pick)
    state = np.where(
        rng.random(states.shape[1]) < 0.5,
        states[pick % len(states)],
        np.nextafter(states[-1 - pick % len(states)], np.float32(rng.choice([-1e29, 1e29]))),
    )
    (rule,) = (one for one in rule_set.rules if one.applies(state[None])[0])
    names = {feature.name: place for place, feature in enumerate(demonstrations.features)}
    for view in condition_views(rule, tuple(state.astype(float).tolist()), rule_set):
        if not re.search(r"[≤>]", view.condition):
            continue  # yes or no
        name = next(one for one in names if one in view.condition)
        value = float(view.value.split()[0])
        asked = re.fullmatch(rf"(?:{_NUMBER} < )?{name} (?:>|≤) {_NUMBER}(?: K)?", view.condition)
        assert asked is not None, view.condition
        low, high = asked.groups()
        if " > " in view.condition:
            assert value > float(high)
        else:
            assert value <= float(high)
            assert low is None or value > float(low)


def kelvin() -> Demonstrations:
    """Temperatures around 293, told apart at 293.42."""
    rng = np.random.default_rng(0)
    states = rng.uniform(292.9, 294.1, (200, 1)).astype(np.float32)
    actions = (states[:, 0] > 293.42).astype(np.int64)
    return Demonstrations(states, actions, np.zeros(200, dtype=np.int64), feature_names=("temp",))


def test_an_offset_takes_more_digits_and_no_noise() -> None:
    demonstrations = kelvin()
    rule_set = mine_rules(demonstrations, supp_min=0.0, conf_min=0.95)
    texts = [
        *(sentence(rule, rule_set) for rule in rule_set.rules),
        rules_to_markdown(rule_set),
        rule_set.to_text(),
        *(row["rule"] for row in csv.DictReader(io.StringIO(rules_to_csv(rule_set)))),
    ]
    numbers = [one for text in texts for one in re.findall(r"293\.\d+", text)]
    assert len(numbers) == 8
    assert len(set(numbers)) == 1
    assert len(numbers[0]) <= len("293.421")
    states = demonstrations.observations[:, 0]
    above = states > float(numbers[0])
    assert (above == (states > 293.42)).all()


def test_markdown_read_back_selects_the_states_of_the_rule() -> None:
    demonstrations = kelvin()
    rule_set = mine_rules(demonstrations, supp_min=0.0, conf_min=0.95)
    signs = reader(_IN_SIGNS, demonstrations)
    rows = [line for line in rules_to_markdown(rule_set).splitlines() if re.match(r"\| R\d", line)]
    assert len(rows) == 2
    for row in rows:
        name, asked, *_ = row.strip("| ").split(" | ")
        rule = rule_set.rules[int(name[1:]) - 1]
        assert signs(asked.replace("&gt;", ">")).tolist() == applies_to(rule, demonstrations)


def test_what_is_drawn_of_a_tree_is_true() -> None:
    demonstrations = kelvin()
    (tree,) = grow_policy_trees(demonstrations)
    signs = reader(_IN_SIGNS, demonstrations)
    for rule in mine_rules([tree], supp_min=0.0, conf_min=0.95).rules:
        (asked,) = path_queries(tree, tree.path(node_of(rule)))
        assert signs(asked).tolist() == applies_to(rule, demonstrations)


def test_example_states_stay_on_their_side_of_the_sentence() -> None:
    demonstrations = kelvin()
    (tree,) = grow_policy_trees(demonstrations)
    rule_set = mine_rules([tree], supp_min=0.0, conf_min=0.95)
    for rule in rule_set.rules:
        (limit,) = re.findall(r"293\.\d+", sentence(rule, rule_set))
        shown = example_columns(demonstrations, tree, rule, count=200)["temp"]
        assert len(shown) == rule.samples
        values = np.array(shown, dtype=np.float64)
        assert ((values > float(limit)) == (rule.conditions[0].op == ">")).all()


def test_the_way_of_a_state_is_told_with_numbers_that_agree() -> None:
    rule_set = mine_rules(kelvin(), supp_min=0.0, conf_min=0.95)
    threshold = rule_set.rules[0].conditions[0].threshold
    for toward in (-np.inf, np.inf):
        state = np.array([np.nextafter(np.float32(threshold), np.float32(toward))])
        table = lit_path_table(PathFinder(rule_set).path(0, state, -1), rule_set, 0)
        asked = re.search(r'temp (≤|&gt;) ([\d.]+)</td><td class="n">([\d.]+)<', table)
        assert asked is not None, table
        sign, limit, value = asked.groups()
        assert (float(value) <= float(limit)) == (sign == "≤") == (state[0] <= threshold)


def test_a_threshold_that_lies_anywhere_in_its_gap_is_no_longer_than_it_must() -> None:
    demonstrations = kelvin()
    (tree,) = grow_budgeted_trees(demonstrations, max_rules=2)
    rule_set = leaf_rules([tree])
    for rule in rule_set.rules:
        (limit,) = re.findall(r"293\.\d+", conditions_text(rule, rule_set))
        assert len(limit) <= len("293.421")


def test_a_force_of_contact_is_no_flag() -> None:
    states = np.array([[0.1], [0.2], [0.6], [0.9]] * 5, dtype=np.float32)
    actions = (states[:, 0] > 0.5).astype(np.int64)
    episodes = np.zeros(len(states), dtype=np.int64)
    for values, told_as in ((states, "contact is above 0.4"), (states > 0.5, "there is contact")):
        shown = Demonstrations(
            values.astype(np.float32), actions, episodes, feature_names=("contact",)
        )
        rule_set = mine_rules(shown, supp_min=0.0, conf_min=0.95)
        assert any(told_as in sentence(rule, rule_set) for rule in rule_set.rules)


def test_what_is_known_around_thresholds_is_no_part_of_the_rules() -> None:
    rule_set = mine_rules(kelvin(), supp_min=0.0, conf_min=0.95)
    bare = rules_from_json(
        re.sub(r',\s*"splits": \[\s*\[[^]]*\]\s*\]', "", rules_to_json(rule_set))
    )
    assert bare.source.features[0].splits is None
    assert bare.source == rule_set.source
    assert rules_digest(bare) == rules_digest(rule_set)
    # Without it, the number parts all 32-bit numbers, and is still no noise.
    said = conditions_text(bare.rules[0], bare)
    (limit,) = re.findall(r"293\.\d+", said)
    assert len(limit) <= len("293.42123")
    threshold = bare.rules[0].conditions[0].threshold
    near = np.float32(threshold)
    for value in (near, *(np.nextafter(near, np.float32(way)) for way in (-np.inf, np.inf))):
        assert (float(value) <= float(limit)) == (float(value) <= threshold)


@pytest.mark.parametrize(
    ("splits", "says"),
    [
        ("[[1.0, 0.5, 0.75]]", "not in ascending order"),
        ("[[1.0, 0.5, 2], [0.0, -1, 0.5]]", "not in ascending order"),
        ("[[1.0, 0.5]]", "the two values around it"),
        ('[[1.0, "a", 2]]', "no number"),
        ("[[null, 0, 2]]", "no number"),
        (f"[[1.0, 0, 1{'0' * 400}]]", "no number"),
        ("[[NaN, 0, 1]]", "no number"),
    ],
)
def test_splits_that_are_none_are_refused(splits: str, says: str) -> None:
    from sarl_core import InputError

    text = rules_to_json(mine_rules(kelvin(), supp_min=0.0, conf_min=0.95))
    broken = re.sub(r'"splits": \[\s*\[[^]]*\]\s*\]', f'"splits": {splits}', text)
    assert broken != text
    with pytest.raises(InputError, match=says) as refused:
        rules_from_json(broken)
    assert len(str(refused.value)) < 300


def test_a_value_is_written_as_far_from_its_threshold_as_it_is() -> None:
    rule_set = mine_rules(kelvin(), supp_min=0.0, conf_min=0.95)
    rule = next(one for one in rule_set.rules if one.conditions[0].op == ">")
    threshold = rule.conditions[0].threshold
    for way in (1e-4, 0.01, 0.1, 0.5):
        (view,) = condition_views(rule, (float(np.float32(threshold + way)),), rule_set)
        limit, value, room = map(float, (view.condition.split()[-1], view.value, view.room))
        assert value - limit == pytest.approx(room, rel=0.25)


@given(st.floats(-1e9, 1e9, width=32), st.floats(1e-6, 1e3))
def test_the_ends_of_a_range_keep_how_wide_it_is(low: float, width: float) -> None:
    high = float(np.float32(low + width))
    if high > low:
        ends = [
            float(number_text(one, apart_from=other)) for one, other in ((low, high), (high, low))
        ]
        assert ends[1] - ends[0] == pytest.approx(high - low, rel=0.21)


@given(st.floats(1e-9, 1e9), st.floats(1.1, 1e6))
def test_digits_tell_a_step(step: float, times: float) -> None:
    largest = step * times
    digits = digits_telling(step, largest)
    texts = {f"{largest - place * 1.01 * step:.{digits}g}" for place in range(2)}
    assert len(texts) == 2
    assert digits_telling(0.0, largest) == digits_telling(step, np.inf) == 4


def test_two_large_numbers_are_told_apart_without_an_exponent() -> None:
    assert number_text(1000000.0625, apart_from=1000000.0) == "1000000.06"
    assert number_text(1000000.0, apart_from=1000000.0625) == "1000000"


def test_digits_tell_the_numbers_of_a_column() -> None:
    rewards = np.array([1000.25, 1000.75, np.nan, np.inf])
    assert digits_across(rewards) == 8
    assert len({f"{value:.{digits_across(rewards)}g}" for value in rewards[:2]}) == 2
    assert digits_across(np.array([])) == digits_across(np.full(3, 293.4)) == 4


def test_a_state_that_is_none_leaves_the_sentence_as_it_is() -> None:
    rule_set = mine_rules(kelvin(), supp_min=0.0, conf_min=0.95)
    rule = rule_set.rules[0]
    for value in (np.nan, np.inf, -np.inf):
        assert sentence(rule, rule_set, state=[value]) == sentence(rule, rule_set)
    table = lit_path_table(PathFinder(rule_set).path(0, np.array([np.nan]), -1), rule_set, 0)
    assert ">not a number<" in table


def test_rules_that_came_without_it_learn_what_was_demonstrated() -> None:
    demonstrations = kelvin()
    rule_set = mine_rules(demonstrations, supp_min=0.0, conf_min=0.95)
    source = rule_set.source.with_splits([None])
    bare = replace(rule_set, source=source)
    said = [conditions_text(rule, rule_set) for rule in rule_set.rules]
    taught = with_splits(bare, demonstrations)
    assert [conditions_text(rule, bare) for rule in bare.rules] != said
    assert [conditions_text(rule, taught) for rule in taught.rules] == said
    # What is known stays, whatever the rules are shown beside.
    half = Demonstrations(
        demonstrations.observations[::2],
        demonstrations.actions[::2],
        demonstrations.episodes[::2],
        feature_names=("temp",),
    )
    shown = with_splits(taught, half)
    assert [conditions_text(rule, shown) for rule in shown.rules] == said
    report = make_report(bare, demonstrations, frames=0).html
    assert all(text.split()[-1] in report for text in said)
    assert bare.rules[0].conditions[0].threshold != float(said[0].split()[-1])
    assert conditions_text(bare.rules[0], bare).split()[-1] not in report


def test_a_rounded_number_has_a_true_minus_sign_and_none_before_zero() -> None:
    numbers = (1213.4, -191.0, -0.4, 0.0, float("nan"), -float("inf"))
    assert [rounded_text(number) for number in numbers] == ["1,213", "−191", "0", "0", "–", "–"]
    assert (rounded_text(-0.04, 1), rounded_text(-1.25, 2)) == ("0.0", "−1.25")
