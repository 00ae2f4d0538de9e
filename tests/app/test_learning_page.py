"""The Learning page: the shipped study, and studies of a visitor's own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, WorkError, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS, arms_named
from sarl_core.learning.curves import Columns, Trial
from sarl_core.learning.study import LearningPlan
from sarl_core.learning.study_files import (
    LearningRun,
    LearningStudy,
    load_run,
    load_study,
    make_folder,
    policy_path,
    save_run,
    save_tables,
    write_json,
)
from sarl_core.library import Library
from sarl_core.shipped import DATA
from sarl_dashboard.jobs import learning
from tests.app.screens import errors, open_page, shown_and_further, texts

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def own_folder(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Studies of visitors go where nobody else's are."""
    folder = tmp_path / "visitors"
    monkeypatch.setenv("SARL_LEARNING", str(folder))
    return folder


def a_run(arm: str) -> LearningRun:
    """A finished run of ten episodes."""
    columns = dict.fromkeys(("returns", "lengths"), [60] * 10)
    columns |= {"crashed": [1] * 10, "interventions": [3] * 10, "covered": [9] * 10}
    columns |= {"ends": list(range(60, 601, 60)), "shielded": [1] * 10}
    trial = Trial((9.0, 10.0), 2, 0.0, 0.0)
    shielded = replace(trial, freedom=0.25)
    return LearningRun(ARMS[arm], 0, 600, Columns(**columns).read(), trial, shielded)


