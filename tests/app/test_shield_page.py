from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.mining.rule_set import rules_to_json
from sarl_core.studies.comparison import Arm, compare
from sarl_dashboard.jobs import episodes as episode_jobs
from tests.app.screens import errors, finished, open_page, texts, upload_rules

DATA = Path(__file__).parents[2] / "data"
CARTPOLE = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")


def run(app: AppTest) -> AppTest:
    app.button(key="run_comparison").click().run()
    return finished(app, "comparison")


def rows(app: AppTest) -> dict[str, dict[str, Any]]:
    """The table by agent and shield."""
    tables = [table.value for table in app.dataframe if "Agent" in table.value]
    found = tables[-1].to_dict("records") if tables else []
    return {f"{row['Agent']}, {row['Shield']}": row for row in found}


def test_before_a_run_the_page_says_what_to_do() -> None:
    app = open_page("shield", data="cartpole", first_seed="1000")
    assert "press Run" in texts(app)
    assert not rows(app)
    assert not app.button(key="run_comparison").disabled


def test_every_agent_with_every_shield_is_what_the_library_gives() -> None:
    app = run(open_page("shield", data="cartpole", episodes="5", first_seed="2000"))
    assert not errors(app)
    filtered = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)
    unfiltered = mine_rules(CARTPOLE, supp_min=0.0, conf_min=1.0)
    arms = [
        Arm(f"{agent}, {name}", agent, rules)
        for agent in ("novice", "expert")
        for name, rules in (
            ("no shield", None),
            ("filtered", filtered),
            ("unfiltered", unfiltered),
        )
    ]
    wanted = compare("CartPole-v1", arms, episodes=5, seed=2000)
    shown = rows(app)
    assert list(shown) == [arm.name for arm in arms]
    for arm, episodes in zip(arms, wanted.episodes, strict=True):
        row = shown[arm.name]
        assert row["Episodes"] == 5
        assert row["Mean return"] == pytest.approx(episodes.returns.mean())
        assert row["Typical return"] == pytest.approx(episodes.statistics.iqm)
        assert (row["Changed"] == "–") == (arm.rules is None)
        flips = f"{50 * episodes.flips.sum() / episodes.lengths.sum():.2f}"  # 50 steps a second
        assert row["Flips a second"] == ("–" if arm.rules is None else flips)
    assert shown["novice, unfiltered"]["Rules"] == f"{len(unfiltered):,}"
    assert shown["novice, no shield"]["Failures"] == "100 %"
    assert "the typical return of the novice rises" in texts(app)
    for agent in ("novice", "expert"):
        (told,) = (line for line in texts(app).splitlines() if f"return of the {agent} " in line)
        assert "the filtered rules" in told
        assert "the unfiltered rules" in told
    assert len(app.get("plotly_chart")) == 3  # and failures against freedom
    assert [button.label for button in app.get("download_button")] == ["Download CSV"]


def test_who_asks_again_has_it_at_once_and_more_goes_on_from_there() -> None:
    query = {"data": "cartpole", "first_seed": "3000", "agents": "novice", "shields": "no shield"}
    first = rows(run(open_page("shield", episodes="9", **query)))["novice, no shield"]
    again = open_page("shield", episodes="9", **query)
    assert rows(again)["novice, no shield"] == first
    assert again.button(key="run_comparison").disabled
    assert "all done already" in texts(again)
    fewer = open_page("shield", episodes="4", **query)
    assert rows(fewer)["novice, no shield"]["Episodes"] == 4
    assert fewer.button(key="run_comparison").disabled
    more = open_page("shield", episodes="12", **query)
    assert rows(more)["novice, no shield"]["Episodes"] == 9
    assert rows(run(more))["novice, no shield"]["Episodes"] == 12
    alone = compare("CartPole-v1", [Arm("a", "novice")], episodes=12, seed=3000)
    assert rows(more)["novice, no shield"]["Mean return"] == alone.episodes[0].returns.mean()


def test_what_was_finished_before_a_cancel_stays_readable() -> None:
    # Enough work for minutes, on any machine.
    query = {"data": "bipedal_walker", "episodes": "1000", "agents": "novice"}
    app = open_page("shield", shields="no shield", **query)
    app.button(key="run_comparison").click().run()
    for _ in range(3_000):
        if rows(app):
            break
        time.sleep(0.1)
        app.run()
    app.button(key="cancel_comparison").click().run()
    assert not app.exception
    assert "Cancelled" in texts(app)
    assert 0 < rows(app)["novice, no shield"]["Episodes"] < 1000
    assert not app.button(key="run_comparison").disabled
    other = open_page("shield", shields="no shield", **query)
    assert rows(other)["novice, no shield"]["Episodes"] > 0


