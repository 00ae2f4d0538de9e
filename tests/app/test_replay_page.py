from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import gymnasium
import pytest
from gymnasium.wrappers import NormalizeObservation
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules, save_demonstrations
from sarl_core.mining.rule_set import rules_to_json
from sarl_dashboard.jobs import replays
from tests.app.screens import (
    errors,
    finished,
    html,
    metrics,
    open_page,
    run_through,
    texts,
    upload_rules,
)

DATA = Path(__file__).parents[2] / "data"


def run(app: AppTest) -> AppTest:
    return run_through(app, "replay")


def test_the_page_opens_with_the_novice_under_the_rules_in_force() -> None:
    app = finished(open_page("replay", data="cartpole"), "replay")
    assert "Novice" in texts(app)
    assert "rules (at the thresholds)" in texts(app)
    assert "Return with rules" in metrics(app)
    assert not app.button(key="run_replay").disabled  # another one can be had


def test_a_replay_that_ends_while_the_page_is_drawn_is_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    latest = replays.latest

    def looked_up_too_soon() -> replays.Played | None:
        before, job = latest(), replays.REPLAY.job
        while job is not None and job.running:
            time.sleep(0.01)
        return before

    monkeypatch.setattr(replays, "latest", looked_up_too_soon)
    app = open_page("replay", data="cartpole")
    assert "Return with rules" in metrics(app)


def test_another_task_is_not_left_with_the_picture_of_the_one_before() -> None:
    app = finished(open_page("replay", data="cartpole"), "replay")
    app.selectbox(key="env").set_value("Pendulum-v1")
    app.selectbox(key="rules").set_value("none").run()
    assert "CartPole" not in texts(finished(app, "replay"))
    assert "**Novice** in **Pendulum-v1**" in texts(app)


def test_what_was_called_off_at_the_first_visit_is_begun_by_a_press() -> None:
    app = open_page("replay", data="lunar_lander", rules="unfiltered", seed="78")
    assert "begins by itself" in texts(app)
    app.button(key="cancel_replay").click().run()
    app.run()
    assert "press Run" in texts(app)
    assert "Cancelled; nothing was kept" in texts(app)
    assert not app.metric


def test_results_stand_above_the_forms_that_made_them() -> None:
    app = run(open_page("replay", data="cartpole", rules="unfiltered", seed="3"))
    app.button(key="next").click().run()
    run_through(app, "fork")
    run_through(app, "episodes")
    protos = [getattr(element, "proto", None) for element in app.main]
    ids = [str(getattr(proto, "id", "")) for proto in protos]
    for result, form in (("film", "run_replay"), ("fork_film", "withhold"), ("comparison", "over")):
        (above,) = [at for at, name in enumerate(ids) if name.endswith(f"-{result}")]
        (below,) = [at for at, name in enumerate(ids) if name.endswith(f"-{form}")]
        assert above < below, form


def test_work_of_the_page_before_is_not_taken_for_a_chosen_step() -> None:
    app = open_page("evidence", data="cartpole", support="0.05", confidence="0.9")
    app.switch_page("replay.py").run()
    assert not app.exception, app.exception
    assert finished(app, "replay").slider(key="step").value == 0


@pytest.mark.parametrize(
    ("data", "agent", "rules"),
    [
        ("cartpole", "novice", "at the thresholds"),
        ("cartpole", "expert", "filtered"),
        ("cartpole", "untrained", "unfiltered"),
        ("lunar_lander", "novice", "unfiltered"),
        ("pendulum", "novice", "at the thresholds"),
    ],
)
def test_an_agent_is_replayed_with_the_rules_and_without(data: str, agent: str, rules: str) -> None:
    app = run(open_page("replay", data=data, agent=agent, rules=rules, seed="3"))
    assert not errors(app)
    assert set(metrics(app)) == {
        "Return with rules",
        "Return without",
        "Length with rules",
        "Length without",
        "Changed",
        "Covered",
        "Freedom",
    }
    assert "With the rules" in texts(app)  # how it ended
    assert "settings have changed" not in texts(app)
    assert len(app.get("plotly_chart")) == 2


def test_the_rules_keep_a_novice_upright() -> None:
    app = run(open_page("replay", data="cartpole", rules="unfiltered", seed="3"))
    shown = metrics(app)
    assert int(shown["Length with rules"]) > 2 * int(shown["Length without"])
    assert shown["Changed"] != "0 %"


def test_a_run_is_called_off_or_goes_on_while_another_page_is_read() -> None:
    app = open_page("replay", data="lunar_lander", rules="unfiltered", seed="77")
    app.button(key="cancel_replay").click().run()
    assert "Cancelled; nothing was kept" in texts(app)
    assert not metrics(app)
    app.button(key="run_replay").click().run()
    assert "press Run" not in texts(app)
    app.switch_page("rules.py").run()
    app.switch_page("replay.py").run()
    assert int(metrics(finished(app, "replay"))["Length with rules"]) > 0


