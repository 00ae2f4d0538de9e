"""The examples of the README run as they stand there, and what it points to exists."""

from __future__ import annotations

import json
import re
import shutil
import sys

import pytest

from sarl_core import RuleSet
from sarl_core.cli.app import app

from .examples import ROOT, run

README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The one code block in a language."""
    found = re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    return found[0]


@pytest.fixture
def checkout(tmp_path):
    """A copy of what the examples use, so that nothing they write is left behind."""
    for folder in ("sarl_core", "data"):
        shutil.copytree(
            ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    return tmp_path


def test_the_python_example(checkout):
    code = block("python")
    assert len(code.strip().splitlines()) == 5
    printed = run([sys.executable, "-c", code], checkout)
    mean = float(re.search(r"mean_return=([\d.]+)", printed)[1])
    assert round(mean) == 400  # as the README says


def test_the_shell_example(checkout):
    code = block("sh")
    assert len(code.strip().splitlines()) == 5
    printed = run(["bash", "-euc", code], checkout)
    documents = [line for line in printed.splitlines() if line.startswith('{"episodes"')]
    assert len(json.loads(documents[0])["episodes"]) == 50
    assert len(RuleSet.load(checkout / "rules.json")) > 0
    assert "</html>" in (checkout / "landscape.html").read_text(encoding="utf-8")
    assert (checkout / "replay.gif").read_bytes()[:6] == b"GIF89a"


def test_the_table_of_commands_is_that_of_the_command_line():
    listed = re.findall(r"^\| `([\w-]+)` \|", README, flags=re.MULTILINE)
    assert listed == [
        command.name or command.callback.__name__ for command in app.registered_commands
    ]


def test_the_targets_of_make_that_it_names_exist():
    makefile = (ROOT / "Makefile").read_text()
    named = set(re.findall(r"\bmake ([a-z]+)\b", README)) - {"a"}
    assert {"app", "test", "lint", "bench"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_what_it_links_to_exists():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert links
    for link in links:
        assert (ROOT / link).is_file(), link
