"""What the shield costs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import gymnasium
import numpy as np

from benchmarks import data
from benchmarks.measure import Row, duration, side_by_side
from sarl_core import RuleSet, Shield, ShieldedEnv, load_rules
from sarl_core.mining.envelope import with_boxes


class Still(gymnasium.Env[Any, Any]):
    """An environment that does nothing, so that only the shield around it takes time."""

    def __init__(self, observation: np.ndarray[Any, Any]) -> None:
        real = gymnasium.make(data.ENV_ID)
        self.observation_space, self.action_space = real.observation_space, real.action_space
        real.close()
        self.observation = observation

    def reset(self, **parameters: Any) -> tuple[Any, dict[str, Any]]:
        """Start."""
        return self.observation, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Do nothing."""
        return self.observation, 0.0, False, False, {}


def decision(quick: bool) -> Iterable[Row]:
    """One decision with its record, against one prediction of the same policy."""
    plain = with_boxes(data.rules(), data.demonstrations())
    yield _decision(quick, "one shield decision, with its record", plain, reach=0.03)
    combined = with_boxes(data.combined_rules(), data.combined())
    yield _decision(quick, "the same, with combinations of two features", combined, reach=0.04)
    shipped = load_rules(data.DATA / "rules" / "lunar_lander_combined.json")
    yield _decision(quick, "the same, with the shipped rules of two features", shipped, reach=0.04)


def _decision(quick: bool, what: str, rules: RuleSet, *, reach: float) -> Row:
    model, shield = data.same_in_sb3(), Shield(rules)
    states = data.demonstrations().observations[:: 15 if quick else 5]
    actions = np.random.default_rng(0).integers(0, 4, len(states))
    bare = Still(states[0])
    shielded = ShieldedEnv(Still(states[0]), shield)
    shielded.reset()

    def predict() -> None:
        for state in states:
            model.predict(state, deterministic=True)

    def with_shield() -> None:
        still: Any = shielded.env
        for state, action in zip(states, actions, strict=True):
            still.observation = state
            shielded.step(action)

    def without() -> None:
        for state, action in zip(states, actions, strict=True):
            bare.observation = state
            bare.step(action)

    repeats = 3 if quick else 7
    shielded_took, predict_took = side_by_side(with_shield, predict, repeats=repeats)
    bare_took, _ = side_by_side(without, predict, repeats=1)
    one, other = (shielded_took - bare_took) / len(states), predict_took / len(states)
    return Row(
        what,
        "one Stable-Baselines3 predict",
        "share",
        one / other,
        reach,
        f"{duration(one)} against {duration(other)}; {len(rules):,} rules",
    )


def batch(quick: bool) -> Iterable[Row]:
    """Many states at once, against one by one."""
    count = 20_000 if quick else 100_000
    shield, generator = Shield(data.rules()), np.random.default_rng(0)
    observations = data.demonstrations().observations
    states = observations[generator.integers(0, len(observations), count)]
    states = states + generator.normal(scale=0.01, size=states.shape).astype(np.float32)
    actions = generator.integers(0, 4, count)

    def one_by_one() -> None:
        for state, action in zip(states, actions, strict=True):
            shield.decide(state, action)

    ours, theirs = side_by_side(
        lambda: shield.decide_batch(states, actions), one_by_one, repeats=3 if quick else 7
    )
    yield Row(
        f"shield, {count:,} states in a batch",
        "the same, one by one",
        "times faster",
        theirs / ours,
        10,
        f"{duration(ours)} against {duration(theirs)}",
    )
