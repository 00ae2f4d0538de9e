import json
from pathlib import Path

import pytest

from sarl_core.agents.agent import shipped_experts
from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.rollouts.recording import SHIPPED

SETS = SHIPPED | {"Driving-v0": "driving"}
FOLDER = Path(__file__).resolve().parents[2] / "data" / "demonstrations"


@pytest.mark.parametrize("env_id", list(SETS))
def test_shipped_demonstrations_are_what_their_cards_say(env_id: str) -> None:
    path = FOLDER / f"{SETS[env_id]}.parquet"
    card = json.loads(path.with_suffix(".json").read_text())
    demos = load_demonstrations(path)
    summary = demos.summary()
    assert (card["digest"], card["env_id"]) == (demos.digest, demos.env_id)
    assert len(demos) == card["steps"] == 15_000
    assert card["episodes"] == demos.n_episodes
    assert card["mean_return"] == pytest.approx(summary.return_mean, abs=0.01)
    assert (demos.agent, demos.seed) == ("expert", 0)
    sampled = " --stochastic" if env_id in SHIPPED else ""
    assert f"--env {env_id} --agent expert{sampled} --steps 15000" in card["command"]
    assert card["command"].endswith(f"data/demonstrations/{path.name}")
    assert demos.bounds_from == (None if demos.is_discrete else "action space")


def test_what_a_policy_demonstrated_has_its_weights_beside_it() -> None:
    assert {env_id: path.stem for env_id, path in shipped_experts().items()} == SHIPPED
