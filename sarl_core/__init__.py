"""Readable safety rules from expert demonstrations, and a shield that holds an agent to them.

Names are loaded when they are first used, so that importing the package costs next to nothing
and a program that only mines rules never loads a learner.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.demonstrations.formats import load_demonstrations, save_demonstrations
    from sarl_core.errors import InputError, SarlError, WorkError
    from sarl_core.mining.algorithm_1 import mine_rules
    from sarl_core.mining.classifier import RuleClassifier
    from sarl_core.mining.landscape import Landscape, threshold_landscape
    from sarl_core.mining.rules import Rule, RuleSet
    from sarl_core.mining.tree import PolicyTree, grow_policy_trees
    from sarl_core.rollouts.episodes import Episodes, rollout
    from sarl_core.rollouts.recording import record
    from sarl_core.shielding.shield import Decision, Shield
    from sarl_core.shielding.vec_env import ShieldedVecEnv
    from sarl_core.shielding.wrappers import ShieldedEnv

__version__ = "0.2.0"

_HOMES = {
    "Decision": "shielding.shield",
    "Demonstrations": "demonstrations.dataset",
    "Episodes": "rollouts.episodes",
    "InputError": "errors",
    "Landscape": "mining.landscape",
    "PolicyTree": "mining.tree",
    "Rule": "mining.rules",
    "RuleClassifier": "mining.classifier",
    "RuleSet": "mining.rules",
    "SarlError": "errors",
    "Shield": "shielding.shield",
    "ShieldedEnv": "shielding.wrappers",
    "ShieldedVecEnv": "shielding.vec_env",
    "WorkError": "errors",
    "grow_policy_trees": "mining.tree",
    "load_demonstrations": "demonstrations.formats",
    "mine_rules": "mining.algorithm_1",
    "record": "rollouts.recording",
    "rollout": "rollouts.episodes",
    "save_demonstrations": "demonstrations.formats",
    "threshold_landscape": "mining.landscape",
}

__all__ = [
    "Decision",
    "Demonstrations",
    "Episodes",
    "InputError",
    "Landscape",
    "PolicyTree",
    "Rule",
    "RuleClassifier",
    "RuleSet",
    "SarlError",
    "Shield",
    "ShieldedEnv",
    "ShieldedVecEnv",
    "WorkError",
    "grow_policy_trees",
    "load_demonstrations",
    "mine_rules",
    "record",
    "rollout",
    "save_demonstrations",
    "threshold_landscape",
]


def __getattr__(name: str) -> Any:
    """Load a public name from its home."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted(__all__)
