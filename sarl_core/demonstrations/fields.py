"""What demonstrations are made of, as it was given or as it was checked."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Actions = NDArray[np.int64] | NDArray[np.float32]


@dataclass(frozen=True)
class ColumnUse:
    """What one column of a file was taken for.

    Attributes:
        column: As the file calls it.
        use: As "feature", "action", "episode number" or "not used".
        why: In words.
    """

    column: str
    use: str
    why: str


@dataclass(frozen=True, eq=False, repr=False)
class DemonstrationFields:
    """N state-action pairs of an expert; `Demonstrations` says what each field is."""

    observations: NDArray[np.float32]
    actions: Actions
    episodes: NDArray[np.int64]
    rewards: NDArray[np.float64] | None = None
    _: KW_ONLY
    terminated: NDArray[np.bool_] | None = None
    truncated: NDArray[np.bool_] | None = None
    steps: NDArray[np.int64] | None = None
    feature_names: tuple[str, ...] | None = None
    feature_units: tuple[str, ...] | None = None
    action_names: tuple[str, ...] | None = None
    label_names: tuple[tuple[str, ...], ...] | None = None
    label_first: tuple[int, ...] | None = None
    action_low: tuple[float, ...] | None = None
    action_high: tuple[float, ...] | None = None
    bounds_from: Literal["action space", "demonstrated values"] | None = None
    env_id: str = ""
    agent: str = ""
    seed: int | None = None
    notes: tuple[str, ...] = ()
    columns: tuple[ColumnUse, ...] = ()
