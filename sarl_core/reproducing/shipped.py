"""The shipped demonstrations, and what is mined from them, read once a run."""

from __future__ import annotations

import hashlib
import re
from functools import lru_cache
from pathlib import Path

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.rules import NAMED_SETTINGS, RuleSet
from sarl_core.mining.tree import PolicyTree, grow_policy_trees
from sarl_core.rollouts.agents import EXPERT_FOLDER
from sarl_core.rollouts.recording import SHIPPED

DEMONSTRATION_FOLDER = EXPERT_FOLDER.parent / "demonstrations"
PAPER_DIVIDER = 2
TREE_SEEDS = (0, 1, 2, 3, 4)
"""Of trees that choose differently among equally good queries; the first is used everywhere."""


def environments() -> tuple[str, ...]:
    """The environments whose demonstrations are shipped, the paper's three first."""
    first = ("CartPole-v1", "LunarLander-v3", "BipedalWalker-v3")
    there = [env_id for env_id, name in SHIPPED.items() if _path(name).is_file()]
    return tuple(sorted(there, key=lambda env_id: (env_id not in first, there.index(env_id))))


def environment_name(env_id: str) -> str:
    """An environment's name for people.

    Args:
        env_id: As "LunarLander-v3".

    Returns:
        As "Lunar Lander".
    """
    family = env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1].rsplit("-v", 1)[0]
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", family)


@lru_cache(maxsize=8)
def demonstrations_of(env_id: str) -> Demonstrations:
    """The shipped demonstrations of an environment.

    Args:
        env_id: One of `environments`.

    Returns:
        15,000 steps.

    Raises:
        InputError: If the file is missing or cannot be read.
    """
    return load_demonstrations(_path(SHIPPED[env_id]))


@lru_cache(maxsize=32)
def trees_of(
    env_id: str, divider: int = PAPER_DIVIDER, seed: int = TREE_SEEDS[0]
) -> tuple[PolicyTree, ...]:
    """The trees of an environment's demonstrations.

    Args:
        env_id: One of `environments`.
        divider: Intervals of continuous actions; without meaning for discrete ones.
        seed: For choosing among equally good queries.

    Returns:
        One an action dimension.
    """
    return grow_policy_trees(demonstrations_of(env_id), divider=divider, seed=seed)


def named_rules(
    env_id: str, divider: int = PAPER_DIVIDER, seed: int = TREE_SEEDS[0]
) -> dict[str, RuleSet]:
    """The rule sets of the paper's Table 1.

    Args:
        env_id: One of `environments`.
        divider: As in `trees_of`.
        seed: As in `trees_of`.

    Returns:
        `filtered` and `unfiltered`.
    """
    trees = trees_of(env_id, divider, seed)
    return {
        name: mine_rules(trees, supp_min=setting.support, conf_min=setting.confidence)
        for name, setting in NAMED_SETTINGS.items()
    }


def _path(name: str) -> Path:
    return DEMONSTRATION_FOLDER / f"{name}.parquet"


def fingerprints(env_id: str) -> dict[str, str]:
    """What tells the shipped files of an environment from others of their name.

    Args:
        env_id: One of `environments`.

    Returns:
        Digests of the `demonstrations` and of the `expert`.
    """
    expert = EXPERT_FOLDER / f"{SHIPPED[env_id]}.npz"
    return {
        "demonstrations": demonstrations_of(env_id).digest,
        "expert": hashlib.blake2b(expert.read_bytes(), digest_size=16).hexdigest(),
    }