@pytest.fixture(scope="module")
def small_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one study of CartPole, as one is shipped: its tables only."""
    rules = mine_rules(
        load_demonstrations(ROOT / "data" / "demonstrations" / "cartpole.parquet"),
        supp_min=0.0,
        conf_min=1.0,
    )
    folder = tmp_path_factory.mktemp("studies") / "cartpole"
    folder.mkdir()
    plan = LearningPlan("CartPole-v1", rules, arms_named(["none", "mask"]), 600, (0,), episodes=2)
    write_json(folder / "plan.json", plan.settings())
    runs = (a_run("none"), a_run("mask"))
    study = LearningStudy("CartPole-v1", 600, plan.settings(), plan.arms, (0,), runs)
    save_tables(folder, study, {})
    return folder.parent


def own(*arms: str, **query: str) -> AppTest:
    """The form, with some ways to learn chosen."""
    app = open_page("learning", **{"data": "cartpole", "learn_view": "Your own", **query})
    if arms:
        app.pills(key="learn_arms").set_value(list(arms)).run()
    return app


def button(app: AppTest, key: str) -> Any:
    """A button, or None."""
    return next((each for each in app.button if each.key == key), None)


def until_over(app: AppTest) -> AppTest:
    """Look again and again, as the page does by itself, until nothing learns any more."""
    for _ in range(600):
        app.run()
        assert not app.exception, app.exception
        if button(app, "cancel_learning") is None:
            return app
        time.sleep(0.3)
    raise AssertionError(texts(app))


# --- the shipped study --------------------------------------------------------------------------


def test_the_shipped_study_stands_first(small_study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learning, "STUDIES", small_study)
    app = open_page("learning", data="cartpole")
    assert not errors(app)
    assert len(app.get("plotly_chart")) == 3
    table = app.dataframe[0].value
    assert table["Way to learn"].tolist() == ["No shield", "Mask"]
    assert table["Freedom, shield on"].tolist() == ["25 %", "25 %"]
    assert "Freedom with the shield on: 25 % of the choice is left to the agent." in texts(app)
    shown = texts(app)
    assert "CartPole-v1, 1,508 rules (support 0, confidence 1), 600 steps" in shown
    commands = "\n".join(code.value for code in app.code)
    assert "mine data/demonstrations/cartpole.parquet --support 0 --confidence 1" in commands
    assert "--arm none --arm mask --steps 600 --seeds 1" in commands


def test_for_other_demonstrations_it_says_that_no_study_is_theirs(
    small_study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "STUDIES", small_study)
    app = open_page("learning", data="pendulum")
    (said,) = app.info
    assert said.value.startswith("For Pendulum-v1 no study is shipped: make one under “Your own”")
    assert said.value.endswith("such as Cart Pole.")
    assert not app.dataframe
    assert not app.get("plotly_chart")


def test_without_a_shipped_study_it_says_what_can_be_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "STUDIES", tmp_path / "none")
    assert "No study is shipped" in texts(open_page("learning"))


def test_a_damaged_study_is_one_sentence(
    small_study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "studies" / "broken"
    folder.mkdir(parents=True)
    plan = (small_study / "cartpole" / "plan.json").read_text()
    (folder / "plan.json").write_text(plan.replace('"version": 1', '"version": 7'))
    monkeypatch.setattr(learning, "STUDIES", folder.parent)
    (sentence,) = errors(open_page("learning"))
    assert "version 7" in sentence


def test_what_is_committed_can_be_shown() -> None:
    plans = list(learning.STUDIES.glob("*/plan.json"))
    assert plans
    for plan in plans:
        study = load_study(plan.parent)
        assert study.complete
        assert len(study.seeds) >= 3
        for name in ("outcome", "curves", "afterwards"):
            assert (plan.parent / f"{name}.png").is_file()
    app = open_page("learning", data="lunar_lander")
    assert "LunarLander-v3, 3,274 rules" in texts(app)
    assert len(app.get("plotly_chart")) == 3
    assert len(app.dataframe) == 1


# --- a study of one's own -----------------------------------------------------------------------


def test_before_the_start_it_says_what_to_do() -> None:
    app = own()
    assert "press Start" in texts(app)
    assert "3 runs of 20,000 steps in CartPole-v1" in texts(app)
    assert not app.get("plotly_chart")


def test_agents_learn_and_what_they_learned_can_be_had(own_folder: Path) -> None:
    few = {"learn_steps": "1000", "learn_episodes": "3", "learn_compare": "novice"}
    app = own("none", "imitate", **few)
    app.button(key="run_learning").click().run()
    assert not app.exception
    assert button(app, "cancel_learning") is not None
    until_over(app)
    assert not errors(app), errors(app)
    assert "2 runs of 1,000 steps in CartPole-v1, all finished" in texts(app)
    assert app.button(key="run_learning").disabled
    assert app.dataframe[0].value["Way to learn"].tolist() == [
        "No shield",
        "Mask and imitate",
        "novice, for comparison",
    ]
    assert "3 episodes each afterwards" in texts(app)
    assert "on the episodes afterwards “novice” without the shield returns" in texts(app)
    assert [each.label for each in app.get("download_button")] == [
        "Download policy (.npz)",
        "Download everything (.zip)",
    ]
    assert button(app, "keep_study") is not None
    (folder,) = own_folder.iterdir()
    assert (folder / "policies" / "imitate-0.npz").is_file()
    # Whoever asks the same again sees it at once.
    again = own("none", "imitate", **few)
    assert "all finished" in texts(again)
    # So it is when the folder has gone with the machine's temporary files.
    curves = (folder / "curves.csv").read_bytes()
    shutil.rmtree(folder)
    again = own("none", "imitate", **few)
    assert "all finished" in texts(again)
    assert (folder / "curves.csv").read_bytes() == curves
    again.button(key="keep_study").click().run()
    assert not errors(again)
    with Library() as library:
        (item,) = library.items("Ada")
        assert item.name == "learned-CartPole-v1"
        summary = json.loads(library.path(item).read_text())
    assert {run["arm"] for run in summary["runs"]} == {"none", "imitate"}


def test_what_was_learned_is_chosen_from_again_by_what_comes_first() -> None:
    """Mask returns more, and handover fails less; both are safe and good."""
    app = own("none", "mask", "handover", learn_steps="1000", learn_rules="unfiltered")
    rules = mine_rules(
        load_demonstrations(ROOT / "data" / "demonstrations" / "cartpole.parquet"),
        supp_min=0.0,
        conf_min=1.0,
    )
    arms = arms_named(["none", "mask", "handover"])
    order = learning.LearningOrder("CartPole-v1", rules, arms, 1000, 1, "centre")
    make_folder(order.folder)
    plan = LearningPlan("CartPole-v1", rules, arms, 1000, (0,))
    write_json(order.folder / "plan.json", plan.settings())
    for arm, crashed, value, failed in (
        ("none", 1, 5.0, True),
        ("mask", 0, 30.0, True),
        ("handover", 0, 20.0, False),
    ):
        run = a_run(arm)
        curve = replace(run.curve, crashed=run.curve.crashed & bool(crashed))
        alone = Trial((value,) * 4, 4 * failed, 0.0, 0.0, failed=(failed,) * 4)
        save_run(order.folder, replace(run, done=1000, curve=curve, alone=alone))
    app.run()
    assert "good afterwards\\: “Mask”." in app.success[0].value
    app.selectbox(key="learn_choose").set_value("failures").run()
    assert not errors(app)
    (answer,) = app.success
    assert "good afterwards\\: “Imitate, then hand over”." in answer.value
    assert "the fewest failures, and among equals" in answer.value


def test_who_can_be_compared_with_depends_on_the_environment() -> None:
    assert own().selectbox(key="learn_compare").options == [
        "nobody",
        "novice",
        "untrained",
        "expert",
    ]


def test_the_form_shows_what_most_need_and_keeps_the_rest_at_hand() -> None:
    assert shown_and_further(own()) == (
        {"learn_rules", "learn_steps", "learn_seeds", "learn_arms", "learn_view"},
        {"learn_episodes", "learn_choose", "learn_compare"},
    )
    _, further = shown_and_further(own(data="pendulum"))
    assert further == {"learn_episodes", "projection", "learn_choose", "learn_compare"}
    assert own(learn_episodes="7").number_input(key="learn_episodes").value == 7


def test_stopped_learning_is_kept_and_goes_on(own_folder: Path) -> None:
    app = own("none", learn_steps="50000")  # so many that it cannot have ended when it is stopped
    app.button(key="run_learning").click().run()
    job = app.session_state["_job_learning"]
    for _ in range(600):
        if job.done:
            break
        time.sleep(0.1)
    app.button(key="cancel_learning").click().run()
    assert not app.exception
    assert "Stopped." in texts(app)
    for _ in range(600):
        if not learning.trainings()._at_work:
            break
        time.sleep(0.1)
    assert not learning.trainings()._at_work
    (folder,) = own_folder.iterdir()
    assert load_study(folder).runs[0].done > 0
    app.run()
    assert app.button(key="run_learning").label == "Go on"
    app.button(key="run_learning").click().run()
    until_over(app)
    assert "all finished" in texts(app)
    assert load_study(folder).runs[0].sittings == 2


def test_a_study_that_cannot_be_learned_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    app = own("none", learn_steps="1000")
    # As when the disk is full, or a package is missing: the process says one line and ends.
    monkeypatch.setattr(learning.Training, "problem", lambda _: "there is no room left; make some")
    monkeypatch.setattr(learning.subprocess, "Popen", failing)
    app.button(key="run_learning").click().run()
    until_over(app)
    (sentence,) = errors(app)
    assert sentence == "There is no room left; make some."
    assert button(app, "run_learning") is not None


def failing(*_: Any, **settings: Any) -> subprocess.Popen[bytes]:
    return REAL(["false"], stdin=subprocess.PIPE, stderr=settings["stderr"])


REAL = subprocess.Popen


@pytest.mark.parametrize(
    ("arms", "query", "fragment"),
    [
        ((), {"set": "own file"}, "rule file that was chosen was not kept"),
        (("mask",), {"data": "pendulum"}, "continuous"),
        (("none",), {"data": "pendulum", "learn_choose": "failures first"}, "chosen by failures"),
    ],
)
def test_what_cannot_be_learned_is_said_in_a_sentence(
    arms: tuple[str, ...], query: dict[str, str], fragment: str
) -> None:
    app = own(*arms, **query)
    (sentence,) = errors(app)
    assert fragment in sentence
    assert "\n" not in sentence
    assert button(app, "run_learning") is None


def test_without_demonstrations_one_is_sent_to_them() -> None:
    app = own(data="upload")
    assert not errors(app)
    assert "Nothing has been uploaded in this session" in texts(app)
    assert button(app, "run_learning") is None


def test_without_a_way_to_learn_it_asks_for_one() -> None:
    app = own()
    app.pills(key="learn_arms").set_value([]).run()
    (sentence,) = errors(app)
    assert "choose at least one" in sentence


# --- who waits for a process --------------------------------------------------------------------


@pytest.fixture
def waiting_process(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Instead of learning, a process that ends when its input does, as `learn` would."""

    def start(*_: Any, **settings: Any) -> subprocess.Popen[bytes]:
        return REAL(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)

    monkeypatch.setattr(learning.subprocess, "Popen", start)
    return