def test_the_same_request_is_not_run_again_and_another_is_noticed() -> None:
    app = run(open_page("replay", data="cartpole", seed="5"))
    before = metrics(app)
    app.number_input(key="seed").set_value(6).run()
    assert "settings have changed" in texts(app)
    assert metrics(app) == before
    run(app)
    assert "settings have changed" not in texts(app)
    app.number_input(key="seed").set_value(5).run()
    assert metrics(run(app)) == before


def test_without_rules_there_is_one_run() -> None:
    app = run(open_page("replay", data="cartpole", rules="none", agent="expert"))
    assert metrics(app)["Return"] == "500.0"
    assert "changed" not in [button.label for button in app.button]


def test_every_step_can_be_looked_at() -> None:
    app = run(open_page("replay", data="cartpole", rules="unfiltered", seed="3"))
    app.button(key="next").click().run()
    assert not app.exception
    first = app.slider(key="step").value
    assert "Changed by the rules" in html(app)
    assert "If the" in html(app)
    app.button(key="next").click().run()
    assert app.slider(key="step").value > first
    app.button(key="previous").click().run()
    assert app.slider(key="step").value == first
    last = app.slider(key="step").max
    app.slider(key="step").set_value(last).run()
    assert not app.exception
    assert "<td>pole angle</td>" in html(app)


def test_a_step_beyond_the_end_is_the_last_one() -> None:
    app = run(open_page("replay", data="cartpole", step="999", seed="3"))
    assert app.slider(key="step").value <= app.slider(key="step").max
    app.number_input(key="seed").set_value(4).run()
    run(app)


@pytest.mark.parametrize("projection", ["centre", "clip", "expert"])
def test_a_continuous_action_is_replaced_in_three_ways(projection: str) -> None:
    app = run(open_page("replay", data="pendulum", projection=projection))
    assert not errors(app)
    assert metrics(app)["Changed"] != "0 %"


def test_twenty_episodes_are_compared() -> None:
    app = run(open_page("replay", data="cartpole", rules="unfiltered"))
    run_through(app, "episodes")
    (table,) = [one.value for one in app.dataframe if "Run" in one.value.columns]
    assert table["Run"].tolist() == ["With the rules", "Without"]
    assert len(app.get("plotly_chart")) == 3


@pytest.mark.parametrize(
    ("query", "fragment"),
    [
        ({"env": "Nowhere-v9"}, "Nowhere-v9"),
        ({"env": "MountainCar-v0", "agent": "expert", "rules": "none"}, "no shipped expert"),
        ({"env": "Pendulum-v1"}, "rules"),
        ({"data": "upload", "env": "CartPole-v1"}, "no demonstrations to mine"),
        ({"agent": "own file"}, "policy has been uploaded"),
        ({"set": "own file"}, "rule file that was chosen was not kept"),
    ],
)
def test_what_cannot_be_run_is_said_in_a_sentence(query: dict[str, str], fragment: str) -> None:
    app = open_page("replay", **{"data": "cartpole", **query})
    if "set" not in query:  # where the rules are not here, the page is not either
        run(app)
    (sentence,) = errors(app)
    assert fragment in sentence
    assert "\n" not in sentence


def test_where_nothing_can_be_run_nobody_is_told_to_press_run() -> None:
    app = open_page("replay", data="cartpole", env="Nowhere-v9")
    assert errors(app)
    assert "press Run" not in texts(app)


def test_an_error_leaves_the_replay_that_was_there() -> None:
    app = run(open_page("replay", data="cartpole"))
    before = metrics(app)
    app.selectbox(key="agent").set_value("own file").run()
    run(app)
    assert errors(app)
    assert metrics(app) == before


def test_an_uploaded_policy_acts() -> None:
    app = open_page("replay", data="cartpole", agent="own file", rules="none")
    content = (DATA / "experts" / "cartpole.npz").read_bytes()
    app.file_uploader(key="policy_file").set_value(("mine.npz", content, "")).run()
    run(app)
    assert not errors(app)
    assert metrics(app)["Return"] == "500.0"
    assert "Mine" in texts(app)


def trained_under_vec_normalize(folder: Path) -> tuple[bytes, bytes]:
    """A model that pushes a cart, and its statistics."""
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")]))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu").learn(64)
    model.save(folder / "mine.zip")
    env.save(str(folder / "statistics.pkl"))
    return (folder / "mine.zip").read_bytes(), (folder / "statistics.pkl").read_bytes()


def test_a_policy_is_uploaded_with_its_statistics(tmp_path: Path) -> None:
    model, statistics = trained_under_vec_normalize(tmp_path)
    app = open_page("replay", data="cartpole", agent="own file", rules="none")
    app.file_uploader(key="policy_file").set_value(("mine.zip", model, "")).run()
    run(app)
    (sentence,) = errors(app)
    assert "mine.zip was trained under a VecNormalize" in sentence
    uploader = app.file_uploader(key="policy_file_statistics")
    uploader.set_value(("statistics.pkl", statistics, "")).run()
    run(app)
    assert not errors(app)
    assert float(metrics(app)["Return"]) > 0


