"""The command that certifies a rate of failures."""

from __future__ import annotations

import json
import shlex

import pytest

from sarl_core.cli.app import main
from sarl_core.rollouts.seeds import CERTIFIED
from sarl_core.studies.certificate_files import load_certificate
from tests.cli.conftest import ROOT

COMPACT = str(ROOT / "data" / "rules" / "cartpole_compact.json")
# Whole episodes, which the environment itself ends soon.
SHORT = '{"max_episode_steps": 40}'
BASE = (
    *("certify", "--env", "CartPole-v1", "--env-args", SHORT),
    *("--rules", COMPACT, "--jobs", "1"),
)


def test_299_episodes_without_a_failure_certify_a_hundredth(run, tmp_path):
    out = tmp_path / "certificate.json"
    document = json.loads(run(*BASE, "--at-most", "0.01", "--out", out, "--json"))
    assert document["certified"] is True
    assert (document["episodes"], document["failures"]) == (299, 0)
    assert (document["at_most"], document["certainty"]) == (0.01, 0.95)
    assert document["seeds"] == {"first": CERTIFIED, "last": CERTIFIED + 298}
    assert json.loads(out.read_text()) == document
    assert load_certificate(out).verdict.certified is True


def test_the_command_of_a_certificate_tests_the_same_again(run):
    document = json.loads(run(*BASE, "--at-most", "0.1", "--json"))
    again = shlex.split(document["command"])[3:]
    assert json.loads(run(*again, "--json"))["seeds"] == document["seeds"]


def test_a_cluster_and_processes_come_to_the_same(run):
    command = (*BASE[:-2], "--at-most", "0.3", "--failure", "abs(cart_position) > 0.1", "--json")
    here = json.loads(run(*command, "--jobs", "1"))
    assert json.loads(run(*command, "--jobs", "2")) == here
    assert json.loads(run(*command, "--cluster", "local:1")) == here
    assert here["failures"] > 0


def test_the_answer_says_what_it_is_about(run):
    text = run(*BASE, "--at-most", "0.1", "--agent", "expert")
    assert "Certified with 95 % certainty: at most 10 % of the episodes fail." in text
    assert "expert in CartPole-v1, shielded by 3 rules" in text
    assert "an end that is no time limit" in text
    assert "about nothing else" in " ".join(text.split())
    refused = run(*BASE, "--at-most", "0.1", "--failure", "abs(pole_angle) >= 0")
    assert "Refused with 95 % certainty: more than 10 % of the episodes fail." in refused
    undecided = run(*BASE, "--at-most", "0.1", "--max-steps", "20", "--episodes", "50")
    assert "Undecided after 50 episodes" in undecided


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (("--at-most", "0"), "a rate of 0 cannot be certified"),
        (("--at-most", "2"), "a rate lies between 0 and 1"),
        (("--at-most", "0.01", "--certainty", "1"), "certainty is 1.0"),
        (("--at-most", "0.01", "--episodes", "9"), "takes 299 without any failure"),
        (("--at-most", "0.1", "--env", "MountainCar-v0"), "nothing to certify in MountainCar-v0"),
        (("--at-most", "0.1", "--env", "FrozenLake-v1"), "nothing says which ends"),
        (("--at-most", "0.1", "--out", "certificate.csv"), "must end in .json"),
        (("--at-most", "0.1", "--rules", "nowhere.json"), "nowhere.json"),
    ],
)
def test_what_cannot_be_certified_is_one_line(capsys, more, sentence):
    assert main([*BASE, *more]) == 2
    printed = capsys.readouterr()
    assert not printed.out
    assert printed.err.count("\n") == 1
    assert sentence in printed.err
