"""Every command, end to end, on the shipped data."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sarl_core import RuleSet, grow_policy_trees, load_demonstrations, mine_rules
from sarl_core.cli.app import main
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.growing import growth

ROOT = Path(__file__).resolve().parents[2]
LANDER = str(ROOT / "data" / "demonstrations" / "lunar_lander.parquet")
CART = str(ROOT / "data" / "demonstrations" / "cartpole.parquet")
PENDULUM = str(ROOT / "data" / "demonstrations" / "pendulum.parquet")
COMMANDS = (
    "record",
    "check",
    "mine",
    "landscape",
    "evaluate",
    "render",
    "train-expert",
    "reproduce",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_has_an_example_and_tells_its_options(command, run):
    text = run(command, "--help")
    assert f"python -m sarl_core {command}" in text.split("Example:")[1]
    assert "--json" in text


def test_the_dashboard_has_a_command(run):
    assert "python -m sarl_core app" in run("app", "--help").split("Example:")[1]


def test_without_a_command_the_commands_are_listed(run):
    text = run()
    assert all(command in text for command in COMMANDS)


def test_check_says_what_is_in_the_file(run):
    text = run("check", LANDER)
    assert "15,000 steps of LunarLander-v3, by expert" in text
    for words in ("horizontal position", "angle (rad)", "fire main engine", "digest", "returns"):
        assert words in text


def test_check_as_json_agrees_with_the_data(run):
    document = json.loads(run("check", LANDER, "--json"))
    demonstrations = load_demonstrations(LANDER)
    assert document["digest"] == demonstrations.digest
    assert document["steps"] == 15_000
    assert document["episodes"] == demonstrations.n_episodes
    assert sum(label["share"] for label in document["actions"][0]["labels"]) == pytest.approx(1)
    lowest = demonstrations.observations.min(axis=0)
    assert [feature["min"] for feature in document["features"]] == lowest.tolist()


@pytest.mark.parametrize(
    ("setting", "support", "confidence"), [("filtered", 0.005, 0.95), ("unfiltered", 0, 1)]
)
def test_the_papers_two_settings_have_names(setting, support, confidence, run, tmp_path):
    named, numbered = tmp_path / "named.json", tmp_path / "numbered.json"
    run("mine", CART, "--setting", setting, "--out", named)
    run("mine", CART, "--support", support, "--confidence", confidence, "--out", numbered)
    assert named.read_bytes() == numbered.read_bytes()
    assert RuleSet.load(named).thresholds.confidence == confidence


def test_check_of_continuous_actions_gives_their_bounds(run):
    action = json.loads(run("check", PENDULUM, "--json"))["actions"][0]
    assert (action["name"], action["low"], action["high"]) == ("torque", -2.0, 2.0)
    assert action["bounds_from"] == "action space"
    assert "-2 to 2" in run("check", PENDULUM)


def rows_of_a_rig(tmp_path):
    path = tmp_path / "rig.csv"
    rows = [f"{i},{0.1 * (i % 7):.1f},{i % 5},{int(i % 7 > 3)},{i // 20}" for i in range(80)]
    path.write_text("\n".join(["row,speed,gap,action,episode", *rows]) + "\n")
    return path


def test_check_tells_what_each_column_was_taken_for(run, tmp_path):
    path = rows_of_a_rig(tmp_path)
    columns = json.loads(run("check", path, "--json"))["columns"]
    assert [(one["column"], one["use"]) for one in columns] == [
        ("row", "not used"),
        ("speed", "feature"),
        ("gap", "feature"),
        ("action", "action"),
        ("episode", "episode number"),
    ]
    text = run("check", path)
    assert "taken for" in text
    assert "it counts the rows" in text
    assert text.count("the columns 'speed', 'gap' were taken as observations") == 1


def test_mine_tells_what_check_tells(run, tmp_path):
    path, rules = rows_of_a_rig(tmp_path), tmp_path / "rules.json"
    said = run("mine", path, "--setting", "filtered", "--out", rules)
    assert "note: the column 'row' was not used: it counts the rows" in said
    document = json.loads(run("mine", path, "--setting", "filtered", "--out", rules, "--json"))
    checked = json.loads(run("check", path, "--json"))
    assert document["notes"] == checked["notes"] != []
    assert document["warnings"] == checked["warnings"]


def test_check_prints_warnings(run, tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("episode,step,obs_x,obs_y,action\n0,0,1.0,2.0,0\n0,1,1.0,3.0,1\n")
    assert "warning: " in run("check", path)
    assert json.loads(run("check", path, "--json"))["warnings"]


def test_record_writes_what_check_reads(run, tmp_path):
    for name in ("cart.parquet", "cart.csv", "cart.npz"):
        path = tmp_path / name
        document = json.loads(
            run(
                "record",
                "--env",
                "CartPole-v1",
                "--agent",
                "novice",
                "--steps",
                120,
                "--seed",
                3,
                "--out",
                path,
                "--json",
            )
        )
        assert document["steps"] == 120
        assert json.loads(run("check", path, "--env", "CartPole-v1", "--json"))["steps"] == 120


def test_record_is_the_same_for_one_seed_and_differs_when_sampled(run, tmp_path):
    def record(name, *more):
        return json.loads(
            run(
                "record",
                "--env",
                "Pendulum-v1",
                "--agent",
                "expert",
                "--steps",
                50,
                "--out",
                tmp_path / name,
                "--json",
                *more,
            )
        )["digest"]

    assert record("a.parquet") == record("b.parquet")
    assert record("a.parquet") != record("c.parquet", "--stochastic")
    assert record("a.parquet") != record("d.parquet", "--seed", 1)


def test_mine_writes_the_rules_and_says_them_in_words(run, tmp_path):
    path = tmp_path / "rules.json"
    text = run("mine", LANDER, "--support", 0.005, "--confidence", 0.95, "--out", path)
    rules = RuleSet.load(path)
    assert len(rules) > 0
    assert (rules.thresholds.support, rules.thresholds.confidence) == (0.005, 0.95)
    assert f"{len(rules):,}" in text
    assert "1. If the " in text


def test_mine_as_json_agrees_with_the_rule_file(run, tmp_path):
    path = tmp_path / "rules.json"
    document = json.loads(
        run(
            "mine",
            PENDULUM,
            "--support",
            0.01,
            "--confidence",
            0.8,
            "--divider",
            4,
            "--max-depth",
            6,
            "--lift",
            1.1,
            "--out",
            path,
            "--json",
        )
    )
    rules = RuleSet.load(path)
    assert document["rules"] == len(rules) == sum(document["rules_per_dimension"].values())
    assert document["coverage"] == rules.coverage
    assert rules.divider == 4
    assert all(rule.length <= 6 and rule.lift >= 1.1 for rule in rules.rules)
    assert document["thresholds"] == {
        "support": 0.01,
        "confidence": 0.8,
        "lift": 1.1,
        "max_depth": 6,
    }


def test_mine_says_so_when_no_rule_is_left(run, tmp_path):
    out = tmp_path / "rules.json"
    arguments = ("mine", LANDER, "--support", 0.9, "--confidence", 1, "--out", out)
    assert "No rule reaches these thresholds" in run(*arguments)
    document = json.loads(run(*arguments, "--json"))
    assert (document["rules"], document["fidelity"]) == (0, None)


def test_a_written_file_can_be_read_by_others(run, tmp_path):
    run("landscape", CART, "--out", tmp_path / "landscape.json")
    (tmp_path / "ordinary").touch()
    written, ordinary = tmp_path / "landscape.json", tmp_path / "ordinary"
    assert written.stat().st_mode == ordinary.stat().st_mode
    assert sorted(path.name for path in tmp_path.iterdir()) == ["landscape.json", "ordinary"]


def test_landscape_json_has_the_papers_grid_and_null_for_no_fidelity(run, tmp_path):
    path = tmp_path / "landscape.json"
    printed = run("landscape", LANDER, "--out", path, "--json")
    document = json.loads(path.read_text())
    assert json.loads(printed) == document | {"notes": []}
    assert document["supports"] == [i / 20 for i in range(11)]
    assert document["confidences"] == [i / 20 for i in range(21)]
    for layer in ("rule_count", "mean_length", "coverage", "fidelity"):
        assert np.array(document[layer], dtype=float).shape == (11, 21)
        assert document["dimensions"][0][layer] == document[layer]
    counts = np.array(document["rule_count"])
    assert (counts == 0).any()
    assert all(
        (fidelity is None) == (count == 0)
        for row, others in zip(document["fidelity"], document["rule_count"], strict=True)
        for fidelity, count in zip(row, others, strict=True)
    )


def test_landscape_agrees_with_mining_at_a_cell_of_the_grid(run, tmp_path):
    path = tmp_path / "landscape.json"
    run(
        "landscape",
        PENDULUM,
        "--divider",
        3,
        "--supports",
        "0.01:0.03:0.01",
        "--confidences",
        "0.7:0.9:0.1",
        "--out",
        path,
    )
    document = json.loads(path.read_text())
    assert document["supports"] == [0.01, 0.02, 0.03]
    mined = json.loads(
        run(
            "mine",
            PENDULUM,
            "--divider",
            3,
            "--support",
            0.02,
            "--confidence",
            0.9,
            "--out",
            tmp_path / "rules.json",
            "--json",
        )
    )
    for layer, name in (
        ("rule_count", "rules"),
        ("mean_length", "mean_length"),
        ("coverage", "coverage"),
        ("fidelity", "fidelity"),
    ):
        assert document[layer][1][2] == pytest.approx(mined[name], abs=1e-12)


def test_landscape_csv_has_one_row_a_cell(run, tmp_path):
    path = tmp_path / "landscape.csv"
    run("landscape", LANDER, "--out", path)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 231
    assert {row["dimension"] for row in rows} == {"all"}
    empty = [row for row in rows if row["rule_count"] == "0"]
    assert empty
    assert all(row["fidelity"] == "" for row in empty)


def test_landscape_csv_tells_action_dimensions_apart(run, tmp_path):
    demonstrations = tmp_path / "two.csv"
    rows = [f"0,{i},{i % 7},{i % 3},{i % 2},{int(i % 7 > 3)}" for i in range(60)]
    demonstrations.write_text(
        "\n".join(["episode,step,obs_x,obs_y,action_up,action_down", *rows]) + "\n"
    )
    path = tmp_path / "landscape.csv"
    run(
        "landscape",
        demonstrations,
        "--supports",
        "0:0.1:0.1",
        "--confidences",
        "0.5:1:0.5",
        "--out",
        path,
    )
    with path.open(newline="") as file:
        found = [row["dimension"] for row in csv.DictReader(file)]
    assert found == ["all"] * 4 + ["up"] * 4 + ["down"] * 4


def test_landscape_of_rules_that_forbid_is_mining_in_its_cells(run, tmp_path):
    path, grid = tmp_path / "landscape.json", ("--never", "0.1:0.3:0.1", "--supports", "0:0.1:0.05")
    run("landscape", LANDER, *grid, "--out", path)
    document = json.loads(path.read_text())
    assert document["epsilons"] == [0.1, 0.2, 0.3]
    assert "confidences" not in document
    assert np.array(document["freedom"]).shape == (3, 3)
    mine = ("mine", LANDER, "--never", 0.2, "--support", 0.05, "--out", tmp_path / "rules.json")
    mined = json.loads(run(*mine, "--json"))
    for layer, name in (
        ("rule_count", "rules"),
        ("mean_length", "mean_length"),
        ("coverage", "coverage"),
        ("fidelity", "fidelity"),
        ("freedom", "freedom"),
    ):
        assert document[layer][1][1] == pytest.approx(mined[name], abs=1e-12), layer
    run("landscape", LANDER, *grid, "--out", tmp_path / "landscape.csv")
    with (tmp_path / "landscape.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9
    assert float(rows[4]["freedom"]) == document["freedom"][1][1]
    assert float(rows[4]["epsilon"]) == 0.2


def test_landscape_html_opens_without_a_network(run, tmp_path):
    path = tmp_path / "landscape.html"
    run("landscape", CART, "--out", path)
    text = path.read_text(encoding="utf-8")
    assert '<html lang="en">' in text
    assert "<title>CartPole-v1: " in text
    assert '<script src="http' not in text
    assert "Coverage" in text


def test_landscape_png_is_a_picture_with_something_on_it(run, tmp_path):
    path = tmp_path / "landscape.png"
    run("landscape", CART, "--out", path)
    with Image.open(path) as picture:
        assert picture.width > 1000
        pixels = np.asarray(picture.convert("RGB").resize((80, 60))).reshape(-1, 3)
        assert len(np.unique(pixels, axis=0)) > 50


def test_json_is_all_there_is_on_standard_output(tmp_path):
    """Also when an environment prints what it likes, in a process of its own."""
    (tmp_path / "chatty.py").write_text(
        "import gymnasium\n"
        "from gymnasium.envs.classic_control import CartPoleEnv\n"
        "print('hello from the module')\n"
        "class Chatty(CartPoleEnv):\n"
        "    def reset(self, **parameters):\n"
        "        print('hello from reset')\n"
        "        return super().reset(**parameters)\n"
        "gymnasium.register('Chatty-v0', entry_point=Chatty, max_episode_steps=5)\n"
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sarl_core",
            "evaluate",
            "--env",
            "chatty:Chatty-v0",
            "--agent",
            "novice",
            "--episodes",
            "2",
            "--json",
        ],
        cwd=ROOT,
        env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["episodes"]) == 2
    assert "hello from reset" in done.stderr


def test_files_that_a_shell_made_of_a_pattern_are_one_set(run, tmp_path):
    for number in (10, 9, 1):
        rows = "".join(f"{x},{int(x > 7)}\n" for x in range(number, 16))
        (tmp_path / f"run_{number}.csv").write_text(f"gap,action\n{rows}")
    names = [str(path) for path in sorted(tmp_path.glob("*.csv"))]
    for given in (names, [str(tmp_path / "*.csv")]):
        answer = json.loads(run("check", *given, "--json"))
        assert (answer["steps"], answer["episodes"]) == (28, 3)
    rules = str(tmp_path / "rules.json")
    run("mine", *names, "--support", "0.1", "--confidence", "0.9", "--out", rules)
    assert json.loads(run("audit", rules, *names, "--json"))["steps"] == 28


def test_where_one_file_is_wanted_several_are_refused_with_what_to_do(capsys, tmp_path, cart_rules):
    rules = str(cart_rules)
    assert main(["audit", rules, CART, CART, "--follow"]) == 2
    assert "give one file" in capsys.readouterr().err
    assert main(["report", rules, "--demonstrations", CART, CART, "--out", "report.html"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert 'quote the pattern ("runs/*.csv") or give the folder' in error


def test_mine_grows_trees_by_the_learner_that_is_named(run, tmp_path):
    path = tmp_path / "rules.json"
    options = ("--setting", "filtered", "--out", path, "--learner", "histogram")
    assert "1,024 bins of each feature" in run("mine", LANDER, *options)
    assert json.loads(run("mine", LANDER, *options, "--json"))["learner"] == "histogram"
    rules = RuleSet.load(path)
    assert rules.learner == "histogram"
    trees = grow_policy_trees(load_demonstrations(LANDER), learner="histogram")
    assert (
        rules.rules
        == with_boxes(
            mine_rules(trees, supp_min=0.005, conf_min=0.95), load_demonstrations(LANDER)
        ).rules
    )


def test_mine_says_that_many_steps_had_the_other_learner(run, tmp_path, monkeypatch):
    path = tmp_path / "rules.json"
    options = ("--setting", "filtered", "--out", path)
    assert "learner" not in run("mine", LANDER, *options)
    monkeypatch.setattr(growth, "EXACT_UP_TO", 1_000)
    assert "histogram" in run("mine", LANDER, *options)
    assert RuleSet.load(path).learner == "histogram"
