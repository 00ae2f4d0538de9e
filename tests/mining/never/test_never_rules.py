"""Rules that forbid: where they are cut, what they say, and how they are written to a file."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from sarl_core import Demonstrations, InputError, RuleSet, grow_policy_trees, mine_rules
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import limits_text, sentence
from sarl_core.mining.never.never_rules import (
    forbidding_nodes,
    mine_never_rules,
    upper_bound,
    with_never_rules,
)
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from tests.mining.strategies import labelled_states


def engines() -> Demonstrations:
    """Left of 0 never label 0, right of it never label 2; at random among the other two."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, 4_000).astype(np.float32)
    labels = rng.integers(0, 2, len(x)) + (x <= 0)
    return Demonstrations(
        x[:, None],
        labels,
        np.arange(len(x)) // 100,
        feature_names=("offset",),
        label_names=(("left", "wait", "right"),),
    )


@given(st.integers(0, 40), st.integers(1, 40))
def test_the_bound_is_that_of_clopper_and_pearson(count, of):
    count = min(count, of)
    exact = binomtest(count, of, alternative="less").proportion_ci(0.95, method="exact").high
    assert upper_bound(np.array(count), np.array(of)) == pytest.approx(exact, abs=1e-9)


@settings(max_examples=60)
@given(
    labelled_states(),
    st.floats(0.05, 0.95),
    st.floats(0, 0.5),
    st.one_of(st.none(), st.integers(0, 4)),
)
def test_a_label_is_forbidden_at_the_first_node_of_a_path_that_qualifies(
    demonstrations, epsilon, supp_min, max_depth
):
    (tree,) = grow_policy_trees(demonstrations)
    expected = set()
    for leaf in range(tree.n_nodes):
        path = tree.path(leaf)
        for label in range(tree.dimension.n_labels):
            for depth, node in enumerate(path):
                samples, count = int(tree.samples[node]), int(tree.counts[node, label])
                high = binomtest(count, samples, alternative="less")
                qualifies = (
                    high.proportion_ci(0.95, method="exact").high <= epsilon
                    and samples / len(demonstrations) >= supp_min
                    and (max_depth is None or depth <= max_depth)
                )
                if qualifies:
                    expected.add((node, label))
                    break
    nodes = forbidding_nodes(tree, epsilon=epsilon, supp_min=supp_min, max_depth=max_depth)
    assert set(zip(*(column.tolist() for column in np.nonzero(nodes)), strict=True)) == expected
    rules = mine_never_rules(tree, epsilon=epsilon, supp_min=supp_min, max_depth=max_depth)
    assert len(rules) == len(expected)
    for rule in rules:
        applying = rule.applies(demonstrations.observations)
        labels = demonstrations.actions[applying]
        assert rule.samples == applying.sum()
        assert rule.confidence == pytest.approx(rule.obeyed_by(labels).mean())
        counts = np.bincount(labels, minlength=tree.dimension.n_labels)
        assert [counts[one] for one in rule.instead] == sorted(
            np.delete(counts, rule.forbids), reverse=True
        )


def test_what_is_forbidden_is_said():
    rules = mine_never_rules(engines(), epsilon=0.05, supp_min=0.1)
    assert [says_text(rule, rules.actions[0]) for rule in rules] == ["never left", "never right"]
    first, second = rules
    assert (first.kind, first.forbids, first.label) == ("never", (0,), 0)
    assert sentence(first, rules).startswith("If the offset is at most ")
    assert sentence(first, rules).endswith(
        f"then never left: the expert did not in 100 % of {first.samples:,} states."
    )
    assert "never right" in sentence(second, rules, evidence=False)
    assert limits_text(rules) == (
        "support at least 0.1, forbidden what the expert does in at most 0.05"
    )
    assert "2 of them forbid" in rules.to_text()
    assert np.isnan(rules.coverage)
    assert np.isnan(rules.fidelity)


def test_what_is_never_done_anywhere_is_forbidden_without_a_condition():
    x = np.linspace(-1, 1, 200, dtype=np.float32)[:, None]
    shown = Demonstrations(x, np.zeros(200, dtype=int), np.zeros(200), label_names=(("a", "b"),))
    (rule,) = mine_never_rules(shown, epsilon=0.05)
    assert rule.conditions == ()
    assert sentence(rule, mine_never_rules(shown, epsilon=0.05), evidence=False) == "Never b."


def test_of_two_labels_to_forbid_one_is_to_demand_the_other():
    x = np.linspace(-1, 1, 400, dtype=np.float32)[:, None]
    shown = Demonstrations(x, (x[:, 0] > 0).astype(int), np.zeros(400))
    rules = mine_never_rules(shown, epsilon=0.05)
    assert [(rule.forbids, rule.instead) for rule in rules] == [((0,), (1,)), ((1,), (0,))]


