"""Experts and recordings that claims are decided over, and what is mined from them.

One recording is one draw of what an expert may show, and one expert one draw of what a training may
come to. So each environment has several experts, the shipped one and others trained by the same
command with other seeds, and several recordings, in turn of one and the next.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from sarl_core.agents.agent import EXPERT_FOLDER
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.mining.tree import PolicyTree
from sarl_core.rollouts.recording import SHIPPED, SHIPPED_STEPS, record
from sarl_core.rollouts.seeds import (
    DEMONSTRATED,
    RECORDED,
    REPRODUCED,
    SEEDS_A_RECORDING,
    SEEDS_A_REPLICATE,
)

DEMONSTRATION_FOLDER = EXPERT_FOLDER.parent / "demonstrations"
REPLICATE_FOLDER = EXPERT_FOLDER / "replicates"
"""Of the experts that are no agent of their own, and only say how much experts differ."""

EXPERTS = 3
PAPER_DIVIDER = 2


@dataclass(frozen=True)
class Replicate:
    """One recording of one expert, and all that is made of it.

    Attributes:
        env_id: Environment.
        recording: Its number; 0 is the shipped one.
        expert: File of its expert, an `.npz`.
    """

    env_id: str
    recording: int
    expert: Path

    @property
    def name(self) -> str:
        """The expert's, as "cartpole_seed_1"."""
        return self.expert.stem

    @property
    def recorded_from(self) -> int:
        """Seed of the first recorded episode."""
        return DEMONSTRATED if not self.recording else RECORDED + self.recording * SEEDS_A_RECORDING

    @property
    def first_seed(self) -> int:
        """Of the episodes that are played with what is mined from it."""
        return REPRODUCED + self.recording * SEEDS_A_REPLICATE


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


def experts_of(env_id: str, count: int = EXPERTS) -> tuple[Path, ...]:
    """The experts of an environment.

    Args:
        env_id: One of `environments`.
        count: How many are needed.

    Returns:
        Their `.npz` files, the shipped one first.

    Raises:
        InputError: If some are missing.
    """
    name = SHIPPED[env_id]
    others = sorted(REPLICATE_FOLDER.glob(f"{name}_seed_*.npz"))[: count - 1]
    if len(others) < count - 1:
        raise InputError(
            f"{REPLICATE_FOLDER} has {len(others)} further experts of {env_id} and {count - 1} "
            f"are needed; train others with `train-expert --env {env_id} --seed S --out "
            f"{REPLICATE_FOLDER / f'{name}_seed_S.npz'}`"
        )
    return (EXPERT_FOLDER / f"{name}.npz", *others)


def replicates_of(env_id: str, count: int) -> tuple[Replicate, ...]:
    """The recordings that claims about an environment are decided over.

    Args:
        env_id: One of `environments`.
        count: How many.

    Returns:
        The shipped recording, and others of one expert after the other, again and again.

    Raises:
        InputError: If an expert is missing.
    """
    experts = experts_of(env_id, min(count, EXPERTS))
    return tuple(
        Replicate(env_id, number, experts[number % len(experts)]) for number in range(count)
    )


@lru_cache(maxsize=64)
def demonstrations_of(replicate: Replicate) -> Demonstrations:
    """The demonstrations of a recording: the shipped file, or made now as it was made.

    Args:
        replicate: Which.

    Returns:
        15,000 steps, the actions sampled.

    Raises:
        InputError: If a file is missing or cannot be read.
    """
    if not replicate.recording:
        return shipped_demonstrations(replicate.env_id)
    return record(
        replicate.env_id,
        replicate.expert,
        steps=SHIPPED_STEPS,
        seed=replicate.recorded_from,
        stochastic=True,
    )


@lru_cache(maxsize=8)
def shipped_demonstrations(env_id: str) -> Demonstrations:
    """The demonstrations of an environment that everything else uses.

    Args:
        env_id: One of `environments`.

    Returns:
        15,000 steps.

    Raises:
        InputError: If the file is missing or cannot be read.
    """
    return load_demonstrations(_path(SHIPPED[env_id]))


@lru_cache(maxsize=64)
def trees_of(replicate: Replicate, divider: int = PAPER_DIVIDER) -> tuple[PolicyTree, ...]:
    """The trees of a recording.

    Args:
        replicate: Which.
        divider: Intervals of continuous actions; without meaning for discrete ones.

    Returns:
        One an action dimension.
    """
    return grow_policy_trees(demonstrations_of(replicate), divider=divider)


def named_rules(replicate: Replicate, divider: int = PAPER_DIVIDER) -> dict[str, RuleSet]:
    """The rule sets of the paper's Table 1.

    Args:
        replicate: Which recording they are mined from.
        divider: As in `trees_of`.

    Returns:
        `filtered` and `unfiltered`.
    """
    trees = trees_of(replicate, divider)
    return {
        name: mine_rules(trees, supp_min=setting.support, conf_min=setting.confidence)
        for name, setting in NAMED_SETTINGS.items()
    }


def _path(name: str) -> Path:
    return DEMONSTRATION_FOLDER / f"{name}.parquet"


def fingerprints(env_id: str, count: int) -> dict[str, dict[str, str]]:
    """What tells experts and recordings of an environment from others of their names.

    Args:
        env_id: One of `environments`.
        count: Number of recordings.

    Returns:
        Digests of the `recordings` by their numbers, and of the `experts` by their names.
    """
    replicates = replicates_of(env_id, count)
    return {
        "recordings": {str(one.recording): demonstrations_of(one).digest for one in replicates},
        "experts": expert_digests(env_id, count),
    }


def expert_digests(env_id: str, count: int) -> dict[str, str]:
    """Digests of the experts of an environment's recordings, by their names.

    Args:
        env_id: One of `environments`.
        count: Number of recordings.
    """
    return {
        one.name: hashlib.blake2b(one.expert.read_bytes(), digest_size=16).hexdigest()
        for one in replicates_of(env_id, count)
    }


def recorded_seeds(env_ids: Iterable[str], count: int) -> dict[str, list[dict[str, Any]]]:
    """Where the seeds of recordings begin, for the report.

    Args:
        env_ids: Some of `environments`.
        count: Number of recordings of each.

    Returns:
        By environment, for each recording its `recording`, `expert` and `first` seed.
    """
    return {
        env_id: [
            {"recording": one.recording, "expert": one.name, "first": one.recorded_from}
            for one in replicates_of(env_id, count)
        ]
        for env_id in env_ids
    }
