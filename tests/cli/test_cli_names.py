"""Names tell which feature is which, wherever rules, files and environments meet."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sarl_core import load_demonstrations, save_demonstrations
from sarl_core.cli.app import main
from tests.cli.conftest import CART

ORDER = (2, 3, 0, 1)
AT = ["--support", "0.005", "--confidence", "0.95"]
RUN = ["--env", "CartPole-v1", "--agent", "novice", "--episodes", "4", "--seed", "5", "--json"]


def write(folder: Path, name: str, columns=None, **changes) -> Path:
    """A CSV of Cart Pole whose features stand in another order."""
    shown = load_demonstrations(CART)
    path = folder / f"{name}.csv"
    names = tuple(columns or (shown.feature_names[place] for place in ORDER))
    moved = replace(
        shown,
        observations=shown.observations[:, ORDER],
        feature_names=names,
        feature_units=None,
        env_id="",
        label_names=None,
        **changes,
    )
    frame = dict(zip(names, moved.observations.T, strict=True))
    import pandas as pd

    pd.DataFrame({**frame, "action": moved.actions, "episode": moved.episodes}).to_csv(
        path, index=False
    )
    return path


def mined(capsys, path, *more):
    rules = path.with_suffix(".json")
    code = main(["mine", str(path), *AT, "--out", str(rules), *more])
    capsys.readouterr()
    assert code == 0
    return rules


def evaluated(capsys, rules):
    assert main(["evaluate", *RUN, "--rules", str(rules)]) == 0
    return json.loads(capsys.readouterr().out)


def test_rules_of_columns_in_another_order_act_on_the_right_features(capsys, tmp_path):
    moved = evaluated(capsys, mined(capsys, write(tmp_path, "moved")))
    right = tmp_path / "right.json"
    assert main(["mine", str(CART), *AT, "--out", str(right)]) == 0
    capsys.readouterr()
    expected = evaluated(capsys, right)
    assert moved["summary"]["mean"] == expected["summary"]["mean"] > 300
    assert any("by their names" in note for note in moved["notes"])
    assert expected["notes"] == []


def test_columns_without_names_are_trusted_and_every_command_says_so(capsys, tmp_path):
    path = write(tmp_path, "bare", ["obs_0", "obs_1", "obs_2", "obs_3"])
    rules = mined(capsys, path)
    assert any("no names" in note for note in evaluated(capsys, rules)["notes"])
    assert main(["evaluate", *RUN[:-1], "--rules", str(rules)]) == 0
    assert "no names" in capsys.readouterr().out
    assert main(["check", str(path), "--env", "CartPole-v1", "--json"]) == 0
    assert any("no names" in note for note in json.loads(capsys.readouterr().out)["notes"])
    diff = ["diff", str(rules), str(rules), "--demonstrations", str(CART)]
    assert main([*diff, "--json"]) == 0
    assert any("no names" in note for note in json.loads(capsys.readouterr().out)["notes"])


@pytest.mark.parametrize("command", ["evaluate", "ablate"])
def test_other_names_are_refused_with_both_lists(capsys, tmp_path, command):
    rules = mined(capsys, write(tmp_path, "other", ["a", "b", "c", "d"]))
    more = ["--out", str(tmp_path / "out.csv")] if command == "ablate" else []
    assert main([command, *RUN, "--rules", str(rules), *more]) == 2
    error = capsys.readouterr().err
    assert "a, b, c, d" in error
    assert "cart position, cart velocity, pole angle, pole angular velocity" in error


def test_a_file_of_other_names_is_not_of_the_environment(capsys, tmp_path):
    path = write(tmp_path, "other", ["a", "b", "c", "d"])
    assert main(["check", str(path), "--env", "CartPole-v1"]) == 2
    assert "a, b, c, d" in capsys.readouterr().err


def test_a_file_with_names_in_its_metadata_is_put_into_order_too(capsys, tmp_path):
    shown = load_demonstrations(CART)
    moved = replace(
        shown,
        observations=shown.observations[:, ORDER],
        feature_names=tuple(shown.feature_names[place] for place in ORDER),
        feature_units=tuple(shown.feature_units[place] for place in ORDER),
        env_id="",
    )
    path = tmp_path / "moved.parquet"
    save_demonstrations(moved, path)
    read = load_demonstrations(path, env_id="CartPole-v1")
    assert read.features == shown.features
    assert (read.observations == shown.observations).all()
    assert any("order of CartPole-v1" in note for note in read.notes)


def test_a_renamed_feature_is_still_itself(capsys, tmp_path):
    shown = load_demonstrations(CART)
    renamed = replace(shown, feature_names=("Ort", "Tempo", "pole angle", "Drall"))
    path = tmp_path / "renamed.parquet"
    save_demonstrations(renamed, path)
    found = evaluated(capsys, mined(capsys, path))
    assert found["summary"]["mean"] > 300
    assert any("'Ort' for 'cart position'" in note for note in found["notes"])
