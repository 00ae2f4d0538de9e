"""What the page What if says and draws."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from sarl_core import Demonstrations, grow_policy_trees, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.explaining.colours import faded, label_colour
from sarl_core.explaining.html.what_if_bars import lines_html, stretches
from sarl_core.explaining.words.what_if import (
    by_use,
    condition_views,
    executed_text,
    feature_change_text,
    float32_text,
    near_miss_text,
    node_of_way,
    outside_texts,
)
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import conditions_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source
from sarl_core.shielding.neighbourhood import FeatureChange, Neighbourhood
from sarl_core.shielding.shield import Shield

FEATURES = (Feature("pole angle", "rad"), Feature("left leg contact", ""), Feature("speed <b>", ""))
PUSH = LabelledDimension("push", ("left", "right"))
BOX = DataBox((-0.125, 0.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.25, 1.0, 1.0))


def rule(name, conditions, action, **kwargs):
    return Rule(
        name, 0, tuple(Condition(*c) for c in conditions), action, 0.1, 1.0, 1.0, 5, **kwargs
    )


def rules(*found):
    return RuleSet(found, (PUSH,), Source("", FEATURES, "none", 100, 1), Thresholds(0.0, 0.0))


SIDES = rules(
    rule("0.1", [(0, ">", 0.125), (0, "<=", 0.5)], 1, box=BOX),
    rule("0.2", [(0, "<=", -0.25), (1, ">", 0.5)], 0),
)


def test_every_condition_stands_beside_the_state_and_its_room():
    (view,) = condition_views(SIDES.rules[0], (0.2, 0.0, 0.0), SIDES)
    assert view.condition == "0.125 < pole angle ≤ 0.5 rad"
    assert view.value == "0.2 rad"
    assert view.room == "0.075 rad"


def test_where_a_state_leaves_the_data_is_said():
    inside = outside_texts(SIDES.rules[0], (0.2, 0.0, 0.0), FEATURES)
    assert inside == ()
    beyond = outside_texts(SIDES.rules[0], (0.375, 0.0, -2.0), FEATURES)
    assert beyond == (
        "pole angle 0.375 rad is above 0.25 rad, the largest that was seen",
        "speed <b> -2 is below -1, the smallest that was seen",
    )
    assert outside_texts(SIDES.rules[1], (9.0, 9.0, 9.0), FEATURES) == ()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (FeatureChange(0, 0.155, 0.125), "pole angle were 0.03 rad less"),
        (FeatureChange(0, 0.0, 0.5), "pole angle were 0.5 rad more"),
        (FeatureChange(1, 0.0, 0.50000006), "there were left leg contact"),
        (FeatureChange(1, 1.0, 0.5), "there were no left leg contact"),
        (FeatureChange(2, 0.0, 2.0), "speed <b> were 2 more"),
    ],
)
def test_a_change_in_words(change, text):
    assert feature_change_text(change, FEATURES[change.feature]) == text


def test_a_near_miss_in_words():
    changes = (FeatureChange(0, 0.0, -0.25), FeatureChange(1, 0.0, 0.50000006))
    assert near_miss_text(changes, FEATURES) == (
        "pole angle were 0.25 rad less and there were left leg contact"
    )


def test_an_exact_number_reads_back_as_the_same():
    for value in np.float32([0.1, 1 / 3, 1e-30, -123456.78, 0.0]):
        assert np.float32(float32_text(float(value))) == value


def test_actions_in_words():
    assert executed_text((1.0,), (PUSH,)) == "right"
    torque = LabelledDimension.of_edges("torque", (-1.0, 0.0, 1.0))
    assert executed_text((-0.5,), (torque,)) == "torque -0.5"
    assert executed_text((0.0, 1.0), (PUSH, PUSH)) == "push: left, push: right"
    wanted, done = (0.50004, 0.1), (0.5, 0.1)
    assert executed_text(wanted, (torque, torque), beside=done) == "torque 0.50004, torque 0.1"
    assert executed_text(done, (torque, torque), beside=wanted) == "torque 0.5, torque 0.1"


def test_features_that_many_states_are_asked_about_come_first():
    often = replace(SIDES.rules[1], samples=500)
    assert by_use(rules(SIDES.rules[0], often)) == (0, 1, 2)
    assert by_use(rules(rule("0.3", [(2, ">", 0.0)], 1), often)) == (0, 1, 2)
    assert by_use(rules(rule("0.3", [(2, ">", 0.0)], 1), replace(often, enabled=False))) == (
        2,
        0,
        1,
    )


def test_a_bar_is_as_the_shield_does():
    """The angle's bar: nothing of a rule, rule 0.1 from just above 0.125, nothing again."""
    near = Neighbourhood(Shield(SIDES))
    line = near.lines(np.zeros(3, dtype=np.float32), 0)[0]
    above = float(np.nextafter(np.float32(0.125), np.float32(1)))
    end = float(np.nextafter(np.float32(0.5), np.float32(1)))
    assert stretches(line, (-1.0, 1.0), 0, SIDES) == [
        (-1.0, above, 0, False),
        (above, end, 1, True),
        (end, 1.0, 0, False),
    ]
    assert stretches(line, (0.25, 0.375), 0, SIDES) == [(0.25, 0.375, 1, True)]


