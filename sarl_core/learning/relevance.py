"""How relevant rules are to an agent that learns (the paper's Figure 4).

A learner and a test take turns. In a test the learner acts alone and the rules only watch: at how
many steps does one apply, and how often is what the learner proposes what the rule says? So every
rule set is judged by the same steps, and none of them helps the learner along.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import PolicyAgent
from sarl_core.arrays import make_read_only
from sarl_core.environments.description import describe_environment, make_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.progress import Progress, report
from sarl_core.rollouts.player import shield_for
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.seeds import MOST_LEARNERS, RELEVANCE, SEEDS_A_LEARNER
from sarl_core.shielding.shield import Shield

if TYPE_CHECKING:
    import pandas as pd
    from stable_baselines3 import PPO

    from sarl_core.mining.rule_set import RuleSet

PAPER_LEARNING = 500  # steps between two tests
PAPER_TEST = 20_000  # steps of a test

# PPO's own defaults, but for what lets it learn CartPole in some dozen updates. A learning phase is
# one update.
_LEARNER: dict[str, Any] = {"gae_lambda": 0.9, "gamma": 0.98, "learning_rate": 0.001}
_LARGEST_BATCH = 100


@dataclass(frozen=True, eq=False)
class Relevance:
    """R rule sets, K learners, P + 1 tests of each; arrays are read-only.

    Attributes:
        env_id: Environment.
        names: Of the rule sets, R.
        rule_counts: Their numbers of rules, R.
        seeds: Of the learners, (K,) int64.
        learned_steps: Steps learned before each test, (P + 1,) int64; the first is 0.
        test_steps: Steps of each test.
        applied: Steps of a test at which some rule applied, (R, K, P + 1) int64.
        broken: Of these, the steps at which the learner's action broke one, likewise.
        returns: Mean return of the episodes that ended in the test (of all where none did),
            (K, P + 1).
    """

    env_id: str
    names: tuple[str, ...]
    rule_counts: tuple[int, ...]
    seeds: NDArray[np.int64]
    learned_steps: NDArray[np.int64]
    test_steps: int
    applied: NDArray[np.int64]
    broken: NDArray[np.int64]
    returns: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    @property
    def obeyed(self) -> NDArray[np.int64]:
        """Steps at which a rule applied and the action broke none, (R, K, P + 1)."""
        return np.asarray(self.applied - self.broken)

    @property
    def applied_share(self) -> NDArray[np.float64]:
        """Share of the test steps at which a rule applied, (R, K, P + 1)."""
        return np.asarray(self.applied / self.test_steps)

    @property
    def obeyed_share(self) -> NDArray[np.float64]:
        """Share of the steps with a rule at which it was kept; NaN without any, (R, K, P + 1)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.obeyed / self.applied)

    def to_frame(self) -> pd.DataFrame:
        """One row a test and rule set.

        Returns:
            Columns `environment`, `rules` (the name), `rule_count`, `seed`, `learned_steps`,
            `test_steps`, `applied`, `kept`, `broken`, `mean_return`.
        """
        import pandas as pd

        r, k, p = np.indices(self.applied.shape).reshape(3, -1)
        return pd.DataFrame(
            {
                "environment": self.env_id,
                "rules": np.array(self.names, dtype=object)[r],
                "rule_count": np.array(self.rule_counts)[r],
                "seed": self.seeds[k],
                "learned_steps": self.learned_steps[p],
                "test_steps": self.test_steps,
                "applied": self.applied.reshape(-1),
                "kept": self.obeyed.reshape(-1),
                "broken": self.broken.reshape(-1),
                "mean_return": self.returns[k, p],
            }
        )


def relevance_from_frame(frame: pd.DataFrame) -> Relevance:
    """Undo `Relevance.to_frame`.

    Args:
        frame: Its columns and rows, in its order.

    Returns:
        The same numbers.

    Raises:
        KeyError: If a column is missing.
        ValueError: If a row is missing.
    """
    names = tuple(frame["rules"].unique().tolist())
    seeds = frame["seed"].unique().astype(np.int64)
    learned = frame["learned_steps"].unique().astype(np.int64)
    shape = (len(names), len(seeds), len(learned))

    def cube(column: str) -> NDArray[np.int64]:
        return frame[column].to_numpy(dtype=np.int64).reshape(shape).copy()

    returns = frame["mean_return"].to_numpy(dtype=np.float64).reshape(shape)[0].copy()
    return Relevance(
        env_id=str(frame["environment"].iloc[0]),
        names=names,
        rule_counts=tuple(cube("rule_count")[:, 0, 0].tolist()),
        seeds=seeds,
        learned_steps=learned,
        test_steps=int(frame["test_steps"].iloc[0]),
        applied=cube("applied"),
        broken=cube("broken"),
        returns=returns,
    )


