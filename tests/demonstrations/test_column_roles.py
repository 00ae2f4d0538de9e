from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sarl_core.demonstrations.formats import (
    ColumnRole,
    load_demonstrations,
    load_roles,
    preview_columns,
    read_demonstrations,
)
from sarl_core.demonstrations.formats.mapping.roles import role_from_text, save_roles
from sarl_core.errors import InputError
from tests.bad_inputs import csv_bytes

RANDOM = np.random.default_rng(4)
N = 60
SPEED, GAP = RANDOM.uniform(0, 9, (2, N)).round(3)
BRAKE = RANDOM.integers(0, 2, N)
PERCENT = RANDOM.integers(0, 101, N)
LANE = RANDOM.integers(0, 3, N)
EPISODE = np.arange(N) // 15


def table(**columns: object) -> bytes:
    rows = [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return csv_bytes(*rows, header=",".join(columns))


def refusal(content: bytes, columns: dict[str, str] | None = None) -> str:
    with pytest.raises(InputError) as error:
        read_demonstrations(content, "rig.csv", columns=columns)
    return str(error.value)


def test_what_is_said_of_a_column_settles_what_was_unclear():
    content = table(v=SPEED, a=GAP, brake=BRAKE, episode=EPISODE)
    assert "--column a=action or --column brake=action" in refusal(content)
    demonstrations = read_demonstrations(content, "rig.csv", columns={"brake": "action"})
    assert demonstrations.feature_names == ("v", "a")
    assert demonstrations.actions.tolist() == BRAKE.tolist()
    assert [use.why for use in demonstrations.columns if use.column == "brake"] == [
        "as it was mapped"
    ]


def test_one_unclear_column_is_settled_without_naming_the_others():
    content = table(speed=SPEED, lane_id=LANE, gap=GAP, action=BRAKE, episode=EPISODE)
    sentence = refusal(content)
    assert "'lane_id'" in sentence
    assert "--column lane_id=feature or --column lane_id=ignore" in sentence
    for role, features in (("feature", 3), ("ignore", 2)):
        read = read_demonstrations(content, "rig.csv", columns={"lane_id": role})
        assert read.observations.shape == (N, features)


def test_a_name_with_spaces_can_be_pasted_into_a_shell():
    assert "--column 'lane id=feature'" in refusal(
        table(**{"speed": SPEED, "lane id": LANE, "action": BRAKE})
    )


def test_a_whole_number_action_is_an_amount_with_bounds_where_that_is_said():
    content = table(x=SPEED, y=GAP, action=PERCENT, episode=EPISODE)
    assert read_demonstrations(content, "rig.csv").is_discrete
    free = read_demonstrations(content, "rig.csv", columns={"action": "action:continuous"})
    assert free.bounds_from == "demonstrated values"
    bounded = read_demonstrations(
        content, "rig.csv", columns={"action": "action:continuous:0:100", "x": "feature:m"}
    )
    assert (bounded.action_low, bounded.action_high) == ((0.0,), (100.0,))
    assert bounded.bounds_from == "action space"
    assert bounded.feature_units == ("m", "")
    assert "outside the action space" in refusal(content, {"action": "action:continuous:0:9"})


def test_amounts_without_fraction_are_labels_where_that_is_said():
    content = table(x=SPEED, action=[f"{one}.0" for one in PERCENT], episode=EPISODE)
    assert not read_demonstrations(content, "rig.csv").is_discrete
    assert read_demonstrations(content, "rig.csv", columns={"action": "action:labels"}).is_discrete
    fractions = table(x=SPEED, action=GAP, episode=EPISODE)
    assert "which is no label" in refusal(fractions, {"action": "action:labels"})


def test_labels_and_amounts_are_not_mixed_and_bounds_are_given_to_each():
    content = table(x=SPEED, steer=PERCENT, gas=LANE, episode=EPISODE)
    mixed = {"steer": "action:continuous", "gas": "action:labels"}
    assert "'steer' is continuous and 'gas' is labels" in refusal(content, mixed)
    halved = {"steer": "action:continuous:0:100", "gas": "action:continuous"}
    assert "'steer' has bounds and 'gas' has none" in refusal(content, halved)


def test_every_column_but_one_can_be_left_out():
    columns = {"gap": "ignore", "clock": "time", "lane": "episode", "brake": "action"}
    content = table(speed=SPEED, gap=GAP, clock=GAP, lane=EPISODE, brake=BRAKE)
    read = read_demonstrations(content, "rig.csv", columns=columns)
    assert (read.feature_names, read.n_episodes) == (("speed",), 4)


@pytest.mark.parametrize(
    ("columns", "fragment"),
    [
        ({"nothing": "action"}, "there is no column 'nothing' among"),
        ({"x": "episode", "y": "episode"}, "'x' and 'y' are both said to be the episode number"),
        ({"x": "acton"}, "'acton' is no role"),
        ({"x": "action:sometimes"}, "is no role"),
        ({"x": "action:continuous:3"}, "is no role"),
        ({"x": "action:continuous:a:b"}, "bounds that are no numbers"),
        ({"x": "action:continuous:2:1"}, "the lower one first"),
        ({"x": "action:continuous:0:inf"}, "the lower one first"),
        ({"x": "action:labels:0:1"}, "only a continuous action has bounds"),
        ({"x": "episode:m"}, "is no role"),
        ({"x": "episode as run"}, "that is 'episode' has no other name"),
        ({"x": "feature as "}, "'feature as' is no role"),
        ({"x": "feature as z", "y": "feature as z"}, "both said to be the feature 'z'; choose one"),
        ({"x": "feature as y"}, "there is a column of that name; say what that one is"),
        ({"x": "feature as y", "y": "feature"}, "the feature name 'y' stands twice"),
    ],
)
def test_what_cannot_be_said_is_refused_in_a_sentence(columns: dict[str, str], fragment: str):
    content = table(x=SPEED, y=GAP, action=BRAKE)
    assert fragment in refusal(content, columns)


def test_a_role_reads_as_it_is_written():
    for text in (
        "episode",
        "feature:km/h",
        "feature:km/h as own speed",
        "feature as time: to go",
        "action:labels",
        "action:continuous:-0.5:1e-09",
        "action as pedal",
    ):
        assert str(role_from_text(text)) == text


def test_features_and_actions_are_called_as_was_said(tmp_path: Path):
    content = table(obs_v=SPEED, obs_a=GAP, gas=LANE, brake=BRAKE, episode=EPISODE)
    said = {
        "obs_v": "feature:m/s as own speed",
        "brake": "action:labels as pedal",
        "gas": "action:labels",
    }
    read = read_demonstrations(content, "rig.csv", columns=said)
    assert read.feature_names == ("own speed", "a")
    assert read.feature_units == ("m/s", "")
    assert {one.name for one in read.action_dimensions} == {"gas", "pedal"}
    roles = {name: role_from_text(role) for name, role in said.items()}
    save_roles(tmp_path / "columns.json", roles, {})
    assert load_roles(tmp_path / "columns.json") == roles


def test_the_action_of_somebody_is_the_action():
    content = table(speed=SPEED, operator_action=BRAKE, run=EPISODE)
    read = read_demonstrations(content, "rig.csv")
    assert (read.feature_names, read.n_episodes) == (("speed",), 4)
    two = table(speed=SPEED, operator_action=BRAKE, agent_action=LANE, run=EPISODE)
    assert "--column operator_action=action" in refusal(two)
    beside = table(speed=SPEED, action=BRAKE, agent_action=LANE, run=EPISODE)
    assert "unclear of the column 'agent_action'" in refusal(beside)


def test_a_complete_table_beside_actions_is_not_joined_to_them(tmp_path: Path):
    (tmp_path / "rig_states.csv").write_bytes(
        table(speed=SPEED, operator_action=BRAKE, run=EPISODE)
    )
    (tmp_path / "rig_actions.csv").write_bytes(table(action=LANE))
    read = load_demonstrations(tmp_path / "rig_states.csv")
    assert read.actions.tolist() == BRAKE.tolist()


def test_a_suggestion_can_be_edited_and_given_back(tmp_path: Path):
    path = tmp_path / "rig.csv"
    path.write_bytes(table(id=LANE, v=SPEED, a=GAP, brake=BRAKE, episode=EPISODE))
    previews = preview_columns(path)
    roles = {one.name: one.role for one in previews}
    assert {name for name, role in roles.items() if role is None} == {"id", "a", "brake"}
    assert roles["episode"] == ColumnRole("episode")
    assert {one.name: one.holds for one in previews}["v"] == "numbers"
    out = tmp_path / "columns.json"
    save_roles(out, roles, {one.name: one.why for one in previews})
    with pytest.raises(InputError, match=r"column 'id': it is left open what it is"):
        load_roles(out)
    document = json.loads(out.read_text())
    document["columns"]["id"]["role"] = "ignore"
    document["columns"]["a"] = "feature:m/s²"
    document["columns"]["brake"] = {"role": "action", "kind": "labels"}
    out.write_text(json.dumps(document))
    read = load_demonstrations(path, columns=load_roles(out))
    assert (read.feature_names, read.feature_units) == (("v", "a"), ("", "m/s²"))


@pytest.mark.parametrize(
    ("change", "fragment"),
    [
        ({"format": "sarl-rules"}, "the format 'sarl-rules'"),
        ({"version": 9}, "'version' is 9"),
        ({"columns": {"x": {"role": "acton"}}}, "column 'x' the role 'acton' is neither"),
        ({"columns": {"x": {"role": "feature", "low": 1}}}, "neither labels nor continuous"),
        ({"columns": {"x": {"rule": "feature"}}}, "'rule'"),
        ({"columns": []}, "'columns'"),
        ({"more": 1}, "'more' is not known"),
    ],
)
def test_a_file_of_roles_is_refused_by_what_is_wrong(
    tmp_path: Path, change: dict[str, object], fragment: str
):
    path = tmp_path / "columns.json"
    document = {"format": "sarl-columns", "version": 1, "columns": {"x": "feature"}}
    path.write_text(json.dumps(document | change))
    with pytest.raises(InputError) as error:
        load_roles(path)
    assert str(error.value).startswith(f"{path}: ")
    assert fragment in str(error.value)


def test_texts_number_the_episodes_in_the_order_of_the_file():
    runs = [f"run_{10 - episode}" for episode in EPISODE]
    read = read_demonstrations(table(run=runs, speed=SPEED, action=BRAKE), "rig.csv")
    assert read.episodes.tolist() == EPISODE.tolist()
    assert "'run_10' first" in " ".join(read.notes)
    scattered = [f"run_{episode % 2}" for episode in EPISODE]
    sentence = refusal(table(episode=scattered, speed=SPEED, action=BRAKE))
    assert "comes back" in sentence


def test_words_are_labels_and_no_amounts():
    content = table(speed=SPEED, operator=[("hold", "go")[one] for one in BRAKE], run=EPISODE)
    read = read_demonstrations(content, "rig.csv", columns={"operator": "action:labels"})
    assert read.action_dimensions[0].labels == ("go", "hold")
    assert "holds words" in refusal(content, {"operator": "action:continuous"})
    (preview,) = [one for one in preview_columns(content, "rig.csv") if one.name == "operator"]
    assert (preview.holds, set(preview.first)) == ("words", {"hold", "go"})


LEFT, RIGHT = (LANE == 1).astype(int), (LANE == 2).astype(int)
JOINED = {"action_left+action_right": "action"}


def test_columns_that_are_never_both_1_are_offered_and_read_as_one_action():
    content = table(speed=SPEED, action_left=LEFT, action_right=RIGHT, run=EPISODE)
    two = read_demonstrations(content, "rig.csv")
    assert two.actions.shape == (N, 2)
    assert "--column action_left+action_right=action" in " ".join(two.notes)
    one = read_demonstrations(content, "rig.csv", columns=JOINED)
    assert one.action_dimensions[0].labels == ("none", "left", "right")
    assert one.actions.tolist() == LANE.tolist()
    assert not any("--column" in note for note in one.notes)
    (preview,) = [
        each for each in preview_columns(content, "rig.csv", columns={}) if each.name == "run"
    ]
    assert preview.ones is None


def test_columns_that_are_both_1_are_no_one_action():
    content = table(speed=SPEED, action_left=LEFT, action_right=BRAKE | RIGHT, run=EPISODE)
    row = int(np.argmax(LEFT & BRAKE)) + 1
    assert f"'action_left', 'action_right' are both 1 in row {row}" in refusal(content, JOINED)
    assert "--column" not in " ".join(read_demonstrations(content, "rig.csv").notes)
    amounts = table(speed=SPEED, action_left=LEFT, action_right=PERCENT, run=EPISODE)
    assert "'action_right' holds something else than 1 and 0" in refusal(amounts, JOINED)


@pytest.mark.parametrize(
    ("columns", "fragment"),
    [
        ({"left+right": "feature"}, "can be one action together and nothing else"),
        ({"left+right": "action:continuous"}, "can be one action together and nothing else"),
        ({"left+right": "action", "left": "feature"}, "'left' is mapped twice"),
        ({"left+nothing": "action"}, "no column 'left+nothing'"),
    ],
)
def test_what_is_joined_is_an_action_of_columns_that_are_there(columns, fragment):
    content = table(speed=SPEED, left=LEFT, right=RIGHT, run=EPISODE)
    assert fragment in refusal(content, columns)


def test_features_stand_in_the_order_in_which_a_person_says_them():
    content = table(x_2=SPEED, x_10=GAP, lane=LANE, action=BRAKE, run=EPISODE)
    columns = {"lane": "feature", "x_10": "feature", "x_2": "feature"}
    read = read_demonstrations(content, "rig.csv", columns=columns)
    assert read.feature_names == ("lane", "x_10", "x_2")


def test_a_word_for_observations_is_no_name_where_every_role_is_said():
    content = table(obs_speed=SPEED, obs_gap=GAP, action=BRAKE, episode=EPISODE)
    said = {"obs_speed": "feature:m/s", "obs_gap": "feature", "action": "action"}
    read = read_demonstrations(content, "rig.csv", columns={**said, "episode": "episode"})
    assert read.feature_names == ("speed", "gap")
    assert read.feature_names == read_demonstrations(content, "rig.csv").feature_names
    beside = table(state=LANE, pressure=GAP, action=BRAKE, episode=EPISODE)
    read = read_demonstrations(
        beside, "rig.csv", columns={"state": "feature", "pressure": "feature"}
    )
    assert read.feature_names == ("state", "pressure")
