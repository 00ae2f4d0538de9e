from __future__ import annotations

import csv
import json
import sys

import numpy as np
import pytest

from sarl_core import RuleSet, Shield, load_demonstrations
from sarl_core.cli.app import main
from tests.cli.conftest import CART


@pytest.mark.parametrize("on_invalid", ["raise", "pass"])
@pytest.mark.parametrize("ending", ["json", "csv", "md", "py", "c", "onnx"])
def test_every_format_comes_with_its_vectors(run, cart_rules, tmp_path, ending, on_invalid):
    out = tmp_path / f"shield.{ending}"
    printed = run("export", cart_rules, "--out", out, "--on-invalid", on_invalid)
    assert out.stat().st_size > 100
    assert str(out) in printed
    rules = RuleSet.load(cart_rules)
    with (tmp_path / f"shield.{ending}.vectors.csv").open() as file:
        rows = list(csv.DictReader(file))
    states = np.array([[row[f"state_{i}"] for i in range(4)] for row in rows], dtype=np.float32)
    proposed = np.array([[row["proposed_0"]] for row in rows], dtype=np.int64)
    decision = Shield(rules, on_invalid="pass").decide_batch(states, proposed)
    assert decision.rules[:, 0].tolist() == [int(row["rule_0"]) for row in rows]
    invalid = [why is not None for why in decision.invalid]
    assert invalid == [row["invalid"] == "1" for row in rows]
    assert any(invalid)
    said = [str(done) for done in decision.executed[:, 0].tolist()]
    if on_invalid == "raise":  # nothing is to be executed
        said = ["" if bad else done for done, bad in zip(said, invalid, strict=True)]
    assert [row["executed_0"] for row in rows] == said
    if ending in ("py", "c", "onnx"):
        assert f"(on_invalid: {on_invalid})".encode() in out.read_bytes()


def test_rounding_is_counted_and_listed(run, cart_rules, tmp_path):
    out = tmp_path / "short.json"
    document = json.loads(
        run(
            "export", cart_rules, "--out", out, "--rounded", "--demonstrations", CART, "--json"
        )
    )  # fmt: skip
    assert document["rounding"]["decisions_changed"] == 0
    assert document["rounding"]["rounded"] > 10
    before, after = RuleSet.load(cart_rules), RuleSet.load(out)
    demonstrations = load_demonstrations(CART)
    found = [
        Shield(rules).decide_batch(demonstrations.observations, demonstrations.actions)
        for rules in (before, after)
    ]
    assert np.array_equal(found[0].rules, found[1].rules)
    assert len(out.read_text()) < len(cart_rules.read_text())
    told = run("export", cart_rules, "--out", out, "--rounded", "--demonstrations", CART)
    assert "0 decisions changed" in told


def test_merged_rules_ask_at_most_twice_of_a_feature(run, cart_rules, tmp_path):
    out = tmp_path / "merged.json"
    run("export", cart_rules, "--out", out, "--merged")
    for rule in RuleSet.load(out).rules:
        asked = [(condition.feature, condition.op) for condition in rule.conditions]
        assert len(set(asked)) == len(asked)


def test_what_cannot_be_exported_is_one_sentence(capsys, cart_rules, tmp_path, monkeypatch):
    def refused(code, *arguments):
        assert main([str(argument) for argument in arguments]) == code
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        return said.err

    out = tmp_path / "shield.c"
    assert "must end in .json or .csv" in refused(2, "export", cart_rules, "--out", "shield.txt")
    assert "with --rounded" in refused(2, "export", cart_rules, "--out", out, "--rounded")
    assert "give both, or neither" in refused(
        2, "export", cart_rules, "--out", out, "--demonstrations", CART
    )
    other = CART.replace("cartpole", "pendulum")
    assert "ask about 4 features and the demonstrations have 3" in refused(
        2, "export", cart_rules, "--out", out, "--rounded", "--demonstrations", other
    )
    empty = json.loads(cart_rules.read_text()) | {"rules": []}
    (tmp_path / "empty.json").write_text(json.dumps(empty))
    for ending in ("json", "csv", "md", "py", "c", "onnx"):
        assert "has no rules, so there is nothing to export" in refused(
            2, "export", tmp_path / "empty.json", "--out", tmp_path / f"shield.{ending}"
        )
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert "run `pip install onnx`" in refused(
        1, "export", cart_rules, "--out", tmp_path / "shield.onnx"
    )
    assert list(tmp_path.glob("shield*")) == []


@pytest.mark.parametrize("ending", ["md", "py", "c", "onnx"])
def test_rules_that_forbid_are_exported_with_their_vectors(run, tmp_path, ending):
    rules, out = tmp_path / "never.json", tmp_path / f"shield.{ending}"
    run("mine", CART, "--never", "0.1", "--support", "0.02", "--out", rules)
    assert str(out) in run("export", rules, "--out", out)
    with (tmp_path / f"shield.{ending}.vectors.csv").open() as file:
        rows = list(csv.DictReader(file))
    proposed = {row["proposed_0"] for row in rows if row["invalid"] == "0"}
    assert proposed == {"0", "1"}
    assert any(row["executed_0"] not in ("", row["proposed_0"]) for row in rows)
    if ending != "onnx":
        assert "never push" in out.read_text()