def test_the_work_goes_on_while_other_pages_are_looked_at() -> None:
    app = open_page("shield", data="cartpole", episodes="12", first_seed="4000")
    app.button(key="run_comparison").click().run()
    app.switch_page("rules.py").run()
    assert not app.exception
    app.switch_page("shield.py").run()
    assert len(rows(finished(app, "comparison"))) == 6


@pytest.mark.parametrize("projection", ["centre", "clip", "expert"])
def test_continuous_actions_are_replaced_in_three_ways(projection: str) -> None:
    app = run(
        open_page("shield", data="pendulum", episodes="2", agents="novice", projection=projection)
    )
    assert not errors(app)
    assert set(rows(app)) == {f"novice, {name}" for name in ("no shield", "filtered", "unfiltered")}
    assert rows(app)["novice, unfiltered"]["Changed"] != "0 %"


def test_on_the_seeds_of_the_demonstrations_the_page_says_so() -> None:
    assert not open_page("shield", data="cartpole").warning
    app = open_page("shield", data="cartpole", first_seed="5")
    assert "know the way" in app.warning[0].value
    assert not open_page("shield", data="cartpole", first_seed="5", shields="no shield").warning
    assert not open_page("shield", data="cartpole", first_seed="30").warning


@pytest.fixture
def lacking() -> Iterator[str]:
    """An environment whose package is missing."""

    def fail(**_: Any) -> Any:
        raise ModuleNotFoundError("No module named 'engine'")

    gymnasium.register("Lacking-v0", entry_point=fail)
    yield "Lacking-v0"
    gymnasium.registry.pop("Lacking-v0")


def test_a_package_that_the_environment_lacks_is_named(lacking: str) -> None:
    (sentence,) = errors(open_page("shield", data="cartpole", env=lacking))
    assert "No module named 'engine'" in sentence
    assert "install it" in sentence


@pytest.mark.parametrize(
    ("query", "fragment"),
    [
        ({"env": "Nowhere-v9"}, "no environment 'Nowhere-v9'"),
        ({"env": "CarRacing-v3"}, "as images do"),
        ({"data": "upload", "env": "CartPole-v1", "shields": "filtered"}, "no demonstrations"),
    ],
)
def test_what_cannot_be_run_is_said_before_it_is_asked_for(
    query: dict[str, str], fragment: str
) -> None:
    (sentence,) = errors(open_page("shield", **{"data": "cartpole", **query}))
    assert fragment in sentence


@pytest.mark.parametrize(
    ("query", "fragment", "left"),
    [
        (
            {"env": "MountainCar-v0", "shields": "no shield", "agents": ["novice", "expert"]},
            "no shipped expert",
            ["novice"],
        ),
        ({"env": "Pendulum-v1", "agents": "novice"}, "rules", ["novice"]),
    ],
)
def test_what_fails_leaves_the_other_rows(
    query: dict[str, Any], fragment: str, left: list[str]
) -> None:
    app = run(open_page("shield", **{"data": "cartpole", "episodes": "2", **query}))
    (sentence,) = errors(app)
    assert fragment in sentence
    assert "\n" not in sentence
    assert [row["Agent"] for row in rows(app).values()] == left


@pytest.mark.parametrize("episodes", ["0", "-3", "many", "1e9"])
def test_a_number_of_episodes_that_cannot_be_is_the_usual_one(episodes: str) -> None:
    app = open_page("shield", data="cartpole", episodes=episodes)
    assert app.number_input(key="episodes").value == 20


def test_with_nothing_chosen_the_page_says_so() -> None:
    app = open_page("shield", data="cartpole")
    app.pills(key="shields").set_value([]).run()
    assert "at least one agent and one shield" in texts(app)
    assert not app.main.button


def test_a_policy_and_rules_of_one_s_own(tmp_path: Path) -> None:
    app = open_page(
        "shield", data="lunar_lander", env="CartPole-v1", episodes="2", first_seed="5000"
    )
    app.pills(key="agents").set_value(["own file"]).run()
    app.pills(key="shields").set_value(["no shield", "in force"]).run()
    policy = (DATA / "experts" / "cartpole.npz").read_bytes()
    learned = MlpPolicy.load(DATA / "experts" / "cartpole.npz")
    # It pushes the other way, and is named as one of the agents that are always there.
    turned = (*learned.weights[:-1], -learned.weights[-1])
    replace(learned, weights=turned).save(tmp_path / "novice.npz")
    other = (tmp_path / "novice.npz").read_bytes()
    files = [("mine.npz", policy, ""), ("again.npz", policy, ""), ("novice.npz", other, "")]
    app.file_uploader(key="policy_files").set_value(files).run()
    rules = mine_rules(CARTPOLE, supp_min=0.0, conf_min=1.0)
    upload_rules(app, "r.json", rules_to_json(rules).encode())
    run(app)
    assert not errors(app)
    assert rows(app)["mine, no shield"]["Mean return"] == 500.0
    assert rows(app)["mine, in force"]["Rules"] == f"{len(rules):,}"
    assert rows(app)["novice (2), no shield"]["Mean return"] < 50.0
    assert not any(name.startswith("again") for name in rows(app))  # one file, uploaded twice


