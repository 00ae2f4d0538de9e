from __future__ import annotations

import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, grow_policy_trees, mine_rules
from sarl_core.limits import READ_LIMIT
from sarl_core.mining.evidence import DataBox, HeldOut
from sarl_core.mining.rule_set import rules_digest, rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition
from tests.mining.strategies import labelled_states


@pytest.fixture(scope="module")
def document(lander_like):
    return json.loads(rules_to_json(mine_rules(lander_like, supp_min=0.02, conf_min=0.8)))


def read(document):
    return rules_from_json(json.dumps(document), name="rules.json")


@settings(max_examples=40)
@given(labelled_states(), st.floats(0, 1), st.floats(0, 1))
def test_what_is_written_is_read(demonstrations, supp, conf):
    rules = mine_rules(demonstrations, supp_min=supp, conf_min=conf)
    assert rules_from_json(rules_to_json(rules)) == rules


def test_continuous_rules_come_back(tmp_path):
    rng = np.random.default_rng(0)
    demonstrations = Demonstrations(
        rng.normal(size=(300, 2)),
        rng.normal(size=(300, 2)).astype(np.float32),
        np.zeros(300, dtype=int),
        feature_names=("pole angle", "speed"),
        feature_units=("rad", "m/s"),
        action_names=("hip", "knee"),
        action_low=(-9.0, -9.0),
        action_high=(9.0, 9.0),
        env_id="Walker",
    )
    rules = mine_rules(demonstrations, supp_min=0.01, conf_min=0.9, divider=3)
    path = tmp_path / "rules.json"
    rules.save(path)
    assert RuleSet.load(path) == rules
    assert [p.name for p in tmp_path.iterdir()] == ["rules.json"]
    written = json.loads(path.read_text())
    assert (written["format"], written["version"], written["divider"]) == ("sarl-rules", 1, 3)
    assert written["features"][0] == {"name": "pole angle", "unit": "rad"}
    assert written["actions"][1]["kind"] == "interval"
    assert written["actions"][1]["edges"] == [-9.0, -3.0, 3.0, 9.0]
    assert written["demonstrations"]["digest"] == demonstrations.digest
    rule = written["rules"][0]
    assert set(rule) >= {
        "id",
        "dimension",
        "conditions",
        "action",
        "support",
        "confidence",
        "lift",
        "samples",
        "length",
        "enabled",
        "origin",
    }


HELD = HeldOut(96, 87, 14, 0.91, 0.78, 0.99)


def test_what_a_rule_carries_comes_back(lander_like):
    rules = mine_rules(lander_like, supp_min=0.02, conf_min=0.8)
    d = lander_like.observations.shape[1]
    box = DataBox((-2.0,) * d, (-1.0,) * d, (0.1,) * d, (float(np.float32(0.3)),) * d)
    carried = replace(
        rules.rules[0], pinned=True, box=box, held_out=HeldOut(96, 87, 14, 0.91, 0.78, 0.99)
    )
    whole = replace(rules, rules=(carried, *rules.rules[1:]))
    again = rules_from_json(rules_to_json(whole))
    assert again == whole
    assert again.rules[0].placed
    assert not again.rules[1].placed


def test_a_file_of_ordinary_size_has_a_line_for_each_value(lander_like):
    mined = mine_rules(lander_like, supp_min=0.02, conf_min=0.8)
    first = replace(mined.rules[0], id="line\nbreak \\n \N{DEGREE SIGN}")
    for rules in (mined, replace(mined, rules=(first,)), replace(mined, rules=())):
        text = rules_to_json(rules)
        assert text == json.dumps(json.loads(text), indent=1, ensure_ascii=False) + "\n"


