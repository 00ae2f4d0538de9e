"""What a program can do by the public names alone, with paths as text."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pytest

import sarl_core
from sarl_core import (
    Demonstrations,
    InputError,
    PolicyTree,
    RuleSet,
    Shield,
    ShieldedEnv,
    ShieldedVecEnv,
    export_rules,
    grow_policy_trees,
    load_demonstrations,
    load_rules,
    make_agent,
    make_report,
    mine_rules,
    record,
    render_episode,
    rollout,
    save_demonstrations,
    threshold_landscape,
)
from sarl_core.cli.app import main

DATA = Path(__file__).resolve().parents[1] / "data"


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(str(DATA / "demonstrations" / "cartpole.parquet"))


@pytest.fixture(scope="module")
def rules(cart: Demonstrations) -> RuleSet:
    return mine_rules(cart, supp_min=0.005, conf_min=0.95)


@pytest.fixture(scope="module")
def trees(cart: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(cart)


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
    # The command has looked into the library.
    written = out.read_text().replace("# Not approved by anybody.\n", "")
    assert written == (tmp_path / "a.py").read_text()
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


class Given(NamedTuple):
    """What the calls below are made with; the types are wrong on purpose."""

    cart: Any
    rules: Any
    trees: Any
    env: Any
    folder: Path


CART, SHARES = "CartPole-v1", {"supp_min": 0.1, "conf_min": 0.9}
MINED = "what rules are mined from must be Demonstrations, or trees grown from them, and is "
WRAP = "the shield must be a Shield and is of type RuleSet; wrap the rules: Shield(rules)"
AGENT = "or an object with name, n_uniforms and act(observations, uniforms), and is of type"
NO_PATH = "the path of a file must be text or a Path and is None"
WRONG: list[tuple[Callable[[Given], object], str]] = [
    (lambda g: mine_rules(None, **SHARES), MINED + "None; load some: load_demonstrations(path)"),
    (lambda g: mine_rules("a.parquet", **SHARES), MINED + "'a.parquet'"),
    (lambda g: mine_rules(g.rules, **SHARES), MINED + "of type RuleSet"),
    (lambda g: mine_rules([g.cart], **SHARES), MINED + "a list of Demonstrations"),
    (lambda g: mine_rules(g.trees, supp_min="a", conf_min=1), "must be a number and is 'a'"),
    (lambda g: mine_rules(g.trees, **SHARES, lift_min=None), "lift must be a number and is None"),
    (lambda g: mine_rules(g.trees, **SHARES, max_depth=1.5), "must be a whole number and is 1.5"),
    (lambda g: mine_rules(g.trees, **SHARES, divider=5), "the divider is 5 and the trees were"),
    (lambda g: grow_policy_trees("a.parquet"), "must be Demonstrations and is 'a.parquet'"),
    (lambda g: grow_policy_trees(g.cart, max_depth="a"), "the maximum depth is 'a'"),
    (lambda g: threshold_landscape(g.cart, [0.1], [0.9]), "must be trees and is of type Demon"),
    (lambda g: threshold_landscape(g.trees, [2], [0.9]), "the supports of a landscape go from 2"),
    (lambda g: threshold_landscape(g.trees, [0.1], [-1, 0]), "the confidences of a landscape go"),
    (lambda g: threshold_landscape(g.trees, "a", [0.9]), "the supports of a landscape must be"),
    (lambda g: threshold_landscape(g.trees, [0.1], [1], lift_min="a"), "lift must be a number"),
    (lambda g: Shield(None), "what a shield holds to must be a RuleSet and is None; mine one"),
    (lambda g: Shield(Path("rules.json")), "must be a RuleSet and is 'rules.json'"),
    (lambda g: Shield(list(g.rules)), "must be a RuleSet and is a list of Rule"),
    (lambda g: rollout(CART, "novice", shield=g.rules), WRAP),
    (lambda g: render_episode(CART, "novice", shield=g.rules), WRAP),
    (lambda g: ShieldedEnv(g.env, g.rules), WRAP),
    (lambda g: ShieldedEnv(None, Shield(g.rules)), "must be a gymnasium.Env and is None"),
    (lambda g: ShieldedEnv(g.env, Shield(g.rules), penalty="x"), "the penalty is 'x'"),
    (lambda g: ShieldedVecEnv(g.env, Shield(g.rules)), "must be a VecEnv of Stable-Baselines3"),
    (lambda g: rollout(CART, lambda state: 0), AGENT + " function"),
    (lambda g: make_agent(print, CART), AGENT),
    (lambda g: make_agent(None, CART), "and is None; give one of these"),
    (lambda g: rollout(g.env, "novice"), "the environment must be text and is of type"),
    (lambda g: rollout(CART, "novice", episodes=1.5), "episodes must be a whole number and is 1.5"),
    (lambda g: rollout(CART, "novice", jobs=None), "jobs must be a whole number and is None"),
    (lambda g: record(CART, "novice", steps="9"), "steps must be a whole number and is '9'"),
    (lambda g: render_episode(CART, "novice", seed=0.5), "seed must be a whole number and is 0.5"),
    (lambda g: make_report(g.cart, g.rules), "call make_report(rules, demonstrations)"),
    (lambda g: make_report(g.rules, None), "must be Demonstrations and is None; call make_report("),
    (lambda g: make_report(g.rules, g.cart, frames=1.5), "must be a whole number and is 1.5"),
    (lambda g: export_rules(None, g.folder / "a.py"), "what is exported must be a RuleSet"),
    (lambda g: export_rules(g.rules, None), NO_PATH),
    (
        lambda g: export_rules(g.rules, g.folder / "a.py", demonstrations="a.csv"),
        "must be Demonstrations and is 'a.csv'",
    ),
    (lambda g: load_rules(None), NO_PATH),
    (lambda g: load_demonstrations(None), NO_PATH),
    (
        lambda g: load_demonstrations("a.csv", columns={"a": 1}),
        "the map of columns must be a ColumnMap",
    ),
    (
        lambda g: save_demonstrations("a.csv", g.cart),
        "call save_demonstrations(demonstrations",
    ),
    (lambda g: save_demonstrations(g.cart, None), NO_PATH),
    (lambda g: g.rules.save(None), NO_PATH),
    (lambda g: g.rules.save(g.folder / "rules.csv"), "rules.csv does not end in .json"),
    (lambda g: make_report(g.rules, g.cart, frames=0).save(g.folder / "a.txt"), "end in .html"),
]


@pytest.mark.parametrize(("call", "says"), WRONG, ids=[says for _, says in WRONG])
def test_what_is_of_another_type_is_one_sentence(
    call: Callable[[Given], object],
    says: str,
    cart: Demonstrations,
    rules: RuleSet,
    trees: tuple[PolicyTree, ...],
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError) as told:
        call(Given(cart, rules, trees, gymnasium.make(CART), tmp_path))
    assert says in str(told.value)
    assert not list(tmp_path.iterdir())


def test_one_tree_is_taken_for_the_trees(trees: tuple[PolicyTree, ...]) -> None:
    assert mine_rules(trees[0], **SHARES) == mine_rules(list(trees), **SHARES, divider=2)
    alone, listed = (threshold_landscape(given, [0.1], [0.9]) for given in (trees[0], trees))
    assert np.array_equal(alone.rule_count, listed.rule_count)


def test_the_text_of_a_rule_set_counts_one_and_none(rules: RuleSet) -> None:
    one = replace(rules, rules=rules.rules[:1])
    assert "\n1 rule, 2 conditions; it covers 33 % of the states and is right in" in one.to_text()
    assert "\n0 rules; no state is covered.\n" in replace(rules, rules=()).to_text()


def test_what_is_large_shows_its_size(rules: RuleSet, trees: tuple[PolicyTree, ...]) -> None:
    shown = repr(threshold_landscape(trees, [0.1, 0.2], [0.9]))
    assert shown.startswith("Landscape(supports=2, confidences=1, rules=")
    assert repr(Shield(rules)).startswith("Shield(RuleSet('CartPole-v1', rules=5, ")
    assert "MlpPolicy('CartPole-v1', layers=4x64x64x2, head=" in repr(make_agent("expert", CART))


def test_the_command_says_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{sarl_core.__version__}\n"
