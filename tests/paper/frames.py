"""Tables as the studies measure them, made up so that it is known what follows from them.

Every table has six recordings of three experts. They say the same, unless a test changes that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sarl_core.learning.relevance import Relevance

SUPPORTS, CONFIDENCES = (0.0, 0.1, 0.2), (0.0, 0.5, 0.75, 1.0)
ENVIRONMENTS = ("CartPole-v1", "LunarLander-v3")
RECORDINGS = 6


def expert(recording: int, env_id: str = "task") -> str:
    """The name of the expert of a recording."""
    return f"{env_id}_{recording % 3}"


def landscapes(
    counts: Mapping[str, ArrayLike],
    lengths: Mapping[str, ArrayLike] | None = None,
    *,
    recordings: Sequence[int] = range(RECORDINGS),
) -> pd.DataFrame:
    """The table of Figures 2 and 3 from one 3 x 4 matrix an environment."""
    supports, confidences = np.meshgrid(SUPPORTS, CONFIDENCES, indexing="ij")
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "environment": env_id,
                    "expert": expert(recording, env_id),
                    "recording": recording,
                    "divider": 0,
                    "support": supports.ravel(),
                    "confidence": confidences.ravel(),
                    "rule_count": np.asarray(values).ravel(),
                    "mean_length": np.asarray((lengths or counts)[env_id], dtype=float).ravel(),
                    "coverage": 0.5,
                    "fidelity": np.nan,
                }
            )
            for env_id, values in counts.items()
            for recording in recordings
        ],
        ignore_index=True,
    )


def learning(
    filtered: Sequence[float],
    unfiltered: Sequence[float],
    *,
    covered: float = 0.8,
    spread: float = 0.005,
) -> pd.DataFrame:
    """The table of Figure 4 from the shares of broken rules in each test, for six learners."""
    steps = 10_000
    # The experts' means are the same.
    shifts = np.array([-spread, 0.0, spread, spread, 0.0, -spread])[:, None]
    broken = np.array([np.asarray(shares) + shifts for shares in (filtered, unfiltered)])
    applied = np.empty(broken.shape)
    applied[0], applied[1] = covered * steps, steps
    tests = broken.shape[2]
    frame = Relevance(
        env_id="CartPole-v1",
        names=("filtered", "unfiltered"),
        rule_counts=(5, 1500),
        seeds=np.arange(RECORDINGS),
        learned_steps=np.arange(tests) * 500,
        test_steps=steps,
        applied=applied.round().astype(np.int64),
        broken=(broken * applied).round().astype(np.int64),
        returns=np.broadcast_to(np.linspace(20, 500, tests), (RECORDINGS, tests)).copy(),
    ).to_frame()
    return frame.assign(recording=frame["seed"], expert=frame["seed"].map(expert))


def episodes(
    env_id: str,
    novice: ArrayLike,
    expert_: ArrayLike,
    shielded: Mapping[int, tuple[ArrayLike, ArrayLike]],
) -> pd.DataFrame:
    """The table of Figures 5 to 7 from returns; filtered and unfiltered ones by their divider.

    Returns are those of each recording, (E,), or of all, (6, E).
    """
    arms = [(0, "novice alone", "novice", 0, novice)]
    for divider, (filtered, unfiltered) in shielded.items():
        arms += [
            (divider, "filtered", "novice", 6, filtered),
            (divider, "unfiltered", "novice", 3000, unfiltered),
        ]
    arms.append((0, "expert", "expert", 0, expert_))
    parts = []
    for recording in range(RECORDINGS):
        for divider, arm, agent, rules, returns in arms:
            every = np.asarray(returns, dtype=np.float64)
            values = every[recording] if every.ndim == 2 else every
            parts.append(
                pd.DataFrame(
                    {
                        "environment": env_id,
                        "expert": expert(recording, env_id),
                        "recording": recording,
                        "divider": divider,
                        "arm": arm,
                        "agent": agent,
                        "rule_count": rules,
                        "crashed": values < 0,
                        "seed": np.arange(len(values)) + 12_000_000 + 10_000 * recording,
                        "return": values,
                        "length": 100,
                        "interventions": 40 if rules else 0,
                        "covered": 50 if rules else 0,
                        "terminated": True,
                        "truncated": False,
                        "last_reward": np.where(values < 0, -100.0, 1.0),
                    }
                )
            )
    return pd.concat(parts, ignore_index=True)


def divided(returns: Mapping[str, Mapping[tuple[int, str], ArrayLike]]) -> pd.DataFrame:
    """The table of the divider study: returns by environment, divider and way to snap."""
    rows: list[dict[str, object]] = []
    for env_id, recording in ((one, number) for one in returns for number in range(RECORDINGS)):
        own = {
            "environment": env_id,
            "expert": expert(recording, env_id),
            "recording": recording,
        }
        found = returns[env_id]
        for (divider, snapping), values in found.items():
            rows += [
                {
                    **own,
                    "what": "return",
                    "divider": divider,
                    "snapping": snapping,
                    "seed": 12_000_000 + 10_000 * recording + number,
                    "value": value,
                    "crashed": float(value < 0) if env_id == "BipedalWalker-v3" else np.nan,
                }
                for number, value in enumerate(np.asarray(values, dtype=float).tolist())
            ]
        for divider in sorted({divider for divider, _ in found if divider}):
            edges = np.linspace(-1, 1, divider + 1)
            rows += [
                {
                    **own,
                    "what": "interval",
                    "divider": divider,
                    "action": "torque",
                    "interval": label,
                    "low": edges[label],
                    "high": edges[label + 1],
                    "count": 100 if label else 0,
                    "median": (edges[label] + edges[label + 1]) / 2,
                }
                for label in range(divider)
            ]
            rows += [
                {
                    **own,
                    "what": "error",
                    "divider": divider,
                    "action": "torque",
                    "snapping": snapping,
                    "value": error,
                }
                for snapping, error in (("centre", 0.5 / divider), ("clip", 0.0), ("expert", 0.1))
            ]
    return pd.DataFrame(rows)