OTHER_RULES = RuleSet.load(DATA / "rules" / "cartpole_compact.json")


def an_order(steps: int = 1000) -> learning.LearningOrder:
    return learning.LearningOrder("CartPole-v1", None, (ARMS["none"],), steps, 1, "centre")


@pytest.mark.usefixtures("waiting_process")
def test_two_who_ask_the_same_share_a_process_and_the_last_one_ends_it() -> None:
    everyone = learning.Trainings()
    first, second = everyone.join(an_order()), everyone.join(an_order())
    assert first is second
    everyone.leave(first)
    assert first.running
    everyone.leave(second)
    assert first.process.returncode == 0  # it is gone, and nothing of it is left
    third = everyone.join(an_order())
    assert third is not first
    assert third.running
    everyone.leave(third)


@pytest.mark.usefixtures("waiting_process")
def test_no_more_learn_at_once_than_the_machine_takes() -> None:
    everyone = learning.Trainings()
    at_work = [everyone.join(an_order(1000 + extra)) for extra in range(learning.MOST_TRAININGS)]
    with pytest.raises(WorkError, match="try again"):
        everyone.join(an_order(9000))
    everyone.leave(at_work.pop())
    at_work.append(everyone.join(an_order(9000)))
    for training in at_work:
        everyone.leave(training)


