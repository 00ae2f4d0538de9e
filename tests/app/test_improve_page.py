from __future__ import annotations

import json
import shlex
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from gymnasium.envs.classic_control import CartPoleEnv
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.demonstrations.names import names_of
from sarl_core.improving.aggregation import Aggregation, aggregate
from sarl_core.improving.aggregation_files import save_aggregation
from sarl_core.improving.gaps import gaps_so_far
from sarl_core.improving.plan import Plan
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import Thresholds
from sarl_dashboard import session
from sarl_dashboard.views.improve.order import command_for
from tests.app.screens import errors, metrics, open_page, shown_and_further, texts

DATA = Path(__file__).parents[2] / "data"
CARTPOLE = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
SMALL = {"max_rules": "4", "rounds": "2", "round_episodes": "6", "validation": "16"}
PLAN = Plan(4, rounds=2, episodes=6, validation=16)


@pytest.fixture(scope="module")
def expected() -> Aggregation:
    """What the library gives for the small run."""
    return aggregate(CARTPOLE, PLAN)


@pytest.fixture(autouse=True)
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped rules, empty at first."""
    open_page("demonstrations", data="cartpole")  # finds the modules of the pages
    monkeypatch.setattr("sarl_dashboard.state.rule_files.RULES_FOLDER", tmp_path)
    monkeypatch.setattr("sarl_dashboard.views.improve.shipped.RULES_FOLDER", tmp_path)
    return tmp_path


def keys(app: AppTest) -> list[str | None]:
    return [button.key for button in app.button]


def shown_work(app: AppTest) -> str:
    return " ".join(bar.proto.text for bar in app.get("progress"))


def finished(app: AppTest) -> AppTest:
    """Look in until the work is done and gathered, as the browser does every second."""
    for _ in range(1200):
        assert not app.exception, app.exception
        if "cancel_improve" not in keys(app) and "Stopping:" not in texts(app):
            return app
        time.sleep(0.1)
        app.run()
    raise AssertionError("the work does not end")


def run(app: AppTest) -> AppTest:
    app.button(key="run_improve").click().run()
    return finished(app)


def specs(app: AppTest) -> list[dict[str, Any]]:
    return [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]


def downloads(app: AppTest) -> list[str]:
    return [button.proto.label for button in app.get("download_button")]


# --- before a run ------------------------------------------------------------------------------


def test_before_a_run_the_page_says_what_it_does() -> None:
    app = open_page("improve", data="cartpole")
    assert "press Run" in texts(app)
    assert "10 rounds of 20 episodes" in texts(app)
    assert not app.get("plotly_chart")
    assert "divider" not in [slider.key for slider in app.slider]


def test_the_shipped_rules_show_how_they_came_about(shipped: Path, expected: Aggregation) -> None:
    save_aggregation(expected, shipped / "cartpole_compact.json", command="make it --again")
    point = {"rules": 4, "mean": 400.0, "std": 10.0}
    budgets = {"environments": {"CartPole-v1": [{**point, "episodes": 100}], "Other-v0": []}}
    (shipped / "budgets.json").write_text(json.dumps(budgets))
    app = open_page("improve", data="cartpole")
    assert expected.reported is not None
    assert f"mean return of **{expected.reported.statistics.mean:,.1f}**" in texts(app)
    assert [code.value for code in app.code] == ["make it --again"]
    table = app.dataframe[0].value
    assert table["Mean return"].tolist() == [
        pytest.approx(one.mean_return, abs=0.01) for one in expected.rounds
    ]
    assert table["Chosen"].tolist() == [one.number == expected.chosen for one in expected.rounds]
    rounds, by_number = specs(app)
    assert rounds["layout"]["yaxis4"]
    assert by_number["data"][0]["name"].startswith("one feature a condition")
    assert "No results are shipped" not in texts(app)


def test_no_results_of_another_task_stand_beside_one_s_own_data(shipped: Path) -> None:
    point = {"rules": 4, "mean": 400.0, "std": 10.0, "episodes": 100}
    budgets = {"environments": {"CartPole-v1": [point], "LunarLander-v3": [point]}}
    (shipped / "budgets.json").write_text(json.dumps(budgets))
    app = open_page("improve", data="cartpole")
    assert len(app.get("plotly_chart")) == 1
    assert "fresh episodes of Cart Pole" in texts(app)
    other = open_page("improve", data="pendulum")
    assert not other.get("plotly_chart")
    assert "No results are shipped for Pendulum-v1" in texts(other)
    assert "How many rules it takes" not in texts(other)


def test_the_form_shows_what_most_need_and_keeps_the_rest_at_hand() -> None:
    assert shown_and_further(open_page("improve", data="cartpole")) == (
        {"env", "expert", "max_rules", "rounds"},
        {"cut", "round_episodes", "validation", "choose", "refine", "improve_seed"},
    )
    assert shown_and_further(open_page("improve", data="pendulum", expert="nobody")) == (
        {"env", "expert", "round_episodes"},
        {"improve_seed", "divider"},
    )
    app = open_page("improve", data="cartpole", validation="32", improve_seed="7")
    assert app.number_input(key="validation").value == 32
    assert app.number_input(key="improve_seed").value == 7


@pytest.mark.parametrize(
    ("name", "content", "fragment"),
    [
        ("cartpole_compact.card.json", "{", "cannot be read"),
        ("cartpole_compact.card.json", "[]", "no JSON object"),
        ("cartpole_compact.card.json", '{"rounds": []}', "lacks"),
        ("budgets.json", '{"environments": {"CartPole-v1": [1]}}', "expected form"),
    ],
)
def test_a_damaged_card_is_one_sentence(
    shipped: Path, name: str, content: str, fragment: str
) -> None:
    rules = (DATA / "rules" / "cartpole_compact.json").read_text(encoding="utf-8")
    (shipped / "cartpole_compact.json").write_text(rules)
    (shipped / name).write_text(content)
    app = open_page("improve", data="cartpole")
    (sentence,) = errors(app)
    assert fragment in sentence
    assert "\n" not in sentence
    assert "run_improve" in keys(app)


# --- with an expert ----------------------------------------------------------------------------


def test_a_run_is_what_the_library_gives_and_goes_on_from_there(expected: Aggregation) -> None:
    app = run(open_page("improve", data="cartpole", **SMALL))
    assert not errors(app)
    table = app.dataframe[0].value
    assert table["Round"].tolist() == [1, 2]
    assert table["Mean return"].tolist() == [one.mean_return for one in expected.rounds]
    assert table["Expert disagrees"].tolist() == [100 * one.disagreement for one in expected.rounds]
    assert table["Demonstrations"].tolist() == [one.pairs for one in expected.rounds]
    assert expected.reported is not None
    spread = expected.reported.statistics
    assert metrics(app)["Mean return"] == f"{spread.mean:,.1f}"
    assert metrics(app)["Least return"] == f"{expected.reported.returns.min():,.1f}"
    assert metrics(app)["Rules"] == str(len(expected.rule_set))
    words = texts(app)
    assert f"**{len(expected.rule_set)} rules** of round {expected.chosen}" in words
    assert "100 fresh episodes" in words
    assert "The rules were chosen on other episodes" in words
    named = [trace.get("name") for trace in specs(app)[0]["data"]]
    assert {"chosen", "fresh episodes"} <= set(named)
    assert downloads(app) == ["Rules", "Card", "Demonstrations"]
    # Whoever asks again has it at once.
    again = open_page("improve", data="cartpole", **SMALL)
    assert again.dataframe[0].value.equals(table)
    assert again.button(key="run_improve").disabled
    assert "All done already" in texts(again)
    # Another seed is another run; what is known stays in sight.
    app.number_input(key="improve_seed").set_value(1).run()
    assert "settings have changed since" in texts(app)
    assert not app.button(key="run_improve").disabled
    assert metrics(app)["Rules"] == str(len(expected.rule_set))
    # And every page works on what was found.
    app.button(key="use_improved").click().run()
    assert not app.exception
    assert "now the ones chosen, on every page" in app.success[0].value
    kept = app.selectbox(key="_data_choice")
    assert app.query_params["data"] == kept.value
    assert any(label.endswith("-rules.parquet") for label in kept.options)
    used = app.session_state["_upload"]
    assert used.digest == expected.demonstrations.digest
    app.switch_page("rules.py").run()
    assert not app.exception
    rules = mine_rules(expected.demonstrations, supp_min=0.005, conf_min=0.95)
    assert len(app.dataframe[0].value) == len(rules)
    app.switch_page("demonstrations.py").run()
    assert not app.exception
    assert metrics(app)["Steps"] == f"{len(expected.demonstrations):,}"


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands that do what the page does, as they are made."""
    made: list[list[str]] = []

    def noted(*arguments: Any) -> str:
        command = command_for(*arguments)
        made.append(shlex.split(command))
        return command

    monkeypatch.setattr("sarl_dashboard.views.improve.order.command_for", noted)
    return made