def test_what_looks_odd_in_a_policy_is_said(tmp_path: Path) -> None:
    env = NormalizeObservation(gymnasium.make("CartPole-v1"))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu")
    model.save(tmp_path / "mine.zip")
    app = open_page("replay", data="cartpole", agent="own file", rules="none")
    content = (tmp_path / "mine.zip").read_bytes()
    app.file_uploader(key="policy_file").set_value(("mine.zip", content, "")).run()
    (warning,) = [entry.value for entry in app.warning if "mine.zip" in entry.value]
    assert "NormalizeObservation" in warning
    assert "/tmp" not in warning


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("mine.npz", b"no policy"),
        ("mine.zip", b"PK\x03\x04"),
        ("mine.txt", b"?"),
        ("mine", b""),
        ("lander.npz", (DATA / "experts" / "lunar_lander.npz").read_bytes()),
    ],
)
def test_a_bad_policy_is_refused_by_its_own_name(name: str, content: bytes) -> None:
    app = open_page("replay", data="cartpole", agent="own file")
    app.file_uploader(key="policy_file").set_value((name, content, "")).run()
    run(app)
    (sentence,) = errors(app)
    assert name in sentence
    assert "/tmp" not in sentence


def test_an_uploaded_rule_file_is_in_force() -> None:
    rules = mine_rules(
        load_demonstrations(DATA / "demonstrations" / "cartpole.parquet"),
        supp_min=0.0,
        conf_min=1.0,
    )
    app = open_page("replay", data="lunar_lander", env="CartPole-v1")
    upload_rules(app, "rules.json", rules_to_json(rules).encode())
    run(app)
    assert not errors(app)
    assert f"{len(rules):,} rules" in texts(app)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"format": "other"}', b"\xff\xfe"])
def test_a_bad_rule_file_is_refused(content: bytes) -> None:
    app = open_page("replay", data="cartpole")
    upload_rules(app, "rules.json", content)
    (sentence,) = errors(app)
    assert "rules.json" in sentence
    assert "set" not in app.query_params  # what was in force still is


def test_the_agent_alone_is_run_over_twenty_episodes() -> None:
    app = run(open_page("replay", data="cartpole", rules="none"))
    run_through(app, "episodes")
    (table,) = [one.value for one in app.dataframe if "Run" in one.value.columns]
    assert table["Run"].tolist() == ["Agent alone"]


@pytest.fixture
def traces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the module `spy` leaves behind when it is imported, which registers an environment."""
    left = tmp_path / "imported.txt"
    (tmp_path / "spy.py").write_text(
        "import gymnasium, pathlib\n"
        f"pathlib.Path({str(left)!r}).write_text('imported')\n"
        "gymnasium.register('Spy-v0', 'gymnasium.envs.classic_control.cartpole:CartPoleEnv')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    return left


def test_a_link_imports_nothing(traces: Path) -> None:
    app = run(open_page("replay", data="cartpole", env="spy:Spy-v0"))
    (sentence,) = errors(app)
    assert "spy:Spy-v0" in sentence
    assert "\n" not in sentence
    assert not app.metric
    assert not traces.exists()
    assert "spy" not in sys.modules


def test_an_uploaded_file_imports_nothing(traces: Path, tmp_path: Path) -> None:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    path = tmp_path / "mine.npz"
    save_demonstrations(replace(demonstrations, env_id="spy:Spy-v0"), path)
    app = open_page("demonstrations")
    app.file_uploader(key="upload_files").set_value([("mine.npz", path.read_bytes(), "")]).run()
    assert not errors(app)
    app.switch_page("replay.py").run()
    run(app)
    assert "spy:Spy-v0" in texts(app)
    assert not errors(app)
    assert not traces.exists()
    assert "spy" not in sys.modules


def test_the_box_of_the_upload_imports_nothing(traces: Path) -> None:
    app = open_page("demonstrations", upload_env="spy:Spy-v0")
    content = (DATA / "demonstrations" / "cartpole.parquet").read_bytes()
    app.file_uploader(key="upload_files").set_value([("mine.parquet", content, "")]).run()
    (sentence,) = errors(app)
    assert "spy:Spy-v0" in sentence
    assert not traces.exists()


def test_few_covered_steps_are_said_and_the_unfiltered_rules_offered() -> None:
    app = run(open_page("replay", data="lunar_lander", rules="filtered", seed="1"))
    covered = metrics(app)["Covered"]
    assert float(covered.split()[0].strip("<")) < 30
    assert f"{covered} of the steps" in texts(app) or "No rule applied" in texts(app)
    finished(app.button(key="try_unfiltered").click().run(), "replay")
    assert app.selectbox(key="rules").value == "unfiltered"
    assert "rules (unfiltered)" in texts(app)
    assert "settings have changed" not in texts(app)
    assert float(metrics(app)["Covered"].split()[0]) > 30
    assert "try_unfiltered" not in [button.key for button in app.button]


def test_on_a_seed_of_the_demonstrations_the_page_says_so() -> None:
    def said(**query: str) -> str:
        app = open_page("replay", data="cartpole", rules="unfiltered", **query)
        return texts(run(app))

    assert "an episode of this seed" in said(seed="3")
    assert "an episode of this seed" not in said()
