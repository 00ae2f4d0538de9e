"""What a program can do by the public names alone, with paths as text."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

import sarl_core
from sarl_core import (
    Demonstrations,
    InputError,
    RuleSet,
    Shield,
    export_rules,
    load_demonstrations,
    load_rules,
    make_agent,
    make_report,
    mine_rules,
    render_episode,
)
from sarl_core.cli.app import main

DATA = Path(__file__).resolve().parents[1] / "data"


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(str(DATA / "demonstrations" / "cartpole.parquet"))


@pytest.fixture(scope="module")
def rules(cart: Demonstrations) -> RuleSet:
    return mine_rules(cart, supp_min=0.005, conf_min=0.95)


def test_rules_are_exported_as_the_command_does(
    rules: RuleSet, cart: Demonstrations, tmp_path: Path
) -> None:
    done = export_rules(rules, str(tmp_path / "a.py"), merged=True, demonstrations=cart)
    assert done.vectors == tmp_path / "a.py.vectors.csv"
    assert len(done.vectors.read_text().splitlines()) > len(rules)
    assert done.prepared.rounding is not None
    rules.save(tmp_path / "rules.json")
    out, data = tmp_path / "b.py", DATA / "demonstrations" / "cartpole.parquet"
    options = ["--out", str(out), "--merged", "--rounded", "--demonstrations", str(data)]
    assert main(["export", str(tmp_path / "rules.json"), *options]) == 0
    assert out.read_text() == (tmp_path / "a.py").read_text()
    with pytest.raises(InputError, match=r"the format '\.txt' is none of"):
        export_rules(rules, tmp_path / "a.txt")


def test_a_report_is_made_and_saved(rules: RuleSet, cart: Demonstrations, tmp_path: Path) -> None:
    path = str(tmp_path / "report.html")
    report = make_report(rules, cart, frames=0, in_full=2)
    report.save(path)
    assert Path(path).read_text(encoding="utf-8") == report.html
    assert (report.in_full, report.pictures) == (2, 0)
    with pytest.raises(InputError, match="the number of pictures a rule is 99"):
        make_report(rules, cart, frames=99)


def test_an_episode_is_a_picture(rules: RuleSet, tmp_path: Path) -> None:
    rules.save(str(tmp_path / "rules.json"))
    shield = Shield(load_rules(str(tmp_path / "rules.json")))
    agent = make_agent(str(DATA / "experts" / "cartpole.npz"), "CartPole-v1")
    replay = render_episode("CartPole-v1", agent, shield=shield, seed=3, max_steps=10)
    replay.save(str(tmp_path / "episode.gif"))
    assert (tmp_path / "episode.gif").read_bytes().startswith(b"GIF8")


@pytest.mark.parametrize(
    "name", [name for name in sarl_core.__all__ if inspect.isfunction(getattr(sarl_core, name))]
)
def test_options_are_named(name: str) -> None:
    given = inspect.signature(getattr(sarl_core, name)).parameters.values()
    by_place = [one for one in given if one.kind is not inspect.Parameter.KEYWORD_ONLY]
    assert all(one.default is inspect.Parameter.empty for one in by_place)
