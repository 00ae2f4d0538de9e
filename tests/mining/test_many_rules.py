"""What is worked out for all rules of a set at once: exactly what comes of each by itself."""

from __future__ import annotations

import csv
import io
import json
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core import Demonstrations, Rule, RuleSet, mine_rules
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.language import Wording, conditions_text, merged_length, sentence
from sarl_core.mining.rule_files import writing
from sarl_core.mining.rule_files.writing import rule_document
from sarl_core.mining.rule_set import exact_texts, rules_to_json
from sarl_core.mining.rules import Bounds, Condition, along_paths, share_bounds


@pytest.fixture(scope="module")
def rules(lander_like: Demonstrations) -> RuleSet:
    return mine_rules(lander_like, supp_min=0.0, conf_min=1.0)


def fresh(rules: RuleSet, conditions: list[tuple[Condition, ...]] | None = None) -> RuleSet:
    """The same rules, of which nothing was worked out."""
    queries = conditions or [rule.conditions for rule in rules]
    made = (replace(rule, conditions=one) for rule, one in zip(rules, queries, strict=True))
    return replace(rules, rules=tuple(made))


@pytest.mark.parametrize("order", ["as mined", "reversed", "of a file"])
def test_the_bounds_that_rules_share_are_those_of_each(rules: RuleSet, order: str) -> None:
    conditions = [rule.conditions for rule in rules]
    if order == "of a file":  # where no two rules have the same objects
        conditions = [tuple(Condition(*one) for one in path) for path in conditions]
    many = fresh(rules, conditions)
    share_bounds(many.rules[::-1] if order == "reversed" else many.rules)
    assert all("bounds" in vars(rule) for rule in many)
    assert [rule.bounds for rule in many] == [rule.bounds for rule in fresh(rules)]


queries = st.builds(
    Condition,
    st.integers(0, 3),
    st.sampled_from(["<=", ">"]),
    st.sampled_from([-1.0, 0.0, 0.5, math.inf]),
)


@given(st.lists(st.lists(queries, max_size=6).map(tuple), max_size=8))
def test_any_paths_come_to_what_each_does(paths: list[tuple[Condition, ...]]) -> None:
    def rule(path: tuple[Condition, ...]) -> Rule:
        return Rule("0.1", 0, path, 0, 0.5, 0.5, 1.0, 1)

    many = [rule(path) for path in paths]
    walked = along_paths(many, (), lambda before, query: (*before, query))
    assert list(walked) == paths
    share_bounds(many)
    assert [one.bounds for one in many] == [rule(path).bounds for path in paths]


def test_a_path_is_worked_out_where_it_leaves_the_one_before(rules: RuleSet) -> None:
    steps = []

    def step(depth: int, query: Condition) -> int:
        steps.append(query)
        return depth + 1

    lengths = list(along_paths(rules, 0, step))
    assert lengths == [rule.length for rule in rules]
    # A tree of R leaves has 2 R - 2 ways from a node to the next.
    assert len(steps) <= 2 * len(rules) - 2
    assert sum(lengths) > 3 * len(steps)


def test_the_words_of_all_rules_are_those_of_each(rules: RuleSet) -> None:
    features = rules.source.features
    wording = Wording(fresh(rules))
    for rule in rules:
        assert wording.sentence(rule) == sentence(rule, rules)
        assert wording.sentence(rule, evidence=False) == sentence(rule, rules, evidence=False)
        assert wording.conditions(rule) == conditions_text(rule, rules)
        assert wording.merged_length(rule) == merged_length(rule, features)


def test_a_csv_file_is_what_the_module_for_it_would_write(rules: RuleSet) -> None:
    odd = replace(rules.source.features[0], name='an "odd", one\r')
    source = replace(rules.source, features=(odd, *rules.source.features[1:]))
    text = rules_to_csv(replace(rules, source=source))
    rows = list(csv.reader(io.StringIO(text, newline="")))
    again = io.StringIO(newline="")
    csv.writer(again, lineterminator="\n").writerows(rows)
    assert text == again.getvalue()
    assert [row[4] for row in rows[1:]] == [
        one.removeprefix("'") for one in exact_texts(replace(rules, source=source))
    ]


NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.floats(width=32).filter(
    math.isfinite
)


@given(st.lists(NUMBERS, min_size=1, max_size=5))
def test_a_box_is_written_as_json_would(numbers: list[float]) -> None:
    box = DataBox(numbers, numbers, numbers, numbers)
    carrying = Rule("0.1", 0, (Condition(0, ">", 0.1),), 0, 0.5, 0.5, 1.0, 1, box=box)
    text = of_many(carrying)
    assert json.dumps(rule_document(carrying), ensure_ascii=False) in text


def test_a_box_with_no_number_is_refused_as_before() -> None:
    box = DataBox((math.inf,), (0.0,), (0.0,), (1.0,))
    with pytest.raises(ValueError, match="JSON"):
        of_many(Rule("0.1", 0, (), 0, 0.5, 0.5, 1.0, 1, box=box))


def of_many(rule: Rule) -> str:
    """The file of a rule that is written as if it stood among very many."""
    states = np.zeros((4, 1), dtype=np.float32)
    labels = np.array([0, 1, 0, 1])
    mined = mine_rules(Demonstrations(states, labels, np.arange(4)), supp_min=0.0, conf_min=0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "_MOST_CONDITIONS", -1)
        return rules_to_json(replace(mined, rules=(rule,)))


def test_a_box_is_its_four_sides() -> None:
    sides = ((0.0, 1.0), (2.0, 3.0), (4.0, 5.0), (6.0, 7.0))
    box = DataBox(*sides)
    assert tuple(box) == sides == (box.least, box.low, box.high, box.most)
    assert box[1:3] == sides[1:3]
    assert box[-1] == box.most
    assert len(box) == 4
    assert len(DataBox((), (), (), ())) == 4
    assert box.by_name() == dict(zip(("least", "low", "high", "most"), sides, strict=True))
    assert np.array(box).shape == (4, 2)
    assert box == DataBox(*sides)
    assert hash(box) == hash(DataBox(*sides))
    assert box != DataBox(*sides[::-1])
    assert box != sides
    assert pickle.loads(pickle.dumps(box)) == box
    assert "least=(0.0, 1.0)" in repr(box)


def test_intervals_are_shared_between_the_rules_that_ask_for_them(rules: RuleSet) -> None:
    many = fresh(rules)
    share_bounds(many.rules)
    objects: dict[int, Bounds] = {id(one): one for rule in many for one in rule.bounds}
    assert sum(len(rule.bounds) for rule in many) > 2 * len(objects)