def test_combinations_are_chosen_again_in_every_round_as_the_command_line_does(
    commands: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    # To report on a hundred episodes takes longer than all the rest.
    monkeypatch.setattr("sarl_dashboard.views.improve.order.Plan", partial(Plan, report=5))
    small = {**SMALL, "rounds": "1"}
    app = run(open_page("improve", data="cartpole", combine="2,3", **small))
    assert not errors(app)
    expected = aggregate(CARTPOLE, replace(PLAN, rounds=1, report=5, combined=((2, 3),)))
    assert expected.reported is not None
    assert metrics(app)["Mean return"] == f"{expected.reported.statistics.mean:,.1f}"
    assert metrics(app)["Rules"] == str(len(expected.rule_set))
    assert commands[-1][-4:-2] == ["--combine", "pole angle, pole angular velocity"]
    open_page("improve", data="cartpole", combine="every", **small)
    assert commands[-1][-3:] == ["--combine", "--out", "rules.json"]
    open_page("improve", data="cartpole", **small)
    assert "--combine" not in commands[-1]


def test_the_command_calls_features_as_the_file_does(commands: list[list[str]]) -> None:
    given = names_of(CARTPOLE)._replace(features=("place", "speed", "lean", "turning"))
    app = open_page("names", data="cartpole", combine="2,3")
    app.session_state["_names"] = {CARTPOLE.digest: given}
    app.switch_page("research/improve.py").run()
    assert not app.exception
    assert not errors(app)
    assert commands[-1][-4:-2] == ["--combine", "pole angle, pole angular velocity"]


def test_the_command_has_the_formulas_of_the_page_names(commands: list[list[str]]) -> None:
    formula = "lean [rad] = abs(pole_angle)"
    app = open_page("names", data="cartpole")
    app.text_input(key=f"formula_{CARTPOLE.digest[:8]}").set_value(formula).run()
    app.button(key="formula_take").click().run()
    app.switch_page("research/improve.py").run()
    assert not app.exception
    assert not errors(app)
    assert commands[-1][-4:] == ["--feature", formula, "--out", "rules.json"]


def test_an_own_expert_and_rules_cut_at_thresholds() -> None:
    query = SMALL | {"rounds": "1", "validation": "4", "max_rules": "12"}
    app = open_page(
        "improve",
        data="cartpole",
        expert="own file",
        cut="at the thresholds",
        support="0.1",
        **query,
    )
    (sentence,) = errors(app)
    assert "No policy has been uploaded" in sentence
    # The search tries every leaf as a rule: with thresholds it is not offered.
    assert "refine" not in [field.key for field in app.number_input]
    policy = (DATA / "experts" / "cartpole.npz").read_bytes()
    app.file_uploader(key="expert_file").set_value([("mine.npz", policy, "")]).run()
    run(app)
    assert not errors(app)
    plan = Plan(12, rounds=1, episodes=6, thresholds=Thresholds(0.1, 0.95), validation=4, report=1)
    wanted = aggregate(CARTPOLE, plan).rounds[0]
    (row,) = app.dataframe[0].value.to_dict("records")
    assert row["Rules"] == wanted.rules
    assert row["Coverage"] == 100 * wanted.coverage < 100
    assert row["Mean return"] == wanted.mean_return


def test_an_expert_of_another_environment_is_refused_in_one_sentence() -> None:
    app = open_page("improve", data="cartpole", expert="own file", **SMALL)
    policy = (DATA / "experts" / "lunar_lander.npz").read_bytes()
    app.file_uploader(key="expert_file").set_value([("lander.npz", policy, "")]).run()
    run(app)
    (sentence,) = errors(app)
    assert "lander.npz" in sentence
    assert "\n" not in sentence
    app.run()  # what the page offers was perhaps drawn before the work had ended
    assert "press Run" in texts(app)


def test_what_was_finished_before_a_cancel_stays_readable() -> None:
    # Enough work for minutes, on any machine.
    query = {"rounds": "200", "round_episodes": "5", "max_rules": "3"}
    app = open_page("improve", data="cartpole", **query)
    app.button(key="run_improve").click().run()
    for _ in range(1200):
        if app.dataframe and len(app.dataframe[0].value) > 1:
            break
        time.sleep(0.1)
        app.run()
    # Meanwhile other pages are there, and the work goes on.
    app.switch_page("rules.py").run()
    assert not app.exception
    app.switch_page("research/improve.py").run()
    assert len(app.dataframe[0].value) > 1
    app.button(key="cancel_improve").click().run()
    finished(app)
    words = texts(app)
    assert "Cancelled. What had been finished is kept" in words
    assert "Nothing was reported on fresh episodes" in words
    assert 1 < len(app.dataframe[0].value) < 200
    assert sum(app.dataframe[0].value["Chosen"]) == 1
    assert downloads(app) == ["Rules", "Card", "Demonstrations"]
    assert not app.button(key="run_improve").disabled


def test_a_cancel_before_the_first_round_keeps_nothing_and_says_so() -> None:
    app = open_page("improve", data="cartpole", round_episodes="1000", rounds="9", max_rules="64")
    app.button(key="run_improve").click().run()
    app.button(key="cancel_improve").click().run()
    finished(app)
    assert "Cancelled before there was anything to keep" in texts(app)
    assert not errors(app)
    assert not app.dataframe


def test_one_visitor_cannot_hold_improve_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    first = open_page("improve", data="cartpole", rounds="200", max_rules="5")
    first.button(key="run_improve").click().run()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(session, "visitor", lambda: "another")
        second = open_page("improve", data="cartpole", expert="nobody", round_episodes="2")
        second.button(key="run_improve").click().run()
        assert "have no rule" in texts(finished(second))
        # The work of others is seen on Library, and not called off there.
        library = open_page("library")
        assert "**Improve.**" in shown_work(library)
        assert "who alone can cancel it" in texts(library)
        assert not [key for key in keys(library) if str(key).startswith("cancel_job")]
    library = open_page("library")
    assert [key for key in keys(library) if str(key).startswith("cancel_job")]
    assert "cancel_improve" in keys(first.run())  # which goes on
    first.button(key="cancel_improve").click().run()
    finished(first)


# --- with nobody to ask ------------------------------------------------------------------------


def test_gaps_are_what_the_library_gives() -> None:
    app = open_page("improve", data="cartpole", expert="nobody", round_episodes="12")
    assert "max_rules" not in [number.key for number in app.number_input]
    assert "press Find the gaps" in texts(app)
    run(app)
    assert not errors(app)
    rules = mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)
    *_, wanted = gaps_so_far("CartPole-v1", rules, episodes=12, seed=100_000)
    assert len(wanted)
    words = texts(app)
    assert f"**{len(wanted):,}** of the {wanted.met:,} states" in words
    assert f"({share_text(wanted.share)})" in words
    assert len(app.get("plotly_chart")) == 4
    table = app.dataframe[0].value
    assert len(table) == min(200, len(wanted))
    assert table["Episode"].max() == wanted.episode.max()
    assert downloads(app) == ["Download all as CSV"]


