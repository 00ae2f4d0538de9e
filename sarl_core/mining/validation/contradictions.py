"""States on which demonstrations disagree: the same, or nearly the same, and another label.

A pair that a rule gets wrong need not contradict another one; the rule may be too coarse. What
contradicts is told here by the demonstrations alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError
from sarl_core.mining.labels import label_dimensions

NEAR = 0.1
"""Two states are near if no feature differs by more than this share of its standard deviation."""
_FIRST_NEIGHBOURS = 4
_ROWS_AT_ONCE = 2**14  # that are compared with one another
_AT_ONCE = 2_000_000  # neighbours asked for in one go

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Contradictions:
    """Where N demonstrated pairs with m action dimensions disagree.

    Attributes:
        reach: How near is near, in standard deviations of each feature.
        identical: Whether the very same state was also shown with another label, (N, m).
        near: Whether the nearest state of another episode is near and has another label, (N, m).
        neighbour: Row of that state, (N,); -1 where none is near.
        distance: How far it is, in standard deviations of the feature that differs most, (N,);
            infinity where none is near.
    """

    reach: float
    identical: Flags
    near: Flags
    neighbour: NDArray[np.int64]
    distance: NDArray[np.float64]

    def contradicting(self, dimension: int | None = None) -> Flags:
        """Whether each pair contradicts another one, in one way or the other, (N,).

        Args:
            dimension: Of the action; None for any of them.
        """
        both = self.identical | self.near
        if dimension is None:
            return np.asarray(both.any(axis=1), dtype=np.bool_)
        return np.asarray(both[:, dimension], dtype=np.bool_)


class EpisodeContradictions(NamedTuple):
    """One episode among the others.

    Attributes:
        episode: Its number.
        steps: Its length.
        identical: Steps whose very state was also shown with another label.
        near: Steps whose nearest state of another episode is near and has another label.
        contradicting: Steps of either kind.
    """

    episode: int
    steps: int
    identical: int
    near: int
    contradicting: int

    @property
    def share(self) -> float:
        """Share of its steps that contradict another one."""
        return self.contradicting / self.steps


def identical_contradictions(demonstrations: Demonstrations, *, divider: int = 2) -> Flags:
    """The pairs whose very state was also shown with another label.

    Args:
        demonstrations: N pairs with m action dimensions.
        divider: Number of intervals of continuous dimensions.

    Returns:
        Shape (N, m).

    Raises:
        InputError: If the divider is out of range.
    """
    return _identical(_same_states(demonstrations), _labels(demonstrations, divider))


def find_contradictions(
    demonstrations: Demonstrations, *, divider: int = 2, reach: float = NEAR
) -> Contradictions:
    """Find the pairs that contradict others.

    A state is compared with its nearest state of another episode, so one odd episode among many
    that agree stands out, and does not make the others look odd. Where the expert changes its mind
    within a short way, near states may differ rightly.

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of continuous dimensions.
        reach: How near is near, in standard deviations of each feature.

    Returns:
        Where they disagree.

    Raises:
        InputError: If the divider or the reach is out of range, or the pairs are a sample.
    """
    require_every_step(demonstrations, "looking for contradictions")
    if not (np.isfinite(reach) and reach >= 0.0):
        raise InputError(f"the distance is {reach}; give 0 or more standard deviations")
    labels = _labels(demonstrations, divider)
    state = _same_states(demonstrations)
    neighbour, distance = _nearest_elsewhere(demonstrations, state, reach)
    near = (neighbour >= 0)[:, None] & (labels != labels[neighbour])
    return Contradictions(reach, _identical(state, labels), near, neighbour, distance)


def by_episode(
    demonstrations: Demonstrations, contradictions: Contradictions, dimension: int | None = None
) -> tuple[EpisodeContradictions, ...]:
    """Count contradictions an episode.

    Args:
        demonstrations: N pairs.
        contradictions: What `find_contradictions` found in them.
        dimension: Of the action; None for any of them.

    Returns:
        The episode with the largest share of contradicting steps first.
    """
    which = slice(None) if dimension is None else slice(dimension, dimension + 1)
    flags = [
        contradictions.identical[:, which].any(axis=1),
        contradictions.near[:, which].any(axis=1),
    ]
    flags.append(flags[0] | flags[1])
    starts = demonstrations.episode_starts
    counts = [np.add.reduceat(flag.astype(np.int64), starts).tolist() for flag in flags]
    episodes = [
        EpisodeContradictions(*numbers)
        for numbers in zip(
            demonstrations.episodes[starts].tolist(),
            demonstrations.episode_lengths.tolist(),
            *counts,
            strict=True,
        )
    ]
    return tuple(sorted(episodes, key=lambda one: (-one.share, one.episode)))


def _labels(demonstrations: Demonstrations, divider: int) -> NDArray[np.int64]:
    return np.stack(
        [
            dimension.labels_of(demonstrations.action_columns[:, index])
            for index, dimension in enumerate(label_dimensions(demonstrations, divider))
        ],
        axis=1,
    )


def _same_states(demonstrations: Demonstrations) -> NDArray[np.int64]:
    """A number for every state, the same for equal ones, (N,)."""
    # Zero has two signs and is one number; then equal states are equal bytes.
    states = np.ascontiguousarray(demonstrations.raw_observations + np.float32(0.0))
    whole = states.view(np.dtype((np.void, states.itemsize * states.shape[1]))).reshape(-1)
    # As np.unique does, which has every state three times over.
    order = np.argsort(whole)
    other = np.zeros(len(order), dtype=np.bool_)  # than the one before
    for start in range(1, len(order), _ROWS_AT_ONCE):
        some = whole[order[start - 1 : start + _ROWS_AT_ONCE]]
        other[start : start + _ROWS_AT_ONCE] = some[1:] != some[:-1]
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.cumsum(other)
    return number


def _identical(state: NDArray[np.int64], labels: NDArray[np.int64]) -> Flags:
    order = np.argsort(state, kind="stable")
    starts = np.flatnonzero(np.diff(state[order], prepend=-1))
    least = np.minimum.reduceat(labels[order], starts, axis=0)
    most = np.maximum.reduceat(labels[order], starts, axis=0)
    return np.asarray((least != most)[state], dtype=np.bool_)


def _nearest_elsewhere(
    demonstrations: Demonstrations, state: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Row and distance of the nearest state of another episode, within reach."""
    from scipy.spatial import cKDTree

    count = len(demonstrations)
    neighbour, distance = np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
    if demonstrations.n_episodes < 2:
        return neighbour, distance
    # A state that an episode visits many times is one place of it.
    visits = state * (int(demonstrations.episodes.max()) + 1) + demonstrations.episodes
    _, row, visit = np.unique(visits, return_index=True, return_inverse=True)
    episode = demonstrations.episodes[row]
    observed = demonstrations.raw_observations.astype(np.float64)
    spread = observed.std(axis=0)
    points = observed[row] / np.where(spread > 0, spread, 1.0)
    tree = cKDTree(points)
    bound = np.nextafter(reach, np.inf)
    near, far = np.full(len(row), -1, dtype=np.int64), np.full(len(row), np.inf)
    waiting, wanted = np.arange(len(row)), _FIRST_NEIGHBOURS
    while len(waiting):
        wanted = min(wanted, len(row))
        later = []
        pieces = max(-(-len(waiting) * wanted // _AT_ONCE), 1)
        for some in np.array_split(waiting, pieces):
            distances, nearest = tree.query(
                points[some], k=wanted, p=np.inf, distance_upper_bound=bound
            )
            there = nearest < len(row)
            elsewhere = there & (
                episode[np.minimum(nearest, len(row) - 1)] != episode[some][:, None]
            )
            first, any_there = elsewhere.argmax(axis=1), elsewhere.any(axis=1)
            at = np.arange(len(some))
            near[some] = np.where(any_there, nearest[at, first], -1)
            far[some] = np.where(any_there, distances[at, first], np.inf)
            # All that were found are of its own episode: others may be further away.
            later.append(some[~any_there & there.all(axis=1) & (wanted < len(row))])
        waiting = np.concatenate(later)
        wanted *= 4
    own, place = visit.reshape(-1), near[visit.reshape(-1)]
    return np.where(place >= 0, row[place], -1), far[own]
