"""A sensor that fails in the middle of an episode, and what everyone says of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import ClassVar

import gymnasium
import numpy as np
import pytest

from sarl_core import Demonstrations, InputError, RuleSet, Shield, mine_rules, rollout
from sarl_core.cli.app import main
from sarl_core.environments.description import describe_environment
from sarl_core.explaining.html.step_card import step_card
from sarl_core.explaining.tables.recorder import recorder_columns
from sarl_core.explaining.words.replay import step_texts, step_view
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.rendering.replay import render_episode

FAILS, STEPS = 5, 12


class Failing(gymnasium.Env):
    """Three sensors; at one step something else comes instead of their numbers."""

    metadata: ClassVar = {"render_modes": ["rgb_array"], "render_fps": 10}
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float32)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, fault: object, render_mode: str | None = None) -> None:
        self.fault, self.render_mode, self.at = fault, render_mode, 0

    def observe(self) -> object:
        state = np.full(3, self.at, dtype=np.float32)
        if self.at == FAILS:
            return self.fault if not callable(self.fault) else self.fault(state)
        return state

    def reset(self, *, seed: int | None = None, options: object = None) -> tuple[object, dict]:
        self.at = 0
        return self.observe(), {}

    def step(self, action: object) -> tuple[object, float, bool, bool, dict]:
        self.at += 1
        return self.observe(), 1.0, False, self.at >= STEPS, {}

    def render(self) -> np.ndarray:
        return np.full((60, 80, 3), self.at, np.uint8)


FAULTS: dict[str, object] = {
    "Nan": lambda state: np.where(np.arange(3) == 1, np.nan, state).astype(np.float32),
    "Inf": lambda state: np.where(np.arange(3) == 1, np.inf, state).astype(np.float32),
    "Large": lambda state: state.astype(np.float64) * 1e300,
    "Masked": lambda state: np.ma.array(state, mask=[False, True, False]),
    "Short": lambda state: state[:2],
    "Text": "out of order",
    "Nothing": None,
}


@pytest.fixture(autouse=True)
def environments() -> Iterator[None]:
    for name, fault in FAULTS.items():
        gymnasium.register(f"{name}Sensor-v0", lambda fault=fault, **more: Failing(fault, **more))
    yield
    for name in FAULTS:
        gymnasium.registry.pop(f"{name}Sensor-v0")
    describe_environment.cache_clear()


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    states = np.repeat(np.arange(STEPS, dtype=np.float32), 3).reshape(-1, 3)
    labels = np.arange(STEPS) % 2
    demonstrations = Demonstrations(states, labels, np.zeros(STEPS, dtype=int))
    return mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)


@pytest.mark.parametrize("name", FAULTS)
def test_a_step_without_a_state_passes_and_is_counted(rules: RuleSet, name: str) -> None:
    shield = Shield(rules, on_invalid="pass")
    found = rollout(f"{name}Sensor-v0", "novice", shield=shield, episodes=3, seed=1)
    assert found.invalid is not None
    assert found.invalid.tolist() == [1, 1, 1]
    assert found.covered.tolist() == [STEPS - 1] * 3
    document = found.to_dict()
    assert [row["invalid"] for row in document["episodes"]] == [1, 1, 1]
    assert document["summary"]["invalid_steps"] == 3
    steps = found.steps
    assert steps is not None
    assert steps.step[steps.is_invalid].tolist() == [FAILS] * 3
    assert np.isnan(steps.margin[steps.is_invalid]).all()
    assert np.isfinite(steps.margin[~steps.is_invalid]).all()
    assert np.array_equal(steps.executed[steps.is_invalid], steps.proposed[steps.is_invalid])
    frame = steps.to_frame()
    assert (frame["invalid"] != "").tolist() == steps.is_invalid.tolist()
    assert found.part(1, 3).invalid.tolist() == [1, 1]


@pytest.mark.parametrize("name", FAULTS)
def test_a_step_without_a_state_is_an_error(rules: RuleSet, name: str) -> None:
    for run in (rollout, render_episode):
        with pytest.raises(InputError, match="observation"):
            run(f"{name}Sensor-v0", "novice", shield=Shield(rules))


def test_nothing_is_counted_where_nothing_passes(rules: RuleSet) -> None:
    assert rollout("CartPole-v1", "novice", episodes=1).invalid is None
    unshielded = rollout("NanSensor-v0", "novice", episodes=2)
    assert unshielded.lengths.tolist() == [STEPS] * 2
    assert "invalid" not in unshielded.to_dict()["episodes"][0]


def test_the_picture_and_the_replay_say_it(rules: RuleSet) -> None:
    replay = render_episode("NanSensor-v0", "novice", shield=Shield(rules, on_invalid="pass"))
    steps = replay.episodes[0].steps
    assert steps is not None
    why = "the observation's 'feature 1' is not a number"
    assert steps.invalid.tolist() == [why if at == FAILS else None for at in range(STEPS)]
    caption = replay.panels[0].caption(FAILS)
    assert caption.mark == "NOT CHECKED"
    assert why in caption.reason
    description = describe_environment("NanSensor-v0")
    dimensions = environment_dimensions(description, rules)
    features = rules.source.features
    view = step_view(steps, FAILS, dimensions, features, rules)
    assert view.state[1][1] == "not a number"
    card = step_card(view, shielded=True)
    assert "Not checked" in card
    assert "is not a number. The action stays as it is." in card
    assert "Not checked" not in step_card(
        step_view(steps, 0, dimensions, features, rules), shielded=True
    )
    assert step_texts(steps, dimensions, rules)[FAILS].endswith(f"not checked<br>{why}")
    columns = recorder_columns(steps, np.arange(STEPS), dimensions, features, rules)
    assert columns["Not checked"] == [why if at == FAILS else "" for at in range(STEPS)]


def test_the_command_line_says_it(
    rules: RuleSet, tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rules.json"
    rules.save(file)
    given = ["--env", "NanSensor-v0", "--agent", "novice", "--rules", str(file)]

    def run(*words: str) -> int:
        return main(list(words))

    assert run("evaluate", *given, "--episodes", "2") == 2
    refused = capsys.readouterr()
    assert "'feature 1' is not a number" in refused.err
    assert "--on-invalid pass" in refused.err
    passing = [*given, "--on-invalid", "pass"]
    assert run("evaluate", *passing, "--episodes", "2") == 0
    assert "2 steps, where the observation was no state" in " ".join(
        capsys.readouterr().out.split()
    )
    assert run("evaluate", *passing, "--episodes", "2", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["summary"]["invalid_steps"] == 2
    assert run("render", *passing, "--out", str(tmp_path / "x.gif"), "--json") == 0
    assert json.loads(capsys.readouterr().out)["episodes"][0]["invalid"] == 1
    ablated = ["--episodes", "10", "--jobs", "1", "--json"]
    assert run("ablate", *given, *ablated) == 2
    capsys.readouterr()
    assert run("ablate", *passing, *ablated) == 0
