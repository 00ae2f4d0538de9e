"""The table of the divider study, and what is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.quantisation import Quantisation, Snapping
from sarl_core.paper.verdicts import Floats
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import interquartile_mean

if TYPE_CHECKING:
    import pandas as pd


def episodes_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], Episodes]:
    """The episodes of each divider and way to snap, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        Seeds and returns of each combination, those of all recordings one after the other, with
        nothing else in them; 0 and ``clip`` stand for the expert as it is.
    """
    rows = frame[(frame["environment"] == env_id) & (frame["what"] == "return")]
    episodes = {}
    for divider, snapping in dict.fromkeys(zip(rows["divider"], rows["snapping"], strict=True)):
        own = rows[(rows["divider"] == divider) & (rows["snapping"] == snapping)]
        nothing = np.zeros(len(own), dtype=np.int64)
        episodes[int(divider), cast(Snapping, snapping)] = Episodes(
            env_id=env_id,
            agent="expert",
            seeds=own["seed"].to_numpy(dtype=np.int64).copy(),
            returns=own["value"].to_numpy(dtype=np.float64).copy(),
            lengths=nothing,
            interventions=nothing,
            covered=nothing,
            terminated=nothing.astype(np.bool_),
            truncated=nothing.astype(np.bool_),
            last_rewards=nothing.astype(np.float64),
        )
    return episodes


def typical_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], Floats]:
    """The typical return (IQM) of each divider and way to snap in each recording.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        As in `episodes_of`, one number a recording.

    Raises:
        ValueError: If recordings have different numbers of episodes.
    """
    recordings = frame[frame["environment"] == env_id]["recording"].nunique()
    return {
        key: interquartile_mean(episodes.returns.reshape(recordings, -1))
        for key, episodes in episodes_of(frame, env_id).items()
    }


def failures_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], float]:
    """The share of the episodes that failed, for each divider and way to snap.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        As in `episodes_of`; NaN where it is not known.
    """
    rows = frame[(frame["environment"] == env_id) & (frame["what"] == "return")]
    shares = rows.groupby(["divider", "snapping"])["crashed"].mean()
    return {key: float(shares.loc[key]) for key in episodes_of(frame, env_id)}


def quantisations_of(frame: pd.DataFrame, env_id: str) -> tuple[tuple[Quantisation, ...], ...]:
    """How the demonstrated actions of the first recording are divided, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        For each action dimension one entry a divider.
    """
    rows = frame[frame["environment"] == env_id]
    rows = rows[rows["recording"] == rows["recording"].iloc[0]]
    intervals, errors = rows[rows["what"] == "interval"], rows[rows["what"] == "error"]
    dimensions = []
    for action in intervals["action"].unique():
        own = intervals[intervals["action"] == action]
        divided = []
        for divider in own["divider"].unique():
            parts = own[own["divider"] == divider]
            edges = [*parts["low"].tolist(), float(parts["high"].iloc[-1])]
            lost = errors[(errors["action"] == action) & (errors["divider"] == divider)]
            divided.append(
                Quantisation(
                    dimension=LabelledDimension.of_edges(str(action), edges),
                    divider=int(divider),
                    counts=parts["count"].to_numpy(dtype=np.int64).copy(),
                    medians=parts["median"].to_numpy(dtype=np.float64).copy(),
                    errors={
                        cast(Snapping, str(snapping)): float(value)
                        for snapping, value in zip(lost["snapping"], lost["value"], strict=True)
                    },
                )
            )
        dimensions.append(tuple(divided))
    return tuple(dimensions)
