"""Numbers in what the commands print: told apart, and without digits that tell nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, load_demonstrations, mine_rules
from sarl_core.cli.app import main
from sarl_core.mining.language import limits_text


def _lines(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[str]:
    assert main([*arguments]) == 0
    return capsys.readouterr().out.splitlines()


def test_check_tells_values_apart_that_lie_near_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "near.csv"
    rows = [f"0,{1000000 + 0.25 * (i % 3)},{10000.5 + 0.5 * (i % 2)}" for i in range(40)]
    path.write_text("episode,pressure,action\n" + "\n".join(rows) + "\n")
    lines = _lines(capsys, "check", str(path))
    (pressure,) = (line for line in lines if re.match(r" *pressure +1", line))
    assert pressure.split()[-3:] == ["1000000", "1000000.25", "1000000.5"]
    (action,) = (line for line in lines if "10000.5 to 10001" in line)
    assert action.split()[-3:] == ["10000.5", "10000.75", "10001"]


def test_thresholds_that_stayed_have_no_digits_that_tell_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, values in (("mined", (293.4, 293.45001)), ("other", (293.1, 293.2))):
        rows = [f"0,{values[i // 20]},{i // 20}" for i in range(40)]
        (tmp_path / f"{name}.csv").write_text("episode,warmth,action\n" + "\n".join(rows) + "\n")
    rule_set = mine_rules(load_demonstrations(tmp_path / "mined.csv"), supp_min=0.0, conf_min=0.9)
    rules, data, out = tmp_path / "rules.json", tmp_path / "other.csv", tmp_path / "rules.csv"
    rule_set.save(rules)
    lines = _lines(
        capsys, "export", str(rules), "--rounded", "--demonstrations", str(data), "--out", str(out)
    )
    (kept,) = (line for line in lines if "no demonstrated state tells" in line)
    number = re.search(r"293\.\d+", kept)
    assert number is not None
    threshold = rule_set.rules[0].conditions[0].threshold
    assert len(number[0]) <= 9 < len(repr(threshold))
    near = np.float32([np.float32(threshold), np.nextafter(np.float32(threshold), np.float32(1e9))])
    assert ((near <= float(number[0])) == (near <= threshold)).all()


def test_limits_are_told_with_every_digit() -> None:
    demonstrations = Demonstrations(
        np.arange(40, dtype=np.float32)[:, None], np.repeat([0, 1], 20), np.zeros(40, dtype=int)
    )
    rule_set = mine_rules(demonstrations, supp_min=0.0, conf_min=0.99999999)
    assert "confidence at least 99.999999 %" in limits_text(rule_set)