def test_where_every_state_has_a_rule_there_is_no_gap() -> None:
    app = open_page(
        "improve",
        data="cartpole",
        expert="nobody",
        round_episodes="2",
        support="0.5",
        confidence="0",
    )
    run(app)
    assert "the rules had an answer" in texts(app)
    assert not app.dataframe
    assert not downloads(app)


def test_several_actions_say_which_of_them_lacks_a_rule() -> None:
    app = open_page(
        "improve", data="bipedal_walker", expert="nobody", round_episodes="1", divider="3"
    )
    assert app.slider(key="divider").value == 3
    run(app)
    assert "for some action" in texts(app)
    assert "hip 1 torque" in texts(app)
    assert "12 of 24 features" in texts(app)
    assert "Without a rule" in app.dataframe[0].value


# --- what cannot be ----------------------------------------------------------------------------


@pytest.fixture
def bare() -> Iterator[str]:
    """An environment like the cart pole's, for which no expert is shipped."""
    gymnasium.register("Bare-v0", entry_point=CartPoleEnv, max_episode_steps=20)
    yield "Bare-v0"
    gymnasium.registry.pop("Bare-v0")


def test_without_a_shipped_expert_the_page_says_whom_to_ask(bare: str) -> None:
    app = open_page("improve", data="cartpole", env=bare)
    (sentence,) = errors(app)
    assert "No expert is shipped for Bare-v0" in sentence
    assert "run_improve" not in keys(app)


@pytest.mark.parametrize(
    ("query", "fragment"),
    [
        ({"env": "LunarLander-v3"}, "have 4 features and LunarLander-v3 has 8"),
        ({"env": "Nowhere-v9"}, "no environment 'Nowhere-v9'"),
    ],
)
def test_what_cannot_be_run_is_said_before_it_is_asked_for(
    query: dict[str, str], fragment: str
) -> None:
    (sentence,) = errors(open_page("improve", data="cartpole", **query))
    assert fragment in sentence


@pytest.mark.parametrize("junk", ["0", "-3", "many", "1e9"])
def test_junk_in_a_link_falls_back_to_the_usual(junk: str) -> None:
    app = open_page(
        "improve",
        data="cartpole",
        max_rules=junk,
        rounds=junk,
        expert=junk,
        cut=junk,
        validation=junk,
    )
    assert app.number_input(key="max_rules").value == 24
    assert app.number_input(key="rounds").value == 10
    assert app.number_input(key="validation").value == 128
    assert app.selectbox(key="expert").value == "shipped"
    assert not errors(app)


def test_without_an_upload_the_page_says_what_to_do() -> None:
    assert "Nothing has been uploaded" in texts(open_page("improve", data="upload"))
