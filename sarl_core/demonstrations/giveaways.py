"""Features that tell what nobody knows when the action is chosen: the action itself, or the time.

A lamp that lights when the brake is pulled gives the action, and a rule about it explains nothing.
What is looked for is narrow, so that an expert who decides by a single feature is not suspected:
not a border on a scale, but values that stand apart from each other, each with its own action.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.requirements import rises_steadily

_LEAST_ROWS = 20
_LOOKED_AT = 1_000  # rows, at first
_GAP = 0.05  # of a feature's spread: values farther from each other stand apart
_MOST_GROUPS = 10  # of a continuous action that has only a few values
_SURE = 0.98  # of the steps
_LEFT = 0.1  # of the errors that the most frequent action would make
_MONOTONE = 0.999  # rank correlation of a copy
_LEAST_CHANGES = 5
_EARLIER = re.compile(r"prev|last|lag|old|past|before|earlier", re.I)


def find_giveaways(demonstrations: Demonstrations) -> list[str]:
    """Features that alone give an action, count the steps, or hold the next state.

    Args:
        demonstrations: N pairs; what was observed counts, and nothing that is derived from it.

    Returns:
        One sentence each; () where there are too few pairs to tell.
    """
    if len(demonstrations) < _LEAST_ROWS:
        return []
    together = np.diff(demonstrations.episodes) == 0
    names = [feature.name for feature in demonstrations.observed]
    sentences = []
    for name, values in zip(names, demonstrations.raw_observations.T, strict=True):
        if values.min() == values.max():
            continue
        moves = _clockwork(values, together)
        if moves is not None:
            sentences.append(
                f"feature {name!r} {moves}, as a counter or a clock does; if it is one, leave it "
                "out, since a rule about it holds in no other episode"
            )
            continue
        for index, dimension in enumerate(demonstrations.action_dimensions):
            share = _share_given(values, demonstrations.action_columns[:, index], dimension.kind)
            if share is not None:
                steps = "every step" if share == 1 else f"{100 * share:.1f} % of the steps"
                sentences.append(
                    f"feature {name!r} alone gives action {dimension.name!r} in {steps}; if it is "
                    "recorded from the action (a copy of it, a lamp that follows it), leave it "
                    "out, since a rule about it explains nothing"
                )
    return sentences + _next_states(demonstrations.raw_observations, names, together)


def _share_given(values: NDArray[np.float32], actions: NDArray[Any], kind: str) -> float | None:
    """In which share of the steps a feature gives the action, None if it does not."""
    stride = -(-len(values) // _LOOKED_AT)
    share = _share(values[::stride], actions[::stride], kind)
    return share if share is None or stride == 1 else _share(values, actions, kind)


def _share(values: NDArray[np.float32], actions: NDArray[Any], kind: str) -> float | None:
    labels = _groups(actions)
    if kind == "discrete":
        labels = np.unique(actions, return_inverse=True)[1]
    n_labels = int(labels.max()) + 1
    if kind == "discrete" or n_labels <= _MOST_GROUPS:
        groups = _groups(values)
        n_groups = int(groups.max()) + 1
        if n_labels > 1 and n_groups <= min(2 * n_labels, len(values) // 10):
            counts = np.bincount(groups * n_labels + labels, minlength=n_groups * n_labels)
            right = float(counts.reshape(n_groups, n_labels).max(axis=1).sum() / len(values))
            base = float(np.bincount(labels).max() / len(values))
            if right >= _SURE and 1 - right <= _LEFT * (1 - base):
                return right
    if len(np.unique(actions)) <= _MOST_GROUPS:
        return None
    rank, other = _ranks(values), _ranks(actions)
    return 1.0 if abs(float(np.corrcoef(rank, other)[0, 1])) >= _MONOTONE else None


def _groups(values: NDArray[Any]) -> NDArray[np.int64]:
    """Which group of neighbours each value belongs to, (N,), where gaps part them."""
    distinct, place = np.unique(values.astype(np.float64), return_inverse=True)
    apart = np.diff(distinct) > _GAP * (distinct[-1] - distinct[0])
    return np.append(0, np.cumsum(apart))[place].astype(np.int64)


def _ranks(values: NDArray[Any]) -> NDArray[np.float64]:
    """Ranks of values, equal ones in the middle of theirs."""
    ordered = np.sort(values)
    below = np.searchsorted(ordered, values, side="left")
    return (below + np.searchsorted(ordered, values, side="right")) / 2


def _clockwork(values: NDArray[np.float32], together: NDArray[np.bool_]) -> str | None:
    """How a feature moves if it does so as a counter or a clock, None if it does not."""
    if len(values) > _LOOKED_AT:
        few = _clockwork(values[:_LOOKED_AT], together[: _LOOKED_AT - 1])
        if few is None:
            return None
    if rises_steadily(values, together, least=_LEAST_ROWS // 2):
        return "rises by the same amount at every step"
    if rises_steadily(-values, together, least=_LEAST_ROWS // 2):
        return "falls by the same amount at every step"
    if together.all() and _begins_again(values):
        return f"counts by one and keeps beginning again at {decimal_text(values[0])}"
    return None


def _begins_again(values: NDArray[np.float32]) -> bool:
    """Whether a feature counts steps of episodes that nothing else tells apart."""
    changes = np.diff(values.astype(np.float64))
    again = values[1:] == values[0]
    counted = changes[~again]
    return bool(
        values[0] == np.floor(values[0])
        and len(counted) >= _LEAST_CHANGES * (1 + np.count_nonzero(again))
        and abs(counted[0]) == 1
        and np.all(counted == counted[0])
    )


def _next_states(
    observations: NDArray[np.float32], names: list[str], together: NDArray[np.bool_]
) -> list[str]:
    if np.count_nonzero(together) < _LEAST_ROWS // 2:
        return []
    few = together[:_LOOKED_AT]  # some rows tell nearly all pairs of features apart
    start = observations[: len(few) + 1]
    later = {values[1:][few].tobytes(): index for index, values in enumerate(start.T)}
    sentences = []
    for index, values in enumerate(start.T):
        base = later.get(values[:-1][few].tobytes())
        if base is None or base == index or _EARLIER.search(names[base]):
            continue
        held = observations[:-1, index][together]
        if (
            np.array_equal(held, observations[1:, base][together])
            and np.count_nonzero(np.diff(held)) >= _LEAST_CHANGES
        ):
            sentences.append(
                f"feature {names[index]!r} holds in each step what feature {names[base]!r} holds "
                "in the next one; if it is the next state, leave it out, since nobody knows it "
                "before acting"
            )
    return sentences
