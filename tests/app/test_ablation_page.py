from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core import Shield, load_demonstrations, mine_rules
from sarl_core.studies.ablation_run import ablate
from tests.app.screens import errors, finished, metrics, open_page, texts

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


def test_every_rule_is_what_the_library_gives_and_kept() -> None:
    query = {"data": "cartpole", "rules": "filtered", "first_seed": "4000", "most_rules": "3"}
    app = open_page("ablation", ablation_episodes="6", **query)
    assert "press Run" in texts(app)
    app.button(key="run_ablation").click().run()
    finished(app, "ablation")
    assert not errors(app)
    rules = mine_rules(
        load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.95
    )
    wanted = ablate("CartPole-v1", "novice", Shield(rules), episodes=6, seed=4000, most=3)
    table = app.dataframe[-1].value
    assert table["Rule"].tolist() == [f"R{rule + 1}" for rule in wanted.rules]
    assert table["Return without it"].tolist() == [e.difference.mean for e in wanted.effects]
    shown = metrics(app)
    assert shown["Failures, all rules"] == f"{wanted.base_failures} of 6"
    assert shown["Episodes run for it"] == str(wanted.played)
    assert f"{len(wanted.left_out)} rules more changed actions" in texts(app)
    assert app.button(key="run_ablation").disabled
    # Asked again, by anyone, it is there at once.
    again = open_page("ablation", ablation_episodes="6", **query)
    assert again.dataframe[-1].value["Rule"].tolist() == table["Rule"].tolist()
    # More episodes are another question; what is known of it is used.
    again.number_input(key="ablation_episodes").set_value(7).run()
    assert not again.button(key="run_ablation").disabled


def test_called_off_it_says_so() -> None:
    app = open_page(
        "ablation", data="cartpole", rules="unfiltered", ablation_episodes="200", first_seed="9000"
    )
    app.button(key="run_ablation").click().run()
    app.button(key="cancel_ablation").click().run()
    finished(app, "ablation")
    assert "Cancelled. What had been finished is kept" in texts(app)
    assert not app.button(key="run_ablation").disabled


@pytest.mark.parametrize(
    ("query", "fragment"),
    [
        ({"env": "Nowhere-v9"}, "Nowhere-v9"),
        ({"agent": "own file"}, "policy has been uploaded"),
        ({"set": "own file"}, "rule file that was chosen was not kept"),
        ({"support": "1", "confidence": "1"}, "no rule that could be taken out"),
    ],
)
def test_what_cannot_be_run_is_said_in_a_sentence(query: dict[str, str], fragment: str) -> None:
    (sentence,) = errors(open_page("ablation", **{"data": "cartpole", **query}))
    assert fragment in sentence
    assert "\n" not in sentence
