"""The record of every step of several episodes, column by column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.spaces import Actions
from sarl_core.arrays import make_read_only

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class StepTable:
    """T steps, in the order of episodes and steps; arrays are read-only.

    Attributes:
        episode: Number of the episode, counted from 0, (T,) int64.
        step: Index within the episode, (T,) int64.
        observation: What the agent saw, (T, d) float32.
        proposed: The agent's actions, (T, m) int64 or float32.
        executed: The actions the environment got, likewise.
        rules: Index of the rule in force for each action dimension or -1, (T, m) int64.
        intervened: Whether the shield changed the action, (T,) bool.
        margin: Distance to the nearest threshold on the paths walked, inf without one, NaN where
            no rule was asked, (T,).
        reward: What the environment gave, (T,) float64.
        outside: Whether the state lies outside the data of a rule that the proposed action
            breaks, (T,) bool; nowhere where not given.
        invalid: Why no rule was asked, where the observation was no state or the proposed action
            none that there is and it passed; else None, (T,) objects; nowhere where not given.
        failed: Whether the step is a failure, (T,) bool; nowhere where not given.
        cost: What the step cost, (T,) float64; NaN where nothing says, or it is not given.
    """

    episode: NDArray[np.int64]
    step: NDArray[np.int64]
    observation: NDArray[np.float32]
    proposed: Actions
    executed: Actions
    rules: NDArray[np.int64]
    intervened: NDArray[np.bool_]
    margin: NDArray[np.float64]
    reward: NDArray[np.float64]
    outside: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    invalid: NDArray[np.object_] = field(default_factory=lambda: np.zeros(0, dtype=np.object_))
    failed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    cost: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        nothing: tuple[tuple[str, Any, Any], ...] = (
            ("outside", False, np.bool_),
            ("invalid", None, np.object_),
            ("failed", False, np.bool_),
            ("cost", np.nan, np.float64),
        )
        for name, value, kind in nothing:
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.step), value, dtype=kind))
        make_read_only(self)

    def __len__(self) -> int:
        """Number of steps T."""
        return len(self.step)

    def __repr__(self) -> str:
        """Shapes, as `StepTable(episode=int64[100], ...)`."""
        columns = [
            f"{column.name}={value.dtype}{list(value.shape)}"
            for column in fields(self)
            for value in [getattr(self, column.name)]
        ]
        return f"StepTable({', '.join(columns)})"

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Whether some rule applied, (T,) bool."""
        return np.asarray((self.rules >= 0).any(axis=1))

    @property
    def is_invalid(self) -> NDArray[np.bool_]:
        """Whether no rule was asked, because there was no state or no action to ask about, (T,)."""
        return self.invalid.astype(np.bool_)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice) -> StepTable:
        """Some of the steps.

        Args:
            rows: What NumPy takes as an index of rows.

        Returns:
            Those steps.
        """
        return StepTable(**{c.name: getattr(self, c.name)[rows] for c in fields(self)})

    def of_episode(self, episode: int) -> StepTable:
        """The steps of one episode.

        Args:
            episode: Its number, counted from 0.

        Returns:
            Its steps; none if there is no such episode.
        """
        ends = np.searchsorted(self.episode, [episode, episode + 1])
        return self.take(slice(int(ends[0]), int(ends[1])))

    def numbered_from(self, first: int) -> StepTable:
        """The same steps, with every episode's number raised.

        Args:
            first: What to add.

        Returns:
            A table that shares the other columns.
        """
        return replace(self, episode=self.episode + first)

    def to_frame(self, feature_names: Sequence[str] | None = None) -> pd.DataFrame:
        """One row a step.

        Args:
            feature_names: d names for the observation's columns.

        Returns:
            Columns `episode`, `step`, `obs_<name>`..., `proposed_<i>`..., `executed_<i>`...,
            `rule_<i>`..., `intervened`, `outside`, `margin`, `reward`; without `_<i>` where there
            is one. Where some step was invalid, also `invalid`: why, or ""; where some failed,
            `failed`; where a cost is known, `cost`.
        """
        import pandas as pd

        columns: dict[str, Any] = {"episode": self.episode, "step": self.step}
        names = feature_names or [str(index) for index in range(self.observation.shape[1])]
        for index, name in enumerate(names):
            columns[f"obs_{name}"] = self.observation[:, index]
        for title, values in (
            ("proposed", self.proposed),
            ("executed", self.executed),
            ("rule", self.rules),
        ):
            for index in range(values.shape[1]):
                key = title if values.shape[1] == 1 else f"{title}_{index}"
                columns[key] = values[:, index]
        columns |= {
            "intervened": self.intervened,
            "outside": self.outside,
            "margin": self.margin,
            "reward": self.reward,
        }
        if self.is_invalid.any():
            columns["invalid"] = [why or "" for why in self.invalid.tolist()]
        if self.failed.any():
            columns["failed"] = self.failed
        if not np.isnan(self.cost).all():
            columns["cost"] = self.cost
        return pd.DataFrame(columns)


def concatenate(tables: Sequence[StepTable]) -> StepTable:
    """Put tables under each other.

    Args:
        tables: At least one, of the same environment.

    Returns:
        All their steps.
    """
    return StepTable(
        **{
            c.name: np.concatenate([getattr(table, c.name) for table in tables])
            for c in fields(StepTable)
        }
    )
