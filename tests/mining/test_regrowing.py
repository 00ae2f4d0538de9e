"""Parts of trees that are regrown: what changes, what stays, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import (
    Demonstrations,
    InputError,
    RuleSet,
    Shield,
    grow_policy_trees,
    mine_rules,
    with_formulas,
)
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.report.provenance import mining_command
from sarl_core.explaining.report.rule_cards import tags
from sarl_core.explaining.words.edits import edit_text, state_text
from sarl_core.explaining.words.what_if import node_of_way
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.edit_counts import edits_counted, edits_sentence, is_plain
from sarl_core.mining.editing.edits import (
    History,
    Pin,
    Regrow,
    Switch,
    apply,
    check_edit,
    next_manual_id,
)
from sarl_core.mining.editing.regrowing import next_queries, regrown, regrown_trees, way_to
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.mining.rules import FILTERED, FIRST_REGROWN, Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree
from tests.mining.strategies import labelled_states


def corners(n: int = 600) -> Demonstrations:
    """Three features in [0, 1); the label is which corner of two of them, with some noise."""
    rng = np.random.default_rng(5)
    states = rng.random((n, 3)).astype(np.float32)
    labels = (states[:, 0] > 0.5).astype(int) + 2 * (states[:, 1] > 0.5)
    noise = rng.random(n) < 0.1
    labels[noise] = rng.integers(0, 4, int(noise.sum()))
    return Demonstrations(
        states,
        labels,
        np.arange(n) // 60,
        feature_names=("angle", "speed", "noise"),
        label_names=(("rest", "left", "right", "both"),),
    )


DATA = corners()
(TREE,) = grow_policy_trees(DATA)
COARSE = {"supp_min": 0.02, "conf_min": 0.8}
MINED = mine_rules(TREE, **COARSE)


def another(tree: PolicyTree, node: int, data: Demonstrations = DATA) -> Regrow:
    """The best query that a node does not ask."""
    query = next(one for one in next_queries(tree, node, data) if not one.current)
    return Regrow(tree.index, node, query.feature, query.threshold)


def done(tree: PolicyTree, edit: Regrow, data: Demonstrations = DATA) -> PolicyTree:
    return regrown(tree, edit.node, edit.feature, edit.threshold, data)


INNER = int(TREE.children_left[0])
EDIT = another(TREE, INNER)
NEW = done(TREE, EDIT)
AFTER = mine_rules(NEW, **COARSE)


# --- the tree ----------------------------------------------------------------------------------


def some_query(data, demonstrations, tree):
    """A node of a tree and a query that parts its pairs; None where no node can be parted."""
    nodes = [
        node
        for node in range(tree.n_nodes)
        if any(len({*column}) > 1 for column in demonstrations.observations[tree.rows(node)].T)
    ]
    if not nodes:
        return None
    node = data.draw(st.sampled_from(nodes))
    states = demonstrations.observations[tree.rows(node)]
    feature = data.draw(
        st.sampled_from([at for at in range(states.shape[1]) if len({*states[:, at]}) > 1])
    )
    threshold = data.draw(st.sampled_from(sorted({*states[:, feature].tolist()})[:-1]))
    return node, feature, threshold


@settings(max_examples=80)
@given(labelled_states(), st.data())
def test_nothing_but_the_part_changes_and_counts_add_up(demonstrations, data):
    (tree,) = grow_policy_trees(demonstrations)
    drawn = some_query(data, demonstrations, tree)
    if drawn is None:
        return
    node, feature, threshold = drawn
    new = regrown(tree, node, feature, threshold, demonstrations)
    states = demonstrations.observations
    before, after = tree.apply(states), new.apply(states)
    outside = np.setdiff1d(np.arange(len(states)), tree.rows(node))
    assert np.array_equal(tree.number[before[outside]], new.number[after[outside]])
    place = new.place_of(node)
    assert place is not None
    assert len(new.path(place)) == len(tree.path(node))
    assert np.array_equal(np.sort(new.rows(place)), np.sort(tree.rows(node)))
    assert (int(new.feature[place]), float(new.threshold[place])) == (feature, threshold)
    inner = np.flatnonzero(new.feature != LEAF)
    left, right = new.children_left[inner], new.children_right[inner]
    assert np.array_equal(new.counts[inner], new.counts[left] + new.counts[right])
    assert np.array_equal(new.parent[left], inner)
    assert np.array_equal(new.parent[right], inner)
    assert np.array_equal(new.counts[0], tree.counts[0])
    assert (new.samples > 0).all()
    assert len({*new.number.tolist()}) == new.n_nodes
    # Fully grown: a leaf has one label, or pairs that nothing tells apart.
    for leaf in np.flatnonzero(new.feature == LEAF).tolist():
        rows = new.rows(leaf)
        assert new.confidence[leaf] == 1.0 or (states[rows] == states[rows[0]]).all()
    # Nodes outside keep their numbers, those below are new.
    below = {
        int(tree.number[at]) for at in range(tree.n_nodes) if at != node and node in tree.path(at)
    }
    if new is not tree:
        assert {one for one in new.number.tolist() if one < FIRST_REGROWN} == {
            *tree.number.tolist()
        } - below


@settings(max_examples=40)
@given(labelled_states())
def test_the_query_that_the_learner_chose_gives_the_tree_back(demonstrations):
    (tree,) = grow_policy_trees(demonstrations)
    for node in np.flatnonzero(tree.feature != LEAF).tolist():
        query = next_queries(tree, node, demonstrations)[0]
        assert query.current
        assert regrown(tree, node, query.feature, query.threshold, demonstrations) is tree


@settings(max_examples=60)
@given(labelled_states(), st.data())
def test_what_is_grown_anew_is_what_the_learner_grows(demonstrations, data):
    """With one feature, no two queries of different features are equally good."""
    one = Demonstrations(
        demonstrations.observations[:, :1],
        demonstrations.actions,
        demonstrations.episodes,
        label_names=demonstrations.label_names,
    )
    (tree,) = grow_policy_trees(one)
    inner = np.flatnonzero(tree.feature != LEAF).tolist()
    if not inner:
        return
    node = data.draw(st.sampled_from(inner))
    values = sorted({*one.observations[tree.rows(node), 0].tolist()})
    threshold = data.draw(st.sampled_from(values[:-1]))
    back = regrown(
        regrown(tree, node, 0, threshold, one), node, 0, float(tree.threshold[node]), one
    )
    for name in ("feature", "threshold", "children_left", "children_right", "counts", "depth"):
        assert np.array_equal(getattr(back, name), getattr(tree, name)), name
    assert np.array_equal(back.sample_order, tree.sample_order)


def test_a_part_that_was_regrown_is_grown_again_by_the_query_that_its_node_asks():
    deeper = another(NEW, int(NEW.number[NEW.children_left[NEW.place_of(INNER)]]))
    twice = done(NEW, deeper)
    assert twice.digest != NEW.digest
    assert done(twice, EDIT).digest == NEW.digest  # the part below is as it was, numbers and all


def test_the_same_edits_give_the_same_tree_and_other_queries_other_numbers():
    assert done(TREE, EDIT).digest == NEW.digest
    other = done(TREE, replace(EDIT, threshold=0.25))
    fresh = [{*tree.number[tree.number >= FIRST_REGROWN].tolist()} for tree in (NEW, other)]
    assert fresh[0]
    assert not fresh[0] & fresh[1]
    assert max(fresh[0] | fresh[1]) < 2**53


def test_a_leaf_can_be_divided_further():
    leaf = next(
        node
        for node in np.flatnonzero(TREE.feature == LEAF).tolist()
        if len({*DATA.observations[TREE.rows(node), 2]}) > 1
    )
    values = np.sort(DATA.observations[TREE.rows(leaf), 2])
    new = regrown(TREE, leaf, 2, float(values[0]), DATA)
    assert new.n_nodes == TREE.n_nodes + 2


# --- the queries -------------------------------------------------------------------------------


def gini(labels):
    return 1.0 - sum((labels == one).mean() ** 2 for one in {*labels.tolist()})


@settings(max_examples=60)
@given(labelled_states(max_steps=30))
def test_the_queries_are_the_best_of_each_feature_the_best_first(demonstrations):
    (tree,) = grow_policy_trees(demonstrations)
    labels, whole = demonstrations.actions, gini(demonstrations.actions)
    best = {}
    for feature, values in enumerate(demonstrations.observations.T):
        gains = [
            whole
            - sum(side.mean() * gini(labels[side]) for side in (values <= border, values > border))
            for border in sorted({*values.tolist()})[:-1]
        ]
        if gains and whole > 0:
            best[feature] = max(gains)
    queries = next_queries(tree, 0, demonstrations, most=10)
    now = [one for one in queries if one.current]
    others = [one for one in queries if not one.current]
    assert [one.current for one in queries] == [True] * len(now) + [False] * len(others)
    assert len(now) == (tree.feature[0] != LEAF)
    assert {one.feature for one in queries} == set(best)
    for one in queries:
        goes_left = demonstrations.observations[:, one.feature] <= np.float64(one.threshold)
        assert (one.left, one.right) == (goes_left.sum(), (~goes_left).sum())
        assert one.gain == pytest.approx(best[one.feature], abs=1e-12)
    assert all(one.gain >= other.gain for one, other in pairwise(others))
    if now:
        assert now[0].gain == pytest.approx(max(best.values()), abs=1e-12)


def test_only_so_many_queries_are_given():
    assert len(next_queries(TREE, 0, DATA, most=1)) == 2


# --- the rules ---------------------------------------------------------------------------------


def ids(rule_set: RuleSet) -> set[str]:
    return {rule.id for rule in rule_set.rules}


def test_rules_elsewhere_stay_under_their_ids_and_those_of_the_part_are_marked():
    part = {f"0.{TREE.number[at]}" for at in range(TREE.n_nodes) if INNER in TREE.path(at)}
    before = {rule.id: rule for rule in MINED.rules if rule.id not in part}
    after = {rule.id: rule for rule in AFTER.rules if not rule.regrown}
    assert before
    assert before == after
    fresh = [rule for rule in AFTER.rules if rule.regrown]
    assert fresh
    assert not ids(MINED) & {rule.id for rule in fresh}
    (query,) = {rule.conditions[1][::2] for rule in fresh}
    assert query == (EDIT.feature, EDIT.threshold)
    assert {state_text(rule) for rule in fresh} == {"regrown"}
    assert {tags(rule) for rule in fresh} == {("of a part of the tree that was regrown by hand",)}


def test_a_shield_of_the_rules_does_what_the_tree_says():
    decided = Shield(AFTER).decide_batch(DATA.observations, DATA.actions).rules[:, 0]
    cut = cut_nodes(NEW, **COARSE)
    leaves = NEW.apply(DATA.observations)
    for row, leaf in enumerate(leaves.tolist()):
        on_way = [node for node in NEW.path(leaf) if node in cut]
        expected = f"0.{NEW.number[on_way[0]]}" if on_way else None
        assert (AFTER.rules[decided[row]].id if decided[row] >= 0 else None) == expected


def test_what_was_regrown_is_said_wherever_the_rules_go():
    count = sum(rule.regrown for rule in AFTER.rules)
    assert is_plain(AFTER)
    assert f"; regrown by hand: {count} rule" in AFTER.to_text()
    assert AFTER.to_text().count("(regrown)") == count
    assert f"; regrown by hand: {count} rule" in rules_to_markdown(AFTER)
    assert rules_to_markdown(AFTER).count(", regrown |") == count
    assert "regrown" not in MINED.to_text() + rules_to_markdown(MINED)
    off = apply(AFTER, [Switch(AFTER.rules[0].id, False)])
    assert edits_counted(off).endswith(f"1 off, 0 pinned, 0 added, {count} regrown")
    assert f"{count} rules were then regrown with a part of the tree." in edits_sentence(AFTER)
    again = rules_from_json(rules_to_json(AFTER))
    assert [rule.regrown for rule in again.rules] == [rule.regrown for rule in AFTER.rules]
    assert mining_command(MINED, "rules.json", "data.parquet", DATA) is not None
    assert mining_command(AFTER, "rules.json", "data.parquet", DATA) is None


def test_a_name_that_somebody_gave_is_no_mark():
    rule = next(rule for rule in AFTER.rules if rule.regrown)
    for name in ("mine", "0.12", "0.", "0.٣234567890123456", "0." + "9" * 5000, f"0.{2**53}"):
        assert not replace(rule, id=name).regrown
    assert not replace(rule, origin="manual").regrown


def test_the_way_of_a_state_ends_at_a_regrown_rule():
    rule = next(rule for rule in AFTER.rules if rule.regrown)
    row = int(np.flatnonzero(rule.applies(DATA.observations))[0])
    state = DATA.observations[row]
    place = node_of_way(rule, state, AFTER, NEW, leaves=False)
    assert place is not None
    assert f"0.{NEW.number[place]}" == rule.id
    assert node_of_way(rule, state, AFTER, TREE, leaves=False) is None


# --- where a part can be regrown ---------------------------------------------------------------


@settings(max_examples=60)
@given(labelled_states(), st.floats(0, 0.5), st.floats(0, 1), st.data())
def test_the_way_ends_above_the_first_cut_and_counts_the_rules_below(
    demonstrations, support, confidence, data
):
    (tree,) = grow_policy_trees(demonstrations)
    node = data.draw(st.integers(0, tree.n_nodes - 1))
    way = way_to(tree, node, Thresholds(support, confidence))
    cut = cut_nodes(tree, supp_min=support, conf_min=confidence).tolist()
    above = []
    for one in tree.path(node):
        if one in cut:
            break
        above.append(one)
    assert way.places == tuple(above)
    assert way.rules == tuple(sum(one in tree.path(end) for end in cut) for one in above)


# --- the edit ----------------------------------------------------------------------------------


def test_trees_are_edited_in_order_and_the_rules_of_others_are_left_alone():
    (new,) = regrown_trees([TREE], [Switch("0.3", False), EDIT, Pin(MINED.rules[0])], DATA)
    assert new.digest == NEW.digest
    assert regrown_trees([TREE], [Switch("0.3", False)], DATA) == (TREE,)
    other = another(TREE, int(TREE.children_right[0]))
    (both,) = regrown_trees([TREE], [EDIT, other], DATA)
    assert both.digest == done(NEW, other).digest
    rule = next(rule for rule in AFTER.rules if rule.regrown)
    made = apply(AFTER, [EDIT, Switch(rule.id, False)])
    assert [one.id for one in made.rules if not one.enabled] == [rule.id]
    assert apply(AFTER, [EDIT]) == AFTER
    # On rules of the tree as it was, the edit of a rule that is not there waits.
    assert apply(MINED, [EDIT, Switch(rule.id, False)]) == MINED
    check_edit(MINED, EDIT)
    assert next_manual_id(MINED, History((EDIT,))) == "manual.1"
    assert edit_text(EDIT, AFTER).startswith("regrow a part (")


def test_a_pinned_rule_outlives_the_part_it_was_of():
    pinned = next(rule for rule in MINED.rules if rule.id not in ids(AFTER))
    made = apply(AFTER, [Pin(pinned), EDIT])
    assert made.rules[0] == replace(pinned, pinned=True)


@given(
    st.integers(0, 10**6 - 1),
    st.integers(0, 9 * 10**15),
    st.integers(0, 10**6 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
)
def test_the_text_of_an_edit_reads_back_to_the_last_bit(dimension, node, feature, threshold):
    edit = Regrow(dimension, node, feature, threshold)
    assert Regrow.of(edit.text) == edit


@pytest.mark.parametrize(
    "text",
    [
        "",
        "0.12",
        "0.12:3",
        "0.12:3:",
        "0.12:3:nan",
        "0.12:3:1e999",
        "0.12:3:1:2",
        "-1.12:3:1",
        "0.12:3:0x1",
        "٣.12:3:1",
        "0.12:3:1\n",
        "0.12:3:1_0",
        "0." + "1" * 5000 + ":3:1",
    ],
)
def test_a_text_that_is_none_is_refused_in_one_sentence(text):
    with pytest.raises(InputError, match="says no part to regrow") as caught:
        Regrow.of(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (Regrow(1, 0, 0, 0.5), "no action dimension 1"),
        (Regrow(0, 10**6, 0, 0.5), "no node 1000000 in the tree"),
        (Regrow(0, 0, 3, 0.5), "no feature 3 .* 0 to 2"),
        (Regrow(0, 0, 0, float("nan")), "finite"),
        (Regrow(0, 0, 0, 2.0), "all 600 pairs of node 0 lie on one side of 2.0"),
        (Regrow(0, 0, 0, -1.0), "all 600 pairs of node 0 lie on one side of -1.0"),
    ],
)
def test_what_does_not_fit_the_tree_is_refused(edit, words):
    with pytest.raises(InputError, match=words) as caught:
        regrown_trees([TREE], [edit], DATA)
    assert "\n" not in str(caught.value)


def test_other_demonstrations_are_refused():
    with pytest.raises(InputError, match="grown from other demonstrations"):
        regrown(TREE, 0, 0, 0.5, corners(500))
    with pytest.raises(InputError, match="grown from other demonstrations"):
        next_queries(TREE, 0, corners(500))


def test_a_feature_that_is_the_same_in_all_pairs_cannot_part_them():
    flat = Demonstrations(
        np.array([[0, 1], [1, 1], [2, 1]], dtype=np.float32), np.array([0, 1, 0]), np.zeros(3, int)
    )
    (tree,) = grow_policy_trees(flat)
    assert {one.feature for one in next_queries(tree, 0, flat)} == {0}
    with pytest.raises(InputError, match="ask about another feature"):
        regrown(tree, 0, 1, 1.0, flat)


# --- other kinds of data -----------------------------------------------------------------------


def test_thresholds_part_states_as_float32_states_are_compared():
    states = np.array([[0.1], [0.2], [0.3], [0.4]], dtype=np.float32)
    data = Demonstrations(states, np.array([0, 1, 0, 1]), np.zeros(4, int))
    (tree,) = grow_policy_trees(data)
    border = float(np.float32(0.2))  # above 0.2 itself
    assert regrown(tree, 0, 0, border, data).samples[1] == 2
    new = regrown(tree, 0, 0, 0.2, data)  # which float32 has no number for: 0.2 is above it
    assert new.samples[1] == 1
    assert (new.confidence[new.feature == LEAF] == 1.0).all()


def test_continuous_actions_of_several_dimensions_with_a_formula():
    rng = np.random.default_rng(2)
    states = rng.random((300, 2)).astype(np.float32)
    actions = np.stack(
        [states[:, 0] - states[:, 1], 2 * states[:, 0] * states[:, 1] - 1], axis=1
    ).astype(np.float32)
    data = with_formulas(
        Demonstrations(states, actions, np.arange(300) // 30, feature_names=("gap", "speed")),
        ["left = gap - speed"],
    )
    trees = grow_policy_trees(data, divider=4)
    assert 2 in {one.feature for one in next_queries(trees[1], 0, data)}
    edit = Regrow(1, 0, 2, 0.0)
    new = regrown_trees(trees, [edit], data)
    assert new[0] is trees[0]
    rules = mine_rules(new, supp_min=0.01, conf_min=0.8)
    of_part = [rule for rule in rules.rules if rule.dimension == 1]
    assert of_part
    for rule in of_part:
        assert rule.regrown
        assert (rule.conditions[0].feature, rule.conditions[0].threshold) == (2, 0.0)
        holds = rule.applies(data.observations)
        assert rule.samples == holds.sum()
        assert rule.demonstrated_value == pytest.approx(float(np.median(actions[holds, 1])))
    assert mine_rules(trees, supp_min=0.01, conf_min=0.8).of_dimension(0) == rules.of_dimension(0)


def test_the_paper_s_thresholds_find_the_same_way_after_a_node_is_regrown():
    way = way_to(NEW, NEW.place_of(INNER), FILTERED)
    assert way.places[-1] == NEW.place_of(INNER)
