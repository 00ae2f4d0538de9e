"""Whether intervals hold what they promise: draws from episodes whose truth is known.

Of each task several hundred fresh episodes are recorded. Then, again and again, as many of them as
the shipped demonstrations have are drawn, rules are mined and told of as the product tells, and the
episodes that were not drawn say what is true. An interval of 95 % covers the truth in about 95 of
100 draws; one that always does is wider than it need be, and one that seldom does is none.

- **A rule**: mined from seven tenths of the episodes drawn, and tried on the rest. Its truth is
  its mean share right over all episodes of the pool that were not drawn and in which it applies.
- **A whole set**: cross-fitted over the episodes drawn. Its truth is what the rules mined from all
  of them come to in the rest of the pool: the mean share right, and the mean share covered.

Both at the paper's filtered and unfiltered thresholds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import Row
from sarl_core import Demonstrations, PolicyTree, grow_policy_trees
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.evidence import EpisodeCounts, HeldOut
from sarl_core.mining.rules import NAMED_SETTINGS, Thresholds
from sarl_core.mining.validation.cross_fitting import cross_fit
from sarl_core.mining.validation.episode_counts import count_applied
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.seeds import POOLED

TASKS = {"CartPole-v1": (150_000, 30), "LunarLander-v3": (75_000, 62)}
"""Steps of the pool, and how many episodes are drawn: as many as the shipped file has."""
HELD_OUT = 0.3
DRAWS = 100
LEAST, MOST = 0.92, 0.99


class Told(NamedTuple):
    """What is told of a rule or of a rule set, and what is true.

    Attributes:
        kind: As "rules, filtered".
        held_out: What is told.
        truth: What other episodes say; NaN where there is none.
    """

    kind: str
    held_out: HeldOut
    truth: float


@lru_cache
def pool(env_id: str, steps: int) -> Demonstrations:
    """Fresh episodes of the shipped expert, its actions sampled; all of them finished.

    Args:
        env_id: One of `TASKS`.
        steps: About how many.

    Returns:
        Recorded once.
    """
    recorded = record(env_id, "expert", steps=steps, seed=POOLED, stochastic=True)
    return recorded.select(np.arange(recorded.n_episodes - 1))


def applied(
    tree: PolicyTree, thresholds: Thresholds, demonstrations: Demonstrations
) -> EpisodeCounts:
    """Rules of a tree on pairs.

    Args:
        tree: With n nodes.
        thresholds: At which it is cut.
        demonstrations: N pairs.

    Returns:
        The counts, by the rule's place among the rules.
    """
    cut = cut_nodes(tree, supp_min=thresholds.support, conf_min=thresholds.confidence)
    rule = np.full(tree.n_nodes, -1)
    rule[cut] = np.arange(len(cut))
    for depth in range(1, int(tree.depth.max()) + 1):
        level = np.flatnonzero(tree.depth == depth)
        above = rule[tree.parent[level]]
        rule[level] = np.where(above >= 0, above, rule[level])
    found = rule[tree.apply(demonstrations.observations)]
    row = np.flatnonzero(found >= 0)
    shown = tree.dimension.labels_of(demonstrations.action_columns[row, tree.index])
    right = tree.label[cut[found[row]]] == shown
    return count_applied(len(cut), found[row], row, right, demonstrations)


def together(counts: EpisodeCounts) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All rules taken as one: pairs of each episode with a rule, and those that are right."""
    return counts.together(np.ones(counts.size, dtype=np.bool_))


def draws(
    env_id: str, count: int, *, steps: int, drawn: int, seed: int = 0
) -> Iterator[list[Told]]:
    """Draw demonstrations again and again.

    Args:
        env_id: One of `TASKS`.
        count: How often.
        steps: Of the pool.
        drawn: Episodes of a draw.
        seed: Of the draws.

    Yields:
        What is told of each draw, and what is true.
    """
    whole = pool(env_id, steps)
    rng = np.random.default_rng(seed)
    for number in range(count):
        order = rng.permutation(whole.n_episodes)
        some, others = whole.select(order[:drawn]), whole.select(order[drawn:])
        held = order[: max(round(HELD_OUT * drawn), 1)]
        kept_back = whole.select(held)
        (tree,) = grow_policy_trees(whole.select(order[len(held) : drawn]))
        (full,) = grow_policy_trees(some)
        fit = cross_fit(some, seed=number)
        found: list[Told] = []
        for name, thresholds in NAMED_SETTINGS.items():
            found += _rules(name, tree, thresholds, kept_back, others)
            judged = fit.at(thresholds)
            covered, correct = together(applied(full, thresholds, others))
            some_covered = covered > 0
            fidelity = (correct[some_covered] / covered[some_covered]).mean()
            coverage = (covered / others.episode_lengths).mean()
            found.append(Told(f"fidelity of sets, {name}", judged.fidelity, float(fidelity)))
            found.append(Told(f"coverage of sets, {name}", judged.coverage, float(coverage)))
        yield found


def _rules(
    name: str,
    tree: PolicyTree,
    thresholds: Thresholds,
    held_out: Demonstrations,
    others: Demonstrations,
) -> Iterator[Told]:
    told = applied(tree, thresholds, held_out).held_out()
    true = applied(tree, thresholds, others).held_out()
    for one, truth in zip(told, true, strict=True):
        yield Told(f"rules, {name}", one, float("nan") if truth.share is None else truth.share)


def intervals(quick: bool) -> Iterable[Row]:
    """How often an interval that is shown misses what is true: in 1 to 8 of 100 draws."""
    count = 20 if quick else DRAWS
    for env_id, (steps, drawn) in TASKS.items():
        told = [one for draw in draws(env_id, count, steps=steps, drawn=drawn) for one in draw]
        rules = [one for one in told if one.kind.startswith("rules")]
        sets = [one for one in told if not one.kind.startswith("rules")]
        for what, some in (("single rules", rules), ("whole rule sets", sets)):
            shown = [one for one in some if one.held_out.interval and one.truth == one.truth]
            missed = 1.0 - _covered(shown)
            yield Row(
                f"95 % intervals of {what} that miss, {env_id}, {count} draws",
                f"{1 - MOST:.0%} to {1 - LEAST:.0%}",
                "share",
                missed,
                1.0 - LEAST,
                _details(some),
                holds=missed >= 1.0 - MOST,
            )


def _covered(shown: list[Told]) -> float:
    inside = [
        one.held_out.interval.low <= one.truth <= one.held_out.interval.high
        for one in shown
        if one.held_out.interval is not None
    ]
    return float(np.mean(inside)) if inside else float("nan")


def _details(some: list[Told]) -> str:
    """Of each kind: how many are shown, how wide, and how often they cover."""
    texts = []
    for kind in dict.fromkeys(one.kind for one in some):
        of_kind = [one for one in some if one.kind == kind]
        shown = [one for one in of_kind if one.held_out.interval and one.truth == one.truth]
        widths = [
            one.held_out.interval.high - one.held_out.interval.low
            for one in shown
            if one.held_out.interval is not None
        ]
        none = 1.0 - len(shown) / max(len(of_kind), 1)
        texts.append(
            f"{kind}: covers {_covered(shown):.1%} of {len(shown):,}, mean width "
            f"{np.mean(widths) if widths else float('nan'):.3f}, none shown for {none:.1%}"
        )
    return "; ".join(texts)
