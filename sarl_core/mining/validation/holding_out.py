"""Rules on episodes that they were not mined from, and how sure one can be of each.

Whole episodes are held out, because the steps within one are alike: a rule that has seen half of an
episode knows the other half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError
from sarl_core.mining.evidence import FEWEST_EPISODES, EpisodeCounts, HeldOut, held_out_of, t_reach
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.episode_counts import count_nodes, count_rules

Verdict = Literal["below", "open", "reached", "unknown"]
Floats = NDArray[np.float64]

_MOST_EPISODES = 2.0**30


class Split(NamedTuple):
    """Demonstrations in two parts, by whole episodes.

    Attributes:
        mined: What rules are mined from.
        held_out: What they are tried on.
    """

    mined: Demonstrations
    held_out: Demonstrations


def hold_out(demonstrations: Demonstrations, share: float, *, seed: int = 0) -> Split:
    """Hold out some episodes, drawn by chance.

    Args:
        demonstrations: E episodes.
        share: Of the episodes to hold out, above 0 and below 1; rounded to whole episodes, and at
            least one.
        seed: Same seed, same episodes. A larger share holds out the same ones and more.

    Returns:
        Both parts, each in its present order.

    Raises:
        InputError: If the share, or the number of episodes, leaves none for one of the parts, or
            the pairs are a sample.
    """
    require_every_step(demonstrations, "holding out other episodes")
    if not 0.0 < share < 1.0:
        raise InputError(
            f"the held-out share is {share:g}; give one above 0 and below 1, so that there are "
            "episodes to mine from and others to try the rules on"
        )
    episodes = demonstrations.episodes[demonstrations.episode_starts]
    count = len(episodes)
    held = max(round(share * count), 1)
    if held >= count:
        there = "one episode" if count == 1 else f"{count} episodes"
        raise InputError(
            f"a held-out share of {share:g} of {there} leaves none to mine from; "
            + ("give more episodes" if count == 1 else "give a smaller share")
        )
    drawn = np.random.default_rng(seed).permutation(count)[:held]
    rest = np.setdiff1d(np.arange(count), drawn)
    return Split(demonstrations.select(episodes[rest]), demonstrations.select(episodes[drawn]))


def with_held_out(rule_set: RuleSet, held_out: Demonstrations) -> RuleSet:
    """Try every rule on pairs that it was not mined from.

    Args:
        rule_set: Its rules.
        held_out: Pairs of other episodes.

    Returns:
        The same rules with `Rule.held_out`.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    held_out = recoded(held_out, rule_set.source.features, called="the demonstrations")
    rule_set = rules_for(rule_set, held_out).rule_set
    counts = count_rules(rule_set, held_out).held_out()
    return replace(
        rule_set,
        rules=tuple(
            replace(rule, held_out=one) for rule, one in zip(rule_set.rules, counts, strict=True)
        ),
    )


