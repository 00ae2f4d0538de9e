"""Choosing combinations: those that a quick tree over all of them asks about."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError, require
from sarl_core.mining.combining.candidates import (
    Pair,
    amount_named,
    candidates,
    pairs_of_like_kind,
)
from sarl_core.mining.combining.gains import binned, gains
from sarl_core.mining.labels import label_dimensions

MOST_COMBINATIONS = 30
_SAMPLED = 5_000  # steps that the quick tree is grown from, at most
_CELLS = 50_000_000  # of steps and candidates, together: 100 MB; fewer steps of more candidates
_LEAVES = 64  # of the quick tree, the best first


def with_combinations(
    demonstrations: Demonstrations,
    *,
    pairs: Sequence[Pair | tuple[str, str]] | None = None,
    divider: int = 2,
    most: int = MOST_COMBINATIONS,
) -> Demonstrations:
    """Demonstrations with those combinations of two features that tell most about the actions.

    Candidates are ``x_i + r * x_j`` for every pair and a few ratios. A tree of few leaves over all
    of them, on a sample of the steps, says which are worth asking about; a tree over the features
    and these is then grown from all steps, as from any demonstrations.

    Args:
        demonstrations: N steps; what they derive already stays.
        pairs: Names or indices of two features that were observed, each; where not given, all
            that are amounts: neither words nor flags.
        divider: Number of intervals of continuous action dimensions.
        most: Combinations to keep, at most.

    Returns:
        The same steps with the combinations behind their features; the same every time.

    Raises:
        InputError: If there is nothing to combine, a pair is none, or the steps are a sample.
    """
    must = "what features are combined of must be Demonstrations"
    require(demonstrations, Demonstrations, must, "load them: load_demonstrations(path)")
    require_every_step(demonstrations, "choosing combinations")
    d = len(demonstrations.observed)
    known = {one.definition for one in demonstrations.derived}
    chosen = (
        pairs_of_like_kind(demonstrations)
        if pairs is None
        else [_pair(demonstrations, pair) for pair in pairs]
    )
    possible = [one for one in candidates(demonstrations, chosen) if one not in known]
    if not possible:
        raise InputError(
            "there are no two features that could be combined: each would have to be a number "
            "that changes; mine without combinations"
        )
    # Evenly spaced, so that the same steps are taken every time, from all episodes.
    count = min(len(demonstrations), _SAMPLED, _CELLS // len(possible))
    rows = np.linspace(0, len(demonstrations) - 1, count).astype(np.int64)
    base = demonstrations.observations[rows]
    blocks = _blocks(base, d, possible)
    worth = np.zeros(len(possible))
    share = max(1, -(-most // len(demonstrations.action_dimensions)))
    for index, dimension in enumerate(label_dimensions(demonstrations, divider)):
        labels = dimension.labels_of(demonstrations.action_columns[rows, index])
        present, labels = np.unique(labels, return_inverse=True)
        # Intervals have an order, names have none.
        targets = np.eye(len(present))
        if dimension.is_interval:
            targets = present[None].astype(np.float64)
        helped = gains(blocks, labels, targets, leaves=_LEAVES)[base.shape[1] :]
        best = np.argsort(-helped, kind="stable")[:share]
        worth[best] = np.maximum(worth[best], helped[best])
    order = np.argsort(-worth, kind="stable")[:most]
    used = sorted(order[worth[order] > 0.0].tolist())
    combined = [DerivedFeature(possible[place]) for place in used]
    return demonstrations.deriving([*demonstrations.derived, *combined])


def chosen_again(
    demonstrations: Demonstrations, pairs: Sequence[Pair], *, divider: int
) -> Demonstrations:
    """Demonstrations with combinations of their own in the place of those that they have.

    Args:
        demonstrations: N steps, perhaps fewer than their combinations were chosen from.
        pairs: Of features that may be combined.
        divider: Number of intervals of continuous action dimensions.

    Returns:
        The same steps; with no combinations where, in these steps, nothing can be combined.
    """
    others = [one for one in demonstrations.derived if not isinstance(one.definition, Combination)]
    plain = demonstrations.deriving(others)
    try:
        return with_combinations(plain, pairs=pairs, divider=divider)
    except InputError:
        return plain


def pairs_chosen_from(demonstrations: Demonstrations, *, divider: int) -> tuple[Pair, ...]:
    """The pairs of features that the combinations of demonstrations were chosen from.

    Args:
        demonstrations: N steps.
        divider: Number of intervals of continuous action dimensions.

    Returns:
        All that are amounts, where these give the same combinations; else the pairs that are
        combined; () where none is.
    """
    pairs = [
        one.definition.features
        for one in demonstrations.derived
        if isinstance(one.definition, Combination)
    ]
    if not pairs:
        return ()
    every = pairs_of_like_kind(demonstrations)
    again = chosen_again(demonstrations, every, divider=divider)
    return every if again.derived == demonstrations.derived else tuple(dict.fromkeys(pairs))


def _pair(demonstrations: Demonstrations, pair: Pair | tuple[str, str]) -> Pair:
    """Indices of two features."""
    d = len(demonstrations.observed)
    places = [
        amount_named(demonstrations, one) if isinstance(one, str) else int(one) for one in pair
    ]
    if len({*places}) != 2 or len(places) != 2 or not all(0 <= place < d for place in places):
        raise InputError(
            f"{pair} are no two of the {d} features; give two different names, or indices from 0"
        )
    return places[0], places[1]


def _blocks(
    base: NDArray[np.float32], d: int, possible: Sequence[Combination]
) -> list[NDArray[np.uint16]]:
    """The features of steps, of which d are observed, and behind them all candidates, in bins."""
    raw = np.asfortranarray(base[:, :d])  # a feature lies in one piece
    with np.errstate(over="ignore"):
        return binned(chain(base.T, (one.values(raw).astype(np.float32) for one in possible)))
