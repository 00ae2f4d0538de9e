"""`--cluster`: steps in Parquet files that are mined elsewhere, and mined files in their place."""

from __future__ import annotations

import json
import os
import socket
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from sarl_core import RuleSet, rollout
from sarl_core.cli.app import main
from sarl_core.clusters import ClusterExecutor, cluster, lasting_executor
from sarl_core.errors import InputError, SarlError, WorkError
from sarl_core.mining.distributed.mined_files import load_mined_data
from sarl_core.processes import completed, run_each
from sarl_core.shielding.leeway import leeway_of

DATA = Path(__file__).resolve().parents[2] / "data" / "demonstrations"
LANDER = DATA / "lunar_lander.parquet"
FILTERED = ("--support", "0.005", "--confidence", "0.9")


@pytest.fixture(scope="module")
def mined_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("mined") / "lander.mined"
    held = ("--hold-out", "0.3", "--support", "0.001")
    assert main(["mine", str(LANDER), "--cluster", "local:1", *held, "--out", str(path)]) == 0
    return path


def test_rules_of_a_cluster_are_those_of_its_mined_file(run, running_cluster, mined_file, tmp_path):
    direct, again = tmp_path / "direct.json", tmp_path / "again.json"
    command = ("mine", LANDER, "--cluster", running_cluster, "--hold-out", "0.3")
    printed = run(*command, "--support", "0.001", "--confidence", "0.9", "--out", direct)
    assert "held out" in printed
    assert "histogram" in printed
    answer = json.loads(
        run(
            "mine",
            mined_file,
            "--support",
            "0.001",
            "--confidence",
            "0.9",
            "--out",
            again,
            "--json",
        )
    )
    assert answer["held_out"]["episodes"] == sorted(answer["held_out"]["episodes"])
    assert len(answer["held_out"]["episodes"]) == round(0.3 * 62)
    assert RuleSet.load(direct).digest == RuleSet.load(again).digest
    assert RuleSet.load(direct).rule_count == answer["rules"] > 20


def test_when_rules_of_a_cluster_are_those_of_one_memory(run, running_cluster, tmp_path):
    """With trees of the same depth, and where no node of up to 500 states is split."""
    there, here = tmp_path / "there.json", tmp_path / "here.json"
    whole = tmp_path / "whole.mined"

    def same():
        first, second = RuleSet.load(there), RuleSet.load(here)
        assert first.rule_count > 1
        assert [(one.conditions, one.action, one.samples) for one in first] == [
            (one.conditions, one.action, one.samples) for one in second
        ]

    cluster_of = ("mine", LANDER, "--cluster", running_cluster)
    memory = ("mine", LANDER, "--learner", "histogram", "--out", here)
    of_many = ("--support", "0.034", "--confidence", "0.8")  # 510 states
    run(*cluster_of, *of_many, "--out", there)
    run(*memory, *of_many)
    same()
    run(*cluster_of, "--support", "0", "--out", whole)
    run("mine", whole, *FILTERED, "--out", there)
    run(*memory, *FILTERED)
    same()


def test_rules_that_forbid_are_mined_from_its_mined_file(run, mined_file, tmp_path):
    out = tmp_path / "never.json"
    command = ("mine", mined_file, "--never", "0.1", "--support", "0.01", "--out", out)
    answer = json.loads(run(*command, "--json"))
    rules, sample = RuleSet.load(out), load_mined_data(mined_file).sample
    assert all(rule.forbids and rule.support >= 0.01 for rule in rules)
    assert answer["rules"] == rules.rule_count > 5
    assert answer["freedom"] == leeway_of(rules, sample).freedom
    assert "held_out" not in answer
    assert any("forbid one of more than two actions" in note for note in answer["notes"])
    run(*command[:4], "--out", out)
    assert RuleSet.load(out).thresholds.support == 0.001  # as far as the trees go
    run(*command[:4], "--setting", "filtered", "--out", out)
    assert {bool(rule.forbids) for rule in RuleSet.load(out)} == {True, False}


