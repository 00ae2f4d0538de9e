"""A rule set as what Python expects of it: a sequence, a frame, text, a notebook's table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, PolicyTree, Rule, RuleSet, mine_rules
from sarl_core.mining.evidence import DataBox, HeldOut
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import load_rules, rules_digest, rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition, Thresholds
from tests.mining.strategies import labelled_states


@pytest.fixture(scope="module")
def rules(lander_like: Demonstrations) -> RuleSet:
    return mine_rules(lander_like, supp_min=0.005, conf_min=0.9)


def test_it_is_a_sequence_of_its_rules(rules: RuleSet) -> None:
    assert isinstance(rules, Sequence)
    assert list(rules) == list(rules.rules)
    assert rules[0] is rules.rules[0]
    assert rules[-1] is rules.rules[-1]
    assert rules[1:3] == rules.rules[1:3]
    assert rules[2] in rules
    assert replace(rules[2], id="another") not in rules
    assert rules.index(rules[3]) == 3
    assert not replace(rules, rules=())
    with pytest.raises(IndexError):
        rules[len(rules)]


def test_a_frame_has_a_row_a_rule_and_numbers_as_numbers(rules: RuleSet) -> None:
    held_out = HeldOut(96, 87, 14, 0.91, 0.78, 0.99)
    marked = replace(rules, rules=(replace(rules[0], held_out=held_out, pinned=True), *rules[1:]))
    frame = marked.to_frame()
    assert frame["name"].tolist() == list(rules.names.values())
    assert frame["id"].tolist() == [rule.id for rule in rules]
    assert frame["support"].tolist() == [rule.support for rule in rules]
    assert frame["samples"].dtype == np.int64
    assert frame["pinned"].tolist() == [True] + [False] * (len(rules) - 1)
    assert frame["held_out_share"][0] == 0.91
    assert np.isnan(frame["held_out_share"][1:]).all()
    first = rules[0].conditions[0]
    assert frame["conditions"][0].startswith(f"feature {first.feature} {first.op} ")
    assert repr(first.threshold) in frame["conditions"][0]
    assert frame["rule"][0].startswith("If the feature")
    empty = replace(rules, rules=()).to_frame()
    assert list(empty.columns) == list(frame.columns)
    assert empty["support"].dtype == np.float64


def test_a_notebook_shows_thirty_rules_and_counts_the_rest(rules: RuleSet) -> None:
    assert len(rules) > 31
    html = rules._repr_html_()
    assert html.count("<tr>") == 31
    assert f"and {len(rules) - 30} more" in html
    few = replace(rules, rules=rules[:2])._repr_html_()
    assert few.count("<tr>") == 3
    assert "more" not in few


def test_a_notebook_is_given_no_markup_of_a_file(rules: RuleSet) -> None:
    source = rules.source
    feature = replace(source.features[0], name="<script>alert(1)</script>", unit="<b>")
    action = LabelledDimension("<i>", ("<a>", "b", "c", "d"))
    hostile = replace(
        rules,
        actions=(action,),
        source=replace(source, env_id="<img src=x>", features=(feature, *source.features[1:])),
    )
    html = hostile._repr_html_()
    assert "&lt;script&gt;" in html
    assert not [tag for tag in ("<script", "<b>", "<i>", "<a>", "<img") if tag in html]


def test_a_path_as_text_is_a_path(rules: RuleSet, tmp_path: Path) -> None:
    path = str(tmp_path / "rules.json")
    rules.save(path)
    assert load_rules(path) == rules
    assert load_rules(path).digest == rules.digest
    with pytest.raises(InputError, match=r"none\.json cannot be read"):
        load_rules(str(tmp_path / "none.json"))


@settings(max_examples=30)
@given(labelled_states(), st.floats(0, 1), st.floats(0, 1))
def test_equal_rules_have_equal_digests_after_saving_too(
    demonstrations: Demonstrations, supp: float, conf: float
) -> None:
    mined = mine_rules(demonstrations, supp_min=supp, conf_min=conf)
    again = rules_from_json(rules_to_json(mined))
    assert again.digest == mined.digest
    assert mine_rules(demonstrations, supp_min=supp, conf_min=conf).digest == mined.digest


def test_numbers_that_are_equal_make_no_other_digest(rules: RuleSet) -> None:
    def with_numbers(zero: float, one: float) -> RuleSet:
        conditions = (Condition(0, ">", zero), Condition(1, "<=", one))
        only = replace(rules[0], conditions=conditions, lift=one, demonstrated_value=zero)
        return replace(rules, rules=(only,), thresholds=Thresholds(zero, one, zero))

    assert with_numbers(0.0, 1.0) == with_numbers(0, 1) == with_numbers(-0.0, 1)
    assert with_numbers(0.0, 1.0).digest == with_numbers(0, 1).digest
    assert with_numbers(0.0, 1.0).digest == with_numbers(-0.0, 1).digest


BOX = DataBox((0.0,) * 8, (0.1,) * 8, (0.2,) * 8, (0.5,) * 8)
RULE_CHANGES: dict[str, Callable[[Rule], Any]] = {
    "id": lambda rule: rule.id + "x",
    "dimension": lambda rule: rule.dimension + 1,
    "conditions": lambda rule: rule.conditions[1:],
    "action": lambda rule: (rule.action + 1) % 4,
    "support": lambda rule: np.nextafter(rule.support, 1),
    "confidence": lambda rule: np.nextafter(rule.confidence, 0),
    "lift": lambda rule: np.nextafter(rule.lift, 9),
    "samples": lambda rule: rule.samples + 1,
    "enabled": lambda rule: not rule.enabled,
    "origin": lambda rule: "manual",
    "demonstrated_value": lambda rule: 0.5,
    "pinned": lambda rule: not rule.pinned,
    "box": lambda rule: BOX,
    "held_out": lambda rule: HeldOut(96, 87, 14, 0.91, 0.78, 0.99),
    "forbids": lambda rule: (rule.action,),
}
SET_CHANGES: dict[str, Callable[[RuleSet], Any]] = {
    "rules": lambda rules: rules.rules[::-1],
    "actions": lambda rules: (replace(rules.actions[0], name="thrust"),),
    "source": lambda rules: replace(rules.source, digest="other"),
    "thresholds": lambda rules: replace(rules.thresholds, max_depth=40),
    "divider": lambda rules: rules.divider + 1,
    "cut": lambda rules: "leaves",
    "learner": lambda rules: "histogram",
}


@settings(max_examples=60)
@given(st.data())
def test_whatever_changes_changes_the_digest(rules: RuleSet, data: st.DataObject) -> None:
    # What comes in the place of something is said by rules that forbid, and by no others.
    assert [*RULE_CHANGES, "instead"] == [field.name for field in fields(Rule)]
    assert list(SET_CHANGES) == [field.name for field in fields(RuleSet)]
    if data.draw(st.booleans()):
        name = data.draw(st.sampled_from(sorted(SET_CHANGES)))
        changed = replace(rules, **{name: SET_CHANGES[name](rules)})
    else:
        name = data.draw(st.sampled_from(sorted(RULE_CHANGES)))
        place = data.draw(st.integers(0, len(rules) - 1))
        one = replace(rules[place], **{name: RULE_CHANGES[name](rules[place])})
        changed = replace(rules, rules=(*rules[:place], one, *rules[place + 1 :]))
    assert changed != rules
    assert changed.digest != rules.digest
    assert rules_digest(changed) != rules_digest(rules)


def test_so_does_what_comes_in_the_place_of_what_is_forbidden(rules: RuleSet) -> None:
    orders = [(1, 2, 3), (2, 1, 3)]
    first, other = (
        replace(rules, rules=(replace(rules[0], forbids=(0,), instead=order),)) for order in orders
    )
    assert first.digest != other.digest


@pytest.mark.parametrize(
    ("part", "values"),
    [("features", {"name": "x"}), ("features", {"unit": "m"}), ("env_id", "E"), ("steps", 1)],
)
def test_so_does_what_it_was_mined_from(rules: RuleSet, part: str, values: Any) -> None:
    source = rules.source
    if part == "features":
        values = (replace(source.features[0], **values), *source.features[1:])
    assert replace(rules, source=replace(source, **{part: values})).digest != rules.digest


def test_a_digest_knows_how_a_threshold_is_written(rules: RuleSet) -> None:
    bare = replace(rules, source=rules.source.with_splits([None] * 8))
    assert bare.digest != rules.digest
    assert rules_digest(bare) == rules_digest(rules) == bare.digest


def test_half_a_pair_of_a_file_has_a_digest(rules: RuleSet) -> None:
    source = replace(rules.source, env_id="\ud800")
    assert replace(rules, source=source).digest != rules.digest


@pytest.mark.parametrize("name", [field.name for field in fields(PolicyTree)])
def test_whatever_changes_in_a_tree_changes_its_digest(
    lander_trees: tuple[PolicyTree, ...], name: str
) -> None:
    (tree,) = lander_trees
    value = getattr(tree, name)
    changed = {
        "index": 1,
        "dimension": replace(tree.dimension, name="x"),
        "divider": 3,
        "source": replace(tree.source, digest="x"),
        "learner": "histogram",
        "sample_place": np.arange(len(tree.sample_order)),
        "least_support": 0.5,
    }.get(name)
    if changed is None:
        changed = value.copy()
        changed[-1] += 1
    assert replace(tree, **{name: changed}).digest != tree.digest
    assert replace(tree).digest == tree.digest
    if name == "source":
        assert replace(tree, source=tree.source.with_splits([None] * 8)).digest != tree.digest
