"""What the benchmarks work on: the shipped Lunar Lander, as the dashboard shows it first."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core import (
    Demonstrations,
    PolicyTree,
    RuleSet,
    grow_policy_trees,
    load_demonstrations,
    mine_rules,
)
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.rollouts.trial import make_agent

if TYPE_CHECKING:
    from stable_baselines3 import PPO

ENV_ID = "LunarLander-v3"
DATA = Path(__file__).resolve().parents[1] / "data"


@lru_cache
def demonstrations() -> Demonstrations:
    """The shipped 15,000 steps."""
    return load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")


@lru_cache
def trees() -> tuple[PolicyTree, ...]:
    """Their tree."""
    return grow_policy_trees(demonstrations())


@lru_cache
def large_tree() -> tuple[PolicyTree, ...]:
    """A tree of 4,000 nodes or a few more, from noisy labels."""
    generator = np.random.default_rng(0)
    states = generator.normal(size=(15_000, 8)).astype(np.float32)
    labels = (states[:, 0] > states[:, 1] * states[:, 2]).astype(np.int64)
    noisy = np.where(generator.random(len(labels)) < 0.15, 1 - labels, labels)
    return grow_policy_trees(Demonstrations(states, noisy, np.zeros(len(noisy), dtype=np.int64)))


@lru_cache
def rules() -> RuleSet:
    """The unfiltered rules: the most there can be, so the longest walk."""
    return mine_rules(trees(), supp_min=0.0, conf_min=1.0)


@lru_cache
def combined() -> Demonstrations:
    """The shipped steps, with combinations of two features."""
    return with_combinations(demonstrations())


@lru_cache
def combined_rules() -> RuleSet:
    """The unfiltered rules over these."""
    return mine_rules(combined(), supp_min=0.0, conf_min=1.0)


@lru_cache
def expert() -> MlpPolicy:
    """The shipped expert's network."""
    agent: Any = make_agent("expert", ENV_ID)
    policy: MlpPolicy = agent.policy
    return policy


@lru_cache
def same_in_sb3() -> PPO:
    """A Stable-Baselines3 PPO whose policy network is the shipped expert's."""
    import gymnasium
    import torch
    from stable_baselines3 import PPO

    ours = expert()
    hidden = [weight.shape[1] for weight in ours.weights[:-1]]
    model = PPO(
        "MlpPolicy",
        gymnasium.make(ENV_ID),
        policy_kwargs={"net_arch": {"pi": hidden, "vf": hidden}},
        device="cpu",
        seed=0,
    )
    network: Any = model.policy
    linear = [layer for layer in network.mlp_extractor.policy_net if hasattr(layer, "weight")]
    with torch.no_grad():
        for layer, weight, bias in zip(
            [*linear, network.action_net], ours.weights, ours.biases, strict=True
        ):
            layer.weight.copy_(torch.from_numpy(weight.T.copy()))
            layer.bias.copy_(torch.from_numpy(bias.copy()))
    return model
