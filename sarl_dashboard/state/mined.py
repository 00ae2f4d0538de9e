"""What is mined from the chosen demonstrations, once for each choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import digest_of_pairs
from sarl_core.errors import InputError
from sarl_core.explaining.tables.rules import TopRules, top_rules
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.editing.renaming import renamed_trees
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.landscape import Landscape, threshold_landscape
from sarl_core.mining.pareto import ParetoPoint, pareto_front
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import PolicyTree, grow_policy_trees
from sarl_core.mining.validation.episode_counts import EpisodeCounts
from sarl_core.mining.validation.holding_out import count_held_out, with_held_out
from sarl_dashboard.cache import cached
from sarl_dashboard.state.data import (
    chosen_demonstrations,
    data_parts,
    digest_or_empty,
    held_out_demonstrations,
    held_out_digest,
    require_demonstrations,
)
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.thresholds import MIN_DIVIDER, chosen_divider, chosen_thresholds


@cached(show_spinner="Growing the decision tree …")
def _grown(pairs: str, divider: int, _demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(_demonstrations, divider=divider)


@cached()
def _trees(digest: str, divider: int, _demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    # Other names make no other tree.
    grown = _grown(digest_of_pairs(_demonstrations), divider, _demonstrations)
    return renamed_trees(grown, _demonstrations)


def grown_trees(demonstrations: Demonstrations, divider: int) -> tuple[PolicyTree, ...]:
    """The trees of demonstrations, one an action dimension; grown once.

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of continuous actions; without meaning for discrete ones.

    Returns:
        Shared between sessions (they are immutable).
    """
    if demonstrations.is_discrete:
        divider = MIN_DIVIDER
    return _trees(demonstrations.digest, divider, demonstrations)


def _key(grown: tuple[PolicyTree, ...]) -> tuple[str, int]:
    return grown[0].source.digest, grown[0].divider


@cached()
def _rule_set(
    key: tuple[str, int],
    thresholds: Thresholds,
    digests: tuple[str, str],
    _trees: tuple[PolicyTree, ...],
    _parts: Parts | None,
) -> RuleSet:
    mined = mine_rules(
        _trees,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
    if _parts is None:
        return mined
    boxed = with_boxes(mined, _parts.mined)
    return boxed if _parts.held_out is None else with_held_out(boxed, _parts.held_out)


def mined_rules(
    grown: tuple[PolicyTree, ...] | None = None, thresholds: Thresholds | None = None
) -> RuleSet:
    """The rule set in force, or that of other trees and thresholds.

    Args:
        grown: Trees; those of the chosen data and divider where not given.
        thresholds: The chosen ones where not given.

    Returns:
        Mined once for each combination. Rules of the chosen data carry their data boxes and what
        the held-out episodes say of them.
    """
    if grown is None:
        grown = grown_trees(require_demonstrations(), chosen_divider())
    found = data_parts()
    if found is not None and found.mined.digest != grown[0].source.digest:
        found = None
    digests = ("", "") if found is None else (found.mined.digest, digest_or_empty(found.held_out))
    return _rule_set(_key(grown), thresholds or chosen_thresholds(), digests, grown, found)


@cached()
def _held_out_counts(
    key: tuple[str, int],
    digest: str,
    _trees: tuple[PolicyTree, ...],
    _held_out: Demonstrations,
) -> tuple[EpisodeCounts, ...]:
    return count_held_out(_trees, _held_out)


@cached()
def _landscape(
    key: tuple[str, int],
    supports: tuple[float, ...],
    confidences: tuple[float, ...],
    lift: float,
    depth: int | None,
    held_out: str,
    _trees: tuple[PolicyTree, ...],
    _counts: tuple[EpisodeCounts, ...] | None,
) -> Landscape:
    return threshold_landscape(
        _trees, supports, confidences, lift_min=lift, max_depth=depth, held_out=_counts
    )


def mined_landscape(
    grown: tuple[PolicyTree, ...],
    supports: NDArray[np.float64] | Sequence[float],
    confidences: NDArray[np.float64] | Sequence[float],
    *,
    lift: float = 0.0,
    depth: int | None = None,
) -> Landscape:
    """The landscape over a grid, computed once for each combination.

    It has a layer of what the held-out episodes say, where there are some.
    """
    other = held_out_demonstrations()
    counts = None
    if other is not None:
        counts = _held_out_counts(_key(grown), other.digest, grown, other)
    return _landscape(
        _key(grown),
        tuple(map(float, supports)),
        tuple(map(float, confidences)),
        lift,
        depth,
        digest_or_empty(other),
        grown,
        counts,
    )


@cached()
def _pareto(
    key: tuple[str, int], lift: float, depth: int | None, _trees: tuple[PolicyTree, ...]
) -> tuple[ParetoPoint, ...]:
    return pareto_front(_trees, lift_min=lift, max_depth=depth)


def mined_front(
    grown: tuple[PolicyTree, ...], *, lift: float = 0.0, depth: int | None = None
) -> tuple[ParetoPoint, ...]:
    """The rule sets that no other one beats, found once for each combination."""
    return _pareto(_key(grown), lift, depth, grown)


@cached()
def _top_rules(
    key: tuple[str, int], thresholds: Thresholds, most: int, _trees: tuple[PolicyTree, ...]
) -> TopRules:
    return top_rules(_trees, thresholds, most)


def largest_rules(grown: tuple[PolicyTree, ...], thresholds: Thresholds, most: int) -> TopRules:
    """The rules with the most support, without making the rest of a large set."""
    return _top_rules(_key(grown), thresholds, most, grown)


def rules_at(thresholds: Thresholds | None) -> tuple[RuleSet, str]:
    """The rule set at thresholds, and what tells it from others.

    Args:
        thresholds: The chosen ones where not given.

    Raises:
        InputError: If there are no demonstrations.
    """
    demonstrations = chosen_demonstrations()
    if demonstrations is None:
        raise InputError(
            "there are no demonstrations to mine rules from; upload some on the "
            "Demonstrations page, or choose a shipped set in the sidebar"
        )
    grown = grown_trees(demonstrations, chosen_divider())
    rule_set = mined_rules(grown, thresholds)
    # What was held out is told apart too: the rules carry what it says of them.
    told = (rule_set.source.digest, rule_set.thresholds, rule_set.divider, held_out_digest())
    return rule_set, repr(told)