def test_where_a_rule_abstains_the_bar_is_pale():
    shield = Shield(SIDES, outside="abstain")
    line = Neighbourhood(shield).lines(np.zeros(3, dtype=np.float32), 0)[0]
    beyond = float(np.nextafter(np.float32(0.25), np.float32(1)))
    found = stretches(line, (-1.0, 1.0), 0, SIDES)
    assert [part[2:] for part in found] == [(0, False), (1, True), (0, False)]
    assert found[1][1] == beyond
    agreeing = Neighbourhood(shield).lines(np.zeros(3, dtype=np.float32), 1)[0]
    assert [part[2:] for part in stretches(agreeing, (-1.0, 1.0), 0, SIDES)] == [
        (1, False),
        (1, True),
        (1, False),
    ]


def drawn(lines, ends, state):
    """The rows of the picture, as elements."""
    found = lines_html(lines, [ends] * len(lines), state, FEATURES, 0, SIDES)
    root = ElementTree.fromstring(f"<root>{found}</root>")
    return root.findall(".//div[@class='row']")


def style(element):
    """What an element's style says."""
    return dict(part.split(":") for part in element.get("style").split(";"))


def test_the_bar_has_a_part_for_each_stretch_in_its_colour():
    """Of the angle, -1 to 1 rad: pale left to 0.125, full right to 0.5, pale left again."""
    lines = Neighbourhood(Shield(SIDES)).lines(np.zeros(3, dtype=np.float32), 0)
    row = drawn(lines, (-1.0, 1.0), [0.0] * 3)[0]
    parts = {part.get("title"): style(part) for part in row.findall(".//span[@style]")}
    pale, full = faded(label_colour(0), 0.32), label_colour(1)
    assert parts == {
        "pole angle -1 to 0.125 rad: left, as the agent wants": {
            "left": "0.00%",
            "width": "56.25%",
            "background": pale,
        },
        "pole angle 0.125 to 0.5 rad: right, by a rule": {
            "left": "56.25%",
            "width": "18.75%",
            "background": full,
        },
        # What ends with the bar hangs at its right.
        "pole angle 0.5 to 1 rad: left, as the agent wants": {
            "right": "0",
            "width": "25.00%",
            "background": pale,
        },
    }


def test_the_narrowest_stretch_lies_on_top():
    lines = Neighbourhood(Shield(SIDES)).lines(np.zeros(3, dtype=np.float32), 0)
    parts = drawn(lines, (-1.0, 1.0), [0.0] * 3)[0].findall(".//span[@style]")
    widths = [float(style(part)["width"].rstrip("%")) for part in parts]
    assert widths == sorted(widths, reverse=True)


LOWEST = (
    "left, as the agent wants, from -1 to 0.125 rad; below that: the bar ends; "
    "above that: right, by a rule"
)


@pytest.mark.parametrize(
    ("angle", "place", "said"),
    [
        (-1.0, "0.00%", f"is -1 rad: {LOWEST}"),
        (0.0, "50.00%", f"is 0 rad: {LOWEST}"),
        (0.125, "56.25%", f"is 0.125 rad: {LOWEST}"),
        (
            0.25,
            "62.50%",
            "is 0.25 rad: right, by a rule, from 0.125 to 0.5 rad; "
            "below that: left, as the agent wants; above that: left, as the agent wants",
        ),
        (
            1.0,
            "100.00%",
            "is 1 rad: left, as the agent wants, from 0.5 to 1 rad; "
            "below that: right, by a rule; above that: the bar ends",
        ),
    ],
)
def test_the_mark_stands_at_the_present_value_and_is_told_to_screen_readers(angle, place, said):
    state = [angle, 0.0, 0.0]
    lines = Neighbourhood(Shield(SIDES)).lines(np.array(state, dtype=np.float32), 0)
    row, contact, _ = drawn(lines, (-1.0, 1.0), state)
    (mark,) = row.findall(".//b")
    assert style(mark) == {"left": place}
    assert row.get("role") == "img"
    assert row.get("aria-label") == f"pole angle {said}"
    here = said.split(": ", 1)[1].split(", from")[0]  # the contact changes nothing there
    assert contact.get("aria-label") == (
        f"left leg contact is 0: {here}, from -1 to 1, which is all of the bar"
        if angle > -0.25
        else "left leg contact is 0: left, as the agent wants, from -1 to 0.5; "
        "below that: the bar ends; above that: left, by a rule"
    )


