"""What is mined from the chosen demonstrations, once for each choice."""

from __future__ import annotations

from operator import attrgetter

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError
from sarl_core.explaining.tables.rules import TopRules, top_rules
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.editing.renaming import renamed_trees
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.evidence import EpisodeCounts
from sarl_core.mining.growing.growth import grow_policy_trees, learner_for
from sarl_core.mining.never.landscape import NeverLandscape, never_landscape
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import Landscape, threshold_landscape
from sarl_core.mining.thresholds.pareto import ParetoPoint, pareto_front
from sarl_core.mining.tree import Learner, PolicyTree
from sarl_core.mining.validation.holding_out import count_held_out, with_held_out
from sarl_core.shielding.leeway import Leeway, leeway_of
from sarl_dashboard.cache import cached
from sarl_dashboard.state.data import (
    chosen_demonstrations,
    data_parts,
    held_out_demonstrations,
    mined_data,
)
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.thresholds import (
    MIN_DIVIDER,
    chosen_divider,
    chosen_learner,
    chosen_thresholds,
)

Trees = tuple[PolicyTree, ...]


@cached(
    show_spinner="Growing the decision tree …",
    hash_funcs={Demonstrations: attrgetter("pairs_digest")},
)
def trees_under_any_name(demonstrations: Demonstrations, divider: int, learner: Learner) -> Trees:
    """Trees of the same pairs, whatever their features are called."""
    return grow_policy_trees(demonstrations, divider=divider, learner=learner)


def grown_trees(
    demonstrations: Demonstrations, divider: int, learner: Learner | None = None
) -> Trees:
    """The trees of demonstrations, one an action dimension; other names grow no others.

    Of a mined file they are those that it holds.

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of continuous actions; without meaning for discrete ones.
        learner: What grows them; the chosen one where not given.

    Returns:
        Shared between sessions (they are immutable).

    Raises:
        InputError: If a mined file has another divider.
    """
    mined = mined_data()
    if mined is not None and demonstrations.sample_of is not None:
        if not (demonstrations.is_discrete or divider == mined.divider):
            require_every_step(demonstrations, f"mining at divider {divider}")
        return mined.trees
    return _grown(*growing_of(demonstrations, divider, learner))


def growing_of(
    demonstrations: Demonstrations, divider: int, learner: Learner | None = None
) -> tuple[Demonstrations, int, Learner]:
    """What trees depend on: the demonstrations, the divider that is meant, and the learner."""
    if demonstrations.is_discrete:
        divider = MIN_DIVIDER
    return demonstrations, divider, learner or learner_of(demonstrations)


@cached()
def _grown(demonstrations: Demonstrations, divider: int, learner: Learner) -> Trees:
    return renamed_trees(trees_under_any_name(demonstrations, divider, learner), demonstrations)


def learner_of(demonstrations: Demonstrations) -> Learner:
    """What grows the trees of demonstrations, as it is chosen, or did so where they were mined."""
    mined = mined_data()
    if mined is not None:
        return mined.trees[0].learner
    return learner_for(chosen_learner(), len(demonstrations))


def mined_rules(trees: Trees, thresholds: Thresholds, parts: Parts | None) -> RuleSet:
    """The rule set of trees at thresholds.

    Args:
        trees: One an action dimension.
        thresholds: At which they are cut.
        parts: The chosen data.

    Returns:
        Rules of these data carry their data boxes and what the held-out episodes say of them.

    Raises:
        InputError: If the trees of a mined file do not reach down to the support.
    """
    mined = mined_data()
    if mined is not None and mined.trees == trees:
        return _rules_of_file(mined, thresholds)
    return _mined_rules(trees, thresholds, parts)


@cached()
def _rules_of_file(mined: MinedData, thresholds: Thresholds) -> RuleSet:
    return mined.at(thresholds)


@cached(show_spinner="Mining the rules …")
def _mined_rules(trees: Trees, thresholds: Thresholds, parts: Parts | None) -> RuleSet:
    rule_set = mine_at(trees, thresholds)
    if parts is None or parts.mined.whole.digest != rule_set.source.digest:
        return rule_set
    boxed = with_boxes(rule_set, parts.mined)
    return boxed if parts.held_out is None else with_held_out(boxed, parts.held_out)


def rules_at(thresholds: Thresholds | None = None) -> RuleSet:
    """The rule set of the chosen data.

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
    trees = grown_trees(demonstrations, chosen_divider())
    return mined_rules(trees, thresholds or chosen_thresholds(), data_parts())


def fidelity_at(thresholds: Thresholds) -> float:
    """Fidelity of the rules at thresholds on what they were mined from.

    Rules that forbid overlap, so it is counted by states: right are those in which nothing that is
    forbidden there was done.
    """
    rule_set, demonstrations = rules_at(thresholds), chosen_demonstrations()
    if thresholds.never is None or demonstrations is None:
        return rule_set.fidelity
    return mined_leeway(rule_set, demonstrations).fidelity


@cached(show_spinner="Counting what the rules forbid …")
def mined_leeway(rule_set: RuleSet, demonstrations: Demonstrations) -> Leeway:
    """What rules that forbid, alone or behind others, say of what they were mined from."""
    return leeway_of(rule_set, demonstrations)


def tried_on() -> Demonstrations | MinedData | None:
    """What rules are tried on: the episodes held out, or the file that counted them; else None."""
    mined = mined_data()
    if mined is None:
        return held_out_demonstrations()
    return mined if mined.held_out else None


def episodes_tried_on() -> tuple[int, int]:
    """How many episodes are held out, and how many there are with these."""
    mined, parts = mined_data(), data_parts()
    if mined is not None:
        held_out = mined.held_out_episodes
        return held_out, mined.sample.whole.episodes + held_out
    if parts is None:
        return 0, 0
    held_out = 0 if parts.held_out is None else parts.held_out.n_episodes
    return held_out, parts.remaining.n_episodes


@cached()
def _held_out_counts(trees: Trees, held_out: Demonstrations) -> tuple[EpisodeCounts, ...]:
    return count_held_out(trees, held_out)


@cached()
def mined_landscape(
    trees: Trees,
    supports: tuple[float, ...],
    confidences: tuple[float, ...],
    *,
    lift: float,
    depth: int | None,
    held_out: Demonstrations | MinedData | None,
) -> Landscape:
    """The landscape over a grid.

    Returns:
        With a layer of what the held-out episodes say, where there are some.
    """
    if isinstance(held_out, MinedData):
        counts: tuple[EpisodeCounts, ...] | None = held_out.held_out
    else:
        counts = None if held_out is None else _held_out_counts(trees, held_out)
    return threshold_landscape(
        trees, supports, confidences, lift_min=lift, max_depth=depth, held_out=counts
    )


@cached(show_spinner="Counting what the rules forbid …")
def mined_never_landscape(
    trees: Trees, supports: tuple[float, ...], epsilons: tuple[float, ...], *, depth: int | None
) -> NeverLandscape:
    """The landscape of rules that forbid over a grid."""
    return never_landscape(trees, supports, epsilons, max_depth=depth)


@cached()
def best_trade_offs(trees: Trees, *, lift: float, depth: int | None) -> tuple[ParetoPoint, ...]:
    """The rule sets that no other one beats."""
    return pareto_front(trees, lift_min=lift, max_depth=depth)


@cached()
def largest_rules(trees: Trees, thresholds: Thresholds, most: int) -> TopRules:
    """The rules with the most support, without making the rest of a large set."""
    return top_rules(trees, thresholds, most)
