"""Several recordings of several experts, none of which anything else takes for its expert."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sarl_core import InputError, record
from sarl_core.agents.agent import EXPERT_FOLDER, shipped_experts
from sarl_core.paper import replicates
from sarl_core.paper.replicates import (
    DEMONSTRATION_FOLDER,
    REPLICATE_FOLDER,
    demonstrations_of,
    environments,
    experts_of,
    fingerprints,
    named_rules,
    replicates_of,
)
from sarl_core.rollouts.recording import SHIPPED
from sarl_core.rollouts.seeds import RECORDED, REPRODUCED, SEEDS_A_RECORDING, SEEDS_A_REPLICATE

CART = "CartPole-v1"


def test_recordings_take_turns_among_the_experts() -> None:
    found = replicates_of(CART, 6)
    assert [one.name for one in found] == ["cartpole", "cartpole_seed_1", "cartpole_seed_2"] * 2
    assert [one.recording for one in found] == list(range(6))
    assert found[0].recorded_from == 0
    assert [one.recorded_from for one in found[1:]] == [
        RECORDED + number * SEEDS_A_RECORDING for number in range(1, 6)
    ]
    assert [one.first_seed for one in found] == [
        REPRODUCED + number * SEEDS_A_REPLICATE for number in range(6)
    ]


def test_the_first_is_the_shipped_one_and_the_others_are_recorded_like_it() -> None:
    first, second, *_ = replicates_of(CART, 6)
    card = json.loads((DEMONSTRATION_FOLDER / "cartpole.json").read_text())
    assert demonstrations_of(first).digest == card["digest"]
    other = demonstrations_of(second)
    assert (len(other.observations), other.agent) == (15_000, "cartpole_seed_1")
    again = record(
        CART, second.expert, steps=400, seed=RECORDED + SEEDS_A_RECORDING, stochastic=True
    )
    assert (other.observations[:400] == again.observations).all()
    assert (other.actions[:400] == again.actions).all()


def test_recordings_of_one_expert_differ_and_so_do_their_rules() -> None:
    first, fourth = (replicates_of(CART, 6)[number] for number in (0, 3))
    assert first.expert == fourth.expert
    assert demonstrations_of(first).digest != demonstrations_of(fourth).digest
    assert len(named_rules(first)["unfiltered"]) != len(named_rules(fourth)["unfiltered"])
    digests = fingerprints(CART, 6)
    assert len(set(digests["recordings"].values())) == 6
    assert len(set(digests["experts"].values())) == 3


def test_further_experts_are_no_agents_of_their_own() -> None:
    assert {path.parent for path in shipped_experts().values()} == {EXPERT_FOLDER}
    assert len(shipped_experts()) == len(SHIPPED)


def test_cards_of_further_experts_say_how_they_are_made_again() -> None:
    for path in sorted(REPLICATE_FOLDER.glob("*.npz")):
        card = json.loads(path.with_suffix(".json").read_text())
        shipped = json.loads((EXPERT_FOLDER / f"{path.stem.split('_seed_')[0]}.json").read_text())
        assert card["command"].endswith(f"--out data/experts/replicates/{path.name}")
        assert f"--seed {card['seed']} --steps {shipped['steps']} " in card["command"]
        assert card["seed"] != shipped["seed"]
        for name in ("what", "algorithm", "steps", "parameters", "kept_by", "report_seeds"):
            assert card[name] == shipped[name], (path.name, name)


def test_a_missing_expert_is_one_sentence_that_says_how_to_train_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replicates, "REPLICATE_FOLDER", tmp_path)
    with pytest.raises(InputError, match="0 further experts of CartPole-v1 and 2 are needed") as e:
        experts_of(CART)
    assert "train-expert --env CartPole-v1" in str(e.value)
    assert environments()[0] == CART