def test_combinations_and_formulas_are_chosen_and_worked_out_on_the_cluster(
    run, running_cluster, tmp_path
):
    out = tmp_path / "rules.json"
    further = (
        "--combine",
        "vertical position, vertical velocity",
        "--feature",
        "twice = 2 * angle",
    )
    run("mine", LANDER, "--cluster", running_cluster, *FILTERED, *further, "--out", out)
    derived = [one for one in RuleSet.load(out).source.features if one.derived is not None]
    assert any(one.name == "twice" for one in derived)
    assert any("times the vertical velocity" in one.name for one in derived)


def test_a_lower_bound_drops_rules(run, mined_file, tmp_path):
    every, sure = tmp_path / "every.json", tmp_path / "sure.json"
    run("mine", mined_file, *FILTERED, "--out", every)
    printed = run("mine", mined_file, *FILTERED, "--lower-bound", "0.8", "--out", sure)
    assert "lower bound" in printed
    left = {rule.id for rule in RuleSet.load(every) if (rule.held_out.low or 0) >= 0.8}
    assert {rule.id for rule in RuleSet.load(sure)} == left


def test_a_report_is_made_of_a_mined_file_as_of_demonstrations(run, mined_file, tmp_path, capsys):
    rules, out = tmp_path / "rules.json", tmp_path / "report.html"
    run("mine", mined_file, *FILTERED, "--out", rules)
    command = ("report", rules, "--demonstrations", mined_file, "--frames", "0", "--out", out)
    assert f"{len(RuleSet.load(rules)):,} rules" in run(*command)
    made = out.read_bytes()
    steps = RuleSet.load(rules).source.steps
    assert f"{steps:,} steps" in made.decode()
    assert f"report {rules} --demonstrations {mined_file}" in made.decode()
    run(*command)
    assert out.read_bytes() == made
    assert main([*map(str, command), "--missing", "drop"]) == 2
    assert "how its steps are read was settled when it was mined" in capsys.readouterr().err


def test_a_mined_file_answers_check_and_landscape(run, mined_file, tmp_path):
    document = json.loads(run("check", mined_file, "--json"))
    assert 0 < document["steps"] < 15_000
    assert document["held_out_episodes"] == 19
    assert document["min_support"] == 0.001
    assert sum(document["trees"][0]["labels"].values()) == document["steps"]
    medians = {one["name"]: one["median"] for one in document["features"]}
    assert {medians[name] for name in medians if "contact" in name} <= {0.0, 1.0}
    assert "what is left of" in run("check", mined_file)
    printed = run("landscape", mined_file, "--out", tmp_path / "plane.json")
    assert "grown down to a support of 0.001" in printed
    assert "minimum supports below 0.001 are left out" in printed
    plane = json.loads((tmp_path / "plane.json").read_text())
    assert plane["supports"] == pytest.approx(np.arange(0.05, 0.51, 0.05))
    assert plane["rule_count"][0][-1] > plane["rule_count"][-1][-1]


def test_a_landscape_of_supports_that_trees_do_not_reach_is_refused(mined_file, tmp_path, capsys):
    out = tmp_path / "plane.json"
    below = ("--supports", "0:0.0005:0.0001")
    assert main(["landscape", str(mined_file), *below, "--out", str(out)]) == 2
    assert "begin --supports there or above" in capsys.readouterr().err
    assert not out.exists()


