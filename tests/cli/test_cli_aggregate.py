"""`aggregate`, as it is typed."""

from __future__ import annotations

import csv
import json

import pytest

from sarl_core import RuleSet
from sarl_core.cli.app import main
from tests.cli.conftest import CART

QUICK = ("--rounds", 1, "--episodes", 2, "--validation", 2, "--max-rules", 3)


def test_rules_and_their_card_are_written(run, tmp_path):
    out = tmp_path / "compact.json"
    printed = run("aggregate", CART, *QUICK, "--out", out)
    rules = RuleSet.load(out)
    card = json.loads((tmp_path / "compact.card.json").read_text())
    assert len(rules) == card["rules"] <= 3
    assert card["command"] == (
        f"python -m sarl_core aggregate {CART} --out {out} --max-rules 3 --rounds 1 --episodes 2 "
        "--validation 2"
    )
    assert f"Wrote {out}: {len(rules)} rules" in printed
    assert f"{card['reported']['mean']:.1f}" in printed


def test_json_is_the_card_of_as_many_episodes_as_were_ordered(run, tmp_path):
    out = tmp_path / "compact.json"
    arguments = (*QUICK, "--report-episodes", 7)
    document = json.loads(run("aggregate", CART, *arguments, "--out", out, "--json"))
    assert document.pop("notes") == []
    assert document["reported"]["episodes"] == 7
    assert document["reported_on"] == "7 episodes used for nothing else"
    assert document["command"].endswith("--report-episodes 7")
    assert document == json.loads((tmp_path / "compact.card.json").read_text())


def test_without_an_expert_the_gaps_are_written(run, tmp_path):
    out = tmp_path / "gaps.csv"
    arguments = ("--expert", "none", "--support", 0.05, "--confidence", 0.95, "--episodes", 3)
    document = json.loads(run("aggregate", CART, *arguments, "--out", out, "--json"))
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == document["without_a_rule"] > 0
    assert list(rows[0])[:2] == ["episode", "step"]
    assert "obs_pole angle" in rows[0]
    assert "need a demonstration" in run("aggregate", CART, *arguments, "--out", out)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--max-rules", "1"), "the budget of rules is 1"),
        (("--max-rules", "-7"), "the budget of rules is -7"),
        (("--episodes", "0"), "the number of episodes a round is 0"),
        (("--support", "0.1"), "--support and --confidence belong together"),
        (("--support", "2", "--confidence", "0.5"), "the minimum support is 2"),
        (
            ("--support", "0.1", "--confidence", "0.9", "--refine", "1"),
            "rules that thresholds cut are not refined; give --refine without",
        ),
        (("--search-limit", "900"), "--search-limit is about a refinement; give --refine, too"),
        (("--search-episodes", "9"), "--search-episodes is about a refinement"),
        (("--search-starts", "9"), "--search-starts is about a refinement"),
        (("--refine", "1", "--search-starts", "99"), "the number of search starts is 99; give"),
        (("--search-steps", "9"), "--search-steps is about a refinement"),
        (("--refine", "1", "--search-steps", "-1"), "the number of search steps is -1; give 0"),
        (
            ("--refine", "1", "--search-steps", "9999"),
            "the first turn and what comes before it take",
        ),
        (("--search-generations", "9"), "--search-generations is about a refinement"),
        (("--refine", "1", "--search-generations", "0"), "the number of search generations is 0"),
        (("--search-worth", "9"), "--search-worth is about a refinement"),
        (("--refine", "1", "--search-worth", "-1"), "the worth of a failure is -1; give a number"),
        (("--refine", "1", "--search-worth", "1e200"), "give a number from 0 to 1e+09"),
        (("--refine", "1", "--search-worth", "nan"), "the worth of a failure is nan; give a"),
        (("--refine", "1", "--search-limit", "0"), "the limit of a search episode is 0"),
        (("--expert", "novice"), "acts at random"),
        (("--expert", "nowhere.npz"), "nowhere.npz"),
        (("--expert", "none"), "must end in .csv"),
        (("--env", "LunarLander-v3"), "8 features"),
        (("--env", "Nowhere-v0"), "Nowhere"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(capsys, tmp_path, arguments, sentence):
    out = tmp_path / "compact.json"
    code = main(["aggregate", CART, "--out", str(out), *arguments])
    told = capsys.readouterr()
    assert code == 2
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert sentence in told.err
    assert not list(tmp_path.iterdir())


def test_stopped_by_ctrl_c_the_finished_rounds_are_kept(capsys, tmp_path, monkeypatch):
    from sarl_core.improving import aggregation

    rollout, calls = aggregation.rollout, []

    def interrupted(*arguments, **named):
        calls.append(named["seed"])
        if len(calls) == 3:
            raise KeyboardInterrupt
        return rollout(*arguments, **named)

    monkeypatch.setattr(aggregation, "rollout", interrupted)
    out = tmp_path / "compact.json"
    arguments = ["--rounds", "5", "--episodes", "2", "--max-rules", "3"]
    code = main(["aggregate", CART, "--out", str(out), *arguments])
    told = capsys.readouterr()
    assert code == 130
    assert told.err == (
        f"error: stopped after 2 of 5 rounds; the best rules so far are in {out}, "
        "chosen by the episodes of their round only; no fresh episode has tried them\n"
    )
    assert len(RuleSet.load(out)) <= 3
    card = json.loads((tmp_path / "compact.card.json").read_text())
    assert card["reported"] is None
    assert len(card["rounds"]) == 2
    # Stopped again, it takes the place of nothing.
    before = out.read_bytes()
    calls.clear()
    assert main(["aggregate", CART, "--out", str(out), *arguments]) == 130
    assert f"are in {tmp_path / 'compact.stopped.json'} ({out} stays as it was), chosen by" in (
        capsys.readouterr().err
    )
    assert out.read_bytes() == before
    assert len(RuleSet.load(tmp_path / "compact.stopped.json")) <= 3


def test_stopped_by_ctrl_c_the_gaps_so_far_are_written(capsys, tmp_path, monkeypatch):
    from sarl_core.improving import gaps

    rollout, calls = gaps.rollout, []

    def interrupted(*arguments, **named):
        calls.append(named["episodes"])
        if len(calls) == stop_at:
            raise KeyboardInterrupt
        return rollout(*arguments, **named)

    monkeypatch.setattr(gaps, "rollout", interrupted)
    out = tmp_path / "gaps.csv"
    thresholds = ["--support", "0.05", "--confidence", "0.95", "--episodes", "12"]
    arguments = ["aggregate", CART, "--expert", "none", "--out", str(out), *thresholds]
    stop_at = 1
    assert main(arguments) == 130
    assert capsys.readouterr().err == "error: stopped; nothing was written\n"
    assert not out.exists()
    calls.clear()
    stop_at = 2
    assert main(arguments) == 130
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert {int(row["episode"]) for row in rows} <= set(range(8))
    assert capsys.readouterr().err == (
        f"error: stopped after 8 of 12 episodes; the {len(rows):,} states without a "
        f"rule that they met are in {out}\n"
    )
    before = out.read_bytes()
    calls.clear()
    assert main(arguments) == 130
    assert f"are in {tmp_path / 'gaps.stopped.csv'} ({out} stays as it was)" in (
        capsys.readouterr().err
    )
    assert out.read_bytes() == before
