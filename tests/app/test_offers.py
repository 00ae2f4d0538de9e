"""Environments and agents that whoever runs a dashboard offers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sarl_core import Environment
from sarl_core.agents.offers import VARIABLE, Offers
from sarl_core.cli.app import main
from sarl_dashboard.state.environments import offers
from tests.app.screens import errors, finished, html, metrics, open_page, run_through, texts

TASK = """
import gymnasium
import numpy as np
from gymnasium.envs.classic_control import CartPoleEnv

class Crane(CartPoleEnv):
    feature_names = ("boom", "boom speed", "load angle", "load speed")

gymnasium.register("OfferedCrane-v0", Crane, max_episode_steps=30)

def operator(observations):
    return (observations[:, 2] > 0).astype(int)
"""
CRANE = Environment("offered_task:OfferedCrane-v0", '{"max_episode_steps": 12}')


@pytest.fixture
def offered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "offered_task.py").write_text(TASK)
    monkeypatch.syspath_prepend(tmp_path)
    given = Offers((CRANE,), (("operator", "offered_task:operator"),))
    monkeypatch.setenv(VARIABLE, given.to_text())
    offers.cache_clear()
    yield
    offers.cache_clear()


def test_an_offered_agent_acts_in_an_offered_environment(offered: None) -> None:
    app = run_through(
        open_page("replay", env=CRANE.id, agent="operator", rules="none", seed="3"), "replay"
    )
    assert not errors(app)
    assert metrics(app)["Length"] == "12 steps"
    assert "boom speed" in html(app)


def test_an_offered_agent_is_compared_with_the_others(offered: None) -> None:
    query = {"env": CRANE.id, "agents": "operator", "shields": "no shield", "episodes": "2"}
    app = open_page("shield", **query)
    app.button(key="run_comparison").click().run()
    finished(app, "comparison")
    assert not errors(app)
    (table,) = [frame.value for frame in app.dataframe if "Agent" in frame.value]
    assert list(table["Agent"]) == ["operator"]


def test_who_knows_the_task_stands_in_the_place_of_the_shipped_expert(offered: None) -> None:
    query = {"data": "cartpole", "env": CRANE.id}
    assert open_page("improve", **query).selectbox(key="expert").value == "operator"
    (agents,) = [one for one in open_page("shield", **query).pills if one.key == "agents"]
    assert agents.value == ["novice"]
    assert "operator" in agents.options
    compared = open_page("learning", learn_view="Your own", **query)
    assert compared.selectbox(key="learn_compare").options[-1] == "operator"


def test_a_failure_that_the_owner_names_is_said_on_every_page_that_plays(
    offered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    always = "cart position < 9"
    failing = Environment("CartPole-v1", CRANE.arguments, failure=always, cost=always)
    given = Offers((failing,), (("operator", "offered_task:operator"),))
    monkeypatch.setenv(VARIABLE, given.to_text())
    offers.cache_clear()
    query = {"data": "cartpole", "agent": "operator", "rules": "filtered"}
    replayed = run_through(open_page("replay", seed="3", **query), "replay")
    assert "With the rules, and without them, it fails. Cost: 12" in texts(replayed)
    assert metrics(replayed)["Freedom"].endswith("%")
    app = open_page("ablation", ablation_episodes="6", most_rules="2", **query)
    app.button(key="run_ablation").click().run()
    finished(app, "ablation")
    shown = metrics(app)
    assert shown["Failures, all rules"] == "6 of 6"
    assert (shown["Cost"], shown["Worst tenth"]) == ("12.0", "12.0")
    (failures,) = [one for one in app.metric if one.label == "Failures, all rules"]
    assert failures.delta == "54 % to 100 %"


def test_nothing_is_imported_that_is_not_offered(tmp_path: Path) -> None:
    offers.cache_clear()
    (sentence,) = errors(open_page("replay", env=CRANE.id, agent="novice", rules="none"))
    assert f"start it with `sarl app --env {CRANE.id}`" in sentence
    app = open_page("replay", env="CartPole-v1", agent="offered_task:operator", rules="none")
    assert app.selectbox(key="agent").value == "novice"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--env", "no_such_task:Crane-v0"], "No module named 'no_such_task'"),
        (["--agent", "operator"], "must be NAME=module:name"),
        (["--agent", "operator=no_such_task:operator"], "cannot be imported"),
        (["--env", "CartPole-v1", "--env", "Pendulum-v1", "--env-args", "{}"], "belong to one"),
        (["--env", "CartPole-v1", "--wrapper", "math:pi"], "cannot be called"),
        (["--settings", "nothing.toml"], "cannot be read"),
    ],
)
def test_what_cannot_be_offered_is_said_before_a_server_starts(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["app", *options]) == 2
    assert said in capsys.readouterr().err