def test_rules_that_demand_come_first_and_names_go_on():
    trees = grow_policy_trees(engines())
    demanding = mine_rules(trees, supp_min=0.1, conf_min=0.45)
    both = with_never_rules(demanding, trees, 0.05)
    assert both.rules[: len(demanding)] == demanding.rules
    assert both.thresholds.never == 0.05
    assert both.forbids
    assert not demanding.forbids
    assert len(set(both.names.values())) == len(both)


@pytest.mark.parametrize("epsilon", [0.0, 1.0, -0.1, 1.5, float("nan")])
def test_an_epsilon_that_is_no_share_is_refused(epsilon):
    with pytest.raises(InputError, match="give a share above 0 and below 1"):
        mine_never_rules(engines(), epsilon=epsilon)


def test_an_epsilon_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="must be a number"):
        mine_never_rules(engines(), epsilon="much")


# --- the rule file -------------------------------------------------------------------------------


def test_a_file_gives_back_what_was_written(tmp_path):
    trees = grow_policy_trees(engines())
    for rules in (
        mine_never_rules(engines(), epsilon=0.05, supp_min=0.1),
        with_never_rules(mine_rules(trees, supp_min=0.1, conf_min=0.45), trees, 0.05),
        with_never_rules(mine_rules(trees, supp_min=0.1, conf_min=1.0), trees, 0.05),  # none
    ):
        rules.save(tmp_path / "rules.json")
        again = RuleSet.load(tmp_path / "rules.json")
        assert again.rules == rules.rules
        assert again.thresholds == rules.thresholds
        assert again.digest == rules.digest


def test_whether_rules_demand_is_written_where_they_do_not_say_it():
    trees = grow_policy_trees(engines())
    alone = mine_never_rules(engines(), epsilon=0.05, supp_min=0.1)
    none = with_never_rules(mine_rules(trees, supp_min=0.1, conf_min=1.0), trees, 0.05)
    some = with_never_rules(mine_rules(trees, supp_min=0.1, conf_min=0.45), trees, 0.05)
    mixed = replace(alone, rules=(*alone.rules, some.rules[0]))  # as when one is added by hand
    assert not any(rule.kind == "do" for rule in none.rules)
    for rules, written in ((alone, None), (some, None), (none, True), (mixed, False)):
        document = json.loads(rules_to_json(rules))
        assert document["thresholds"].get("demands") == written
        assert rules_from_json(json.dumps(document)).thresholds == rules.thresholds
        document["thresholds"].pop("demands", None)  # as before it was written
        before = rules_from_json(json.dumps(document)).thresholds
        assert before.demands == (rules.thresholds.demands if written is None else not written)


def test_whether_rules_demand_is_refused_where_none_forbid():
    document = json.loads(rules_to_json(mine_rules(engines(), supp_min=0.1, conf_min=0.45)))
    document["thresholds"]["demands"] = False
    with pytest.raises(InputError, match="'demands' stands beside 'never' alone in thresholds"):
        rules_from_json(json.dumps(document))


def test_a_never_rule_forbids_in_the_place_of_an_action():
    document = json.loads(rules_to_json(mine_never_rules(engines(), epsilon=0.05, supp_min=0.1)))
    assert document["version"] == 2
    assert document["thresholds"]["never"] == 0.05
    first = document["rules"][0]
    assert (first["kind"], first["forbids"], sorted(first["instead"])) == ("never", [0], [1, 2])
    assert "action" not in first


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "always"}, "kind"),
        ({"action": 1}, "a never-rule has 'forbids' and no 'action'"),
        ({"forbids": []}, "'forbids' must be one label or more"),
        ({"forbids": [0, 0]}, "'forbids' must be one label or more"),
        ({"forbids": [7]}, "together must be the 3 labels"),
        ({"forbids": [0, 1, 2], "instead": []}, "must leave one label or more"),
        ({"instead": [1]}, "together must be the 3 labels"),
        ({"kind": "do"}, "'action' is missing"),
        ({"kind": "do", "action": 1}, "has no 'forbids'"),
    ],
)
def test_what_is_no_never_rule_is_refused_by_name(change, said):
    document = json.loads(rules_to_json(mine_never_rules(engines(), epsilon=0.05, supp_min=0.1)))
    document["rules"][0] |= change
    with pytest.raises(InputError, match=said) as refused:
        rules_from_json(json.dumps(document), name="mine.json")
    assert "rules 1" in str(refused.value)


def test_a_reader_of_version_1_knows_no_never_rules():
    document = json.loads(rules_to_json(mine_never_rules(engines(), epsilon=0.05, supp_min=0.1)))
    with pytest.raises(InputError, match="version 1 of the format knows no never-rules"):
        rules_from_json(json.dumps(document | {"version": 1}))
