"""Every command tells how columns and features were matched, and which episodes were cut off."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sarl_core import RuleSet
from sarl_core.cli.app import main
from tests.cli.conftest import CART

BY_NAME = "were put into the order of"


@pytest.fixture(scope="module")
def turned(tmp_path_factory, cart_rules):
    """A few rules of Cart Pole whose features come in another order."""
    rules = RuleSet.load(cart_rules)
    largest = sorted(rules.rules, key=lambda rule: -rule.samples)[:4]
    path = tmp_path_factory.mktemp("turned") / "rules.json"
    replace(
        rules,
        rules=tuple(
            replace(
                rule,
                box=None,
                conditions=tuple(one._replace(feature=3 - one.feature) for one in rule.conditions),
            )
            for rule in largest
        ),
        source=replace(rules.source, features=rules.source.features[::-1], digest=""),
    ).save(path)
    return path


def told(run, *arguments):
    """The notes of a command's document, which its text repeats."""
    document = json.loads(run(*arguments, "--json"))
    text = " ".join(run(*arguments).split())
    assert all(f"note: {note}" in text for note in document["notes"])
    return document["notes"]


def test_rounding_and_the_report_tell_the_order_of_the_rules(run, turned, tmp_path):
    rounded = ("--rounded", "--demonstrations", CART, "--out", str(tmp_path / "shield.py"))
    assert BY_NAME in told(run, "export", str(turned), *rounded)[-1]
    assert told(run, "export", str(turned), "--out", str(tmp_path / "shield.py")) == []
    out = ("--out", str(tmp_path / "report.html"), "--frames", "0")
    assert BY_NAME in told(run, "report", str(turned), "--demonstrations", CART, *out)[-1]


def test_a_landscape_tells_how_its_file_was_read(run, tmp_path):
    file = tmp_path / "other.csv"
    names = ("pole angle", "cart velocity", "cart position", "pole angular velocity")
    rows = [f"{index % 7},{index % 5},{index % 3},{index % 2},{index % 2}" for index in range(40)]
    file.write_text("\n".join([",".join([*(f"obs_{one}" for one in names), "action"]), *rows]))
    out = ("--out", str(tmp_path / "landscape.csv"))
    notes = told(run, "landscape", str(file), "--env", "CartPole-v1", *out)
    assert any("order of CartPole-v1" in note for note in notes)


def test_a_study_of_learning_tells_both(run, turned, tmp_path):
    learn = ("learn", "--env", "CartPole-v1", "--rules", str(turned), "--arm", "none")
    size = ("--steps", "64", "--episodes", "3", "--max-steps", "5")
    out = ("--out", str(tmp_path / "learned"))
    assert BY_NAME in told(run, *learn, *size, *out)[0]
    document = json.loads(run(*learn, *size, *out, "--json"))
    (arm,) = document["arms"]
    assert arm["alone"]["cut"] == arm["shielded"]["cut"] == 3
    sentence = "All 6 episodes after learning were cut off after 5 steps (max_steps)"
    assert any(one.startswith(sentence) for one in document["finding"])


def test_asking_an_expert_tells_what_was_cut(run, tmp_path):
    out = ("--out", str(tmp_path / "compact.json"))
    size = ("--rounds", "1", "--episodes", "2", "--validation", "2", "--max-rules", "2")
    notes = told(run, "aggregate", CART, *size, "--max-steps", "6", *out)
    assert notes[0].startswith("all 2 episodes of the rounds were cut off after 6 steps")
    assert notes[1].startswith("all 100 episodes were cut off after 6 steps")
    card = json.loads((tmp_path / "compact.card.json").read_text())
    assert (card["max_steps"], card["reported"]["cut"], card["reported"]["mean"]) == (6, 100, 6.0)


def test_a_search_for_gaps_and_the_pictures_of_a_report_may_be_cut(run, turned, tmp_path):
    gaps = ("aggregate", CART, "--expert", "none", "--support", "0.1", "--confidence", "0.9")
    out = ("--episodes", "2", "--max-steps", "6", "--out", str(tmp_path / "gaps.csv"))
    (note,) = told(run, *gaps, *out)
    assert note.startswith("all 2 episodes were cut off after 6 steps")
    report = ("report", str(turned), "--demonstrations", CART, "--frames", "1", "--episodes", "2")
    out = ("--max-steps", "6", "--out", str(tmp_path / "report.html"))
    notes = told(run, *report, *out)
    assert any(note.startswith("all 2 episodes were cut off after 6 steps") for note in notes)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log in which two columns may be the action, and one may be a feature."""
    random = np.random.default_rng(2)
    speed, a = random.uniform(0, 30, (2, 300)).round(2)
    rows = zip(speed, a, (speed > 20).astype(int), random.integers(0, 3, 300), strict=True)
    lines = [f"{v},{a},{brake},{lane},{i // 30}" for i, (v, a, brake, lane) in enumerate(rows)]
    path = tmp_path_factory.mktemp("log") / "drive.csv"
    path.write_text("\n".join(["v,a,brake,lane_id,run", *lines]))
    return path


SAID = ("--column", "brake=action", "--column", "lane_id=ignore", "--column", "v=feature:m/s")
MINE = ("--support", "0.1", "--confidence", "0.9")


def test_options_and_file_say_the_same_in_every_command(run, capsys, log, tmp_path):
    assert main(["mine", str(log), *MINE, "--out", str(tmp_path / "no.json")]) == 2
    assert "--column lane_id=feature" in capsys.readouterr().err
    columns, rules = tmp_path / "columns.json", tmp_path / "rules.json"
    assert "unclear" in run("check", log, "--suggest-columns", columns)
    suggested = json.loads(columns.read_text())
    assert suggested["columns"]["run"]["role"] == "episode"
    run("check", log, *SAID, "--suggest-columns", columns)
    by_file = ("--columns", columns)
    run("mine", log, *by_file, *MINE, "--out", rules)
    assert json.loads(rules.read_text())["features"][0]["unit"] == "m/s"
    again = tmp_path / "again.json"
    run("mine", log, *SAID, *MINE, "--out", again)
    one, other = (json.loads(path.read_text()) for path in (rules, again))
    assert one["rules"] == other["rules"]
    states = ("--demonstrations", log)
    run("landscape", log, *by_file, "--out", tmp_path / "landscape.csv")
    run("diff", rules, again, *states, *by_file)
    run("export", rules, *states, *by_file, "--rounded", "--out", tmp_path / "shield.py")
    page = tmp_path / "report.html"
    run("report", rules, *states, *by_file, "--frames", "0", "--out", page)
    assert "--column brake=action:labels" in page.read_text()


def test_an_option_goes_before_the_file(run, log, tmp_path):
    columns = tmp_path / "columns.json"
    run("check", log, *SAID, "--suggest-columns", columns)
    document = json.loads(run("check", log, "--columns", columns, "--column", "a=ignore", "--json"))
    assert [feature["name"] for feature in document["features"]] == ["v"]


@pytest.mark.parametrize(
    ("option", "sentence"), [("brake", "has no name or no role"), ("=action", "has no name")]
)
def test_an_option_without_both_sides_is_refused(capsys, log, option, sentence):
    assert main(["check", str(log), "--column", option]) == 2
    assert sentence in capsys.readouterr().err
