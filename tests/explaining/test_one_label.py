"""An action that is always the same has one label, everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from sarl_core import (
    Demonstrations,
    RuleSet,
    Shield,
    ShieldedEnv,
    grow_policy_trees,
    mine_rules,
    threshold_landscape,
)
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.explaining.exports.vectors import make_vectors
from sarl_core.explaining.figures.demonstrations import action_figure
from sarl_core.explaining.figures.distributions import interval_histogram
from sarl_core.mining.action_words import action_text, label_text
from sarl_core.mining.quantisation import quantise
from tests.bad_inputs import csv_bytes
from tests.explaining.exported import agree, expected, run_c, run_onnx, run_python

N = 120
STATES = np.random.default_rng(1).uniform(-1, 1, (N, 2)).astype(np.float32)
ACTIONS: dict[str, NDArray[Any]] = {
    "one value": np.full((N, 1), 0.3, np.float32),
    "one value and another dimension": np.c_[np.full(N, 0.3), STATES[:, 0]].astype(np.float32),
    "one number": np.full(N, 3),
    "one number and another dimension": np.c_[np.full(N, 3), STATES[:, 0] > 0].astype(np.int64),
}


def demonstrated(name: str) -> Demonstrations:
    return Demonstrations(STATES, ACTIONS[name], np.arange(N) // 20)


def rules_of(name: str) -> RuleSet:
    return mine_rules(demonstrated(name), supp_min=0, conf_min=1, divider=3)


@pytest.mark.parametrize("name", ACTIONS)
def test_a_constant_action_is_one_label_and_one_rule(name: str, tmp_path: Path) -> None:
    rules = rules_of(name)
    constant = rules.actions[0]
    assert constant.n_labels == 1
    assert [rule.conditions for rule in rules.of_dimension(0)] == [()]
    assert label_text(0, constant) == constant.label_names[0] == ("0.3" if "value" in name else "3")
    assert " to " not in action_text(0, constant)
    rules.save(tmp_path / "rules.json")
    back = RuleSet.load(tmp_path / "rules.json")
    assert back.actions == rules.actions
    assert [rule.action for rule in back.rules] == [rule.action for rule in rules.rules]


@pytest.mark.parametrize("name", ACTIONS)
@pytest.mark.parametrize("projection", ["centre", "clip", "expert"])
def test_the_shield_and_its_exports_agree(name: str, projection: Any, tmp_path: Path) -> None:
    rules = rules_of(name)
    assert len(make_vectors(rules, projection)) > 0
    shown = ACTIONS[name].reshape(N, -1)
    states, proposed = STATES, (shown + np.random.default_rng(2).integers(-1, 2, shown.shape))
    proposed = np.clip(proposed, shown.min(axis=0), shown.max(axis=0) + 1).astype(shown.dtype)
    wanted = expected(rules, projection, states, proposed)
    assert not wanted.invalid.all()
    assert (wanted.rules[~wanted.invalid, 0] == 0).all()
    in_c = run_c(rules, projection, states, proposed, tmp_path)
    agree(in_c, wanted)
    assert np.array_equal(in_c.changed, wanted.changed)
    agree(run_onnx(rules, projection, states, proposed), wanted)
    agree(run_python(rules, projection, states, proposed), wanted)


class Lift(gymnasium.Env[Any, Any]):
    """Two numbers to see and four things to do."""

    observation_space = gymnasium.spaces.Box(-1, 1, (2,))
    action_space = gymnasium.spaces.Discrete(4)

    def reset(self, **_: Any) -> tuple[Any, dict[str, Any]]:
        return STATES[0], {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return STATES[1], float(action), False, False, {}


def test_what_differs_from_the_only_number_is_replaced() -> None:
    env = ShieldedEnv(Lift(), Shield(rules_of("one number")))
    env.reset()
    for proposed in range(4):
        _, executed, _, _, info = env.step(proposed)
        assert executed == 3
        assert info["shield"].intervened == (proposed != 3)


def test_a_file_whose_action_never_changes() -> None:
    content = csv_bytes(*[f"{i % 7},3" for i in range(20)], header="speed,action")
    (dimension,) = read_demonstrations(content, "rig.csv").action_dimensions
    assert dimension.labels == ("3",)
    assert dimension.first == 3


@pytest.mark.parametrize("name", ACTIONS)
def test_the_landscape_has_one_rule_for_it(name: str) -> None:
    trees = grow_policy_trees(demonstrated(name))
    found = threshold_landscape(trees, np.array([0.0, 0.5]), np.array([0.0, 1.0]))
    assert found.rule_count[0, 0] == len(trees)


def test_figures_of_one_value() -> None:
    demonstrations = demonstrated("one value")
    dimension = rules_of("one value").actions[0]
    histogram = interval_histogram(demonstrations.action_columns[:, 0], dimension)
    assert histogram.counts.sum() == N
    low, high = action_figure(histogram, dimension).layout.xaxis.range
    assert low < dimension.edges[0] < high
    ((divided, *_),) = quantise(demonstrations)
    assert divided.share_of_width("centre") == 0
