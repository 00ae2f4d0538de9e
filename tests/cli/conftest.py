"""Running a command line within the tests' own process."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core.cli.app import main
from sarl_core.clusters import cluster

ROOT = Path(__file__).resolve().parents[2]
CART = str(ROOT / "data" / "demonstrations" / "cartpole.parquet")


@pytest.fixture
def run(capsys):
    """Run a command line that is to succeed, and give what it printed."""

    def call(*arguments):
        code = main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        assert code == 0, printed.err
        return printed.out

    return call


@pytest.fixture(scope="module")
def cart_rules(tmp_path_factory):
    """Rules that cover nearly every state of CartPole."""
    path = tmp_path_factory.mktemp("rules") / "rules.json"
    assert main(["mine", CART, "--support", "0", "--confidence", "0.9", "--out", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def running_cluster():
    """The address of a cluster of two processes, which does not end with the commands."""
    with cluster("local:2") as client:
        yield client.scheduler.address