@pytest.fixture(scope="module")
def deep(lander_like):
    """Rules with 640,400 conditions, 1,000 of them different."""
    mined = mine_rules(lander_like, supp_min=0.02, conf_min=0.8)
    conditions = tuple(Condition(index % 2, ">", index / 7) for index in range(1000))
    return replace(
        mined,
        rules=tuple(
            replace(mined.rules[0], id=f"0.{index}", conditions=conditions[index // 2 :])
            for index in range(800)
        ),
    )


def test_rules_with_very_many_conditions_stand_on_a_line_each(deep, tmp_path):
    text = rules_to_json(deep)
    assert len(text.splitlines()) < 2_000
    path = tmp_path / "rules.json"
    deep.save(path)
    assert path.read_text(encoding="utf-8") == text
    assert RuleSet.load(path) == deep
    assert rules_digest(deep) != rules_digest(replace(deep, rules=()))


def test_a_line_is_what_json_writes_whatever_a_rule_is_called(deep):
    named = replace(deep.rules[0], id='"conditions": [] \\ \N{DEGREE SIGN}')
    rules = replace(deep, rules=(named, *deep.rules[1:]))
    lines = [line for line in rules_to_json(rules).splitlines() if '"conditions"' in line]
    assert len(lines) == len(rules)
    for line, rule in zip(lines, rules, strict=True):
        entry = json.loads(line.strip().rstrip(","))
        assert line.strip().rstrip(",") == json.dumps(entry, ensure_ascii=False)
        assert entry["id"] == rule.id
        assert entry["length"] == len(entry["conditions"]) == rule.length


def test_saving_very_many_conditions_takes_little_memory(deep, tmp_path):
    tracemalloc.start()
    try:
        deep.save(tmp_path / "rules.json")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2 * 2**20


def test_a_file_that_takes_too_much_memory_is_said_to(deep, tmp_path, monkeypatch):
    path = tmp_path / "rules.json"
    deep.save(path)
    monkeypatch.setenv(READ_LIMIT, "0.01")
    with pytest.raises(InputError) as error:
        RuleSet.load(path)
    message = str(error.value)
    assert message.startswith(f"{path}: it unpacks to 0.1 GiB, more than the 0.01 GiB")
    assert READ_LIMIT in message
    assert "JSON" not in message


def test_held_out_pairs_of_version_1_are_read_without_episodes(lander_like):
    document = json.loads(rules_to_json(mine_rules(lander_like, supp_min=0.02, conf_min=0.8)))
    assert document["version"] == 1  # nothing in it is new
    document["rules"][0]["held_out"] = {"samples": 96, "correct": 87}
    read = rules_from_json(json.dumps(document))
    assert read.rules[0].held_out == HeldOut(96, 87, 0, None, None, None)
    again = json.loads(rules_to_json(read))
    assert again["version"] == 2
    assert again["rules"][0]["held_out"] == {
        "samples": 96,
        "correct": 87,
        "episodes": 0,
        "share": None,
        "low": None,
        "high": None,
    }
    assert rules_from_json(json.dumps(again)) == read


def carrying(key, value):
    return lambda d: d["rules"][0].update({key: value})


def held(version=2, **more):
    """A file of a version, whose first rule has held-out pairs, with something else in them."""
    counts = {"samples": 20, "correct": 15}
    if version > 1 and more:
        counts |= {"episodes": 8, "share": 0.7, "low": 0.5, "high": 0.9}

    def change(document):
        document["version"] = version
        document["rules"][0]["held_out"] = counts | more

    return change


BAD = {
    "a box of other features": (
        carrying("box", {"least": [0], "low": [0], "high": [0], "most": [0]}),
        "'least' must be",
    ),
    "a box inside out": (
        lambda d: d["rules"][0].update(
            box={
                name: [value] * len(d["features"])
                for name, value in (("least", 3), ("low", 2), ("high", 1), ("most", 0))
            }
        ),
        "in the order",
    ),
    "more held-out pairs right than there are": (
        carrying("held_out", {"samples": 3, "correct": 4}),
        "'correct' is 4",
    ),
    "a pin that is no yes or no": (carrying("pinned", 1), "'pinned'"),
    "another format": (lambda d: d.update(format="other"), "format"),
    "a later version": (lambda d: d.update(version=4), "version 4"),
    "a version that is yes": (lambda d: d.update(version=True), "version True"),
    "episodes in version 1": (held(version=1, episodes=3), "'episodes' is not known"),
    "version 2 without episodes": (held(), "'episodes' is missing"),
    "a share above 1": (held(share=1.1), "'share'"),
    "no share of episodes": (held(share=None), "'share' does not match its episodes"),
    "half an interval": (held(low=None), "no interval"),
    "an interval inside out": (held(low=0.95), "no interval"),
    "more episodes than pairs": (held(episodes=21), "'episodes'"),
    "an unknown key": (lambda d: d.update(colour="red"), "'colour'"),
    "an unknown key in a rule": (lambda d: d["rules"][0].update(weight=1), "'weight'"),
    "an unknown key in a condition": (
        lambda d: d["rules"][0]["conditions"][0].update(unit="m"),
        "'unit'",
    ),
    "an unknown threshold": (lambda d: d["thresholds"].update(gini=1), "'gini'"),
    "an unknown kind": (lambda d: d["actions"][0].update(kind="fuzzy"), "'fuzzy'"),
    "an unknown operator": (
        lambda d: d["rules"][0]["conditions"][0].update(op="<"),
        "operator '<'",
    ),
    "an unknown feature": (
        lambda d: d["rules"][0]["conditions"][0].update(feature=99),
        "feature 99",
    ),
    "an unknown label": (lambda d: d["rules"][0].update(action=17), "action 17"),
    "an unknown dimension": (lambda d: d["rules"][0].update(dimension=3), "dimension 3"),
    "an unknown origin": (lambda d: d["rules"][0].update(origin="dream"), "'dream'"),
    "a missing key": (lambda d: d["rules"][0].pop("support"), "'support' is missing"),
    "a wrong length": (lambda d: d["rules"][0].update(length=77), "'length'"),
    "a text for a number": (lambda d: d["rules"][0].update(support="all"), "'support'"),
    "a truth value for a number": (lambda d: d["rules"][0].update(samples=True), "'samples'"),
    "a threshold that is no number": (
        lambda d: d["rules"][0]["conditions"][0].update(threshold=float("nan")),
        "not a number from",
    ),
    "a threshold beyond every float": (
        lambda d: d["rules"][0]["conditions"][0].update(threshold=10**400),
        "far too large",
    ),
    "a version beyond counting": (lambda d: d.update(version=10**400), "far too large"),
    "a depth beyond counting": (lambda d: d["thresholds"].update(max_depth=10**400), "far too"),
    "no steps": (lambda d: d["demonstrations"].update(steps=0), "'steps' is 0"),
    "a confidence of 7": (lambda d: d["rules"][0].update(confidence=7), "'confidence' is 7"),
    "more samples than steps": (lambda d: d["rules"][0].update(samples=10**9), "'samples'"),
    "a divider of 0": (lambda d: d.update(divider=0), "'divider' is 0"),
    "a doubled id": (lambda d: d["rules"].append(d["rules"][0]), "stands twice"),
    "a doubled feature": (
        lambda d: d["features"][1].update(name=d["features"][0]["name"]),
        "stands twice in features 1",
    ),
    "a feature without a name": (
        lambda d: d["features"][1].update(name=" "),
        "the name is empty in features 2",
    ),
    "no features": (lambda d: d.update(features=[]), "features"),
    "an impossible threshold": (lambda d: d["thresholds"].update(support=3.0), "'support' is 3"),
    "a rule that is a number": (lambda d: d["rules"].append(5), "not an object"),
    "both ends of a range": (
        lambda d: d["rules"][1].update(support=2),
        "'support' is 2, not a number from 0 to 1 in rules 2;",
    ),
    "what there is to choose from": (
        lambda d: d["rules"][0]["conditions"][1].update(op="=="),
        "the operator '==' is neither '<=' nor '>' in rules 1 conditions 2;",
    ),
    "kinds of actions": (
        lambda d: d["actions"][0].update(kind="fuzzy"),
        "the kind 'fuzzy' is neither 'discrete' nor 'interval' in actions 1;",
    ),
    "a key that speaks of another place": (
        lambda d: d.update({"x - at `$.rules[0].support": 1}),
        "'x - at `$.rules[0].support' is not known to this version",
    ),
    "a key of half a pair": (lambda d: d.update({"\ud800": 1}), "holds half of a surrogate pair"),
    "a name of half a pair": (
        lambda d: d["features"][0].update(name="\ud800"),
        "holds half of a surrogate pair",
    ),
    "a word that is none": (
        lambda d: d["features"][0].update(indicator={"column": "mode", "value": ""}),
        "'value' is '', of the wrong kind in features 1 indicator",
    ),
    "a label that is a number": (
        lambda d: d["actions"][0].update(labels=["a", 2]),
        "labels 2 is 2, of the wrong kind in actions 1;",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_not_understood_is_refused_by_name(document, case):
    spoil, names = BAD[case]
    copy = json.loads(json.dumps(document))
    spoil(copy)
    with pytest.raises(InputError) as caught:
        read(copy)
    assert names in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null", '{"format": "sarl-rules"}', "\xff"])
def test_what_is_no_rule_file_is_refused(text, tmp_path):
    path = tmp_path / "rules.json"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match=r"rules\.json"):
        RuleSet.load(path)


def test_a_missing_file_and_a_missing_folder_are_said(tmp_path, lander_like):
    with pytest.raises(InputError, match="cannot be read"):
        RuleSet.load(tmp_path / "none.json")
    with pytest.raises(InputError, match="does not exist"):
        mine_rules(lander_like, supp_min=0.1, conf_min=0.5).save(tmp_path / "no" / "rules.json")


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**400),
    st.just(-(10**30)),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.integers(), max_size=3),
    st.just({}),
    st.just([[]]),
)


