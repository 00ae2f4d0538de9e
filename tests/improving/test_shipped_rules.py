"""The compact rules that are shipped: what their cards say, and what they reach."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from docs.scripts.compact_sets import median
from sarl_core import RuleSet
from sarl_core.improving.aggregation_files import card_path
from sarl_core.rollouts.episodes import rollout
from sarl_core.shielding.shield import Shield

FOLDER = Path(__file__).resolve().parents[2] / "data" / "rules"
SHIPPED = {
    "cartpole_combined.json": ("CartPole-v1", 2, 500.0),
    "cartpole_compact.json": ("CartPole-v1", 3, 500.0),
    "lunar_lander_combined.json": ("LunarLander-v3", 24, 265.0),
    "lunar_lander_few_combined.json": ("LunarLander-v3", 8, 240.0),
    "lunar_lander_compact.json": ("LunarLander-v3", 48, 200.0),
    "lunar_lander_continuous_combined.json": ("LunarLanderContinuous-v3", 16, 240.0),
    "pendulum_combined.json": ("Pendulum-v1", 16, -175.0),
    "bipedal_walker_compact.json": ("BipedalWalker-v3", 128, 250.0),
    "driving_compact.json": ("Driving-v0", 24, 22.0),
}

EPISODES = 30
FEWER = {"driving_compact.json": 10}  # an episode takes a second


@pytest.mark.parametrize("name", SHIPPED)
def test_the_card_is_that_of_the_file(name: str) -> None:
    env_id, most, _ = SHIPPED[name]
    rules = RuleSet.load(FOLDER / name)
    card = json.loads(card_path(FOLDER / name).read_text())
    counts = [len(rules.of_dimension(index)) for index in range(len(rules.actions))]
    assert card["rules_per_dimension"] == counts
    assert max(counts) <= card["budget"] == most
    assert card["rules"] == len(rules)
    assert card["env_id"] == rules.source.env_id == env_id
    assert card["cut"] == rules.cut == "leaves"
    assert card["mean_length"] == pytest.approx(np.mean([r.length for r in rules.rules]), abs=0.01)
    chosen = card["rounds"][card["chosen_round"] - 1]
    assert card["demonstrations"]["digest"] == rules.source.digest
    assert card["demonstrations"]["steps"] == rules.source.steps == chosen["pairs"]
    assert card["demonstrations"]["episodes"] == rules.source.episodes
    assert f"--out data/rules/{name}" in card["command"]


@pytest.mark.parametrize("name", SHIPPED)
def test_the_card_names_the_seeds_of_what_happened(name: str) -> None:
    card = json.loads(card_path(FOLDER / name).read_text())
    searched = card["refined"] or card.get("turns", 0) > 0
    later = card["seed"] * 1_000_000
    assert card["seeds"] == {
        "rounds": 20_000_000 + later,
        "validation": 30_000_000 + later,
        # A search of thresholds alone began with its second generation's seeds.
        "refinement": later + 40_000_000 + 16 * ("generations" in card) if searched else None,
        # It was chosen by a second validation then.
        **(
            {"second_validation": 30_500_000 + later if searched else None}
            if "generations" in card
            else {}
        ),
        "report": 50_000_000 + later,
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_they_reach_what_was_promised(name: str) -> None:
    """As `evaluate --agent novice --seed 100000` plays them."""
    env_id, most, promised = SHIPPED[name]
    episodes = FEWER.get(name, EPISODES)
    rules = RuleSet.load(FOLDER / name)
    found = rollout(
        env_id, "novice", shield=Shield(rules), episodes=episodes, seed=100_000, keep_steps=False
    )
    assert max(len(rules.of_dimension(index)) for index in range(len(rules.actions))) <= most
    assert found.statistics.mean >= promised


def test_of_several_seeds_the_one_in_the_middle_is_shipped() -> None:
    known = json.loads((FOLDER / "seeds.json").read_text(encoding="utf-8"))
    sets = {name: seeds for name, seeds in known.items() if not name.endswith("_expert")}
    assert "cartpole_combined" in sets
    for name, seeds in sets.items():
        assert {one["seed"] for one in seeds} <= set(range(5))
        if len(seeds) < 5:  # begun, and shipped once all of them are known
            continue
        card = json.loads(card_path(FOLDER / f"{name}.json").read_text(encoding="utf-8"))
        middle = median(seeds)
        assert card["seed"] == middle["seed"]
        assert card["command"] == middle["command"]
        assert card["reported"]["mean"] == pytest.approx(middle["mean"], abs=0.01)
        assert card["reported"].get("failures") == middle["failures"]  # Pendulum has none
        assert max(card["rules_per_dimension"]) == middle["rules"]


def test_few_rules_achieve_what_the_guide_says_of_them() -> None:
    """Over the episodes of the report, which nothing was chosen by."""
    known = json.loads((FOLDER / "seeds.json").read_text(encoding="utf-8"))
    for name, rules, mean, most in (
        ("cartpole_combined", 2, 500.0, 0.0013),
        ("lunar_lander_few_combined", 8, 240.0, 0.04),
        ("lunar_lander_combined", 24, 270.0, 0.02),
        ("lunar_lander_continuous_combined", 16, 259.0, 0.02),
    ):
        middle = median(known[name])
        assert middle["rules"] <= rules
        assert middle["mean"] >= mean
        assert middle["failure_high"] <= most


def test_what_is_forbidden_keeps_a_novice_whole_and_leaves_it_most() -> None:
    path = FOLDER / "lunar_lander_never.json"
    rules, card = RuleSet.load(path), json.loads(card_path(path).read_text())
    assert card["rules"] == len(rules) == card["rounds"][card["chosen_round"] - 1]["rules"]
    failures = [one["failures"] for one in card["rounds"]]
    assert failures.index(min(failures)) == card["chosen_round"] - 1
    assert {rule.origin for rule in rules} == {"probed"}
    played = rollout("LunarLander-v3", "novice", shield=Shield(rules), episodes=30, seed=70_000_000)
    alone = rollout("LunarLander-v3", "novice", episodes=30, seed=70_000_000)
    assert played.failed.sum() <= 8
    assert alone.failed.sum() >= 29
    assert played.summary()["freedom"] > 0.8
    assert 0.08 < card["reported"]["failure_rate"] < 0.15
    assert card["reported"]["freedom"] > 0.85
