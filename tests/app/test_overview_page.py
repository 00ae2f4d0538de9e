"""The page Overview, and the first run that begins on it."""

from __future__ import annotations

import json

import pytest
from PIL import Image
from streamlit.testing.v1 import AppTest

from sarl_core import load_rules, make_agent, rollout
from sarl_core.explaining.words.glossary import GLOSSARY, meaning_of
from sarl_core.shielding.shield import Shield
from sarl_dashboard.components.journey.first_run import STEPS
from tests.app.screens import ROUTER, follow, open_page, run_through, texts

DATA = ROUTER.parents[1] / "data"
REPLAY = DATA / "replays" / "lunar_lander.gif"


def stages(app: AppTest) -> dict[str, tuple[bool, str]]:
    """Whether each stage is done, and what is said of it."""
    lines = [link.proto.label for link in app.get("page_link") if "material/c" in link.proto.label]
    found = {}
    for line in lines:
        icon, name, text = line.split("**")
        found[name.removesuffix(":")] = ("check_circle" in icon, text.strip())
    return found


def test_one_arrives_at_it_and_old_links_bring_their_data() -> None:
    app = open_page("overview", data="pendulum")
    assert app.title[0].value == "Overview"
    assert "What is done for Pendulum" in texts(app)


def test_the_replay_plays_and_its_card_is_true() -> None:
    with Image.open(REPLAY) as film:
        assert film.n_frames > 50
    assert REPLAY.stat().st_size < 600_000
    card = json.loads(REPLAY.with_suffix(".json").read_text())
    rules = load_rules(DATA / "rules" / f"{card['rules']}.json")
    for name, shield in (("shielded", Shield(rules)), ("unshielded", None)):
        agent = make_agent(card["agent"], card["env_id"])
        played = rollout(card["env_id"], agent, shield=shield, episodes=1, seed=card["seed"])
        assert round(float(played.returns[0]), 1) == card[name]["return"]
        assert int(played.lengths[0]) == card[name]["length"]
        assert bool(played.summary()["failures"]) == card[name]["failed"]
        if shield is not None:
            assert int(played.interventions[0]) == card[name]["interventions"]
    assert "correct 243 of 320 actions" in texts(open_page("overview"))


def test_nothing_is_said_to_be_done_that_was_not(monkeypatch: pytest.MonkeyPatch) -> None:
    # What another visit has found out is known to all.
    monkeypatch.setattr("sarl_dashboard.views.overview.stages.known", lambda: None)
    found = stages(open_page("overview", data="cartpole"))
    assert found["Data"] == (True, "15,000 steps in 30 episodes, shipped")
    assert [name for name, (done, _) in found.items() if done] == ["Data"]
    assert stages(open_page("overview", data="upload")) == {"Data": (False, "nothing uploaded yet")}


@pytest.mark.parametrize(
    ("query", "stage", "text"),
    [
        ({"support": "0.01"}, "Thresholds", "set: support at least 0.01, confidence at least 0.95"),
        ({"set": "compact"}, "Rules", "Compact rules chosen"),
        ({"holdout": "0.2"}, "Evidence", "20 % of the episodes held out"),
    ],
)
def test_a_choice_that_was_made_is_done(query: dict[str, str], stage: str, text: str) -> None:
    assert stages(open_page("overview", data="cartpole", **query))[stage] == (True, text)


def test_edits_names_and_a_replay_are_done_for_the_data_they_were_made_on() -> None:
    app = open_page("edit", data="cartpole", support="0.01", confidence="0.9")
    app.button(key="edit_switch").click().run()
    app.switch_page("replay.py").run()
    run_through(app, "replay")
    app.switch_page("overview.py").run()
    found = stages(app)
    assert found["Edits"] == (True, "1 edit")
    assert found["Replay"][0]
    app.selectbox(key="_data_choice").set_value("pendulum").run()
    found = stages(app)
    assert not found["Edits"][0]
    assert not found["Replay"][0]


def test_every_word_is_in_the_list_and_a_question_mark_leads_to_it() -> None:
    said = texts(open_page("overview"))
    for word in GLOSSARY:
        assert f"**{word[0].upper()}{word[1:]}:** " in said
    app = open_page("thresholds", data="cartpole")
    helps = {metric.label: metric.help for metric in app.metric}
    helps |= {slider.label: slider.help for slider in app.select_slider}
    for label, word in (
        ("Rules", "rule"),
        ("Mean length", "length of a rule"),
        ("Coverage", "coverage"),
        ("Fidelity", "fidelity"),
        ("Minimum support", "support"),
        ("Minimum confidence", "confidence"),
    ):
        assert helps[label].startswith(meaning_of(word))
        assert "(./?words=all)" in helps[label]


def test_the_words_open_beside_any_page() -> None:
    app = open_page("rules", data="cartpole")
    assert "**Novice:** " not in texts(app)
    app.button(key="words").click().run()
    assert "**Novice:** " in texts(app)
    assert app.title[0].value == "Rules"


def test_the_first_run_leads_through_five_pages_on_lunar_lander() -> None:
    app = open_page("overview", data="cartpole", set="compact")
    assert len(STEPS) == 5
    follow(app, "Begin the first run")
    for number, step in enumerate(STEPS):
        assert not app.exception
        assert app.title[0].value == step.page
        assert f"step {number + 1} of 5" in texts(app)
        assert step.task in texts(app)
        assert app.selectbox(key="_data_choice").value == "lunar_lander"
        if step.page == "Thresholds":  # moving its sliders changes the rules in force
            assert "Compact rules" not in texts(app)
        if step.page == "Rules":
            assert app.selectbox(key="_rules_choice").value == "fewest, two features"
        if step.page == "Replay":
            assert app.selectbox(key="rules").value == "fewest, two features"
            follow(app, "Done")
        else:
            follow(app, f"Next: {STEPS[number + 1].page}")
    assert app.title[0].value == "Overview"
    app.switch_page("rules.py").run()
    assert "First run" not in texts(app)


def test_the_first_run_waits_while_one_looks_elsewhere_and_ends_when_told_to() -> None:
    app = open_page("overview")
    follow(app, "Begin the first run")
    follow(app, "Next: Thresholds")
    app.switch_page("export.py").run()
    assert "step 2 of 5" in texts(app)
    assert STEPS[1].task not in texts(app)
    follow(app, "Go on with Thresholds")
    assert app.title[0].value == "Thresholds"
    follow(app, "Back")
    assert app.title[0].value == "Demonstrations"
    app.button(key="first_run_end").click().run()
    assert app.title[0].value == "Demonstrations"
    assert "First run" not in texts(app)


def test_the_first_run_goes_on_after_a_reload_and_a_restart() -> None:
    app = open_page("rules", set="fewest, two features", first_run="3")
    assert "step 3 of 5" in texts(app)
    assert STEPS[2].task in texts(app)
    assert app.query_params["first_run"] == "3"
    app.button(key="first_run_end").click().run()
    assert "First run" not in texts(app)
    assert "first_run" not in app.query_params
    for number in ("0", "6", "x"):
        assert "First run" not in texts(open_page("rules", first_run=number))