def test_statistics_go_to_the_policy_whose_name_they_have(tmp_path: Path) -> None:
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")]))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu").learn(64)
    model.save(tmp_path / "mine.zip")
    env.save(str(tmp_path / "statistics.pkl"))
    content = (tmp_path / "mine.zip").read_bytes()
    statistics = (tmp_path / "statistics.pkl").read_bytes()
    app = open_page("shield", data="cartpole", episodes="2", first_seed="5000")
    app.pills(key="agents").set_value(["own file"]).run()
    app.pills(key="shields").set_value(["no shield"]).run()
    zips = [("mine.zip", content, ""), ("other.zip", content + b"\0", "")]
    files = [("mine_vecnormalize.pkl", statistics, ""), ("stray.pkl", statistics, "")]
    app.file_uploader(key="policy_files").set_value([*zips, *files]).run()
    run(app)
    assert list(rows(app)) == ["mine, no shield"]
    (sentence,) = errors(app)
    assert "other.zip was trained under a VecNormalize" in sentence
    assert any("stray.pkl was not used" in entry.value for entry in app.warning)
    app.file_uploader(key="policy_files").set_value([zips[1], files[1]]).run()
    run(app)
    assert not errors(app)
    assert list(rows(app)) == ["other, no shield"]


def test_a_rule_file_of_another_version_and_a_foreign_policy_are_named() -> None:
    app = open_page("shield", data="cartpole", episodes="2", first_seed="6000")
    app.pills(key="shields").set_value(["no shield"]).run()
    document = json.loads(rules_to_json(mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)))
    content = json.dumps(document | {"version": 99}).encode()
    upload_rules(app, "new.json", content)
    (sentence,) = errors(app)
    assert "new.json has version 99" in sentence
    app.pills(key="agents").set_value(["novice", "own file"]).run()
    policy = (DATA / "experts" / "lunar_lander.npz").read_bytes()
    app.file_uploader(key="policy_files").set_value([("lander.npz", policy, "")]).run()
    run(app)
    assert any("lander.npz" in sentence and "features" in sentence for sentence in errors(app))
    assert list(rows(app)) == ["novice, no shield"]


def test_two_names_for_the_same_rules_are_two_rows_and_one_run() -> None:
    app = open_page("shield", data="cartpole", episodes="3", first_seed="9000", agents="novice")
    app.pills(key="shields").set_value(["filtered", "at the thresholds"]).run()
    filtered, same = rows(run(app)).values()
    assert (filtered["Shield"], same["Shield"]) == ("filtered", "at the thresholds")
    assert {**filtered, "Shield": ""} == {**same, "Shield": ""}


def test_thresholds_that_leave_no_rule_leave_the_agent_alone() -> None:
    app = open_page(
        "shield",
        data="cartpole",
        episodes="3",
        first_seed="9100",
        agents="novice",
        support="0.9",
        confidence="1",
    )
    app.pills(key="shields").set_value(["no shield", "at the thresholds"]).run()
    alone, empty = rows(run(app)).values()
    assert not errors(app)
    assert empty["Rules"] == "0"
    assert empty["Covered"] == empty["Changed"] == "0 %"
    assert empty["Mean return"] == alone["Mean return"]


def test_compact_rules_are_offered_where_there_are_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    query = {"data": "cartpole", "episodes": "2", "first_seed": "7000", "agents": "novice"}
    open_page("shield", **query)
    monkeypatch.setattr("sarl_dashboard.state.rule_files.RULES_FOLDER", tmp_path)
    assert "compact" not in open_page("shield", **query).pills(key="shields").options
    mine_rules(CARTPOLE, supp_min=0.1, conf_min=0.5).save(tmp_path / "cartpole_compact.json")
    app = run(open_page("shield", **query, shields="compact"))
    assert list(rows(app)) == ["novice, compact"]


def test_a_link_to_a_comparison_shows_it_after_a_restart_and_runs_nothing_again() -> None:
    query = {"data": "cartpole", "agents": "novice", "episodes": "4", "first_seed": "7000"}
    app = run(open_page("shield", **query))
    before = rows(app)
    assert before
    episode_jobs.results.clear()  # as a server that was started anew
    again = open_page("shield", **query)
    assert rows(again) == before
    assert again.button(key="run_comparison").disabled
    # Of more episodes the first ones are known.
    more = open_page("shield", **query | {"episodes": "6"})
    assert rows(more) == before
    assert not more.button(key="run_comparison").disabled
