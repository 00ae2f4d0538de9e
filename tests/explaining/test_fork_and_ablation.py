from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Environment, RuleSet, Shield, load_demonstrations, mine_rules, rollout
from sarl_core.explaining.figures.ablation import (
    VERDICT_COLOURS,
    ablation_columns,
    ablation_figure,
    ablation_text,
    difference_text,
    left_out_text,
)
from sarl_core.explaining.words.fork import ending_text, ending_texts, fork_text
from sarl_core.rendering.fork import fork
from sarl_core.studies.ablation import Ablation
from sarl_core.studies.ablation_run import ablate

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.95)


@pytest.fixture(scope="module")
def found(rules: RuleSet) -> Ablation:
    return ablate("CartPole-v1", "novice", Shield(rules), episodes=8, seed=100_000)


def test_the_table_and_the_figure_say_the_same(found: Ablation, rules: RuleSet) -> None:
    columns = ablation_columns(found)
    assert {len(column) for column in columns.values()} == {len(found.rules)}
    for row, rule in enumerate(found.rules):
        assert columns["Rule"][row] == f"R{rule + 1}"
        difference = (found.returns[row] - found.base.returns).mean()
        assert columns["Return without it"][row] == pytest.approx(difference)
        assert columns["Failures without it"][row] == int(found.failed[row].sum())
    figure = ablation_figure(found, found.effects)
    drawn = {
        (float(x), int(y)): trace.marker.color
        for trace in figure.data
        for x, y in zip(trace.x, trace.y, strict=True)
    }
    assert drawn == {
        (effect.difference.mean, row): VERDICT_COLOURS[effect.verdict]
        for row, effect in enumerate(found.effects)
    }
    assert list(figure.layout.yaxis.ticktext) == columns["Rule"]


def test_the_sentences_count(found: Ablation) -> None:
    texts = " ".join(ablation_text(found))
    assert f"{len(found.rules)} rules taken out, over 8 episodes: " in texts
    # Five signs that agree come about by chance at 2 in 32: too often, for any number of rules.
    assert found.least_episodes == next(
        count for count in range(99) if 2 / 2**count * found.tests < 0.05
    )
    assert ("too few" in texts) == (found.least_episodes > 8)
    assert left_out_text(found) == ""
    fewer = replace(found, left_out=(1,))
    assert left_out_text(fewer).startswith("1 rule more changed actions")
    none = ablate(
        "CartPole-v1",
        "expert",
        Shield(replace(found.shield.rule_set, rules=found.shield.rule_set.rules[:1])),
        episodes=2,
        seed=5,
        most=1,
    )
    assert len(none.rules) + len(none.unused) == 1
    assert ablation_text(none)


def test_differences_have_their_signs() -> None:
    assert [difference_text(value) for value in (1234.56, -3.41, 0.0, -0.04)] == [
        "+1,234.6",
        "-3.4",
        "0",
        "0",
    ]


def test_a_fork_in_words(rules: RuleSet) -> None:
    shield = Shield(rules)
    steps = rollout("CartPole-v1", "novice", shield=shield, episodes=1, seed=100_000).steps
    assert steps is not None
    step = int(np.flatnonzero(steps.intervened)[0])
    made = fork("CartPole-v1", "novice", shield, step=step, rest="alone", seed=100_000)
    text = fork_text(made)
    with_it, without = made.branches
    assert text.startswith(f"With the change the return is {with_it.gained:,.1f} and ")
    assert f"Without it the return is {without.gained:,.1f}" in text
    assert "the pole falls" in text
    words = "less" if made.difference < 0 else "more" if made.difference > 0 else "the same"
    assert words in text


def test_endings_have_the_words_of_their_environment() -> None:
    assert ending_text("failure", "LunarLander-v3") == "it crashes"
    assert ending_text("end", "LunarLanderContinuous-v3") == "it lands and rests"
    assert ending_text("end", "BipedalWalker-v3") == "it arrives"
    assert ending_text("limit", "CartPole-v1") == "it runs to the limit"
    assert ending_text("end", "somewhere/Else-v0") == "the environment ends it"
    assert ending_text("failure", "Driving-v0") == "it crashes"


def test_a_failure_that_somebody_named_is_no_crash() -> None:
    environment = Environment("LunarLander-v3", failure="vertical position > -100")
    played = rollout(environment, "novice", episodes=2, seed=0)
    assert played.failed.all()
    assert ending_texts(played) == ["it fails", "it fails"]
    assert set(ending_texts(rollout("LunarLander-v3", "novice", episodes=2, seed=0))) == {
        "it crashes"
    }