def with_untried_held_out(rule_set: RuleSet, held_out: Demonstrations) -> RuleSet:
    """Try the rules on held-out pairs that were not tried yet, as those written by hand.

    Args:
        rule_set: Its rules.
        held_out: Pairs of other episodes.

    Returns:
        The same rules, each with `Rule.held_out`; the set itself where none was missing.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    if all(rule.held_out is not None for rule in rule_set.rules):
        return rule_set
    held_out = recoded(held_out, rule_set.source.features, called="the demonstrations")
    rule_set = rules_for(rule_set, held_out).rule_set
    untried = tuple(rule for rule in rule_set.rules if rule.held_out is None)
    tried = iter(with_held_out(replace(rule_set, rules=untried), held_out).rules)
    return replace(
        rule_set,
        rules=tuple(next(tried) if rule.held_out is None else rule for rule in rule_set.rules),
    )


def count_held_out(
    trees: Sequence[PolicyTree], held_out: Demonstrations
) -> tuple[EpisodeCounts, ...]:
    """Send other pairs down trees and count them at every node, for the landscape.

    Args:
        trees: One an action dimension.
        held_out: Pairs of other episodes.

    Returns:
        One entry a tree.
    """
    return tuple(count_nodes(tree, held_out) for tree in trees)


# --- how sure one can be ------------------------------------------------------------------------
# What a rule was mined from says nothing here: the rule was chosen for being right there.


def lower_bound(rule: Rule) -> float:
    """Lower end of the held-out interval; 0 where there is none, since nothing is known then."""
    return 0.0 if rule.held_out is None else rule.held_out.low or 0.0


def best_lower_bound(episodes: int) -> float:
    """The largest `lower_bound` there is with so many held-out episodes.

    Args:
        episodes: Held out, 0 or more.

    Returns:
        That of a rule that applies in each of them and is never wrong; 0 where they are too few
        for any interval.
    """
    return held_out_of([1] * episodes, [1] * episodes).low or 0.0


def least_confidence(rule: Rule, thresholds: Thresholds) -> float:
    """What the confidence of a rule has to reach: of one that forbids, all but epsilon."""
    return 1.0 - (thresholds.never or 0.0) if rule.forbids else thresholds.confidence


def verdict(rule: Rule, threshold: float) -> Verdict:
    """What the held-out episodes say of a rule's confidence.

    Args:
        rule: With what was held out, if anything was.
        threshold: The minimum confidence.

    Returns:
        "below" if the whole interval lies below the threshold, "reached" if none of it does,
        "open" between the two, and "unknown" where there is no interval.
    """
    interval = None if rule.held_out is None else rule.held_out.interval
    if interval is None:
        return "unknown"
    if interval.high < threshold:
        return "below"
    return "reached" if interval.low >= threshold else "open"


class Shortfall(NamedTuple):
    """How many rules reach a lower bound, and why the others do not.

    Attributes:
        least: That `lower_bound` has to be.
        episodes: Held out.
        reached: Rules that reach it.
        too_few: Rules met in so few of these episodes that they could not, were they never wrong.
        wrong: The others: met in enough, and not right often enough.
        best: The largest `lower_bound` of any; 0 where nothing is known of one.
    """

    least: float
    episodes: int
    reached: int
    too_few: int
    wrong: int
    best: float

    @property
    def rules(self) -> int:
        """How many there are."""
        return self.reached + self.too_few + self.wrong


def shortfall(rules: Sequence[Rule], least: float, episodes: int) -> Shortfall:
    """Tell rules that were met too rarely for a lower bound from those that are too often wrong.

    Args:
        rules: With what was held out.
        least: Of the `lower_bound`, 0 to 1.
        episodes: Held out.

    Returns:
        Their numbers.
    """
    bounds = [lower_bound(rule) for rule in rules]
    met = [
        0 if rule.held_out is None else rule.held_out.episodes
        for rule, bound in zip(rules, bounds, strict=True)
        if bound < least
    ]
    enough = {count: best_lower_bound(count) >= least for count in set(met)}
    wrong = sum(enough[count] for count in met)
    return Shortfall(
        least, episodes, len(bounds) - len(met), len(met) - wrong, wrong, max(bounds, default=0.0)
    )


def with_lower_bound(rule_set: RuleSet, least: float) -> RuleSet:
    """Keep the rules of whose confidence one can be sure.

    Args:
        rule_set: With what was held out.
        least: Of the `lower_bound`, 0 to 1.

    Returns:
        The rules that reach it, in their order; all of them at 0.

    Raises:
        InputError: If the bound is no share.
    """
    if not 0.0 <= least <= 1.0:
        raise InputError(f"the lower bound is {least:g}; give a share from 0 to 1")
    return replace(
        rule_set, rules=tuple(rule for rule in rule_set.rules if lower_bound(rule) >= least)
    )


def episodes_needed(share: Floats, spread: Floats, threshold: float | Floats) -> Floats:
    """Episodes after which the lower end of the interval reaches a threshold.

    Args:
        share: Mean share of an episode, which stays so, (R,).
        spread: Variance of these shares between episodes, which stays so too, (R,).
        threshold: To be reached, by all or by each, (R,).

    Returns:
        Whole numbers; infinity where it is never reached, or not within `_MOST_EPISODES`.
    """
    apart = np.square(share - 0.5)

    def reached(n: Floats) -> NDArray[np.bool_]:
        mean = (n * share + 0.5) / (n + 1.0)
        squares = (n - 1.0) * spread + n / (n + 1.0) * apart
        return np.asarray(mean - t_reach(n + 1.0, squares) >= threshold)

    low = np.full(share.shape, float(FEWEST_EPISODES - 1))  # never enough
    high = np.full(share.shape, _MOST_EPISODES)
    never = ~reached(high)
    while (high - low > 1.0).any():
        middle = np.floor((low + high) / 2.0)
        enough = reached(middle)
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.where(never, np.inf, high)


def more_episodes(
    rules: Sequence[Rule], episodes: int, thresholds: Thresholds
) -> tuple[float, ...]:
    """Episodes still missing until each `lower_bound` is what it has to be, at the present rate.

    Of every further episodes, the same share is held out, and a rule applies in the same share of
    those; it is right in them as often as so far, and as unevenly.

    Args:
        rules: With what was held out.
        episodes: Demonstrated so far, the held-out ones among them.
        thresholds: Of the rules, as `least_confidence` reads them.

    Returns:
        Whole numbers, 0 where it is reached; infinity where it never is at this rate, and NaN
        where too few episodes were held out to say.
    """
    needed = np.full(len(rules), np.nan)
    known = [
        (place, rule.held_out, rule.held_out.share)
        for place, rule in enumerate(rules)
        if rule.held_out is not None
        and rule.held_out.share is not None
        and rule.held_out.interval is not None
    ]
    if not known:
        return tuple(needed.tolist())
    place = [at for at, _, _ in known]
    share = np.array([share for _, _, share in known])
    there = np.array([held.episodes for _, held, _ in known], dtype=np.float64)
    spread = np.array([_spread(held) for _, held, _ in known])
    least = np.array([least_confidence(rules[at], thresholds) for at in place])
    missing = episodes_needed(share, spread, least) - there
    more = np.maximum(np.ceil(missing * episodes / there), 1.0)
    sure = np.array([held.low or 0.0 for _, held, _ in known]) >= least
    needed[place] = np.where(sure, 0.0, more)
    return tuple(needed.tolist())


def _spread(held: HeldOut) -> float:
    """Variance between the shares of the episodes, which its interval tells."""
    n, share = float(held.episodes), float(held.share or 0.0)
    low, high = float(held.low or 0.0), 1.0 if held.high is None else held.high
    mean = (n * share + 0.5) / (n + 1.0)
    if low <= 0.0 and high >= 1.0:
        return share * (1.0 - share) * n / (n - 1.0)  # both ends are cut off: the most there can be
    reach = mean - low if low > 0.0 else high - mean
    one = float(t_reach(np.array(n + 1.0), np.array(1.0)))
    squares = (reach / one) ** 2 - n / (n + 1.0) * (share - 0.5) ** 2
    return max(squares, 0.0) / (n - 1.0)
