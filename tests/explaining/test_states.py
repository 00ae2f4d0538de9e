"""States in tables: words are said as words, and not as 1 and 0."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pandas as pd

from sarl_core import Demonstrations, grow_policy_trees, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.explaining.exports.steps import RecordedSteps, steps_to_csv
from sarl_core.explaining.report.demonstrations import demonstrations_part
from sarl_core.explaining.report.tally import tally
from sarl_core.explaining.tables.recorder import recorder_columns
from sarl_core.explaining.tables.rule_evidence import example_columns
from sarl_core.explaining.words.replay import state_rows
from sarl_core.explaining.words.states import state_columns, word_shares
from sarl_core.explaining.words.what_if import outside_texts
from sarl_core.mining.evidence import DataBox
from sarl_core.rollouts.steps import StepTable

MODES = ("heavy", "light", "mixed")
FEATURES = (
    *(Feature(f"mode is {word}", "", Indicator("mode", word)) for word in MODES),
    Feature("wind", "m/s"),
    Feature("ground is firm", "", Indicator("ground", "firm", "soft")),
    Feature("brake", "", Indicator("brake", "true", "false")),
)
STATES = np.array([[0, 0, 1, 9.5, 1, 0], [1, 0, 0, 3.0, 0, 1], [0, 0, 0, 3.0, 0, 1]], np.float32)


def log() -> Demonstrations:
    rows = "".join(
        f"{i // 10},{MODES[i % 3]},{i % 7}.5,{['firm', 'soft'][i % 2]},"
        f"{'up' if i % 3 else 'down'}\n"
        for i in range(60)
    )
    return read_demonstrations(f"run,mode,gap,ground,action\n{rows}".encode(), "log.csv")


def test_a_column_of_words_is_one_column() -> None:
    columns = state_columns(FEATURES)
    assert [one.title for one in columns] == ["mode", "wind", "ground", "brake"]
    assert [one.of_words for one in columns] == [True, False, True, True]
    assert columns[0].words(STATES) == ["mixed", "heavy", "–"]
    assert columns[2].words(STATES) == ["firm", "soft", "soft"]
    assert columns[3].words(STATES) == ["false", "true", "true"]


def test_renamed_words_keep_their_names_and_those_that_part_stand_alone() -> None:
    load = [replace(one, name=one.name.replace("mode is heavy", "load is big")) for one in FEATURES]
    assert [one.title for one in state_columns(load)][:3] == ["load", "mode", "mode"]
    whole = [replace(one, name=one.name.replace("mode", "load")) for one in FEATURES]
    assert state_columns(whole)[0].title == "load"
    laden = state_columns([replace(FEATURES[4], name="laden")])[0]
    assert (laden.title, laden.words(STATES[:, 4:])) == ("laden", ["true", "false", "false"])


def test_tables_and_files_of_states_say_words() -> None:
    rows = state_rows(STATES[0], FEATURES, FEATURES, ())
    assert rows == (
        ("mode", "mixed", ""),
        ("wind", "9.5", "m/s"),
        ("ground", "firm", ""),
        ("brake", "false", ""),
    )
    shown = log()
    (tree,) = grow_policy_trees(shown)
    rules = mine_rules((tree,), supp_min=0.0, conf_min=1.0)
    examples = example_columns(shown, tree, rules[0])
    assert set(examples["ground"]) == {"firm", "soft"}
    assert not {name for name in examples if " is " in name}
    steps = StepTable(
        episode=np.zeros(3, np.int64),
        step=np.arange(3),
        observation=STATES.copy(),
        proposed=np.zeros((3, 1), np.int64),
        executed=np.zeros((3, 1), np.int64),
        rules=np.full((3, 1), -1),
        intervened=np.zeros(3, bool),
        margin=np.full(3, np.inf),
        reward=np.zeros(3),
    )
    columns = recorder_columns(steps, np.arange(3), rules.actions, FEATURES, None)
    assert columns["mode"] == ["mixed", "heavy", "–"]
    assert "mode is heavy" not in columns
    recorded = RecordedSteps(steps, "", "", [7], FEATURES, None)
    written = pd.read_csv(io.BytesIO(steps_to_csv(recorded)), dtype=str)
    assert written["obs_ground"].tolist() == ["firm", "soft", "soft"]
    assert [name for name in written.columns if name.startswith("obs_")] == [
        "obs_mode",
        "obs_wind",
        "obs_ground",
        "obs_brake",
    ]


def test_how_often_which_word_stands_there_is_told_in_place_of_numbers() -> None:
    shown = log()
    assert word_shares(shown)["ground"] == {"firm": 0.5, "soft": 0.5}
    assert set(word_shares(shown)["mode"].values()) == {1 / 3}
    rules = mine_rules(shown, supp_min=0.0, conf_min=1.0)
    part = demonstrations_part(rules, shown, tally(rules, shown))
    assert [line.name for line in part.features] == ["gap"]
    assert "1 number and 2 words listed below" in part.sentences[0]
    assert "The ground was firm in 50 % of the steps, soft in 50 %." in part.sentences


def test_a_word_that_was_never_seen_is_told_once() -> None:
    rules = mine_rules(log(), supp_min=0.0, conf_min=1.0)
    light = DataBox((0, 1, 0, 0, 0), (0,) * 5, (0,) * 5, (0, 1, 0, 9, 1))
    rule = replace(rules[0], box=light)
    state = (1.0, 0.0, 0.0, 3.5, 1.0)
    assert outside_texts(rule, state, rules.source.features) == (
        "mode is heavy, which was never seen there",
    )
