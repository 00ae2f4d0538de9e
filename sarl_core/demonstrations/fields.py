"""What demonstrations are made of, as it was given or as it was checked."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import DerivedFeature

Actions = NDArray[np.int64] | NDArray[np.float32]


@dataclass(frozen=True)
class Indicator:
    """What a feature that is 1 or 0 says of a column of words, or of one of true and false.

    Attributes:
        column: As "mode".
        value: Of the column where the feature is 1, as "heavy".
        otherwise: The only other value that there is, as "light"; "" where there are several
            others, or none.
    """

    column: str
    value: str
    otherwise: str = ""

    @property
    def name(self) -> str:
        """What the feature is called unless somebody renames it, as "mode is heavy"."""
        return self.column if self.is_truth else f"{self.column} is {self.value}"

    @property
    def is_truth(self) -> bool:
        """Whether the column holds true and false."""
        return (self.value, self.otherwise) == TRUTH[::-1]


TRUTH = ("false", "true")
"""What false and true are called where nobody has written them otherwise."""


def labels_of(actions: NDArray[Any], first: int, codes: tuple[int, ...] = ()) -> NDArray[np.int64]:
    """The labels of discrete actions.

    Args:
        actions: Whole numbers of one action dimension, (N,).
        first: The action that label 0 stands for, where labels count from it.
        codes: The action of each label, ascending, where they do not count.

    Returns:
        Shape (N,); a number that is no label for an action that has none.
    """
    whole = actions.astype(np.int64)
    if not codes:
        return np.asarray(whole - first)
    known = np.array(codes, dtype=np.int64)
    at = np.minimum(np.searchsorted(known, whole), len(known) - 1)
    return np.where(known[at] == whole, at, -1).astype(np.int64)


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


@dataclass(frozen=True)
class Whole:
    """The demonstrations that others are a sample of.

    Attributes:
        digest: Fingerprint of all steps.
        steps: How many there are.
        episodes: How many episodes.
    """

    digest: str
    steps: int
    episodes: int


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
    times: NDArray[np.float64] | None = None
    feature_names: tuple[str, ...] | None = None
    feature_units: tuple[str, ...] | None = None
    indicators: tuple[Indicator | None, ...] | None = None
    derived: tuple[DerivedFeature, ...] = ()
    action_names: tuple[str, ...] | None = None
    label_names: tuple[tuple[str, ...], ...] | None = None
    label_first: tuple[int, ...] | None = None
    label_codes: tuple[tuple[int, ...], ...] | None = None
    action_low: tuple[float, ...] | None = None
    action_high: tuple[float, ...] | None = None
    bounds_from: Literal["action space", "demonstrated values"] | None = None
    env_id: str = ""
    agent: str = ""
    seed: int | None = None
    notes: tuple[str, ...] = ()
    columns: tuple[ColumnUse, ...] = ()
    sample_of: Whole | None = None