def test_every_feature_has_its_name_and_its_ends_and_none_is_markup():
    lines = Neighbourhood(Shield(SIDES)).lines(np.zeros(3, dtype=np.float32), 0)
    rows = drawn(lines, (-1.0, 2.5), [0.0] * 3)
    names = [row.find("div[@class='name']") for row in rows]
    assert [name.text for name in names] == [feature.name for feature in FEATURES]
    ends = [[end.text for end in row.findall(".//div[@class='ends']/span")] for row in rows]
    assert ends == [["-1 rad", "2.5 rad"], ["-1", "2.5"], ["-1", "2.5"]]
    evil = replace(PUSH, label_names=("<i>left", '"east'))
    found = lines_html(
        lines, [(-1.0, 1.0)] * 3, [0.0] * 3, FEATURES, 0, replace(SIDES, actions=(evil,))
    )
    assert "&lt;i&gt;left" in found
    assert "<i>left" not in found
    assert '"east' not in found


# --- the way of a state -------------------------------------------------------------------------


def test_the_way_ends_at_the_node_of_the_rule_and_else_at_a_leaf(lander_like, lander_trees):
    (tree,) = lander_trees
    mined = mine_rules(lander_trees, supp_min=0.02, conf_min=0.8)
    states = lander_like.observations[:50]
    for row, leaf in zip(states, tree.apply(states), strict=True):
        applies = [one for one in mined.rules if one.applies(row[None])[0]]
        wanted = int(applies[0].id.split(".")[1]) if applies else int(leaf)
        found = applies[0] if applies else None
        assert node_of_way(found, row, mined, tree, leaves=False) == wanted
        manual = rule("manual.1", [(0, ">", -9.0)], 0, origin="manual")
        assert node_of_way(manual, row, mined, tree, leaves=False) == int(leaf)


@pytest.mark.parametrize(
    "name", ["mine", "0.99999", "1.2", "0.-1", "0.²", "0." + "9" * 5000, "0.0", "0."]
)
def test_a_rule_of_another_tree_lights_no_path_of_this_one(lander_like, lander_trees, name):
    mined = mine_rules(lander_trees, supp_min=0.02, conf_min=0.8)
    foreign = replace(mined.rules[0], id=name)
    state = lander_like.observations[0]
    assert node_of_way(foreign, state, mined, lander_trees[0], leaves=False) is None


def test_a_rule_set_of_other_data_or_another_cut_is_of_no_tree_here(lander_like, lander_trees):
    mined = mine_rules(lander_trees, supp_min=0.02, conf_min=0.8)
    state, first = lander_like.observations[0], mined.rules[0]
    assert node_of_way(first, state, mined, lander_trees[0], leaves=False) is not None
    others = replace(mined, source=replace(mined.source, digest="other"))
    for one, leaves in ((others, False), (mined, True), (replace(mined, cut="leaves"), False)):
        for found in (first, None):
            assert node_of_way(found, state, one, lander_trees[0], leaves=leaves) is None


def test_intervals_of_another_number_are_of_another_tree(two_torques):
    here, there = (mine_rules(two_torques, supp_min=0.1, conf_min=0.5, divider=d) for d in (2, 3))
    (tree, _) = grow_policy_trees(two_torques, divider=2)
    state = two_torques.observations[0]
    assert node_of_way(None, state, here, tree, leaves=False) is not None
    assert node_of_way(None, state, there, tree, leaves=False) is None


def test_a_rule_that_lacks_a_combination_is_said_once_for_each_of_its_two_features() -> None:
    states = np.random.default_rng(0).normal(size=(800, 3)).astype(np.float32)
    later = states[:, 0] + 0.5 * states[:, 1]
    made = Demonstrations(
        states,
        ((later > 0.3) & (states[:, 2] > 0.2)).astype(np.int64),
        np.repeat(np.arange(8), 100),
        feature_names=("gap", "speed", "lead"),
        feature_units=("m", "m/s", "m"),
        label_names=(("go", "brake"),),
    ).deriving([DerivedFeature(Combination(((0, 1.0), (1, 0.5))))])
    rules = mine_rules(made, supp_min=0.01, conf_min=0.95)
    features = rules.source.features
    near = Neighbourhood(Shield(rules))
    beyond = "gap plus 0.5 s of speed > 0.302 m and lead "
    for lead, lacking in ((0.0, f"{beyond}≤ 0.2 m"), (1.0, f"{beyond}> 0.2 m")):
        state = np.array([0.0, 0.0, lead], dtype=np.float32)
        misses = near.near_misses(state, np.ones(3))
        (rule,) = {miss.rule for miss in misses}
        assert conditions_text(rules[rule], rules) == lacking
        assert [near_miss_text(miss.changes, features) for miss in misses] == [
            "gap were 0.302 m more",
            "speed were 0.604 m/s more",
        ]
        for miss in misses:
            moved = state.copy()
            for one in miss.changes:
                moved[one.feature] = one.after
            assert Shield(rules).decide(moved, 0).rules == (miss.rule,)
            assert miss.in_force