def places(value, path=()):
    """Where a document holds anything, however deep."""
    if isinstance(value, dict):
        for key in value:
            yield (*path, key)
            yield from places(value[key], (*path, key))
    elif isinstance(value, list):
        for index, entry in enumerate(value[:2]):
            yield (*path, index)
            yield from places(entry, (*path, index))


@settings(max_examples=300)
@given(st.data())
def test_whatever_stands_in_a_file_is_read_or_refused_in_a_sentence(document, data):
    copy = json.loads(json.dumps(document))
    *path, last = data.draw(st.sampled_from(list(places(copy))))
    target = copy
    for key in path:
        target = target[key]
    target[last] = data.draw(ODD)
    try:
        rules = read(copy)
    except InputError as caught:
        said = str(caught)
    else:
        said = ""
        assert 0 <= rules.coverage <= len(rules)
        assert rules_from_json(rules_to_json(rules)) == rules
    assert "\n" not in said
    assert len(said) < 400


def test_a_file_says_that_a_histogram_learner_grew_the_trees(lander_like, tmp_path):
    trees = grow_policy_trees(lander_like, learner="histogram")
    rules = mine_rules(trees, supp_min=0.01, conf_min=0.9)
    path = tmp_path / "rules.json"
    rules.save(path)
    document = json.loads(path.read_text())
    assert (document["version"], document["learner"]) == (2, "histogram")
    assert RuleSet.load(path) == rules
    assert RuleSet.load(path).learner == "histogram"
    exact = mine_rules(lander_like, supp_min=0.01, conf_min=0.9)
    exact.save(path)
    assert "learner" not in json.loads(path.read_text())
    path.write_text(json.dumps(document | {"learner": "guess"}))
    with pytest.raises(InputError, match="learner"):
        RuleSet.load(path)
