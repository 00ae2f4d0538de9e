"""What happened while learning, episode by episode, and how good the learner was afterwards."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import asdict
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.documents import Count, MisfitError, Number, Share


class Columns(Struct):
    """Of a learning curve as a file has it, one entry an episode; see `LearningEpisodes`."""

    ends: list[Count]
    returns: list[float]
    lengths: list[Count]
    crashed: list[bool]
    interventions: list[Count]
    covered: list[Count]
    shielded: list[bool]

    def read(self) -> LearningEpisodes:
        """The curve.

        Raises:
            MisfitError: If the columns are not equally long.
        """
        if len({len(column) for column in asdict(self).values()}) > 1:
            raise MisfitError("the columns of a learning curve are not equally long")
        whole = {
            name: np.array(getattr(self, name), dtype=np.int64)
            for name in ("ends", "lengths", "interventions", "covered")
        }
        return LearningEpisodes(
            returns=np.array(self.returns, dtype=np.float64),
            crashed=np.array(self.crashed, dtype=np.bool_),
            shielded=np.array(self.shielded, dtype=np.bool_),
            **whole,
        )


@dataclass(frozen=True, eq=False, repr=False)
class LearningEpisodes:
    """E episodes that ended while learning, in the order in which they did; read-only.

    Attributes:
        ends: Environment steps, over all environments side by side, at which each ended, (E,).
        returns: Sum of the environment's rewards, without any penalty, (E,).
        lengths: Steps, (E,).
        crashed: Whether it ended by failure, (E,).
        interventions: Steps at which the rules changed what the learner had wanted, (E,).
        covered: Steps at which a rule applied and was in force, (E,).
        shielded: Whether the rules were in force, (E,).
    """

    ends: NDArray[np.int64]
    returns: NDArray[np.float64]
    lengths: NDArray[np.int64]
    crashed: NDArray[np.bool_]
    interventions: NDArray[np.int64]
    covered: NDArray[np.int64]
    shielded: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    def __len__(self) -> int:
        """Number of episodes E."""
        return len(self.ends)

    def __repr__(self) -> str:
        """As `LearningEpisodes(episodes=412, steps=119936, crashes=130)`."""
        steps = int(self.ends[-1]) if len(self) else 0
        return f"LearningEpisodes(episodes={len(self)}, steps={steps}, crashes={self.crashes})"

    @property
    def crashes(self) -> int:
        """Episodes that ended by failure."""
        return int(self.crashed.sum())

    @property
    def intervention_rate(self) -> float:
        """Share of the steps at which the rules changed the action; NaN without episodes."""
        return _ratio(self.interventions.sum(), self.lengths.sum())

    def crashes_at(self, steps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Crashes so far.

        Args:
            steps: Environment steps, (k,).

        Returns:
            Crashes up to and with each, (k,).
        """
        so_far = np.concatenate([[0], np.cumsum(self.crashed)])
        return np.asarray(so_far[np.searchsorted(self.ends, steps, side="right")])

    def binned(self, edges: NDArray[np.int64]) -> Bins:
        """Mean return and intervention rate of the episodes that ended between two edges.

        Args:
            edges: Ascending, (k + 1,); an episode belongs to the bin with low < end <= high.

        Returns:
            k bins; NaN where no episode ended.
        """
        place = np.searchsorted(edges, self.ends, side="left") - 1
        inside = (place >= 0) & (place < len(edges) - 1)

        def total(values: NDArray[Any]) -> NDArray[np.float64]:
            return np.bincount(
                place[inside], weights=values[inside], minlength=len(edges) - 1
            ).astype(np.float64)

        with np.errstate(invalid="ignore", divide="ignore"):
            return Bins(
                total(self.returns) / total(np.ones(len(self))),
                total(self.interventions) / total(self.lengths),
            )

    def to_dict(self) -> dict[str, list[Any]]:
        """Its columns, ready for JSON."""
        return {one.name: getattr(self, one.name).tolist() for one in fields(self)}


@dataclass(frozen=True, eq=False)
class Bins:
    """A learning curve in k bins of steps.

    Attributes:
        returns: Mean return of the episodes that ended in each, (k,).
        interventions: Share of their steps that the rules changed, (k,).
    """

    returns: NDArray[np.float64]
    interventions: NDArray[np.float64]


NO_EPISODES = Columns([], [], [], [], [], [], []).read()


@dataclass(frozen=True)
class Trial:
    """Episodes after learning, with the learned policy acting as it thinks best.

    Attributes:
        returns: One an episode.
        crashes: Episodes that ended by failure.
        intervention_rate: Share of the steps that the rules changed; 0 without a shield.
        coverage: Share of the steps to which a rule applied; 0 without a shield.
        cut: Episodes that were cut off before their end; none of them is among the crashes.
        failed: Whether each ended by failure; none where that was not known, or not kept.
        costs: What each cost; none likewise.
        freedom: What the rules left the policy to choose from, mean over the steps, 0 to 1; None
            without a shield, or where it was not kept.
    """

    returns: tuple[Number, ...]
    crashes: Count
    intervention_rate: Share
    coverage: Share
    cut: Count = 0
    failed: tuple[bool, ...] = ()
    costs: tuple[Number, ...] = ()
    freedom: Share | None = None

    @property
    def mean(self) -> float:
        """Mean return."""
        return float(np.mean(self.returns))

    @property
    def crash_rate(self) -> float:
        """Share of the episodes that ended by failure; with some cut off, the least it can be."""
        return self.crashes / len(self.returns)

    def to_dict(self) -> dict[str, Any]:
        """Its fields, ready for JSON."""
        return {
            "returns": list(self.returns),
            "crashes": self.crashes,
            "intervention_rate": self.intervention_rate,
            "coverage": self.coverage,
            **({"cut": self.cut} if self.cut else {}),
            **({"failed": list(self.failed)} if self.failed else {}),
            **({"costs": list(self.costs)} if self.costs else {}),
            **({} if self.freedom is None else {"freedom": self.freedom}),
        }


def _ratio(part: Any, whole: Any) -> float:
    return float(part) / float(whole) if whole else float("nan")