WRONG = {
    "no thresholds": (["FILE", "--cluster", "local:1", "--out", "r.json"], "give both --support"),
    "a mined file of no cluster": (["FILE", "--out", "r.mined"], "give these and --cluster"),
    "cross-fitting": (
        ["FILE", "--cluster", "local:1", "--cross-fit", *FILTERED, "--out", "r.json"],
        "--cross-fit needs all steps in one memory",
    ),
    "an exact learner": (
        ["MINED", "--learner", "exact", *FILTERED, "--out", "r.json"],
        "--learner exact needs all steps in one memory",
    ),
    "other episodes": (
        ["MINED", "--hold-out", "0.5", *FILTERED, "--out", "r.json"],
        "what is held out, and where, was settled when it was mined",
    ),
    "a seed of what was drawn": (
        ["MINED", "--seed", "0", *FILTERED, "--out", "r.json"],
        "what is held out, and where, was settled when it was mined",
    ),
    "too little support": (
        ["MINED", "--support", "0", "--confidence", "1", "--out", "r.json"],
        "these trees were grown down to 0.001",
    ),
    "a bound of nothing": (
        ["FILE", "--cluster", "local:1", "--lower-bound", "0.5", *FILTERED, "--out", "r.json"],
        "none is held out; give --hold-out",
    ),
    "columns of no steps": (
        ["MINED", "--column", "x=ignore", *FILTERED, "--out", "r.json"],
        "how its steps are read, and what is derived from them, was settled",
    ),
    "another divider": (
        ["MINED", "--divider", "5", *FILTERED, "--out", "r.json"],
        "the divider is 5, and",
    ),
    "a depth of any rules": (
        ["FILE", "--cluster", "local:1", "--max-depth", "0", "--out", "r.mined"],
        "--max-depth is about rules",
    ),
    "no cluster": (
        ["FILE", "--cluster", "here", *FILTERED, "--out", "r.json"],
        "'here' is no cluster",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_is_one_sentence(what, mined_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments, sentence = WRONG[what]
    names = {"FILE": str(LANDER), "MINED": str(mined_file)}
    code = main(["mine", *(names.get(one, one) for one in arguments)])
    printed = capsys.readouterr()
    assert code == 2
    assert sentence in printed.err
    assert printed.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


# --- episodes ------------------------------------------------------------------------------------


def test_episodes_of_a_cluster_are_those_of_one_machine(run, running_cluster, tmp_path):
    rules = tmp_path / "rules.json"
    run("mine", LANDER, *FILTERED, "--out", rules)
    command = ("evaluate", "--env", "LunarLander-v3", "--agent", "novice", "--rules", rules)
    command += ("--episodes", "9", "--seed", "3", "--json")
    here = json.loads(run(*command))
    assert json.loads(run(*command, "--cluster", running_cluster)) == here
    out = tmp_path / "episodes.parquet"
    answer = json.loads(run(*command, "--cluster", running_cluster, "--out", out))
    assert answer["summary"] == here["summary"]
    assert answer["count"] == 9
    table = pd.read_parquet(out)
    assert table["seed"].tolist() == list(range(3, 12))
    assert table["return"].tolist() == [one["return"] for one in here["episodes"]]
    printed = run(*command[:-1], "--out", out)
    assert f"Wrote {out}: 9 episodes" in printed


def test_episodes_are_written_some_at_a_time(run, tmp_path, monkeypatch):
    monkeypatch.setattr("sarl_core.rollouts.episode_tables._AT_ONCE", 4)
    out = tmp_path / "episodes.parquet"
    run("evaluate", "--env", "CartPole-v1", "--agent", "novice", "--episodes", "10", "--out", out)
    with pq.ParquetFile(out) as file:
        rows = [file.metadata.row_group(at).num_rows for at in range(file.num_row_groups)]
    assert rows == [4, 4, 2]
    played = rollout("CartPole-v1", "novice", episodes=10, keep_steps=False)
    pd.testing.assert_frame_equal(pd.read_parquet(out), played.to_frame())


def test_ablations_and_learners_of_a_cluster_are_those_of_one_machine(
    run, running_cluster, cart_rules, tmp_path
):
    command = ("ablate", "--env", "CartPole-v1", "--agent", "novice", "--rules", cart_rules)
    command += ("--episodes", "2", "--most", "2", "--json")
    assert json.loads(run(*command, "--cluster", running_cluster)) == json.loads(run(*command))
    learn = ("learn", "--env", "CartPole-v1", "--arm", "none", "--steps", "600", "--seeds", "2")
    learn += ("--episodes", "2")
    run(*learn, "--out", tmp_path / "here")
    run(*learn, "--cluster", running_cluster, "--out", tmp_path / "there")
    names = ["curves.csv", "policies/none-0.npz", "policies/none-1.npz"]
    for name in names:
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    # What is finished there is taken up here, and nothing learns anew.
    before = (tmp_path / "there" / names[1]).stat().st_mtime_ns
    run(*learn[:-2], "--episodes", "2", "--out", tmp_path / "there")
    assert (tmp_path / "there" / names[1]).stat().st_mtime_ns == before


def test_aggregation_on_a_cluster_is_that_of_one_machine(run, running_cluster, tmp_path):
    command = ("aggregate", DATA / "cartpole.parquet", "--max-rules", "3", "--rounds", "2")
    command += ("--episodes", "2", "--validation", "4", "--report-episodes", "4")
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    run(*command, "--out", here)
    run(*command, "--cluster", running_cluster, "--out", there)
    assert RuleSet.load(there).digest == RuleSet.load(here).digest
    cards = [json.loads(path.with_suffix(".card.json").read_text()) for path in (here, there)]
    assert cards[0]["rounds"] == cards[1]["rounds"]
    assert "--cluster" not in cards[1]["command"]


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("local:2", "a dashboard works in processes of this machine anyway"),
        ("tcp://127.0.0.1:9", "no scheduler answers at 'tcp://127.0.0.1:9'"),
    ],
)
def test_a_dashboard_is_not_started_with_a_cluster_that_is_none(
    address, sentence, monkeypatch, capsys
):
    monkeypatch.setattr("sarl_core.clusters._SECONDS", 1)
    assert main(["app", "--cluster", address]) == 2
    assert sentence in capsys.readouterr().err


def test_jobs_of_a_dashboard_are_done_on_the_cluster_of_its_owner(running_cluster, monkeypatch):
    from sarl_dashboard.jobs.processes import processes

    with cluster(running_cluster) as owner:
        monkeypatch.setenv("SARL_CLUSTER", running_cluster)
        processes.clear()
        try:
            (there,) = run_each(os.getpid, [()], executor=processes())
            assert there in owner.run(os.getpid).values()
        finally:
            processes().shutdown()
            processes.clear()


def test_a_scheduler_that_was_lost_and_is_back_is_used_again(monkeypatch):
    monkeypatch.setattr("sarl_core.clusters._REFUSED_SECONDS", 0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    def begun():
        return LocalCluster(
            n_workers=1,
            processes=False,
            protocol="tcp",
            host="127.0.0.1",
            scheduler_port=port,
            dashboard_address=None,
        )

    executor = lasting_executor(f"tcp://127.0.0.1:{port}")
    with pytest.raises(InputError, match=r"^no scheduler answers at"):
        run_each(abs, [(-1,)], executor=executor)
    with begun():
        assert run_each(abs, [(-1,), (-2,)], executor=executor) == [1, 2]
    with pytest.raises(SarlError, match=r"^(the cluster ended in the|no scheduler answers at)"):
        run_each(abs, [(-1,)], executor=executor)
    with begun():
        try:
            assert run_each(abs, [(-1,), (-2,)], executor=executor) == [1, 2]
        finally:
            executor.shutdown()


def test_work_on_a_cluster_that_ends_meanwhile_is_one_sentence():
    with cluster("local:1") as client:
        executor = ClusterExecutor(client)
        calls = [(number, time.sleep, (0.1,)) for number in range(100)]
        work = completed(executor, calls, lost="a process ended")
        next(work)
        client.close()
        with pytest.raises(WorkError, match=r"^the cluster ended in the middle of the work; run"):
            list(work)
        with pytest.raises(WorkError, match=r"^the cluster ended in the middle of the work; run"):
            _ = executor.workers
