"""Words as actions and as features: labels and indicators, in memory and in every format."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core import Demonstrations, ShieldedEnv, load_demonstrations, mine_rules
from sarl_core.auditing.audit import audit
from sarl_core.demonstrations.fields import Indicator
from sarl_core.demonstrations.formats import read_demonstrations, save_demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.errors import InputError
from sarl_core.explaining.words.what_if import near_miss_text
from sarl_core.mining.editing.manual_rules import asks_of, manual_rule
from sarl_core.mining.language import conditions_text
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet, rules_from_json
from sarl_core.shielding.neighbourhood import FeatureChange
from sarl_core.shielding.shield import Shield

ROWS = "mode,gap,done_by,action\n" + "".join(
    f"{('heavy', 'light', 'medium')[i % 3]},{i % 7}.5,{str(i % 2 == 0).lower()},"
    f"{'brake' if i % 3 == 0 else 'hoist'}\n"
    for i in range(30)
)


def read(text: str, name: str = "log.csv", **options: Any) -> Demonstrations:
    return read_demonstrations(text.encode(), name, **options)


def test_words_of_a_file_are_labels_and_indicators() -> None:
    log = read(ROWS)
    assert log.label_names == (("brake", "hoist"),)
    assert log.feature_names == (
        "mode is heavy",
        "mode is light",
        "mode is medium",
        "gap",
        "done_by",
    )
    assert log.indicators is not None
    assert log.indicators[4] == Indicator("done_by", "true", "false")
    assert log.observations[:3].tolist() == [
        [1, 0, 0, 0.5, 1],
        [0, 1, 0, 1.5, 0],
        [0, 0, 1, 2.5, 1],
    ]
    rules = mine_rules(log, supp_min=0.0, conf_min=1.0).to_text()
    assert "If the mode is heavy, then brake" in rules
    assert "If the mode is not heavy, then hoist" in rules


def test_two_words_are_one_feature_and_both_are_said() -> None:
    log = read(ROWS.replace("medium", "light"))
    assert log.feature_names == ("mode is heavy", "gap", "done_by")
    text = mine_rules(log, supp_min=0.0, conf_min=1.0).to_text()
    assert "If the mode is heavy, then brake" in text
    assert "If the mode is light, then hoist" in text


@pytest.mark.parametrize(
    ("actions", "names", "column"),
    [
        (np.array(["up", "down", "up", "down"]), ("down", "up"), [1, 0, 1, 0]),
        (np.array([True, False, True, True]), ("false", "true"), [1, 0, 1, 1]),
        (
            pd.Categorical(["low", "high", "mid", "low"], ["low", "mid", "high"], ordered=True),
            ("low", "mid", "high"),
            [0, 2, 1, 0],
        ),
        (pd.Series(["b", "a", "c", "a"], dtype="category"), ("a", "b", "c"), [1, 0, 2, 0]),
        (np.array([100, 90000, 205, 100]), ("100", "205", "90000"), [0, 2, 1, 0]),
        (np.array([-1, 1, 1, -1]), ("-1", "1"), [0, 1, 1, 0]),
        (np.array([3, 4, 5, 4]), ("3", "4", "5"), [0, 1, 2, 1]),
    ],
)
def test_labels_keep_their_names_and_their_order(
    actions: Any, names: tuple[str, ...], column: list[int]
) -> None:
    shown = Demonstrations(np.arange(8.0).reshape(4, 2), actions, np.zeros(4, int))
    assert shown.label_names == (names,)
    (dimension,) = shown.action_dimensions
    assert dimension.labels_of(shown.action_columns[:, 0]).tolist() == column


def test_several_columns_of_words() -> None:
    frame = pd.DataFrame({"gear": ["up", "down", "up"], "lamp": ["on", "off", "off"]})
    shown = Demonstrations(np.eye(3), frame, np.zeros(3, int), action_names=("gear", "lamp"))
    assert shown.label_names == (("down", "up"), ("off", "on"))
    rules = mine_rules(shown, supp_min=0.0, conf_min=1.0).to_text()
    assert "then up" in rules
    assert "then lamp on" in rules


def test_an_ordered_category_of_parquet_keeps_its_order(tmp_path: Path) -> None:
    levels = pd.Categorical(["low", "high", "mid"] * 4, ["low", "mid", "high"], ordered=True)
    frame = pd.DataFrame({"obs_x": np.arange(12.0), "obs_level": levels, "action": levels})
    frame.to_parquet(tmp_path / "log.parquet")
    log = load_demonstrations(tmp_path / "log.parquet")
    assert log.label_names == (("low", "mid", "high"),)
    assert log.feature_names == ("x", "level is low", "level is mid", "level is high")


def test_a_dictionary_column_without_an_order_is_sorted(tmp_path: Path) -> None:
    action = pa.array(["push", "brake", "push", "brake"]).dictionary_encode()
    pq.write_table(pa.table({"obs_x": [1.0, 2, 3, 4], "action": action}), tmp_path / "a.parquet")
    log = load_demonstrations(tmp_path / "a.parquet")
    assert log.label_names == (("brake", "push"),)
    assert log.actions.tolist() == [1, 0, 1, 0]


def test_words_name_the_actions_of_a_known_environment() -> None:
    header = "obs_0,obs_1,obs_2,obs_3,action\n"
    named = read(header + "0,0,0,0,Push right\n1,1,1,1,push left\n", env_id="CartPole-v1")
    assert named.actions.tolist() == [1, 0]
    truths = read(header + "0,0,0,0,True\n1,1,1,1,False\n", env_id="CartPole-v1")
    assert truths.actions.tolist() == [1, 0]
    with pytest.raises(InputError, match=r"'jump', which is none of the actions of CartPole-v1"):
        read(header + "0,0,0,0,jump\n1,1,1,1,push left\n", env_id="CartPole-v1")
    with pytest.raises(InputError, match=r"column 'obs_3' holds words, as 'a', and"):
        read(header + "0,0,0,a,0\n1,1,1,b,1\n", env_id="CartPole-v1")


def test_a_shield_executes_the_action_of_a_code(tmp_path: Path) -> None:
    codes = np.array([100, 205, 90000] * 4)
    shown = Demonstrations(codes[:, None] / 1000, codes, np.zeros(12, int))
    rules = mine_rules(shown, supp_min=0.0, conf_min=1.0)
    rules.save(tmp_path / "rules.json")
    shield = Shield(RuleSet.load(tmp_path / "rules.json"))
    states = np.array([[0.1], [0.2], [90.0], [90.0]], dtype=np.float32)
    proposed = np.array([205, 205, 100, 777])  # no label, and no reason to let it pass
    executed = shield.decide_batch(states, proposed).executed
    assert executed.tolist() == [100, 205, 90000, 90000]
    assert [
        shield.decide(state, action).executed
        for state, action in zip(states, proposed, strict=True)
    ] == executed.tolist()


WORDS = (
    st.text("abcdefgh xyz'\",;é", min_size=1, max_size=8)
    .map(str.strip)
    .filter(lambda word: word and word not in ("na",))
)


@given(
    st.lists(st.tuples(WORDS, WORDS, st.booleans()), min_size=3, max_size=12),
    st.sampled_from(("parquet", "csv", "npz")),
)
def test_saved_words_are_read_again(rows: list[tuple[str, str, bool]], kind: str) -> None:
    mode, action, brake = (pa.array(column) for column in zip(*rows, strict=True))
    out = pa.BufferOutputStream()
    table = pa.table({"obs_mode": mode, "obs_brake": brake, "action": action})
    pq.write_table(table, out)
    log = read_demonstrations(out.getvalue().to_pybytes(), "log.parquet")
    with TemporaryDirectory() as folder:
        save_demonstrations(log, path := Path(folder) / f"log.{kind}")
        again = load_demonstrations(path)
    assert again.label_names == log.label_names
    assert again.features == log.features
    assert np.array_equal(again.observations, log.observations)
    assert np.array_equal(again.actions, log.actions)


def test_a_word_that_csv_cannot_hold_is_refused(tmp_path: Path) -> None:
    shown = Demonstrations(np.eye(2), np.array(["NA", "EU"]), np.zeros(2, int))
    with pytest.raises(InputError, match=r"'action' holds 'NA' as a word"):
        save_demonstrations(shown, tmp_path / "log.csv")
    assert not (tmp_path / "log.csv").exists()


def mined_words() -> RuleSet:
    return mine_rules(read(ROWS), supp_min=0.0, conf_min=1.0)


def test_another_log_says_its_words_as_the_rules_do() -> None:
    rules = mined_words()
    few = ROWS.replace("medium", "light")  # two words are one feature, and three are three
    log = recoded(read(few), rules.source.features, called="the log")
    assert log.features == rules.source.features
    assert log.observations[:3, :3].tolist() == [[1, 0, 0], [0, 1, 0], [0, 1, 0]]
    held = audit(rules, read(few))
    assert held.agreement == 1.0
    one = read(ROWS.replace("medium", "heavy").replace("light", "heavy"))
    assert recoded(one, rules.source.features, called="the log").observations[:, 0].all()


def test_a_word_that_rules_do_not_know_is_named() -> None:
    rules, strange = mined_words(), read(ROWS.replace("medium", "huge"))
    said = r"the mode 'huge' in row 3 \(10 rows in all\).*mined from heavy, light, medium"
    with pytest.raises(InputError, match=said):
        audit(rules, strange)
    with pytest.raises(InputError, match=said):
        rules_for(rules, strange)


def test_labels_of_a_log_may_be_spelled_in_several_ways() -> None:
    rules = mined_words()
    lines = ROWS.splitlines(keepends=True)
    mixed = "".join(
        line.replace("brake", "Brake") if at % 2 else line for at, line in enumerate(lines)
    )
    assert len(read(mixed).label_names[0]) == 3
    assert audit(rules, read(mixed)).broken == audit(rules, read(ROWS)).broken


def test_numbers_are_no_words_whatever_their_column_is_called() -> None:
    rules = mined_words()
    beside = "".join(
        f"{'MODE' if not at else at % 2},{line}"
        for at, line in enumerate(ROWS.splitlines(keepends=True))
    )
    held = audit(rules, read(beside))
    assert held.agreement == audit(rules, read(ROWS)).agreement
    assert any("MODE of the log is no feature of the rules" in note for note in held.notes)
    flags = read(ROWS.replace("true", "1").replace("false", "0"))
    assert audit(rules, flags).agreement == held.agreement


def test_words_are_said_in_edits_and_near_misses() -> None:
    rules = mined_words()
    features = rules.source.features
    assert features[0].statement(False) == "mode is not heavy"
    assert features[4].statement(False) == "done_by is false"
    renamed = replace(features[0], name="load is large")
    assert renamed.statement(False) == "load is not large"
    assert replace(features[0], name="laden").statement(True) == "laden is true"
    change = FeatureChange(0, 0.0, 1.0)
    assert near_miss_text((change,), features) == "mode were heavy"
    asks, other = asks_of(rules[0], rules), 1 - rules[0].action
    again = manual_rule(rules, asks, rule_id="by hand", action=other, dimension=0)
    assert conditions_text(again, rules) == conditions_text(rules[0], rules)


def test_a_rule_file_with_words_has_version_2_and_others_stay_what_they_were(
    tmp_path: Path,
) -> None:
    rules = mined_words()
    rules.save(tmp_path / "rules.json")
    document = json.loads((tmp_path / "rules.json").read_text())
    assert document["version"] == 2
    assert document["features"][0]["indicator"] == {"column": "mode", "value": "heavy"}
    assert RuleSet.load(tmp_path / "rules.json").digest == rules.digest
    document["features"][0]["indicator"]["colour"] = "red"
    with pytest.raises(InputError, match=r"'colour' is not known to this version"):
        rules_from_json(json.dumps(document))
    plain = mine_rules(read("obs_x,action\n1,0\n2,1\n"), supp_min=0.0, conf_min=1.0)
    plain.save(tmp_path / "plain.json")
    assert json.loads((tmp_path / "plain.json").read_text())["version"] == 1


def test_words_of_an_unknown_environment_are_said_to_stand_for_its_actions() -> None:
    header = "cart position,cart velocity,pole angle,pole angular velocity,action\n"
    log = read(header + "0,0,0,1,right\n0,0,0,-1,left\n0,0,0,2,right\n0,0,0,-2,left\n")
    shield = Shield(mine_rules(log, supp_min=0.0, conf_min=1.0))
    env = ShieldedEnv(gymnasium.make("CartPole-v1"), shield)
    assert any("'left' for 0, 'right' for 1" in note for note in env.notes)
    swapped = replace(log, label_names=(("push right", "push left"),))
    shield = Shield(mine_rules(swapped, supp_min=0.0, conf_min=1.0))
    with pytest.raises(InputError, match=r"otherwise than the environment numbers .* --env"):
        ShieldedEnv(gymnasium.make("CartPole-v1"), shield)