@pytest.mark.usefixtures("waiting_process")
def test_old_folders_go_and_those_in_use_stay(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "MOST_FOLDERS", 2)
    monkeypatch.setattr(learning, "MOST_TRAININGS", 9)
    everyone = learning.Trainings()
    oldest = everyone.join(an_order(1000))
    for steps in (2000, 3000):
        everyone.leave(everyone.join(an_order(steps)))
    hours_ago = time.time() - 7 * 3600
    for folder in (oldest.folder, an_order(2000).folder):
        os.utime(folder, (hours_ago, hours_ago))
    everyone.leave(everyone.join(an_order(4000)))
    left = set(own_folder.iterdir())
    assert oldest.folder in left
    assert an_order(4000).folder in left
    assert an_order(3000).folder in left  # somebody may still be looking at it
    assert an_order(2000).folder not in left
    everyone.leave(oldest)


@pytest.mark.usefixtures("waiting_process")
def test_finished_runs_under_the_same_conditions_are_taken_over() -> None:
    before = an_order()
    make_folder(before.folder)
    save_run(before.folder, a_run("none"))
    policy_path(before.folder, ARMS["none"], 0).write_bytes(b"learned")
    more = replace(before, arms=(ARMS["none"], ARMS["none-replay"]))
    others = [replace(more, steps=2000), replace(more, rules=OTHER_RULES)]
    everyone = learning.Trainings()
    for order in (more, *others):
        everyone.leave(everyone.join(order))
    assert policy_path(more.folder, ARMS["none"], 0).read_bytes() == b"learned"
    assert load_run(more.folder / "runs" / "none-0.json").finished
    assert not any((order.folder / "runs" / "none-0.json").exists() for order in others)


def test_a_folder_that_cannot_be_made_is_said(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_folder.write_text("in the way")
    app = own("none", learn_steps="1000")
    app.button(key="run_learning").click().run()
    until_over(app)
    (sentence,) = errors(app)
    assert "cannot be made" in sentence


def test_orders_differ_in_their_folders_by_all_that_changes_the_numbers() -> None:
    order = an_order()
    others = [
        replace(order, env_id="LunarLander-v3"),
        replace(order, steps=2000),
        replace(order, seeds=2),
        replace(order, rules=OTHER_RULES),
        replace(order, arms=(ARMS["none-replay"],)),
        replace(order, projection="clip"),
        replace(order, episodes=7),
        replace(order, agent=("novice", "novice")),
    ]
    assert len({each.folder for each in (order, *others)}) == len(others) + 1
    assert replace(order, choose="failures").folder == order.folder