def study_relevance(
    env_id: EnvironmentOrId,
    rule_sets: Mapping[str, RuleSet],
    *,
    seeds: Sequence[int] = (0, 1, 2, 3, 4),
    phases: int = 100,
    learning_steps: int = PAPER_LEARNING,
    test_steps: int = PAPER_TEST,
    progress: Progress | None = None,
) -> Relevance:
    """Test a learner before it has learned anything, and after each of `phases` of learning.

    The learner is Stable-Baselines3's PPO; in a test its actions are sampled, as it samples them
    while it learns. All tests of one learner start from the same states, so that what changes
    between them is the learner. The shield intervenes in nothing.

    Args:
        env_id: What ``gymnasium.make`` takes.
        rule_sets: R rule sets by their names on screen.
        seeds: Of the K learners.
        phases: Phases of learning, P.
        learning_steps: Steps of each phase; one update of PPO.
        test_steps: Steps of each test, exactly.
        progress: Called with (tests done, in all); returning False stops.

    Returns:
        What was counted.

    Raises:
        InputError: If a number is out of range, or rules and environment do not fit.
        CancelledError: If `progress` returned False.
    """
    for name, value, least in (
        ("phases", phases, 1),
        ("learning_steps", learning_steps, 2),
        ("test_steps", test_steps, 1),
        ("rule sets", len(rule_sets), 1),
        ("seeds", len(seeds), 1),
    ):
        if value < least:
            raise InputError(f"{name} is {value} and must be at least {least}; give more")
    if test_steps > SEEDS_A_LEARNER:
        raise InputError(
            f"test_steps is {test_steps} and must be at most {SEEDS_A_LEARNER}; give fewer"
        )
    if len(set(seeds)) < len(seeds) or min(seeds) < 0 or max(seeds) >= MOST_LEARNERS:
        raise InputError(
            f"the seeds of the learners must differ and be from 0 to {MOST_LEARNERS - 1}; give "
            "others"
        )
    shields = [shield_for(env_id, Shield(rules)) for rules in rule_sets.values()]
    shape = (len(shields), len(seeds), phases + 1)
    applied, broken = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    returns = np.zeros(shape[1:])
    report(progress, 0, returns.size)
    for k, seed in enumerate(seeds):
        learner = _learner(env_id, seed, learning_steps)
        for p in range(phases + 1):
            if p:
                learner.learn(learning_steps, reset_num_timesteps=p == 1)
            counts, returns[k, p] = _test(env_id, learner, seed, shields, test_steps)
            applied[:, k, p], broken[:, k, p] = counts
            report(progress, k * (phases + 1) + p + 1, returns.size)
        environment = learner.get_env()
        if environment is not None:
            environment.close()
    return Relevance(
        env_id=str(env_id),
        names=tuple(rule_sets),
        rule_counts=tuple(len(rules) for rules in rule_sets.values()),
        seeds=np.array(seeds, dtype=np.int64),
        learned_steps=np.arange(phases + 1, dtype=np.int64) * learning_steps,
        test_steps=test_steps,
        applied=applied,
        broken=broken,
        returns=returns,
    )


def _learner(env_id: EnvironmentOrId, seed: int, learning_steps: int) -> PPO:
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)  # the network is too small to gain from more
    # Batches of equal size, so that no step counts for more than another.
    sizes = range(_LARGEST_BATCH, 1, -1)
    batch_size = next((size for size in sizes if learning_steps % size == 0), learning_steps)
    return PPO(
        "MlpPolicy",
        make_environment(env_id),
        n_steps=learning_steps,
        batch_size=batch_size,
        seed=seed,
        device="cpu",
        **_LEARNER,
    )


def _test(
    env_id: EnvironmentOrId, learner: PPO, seed: int, shields: Sequence[Shield], steps: int
) -> tuple[tuple[list[int], list[int]], float]:
    """Steps at which each shield's rules applied and were broken, and the mean return."""
    from sarl_core.learning.experts import export_policy

    first = np.array(describe_environment(env_id).label_first, dtype=np.int64)
    agent = PolicyAgent("learner", export_policy(learner, env_id=str(env_id)), True, first)
    recorded = record(env_id, agent, steps=steps, seed=RELEVANCE + SEEDS_A_LEARNER * seed)
    applied, broken = [], []
    for shield in shields:
        decision = shield.decide_batch(recorded.observations, recorded.actions)
        applied.append(int((decision.rules >= 0).any(axis=1).sum()))
        broken.append(int(decision.intervened.sum()))
    returns, ended = recorded.episode_returns, recorded.episode_finished
    assert returns is not None
    some = ended is not None and bool(ended.any())
    return (applied, broken), float(returns[ended].mean() if some else returns.mean())
