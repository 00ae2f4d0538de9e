"""The reports in docs are about the rules that their commands name."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import pytest

from sarl_core import RuleSet
from sarl_core.cli.app import main
from sarl_core.mining.rule_set import rules_digest

ROOT = Path(__file__).resolve().parents[2]
REPORTS = sorted((ROOT / "docs" / "reports").glob("*.html"))


def test_there_are_three() -> None:
    names = [path.name for path in REPORTS]
    assert names == ["cartpole.html", "driving.html", "lunar_lander.html"]


@pytest.mark.parametrize("report", REPORTS, ids=lambda path: path.stem)
def test_the_fingerprint_is_that_of_the_rules(report: Path, tmp_path: Path) -> None:
    text = report.read_text(encoding="utf-8")
    (printed,) = re.findall(r"<pre>(.*?)</pre>", text, flags=re.S)
    commands = [shlex.split(line)[3:] for line in html.unescape(printed).splitlines()]
    name = commands[-1][1]
    if len(commands) == 1:
        rules = ROOT / name
    else:
        verb, demonstrations, *options, out = commands[0]
        assert (verb, out) == ("mine", name)
        rules = tmp_path / "rules.json"
        assert main([verb, str(ROOT / demonstrations), *options, str(rules)]) == 0
    (fingerprint,) = re.findall(r'<th scope="row">Rules</th><td>([0-9a-f]{32}) ', text)
    assert rules_digest(RuleSet.load(rules)) == fingerprint
