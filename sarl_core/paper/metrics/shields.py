"""Shielded novices (Figures 5 to 7)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import share_text
from sarl_core.paper.criteria import Measurement, Sample
from sarl_core.paper.shields import (
    ARMS,
    EXPERT,
    FILTERED,
    NOVICE,
    UNFILTERED,
    Runs,
    dividers_of,
    runs_of,
)
from sarl_core.paper.study import Frames
from sarl_core.paper.verdicts import Floats, Truths, over_recordings, share_over_recordings
from sarl_core.paper.words import interval, percent, shares

if TYPE_CHECKING:
    import pandas as pd

_NOVICE_RANGE = (8.0, 95.0)  # of the paper's lone novice on CartPole
_PAPERS_DIP = 167.0
_HALF = 0.5  # of the expert's typical return
NEARLY_ALL = 0.95  # of the episodes
AS_GOOD = 0.05  # of the way from the lone novice's typical return to the expert's
MORE_FAILURES = 0.05  # of the episodes


def first_runs(frame: pd.DataFrame) -> Runs:
    """The episodes with the first divider of a figure's table."""
    return runs_of(frame, dividers_of(frame)[0])


def lander_runs(frames: Frames) -> Runs:
    """The episodes of Figure 6, beside those of Figure 5 where its table is at hand."""
    beside = {"Cart Pole": first_runs(frames["5"])} if "5" in frames else {}
    return replace(first_runs(frames["6"]), beside=beside)


def walker_runs(frame: pd.DataFrame) -> Runs:
    """The episodes of Figure 7 with the paper's divider, beside those with finer ones."""
    finer = {f"divider {divider}": runs_of(frame, divider) for divider in dividers_of(frame)[1:]}
    return replace(first_runs(frame), beside=finer)


def _means(runs: Runs, *arms: str) -> dict[str, float]:
    return {arm: runs.over(arm).mean for arm in arms}


def _typical(runs: Runs, *arms: str) -> str:
    return "Typical returns: " + ", ".join(f"{arm} {runs.in_words(arm)}" for arm in arms)


def _gained(runs: Runs) -> Floats:
    """How much more unfiltered rules bring than filtered ones, in parts of the way."""
    return np.asarray(runs.way(runs.typical(UNFILTERED)) - runs.way(runs.typical(FILTERED)))


# --- CartPole ------------------------------------------------------------------------------------


def expert_ahead(runs: Runs) -> Measurement:
    """Whether the expert's typical return is above that of every other."""
    others = [arm for arm in ARMS if arm != EXPERT]
    ahead = 1.0 - np.max([runs.way(runs.typical(arm)) for arm in others], axis=0)
    return Measurement(
        (Sample(ahead > 0, runs.experts, in_part=ahead >= -AS_GOOD),),
        f"{_typical(runs, EXPERT, *others)}.",
        _means(runs, *ARMS),
    )


def novice_range(runs: Runs) -> Measurement:
    """The share of the lone novice's episodes that are within the paper's range."""
    values = runs.returns[NOVICE]
    inside = (values >= _NOVICE_RANGE[0]) & (values <= _NOVICE_RANGE[1])
    return Measurement(
        (Sample(inside, runs.experts),),
        f"It varies between {rounded_text(values.min())} and {rounded_text(values.max())}; "
        f"{share_text(float(inside.mean()))} of {values.size} episodes are within the paper's "
        "range.",
        {"least": float(values.min()), "greatest": float(values.max())},
    )


def reaching_the_expert(runs: Runs, arm: str) -> Measurement:
    """The share of an arm's episodes that reach the lower quartile of the expert's."""
    levels = np.quantile(runs.returns[EXPERT], 0.25, axis=1, keepdims=True)
    reached = Sample(runs.returns[arm] >= levels, runs.experts)
    return Measurement(
        (reached,),
        f"{shares(reached.interval)} of its episodes reach what three quarters of the expert's do "
        f"({rounded_text(levels.mean())}); it has {runs.in_words(arm)}, the expert "
        f"{runs.in_words(EXPERT)}.",
        {"level": float(levels.mean())},
    )


def _dips(runs: Runs, arm: str) -> tuple[Truths, Floats]:
    """Which episodes of an arm are dips, (R, E), and below which return, (R, 1)."""
    deep = _HALF * runs.typical(EXPERT)[:, None]
    return runs.returns[arm] < deep, deep


def dips(runs: Runs) -> Measurement:
    """Whether there are dips with unfiltered rules."""
    dipped, deep = _dips(runs, UNFILTERED)
    lowest = float(runs.returns[UNFILTERED].min())
    return Measurement(
        (Sample(np.any(dipped, axis=1), runs.experts),),
        f"The lowest return is {rounded_text(lowest)}; "
        f"{shares(share_over_recordings(dipped, runs.experts))} of the episodes are below "
        f"{rounded_text(deep.mean())}, half of the expert's typical return.",
        {"lowest": lowest, "share": float(dipped.mean()), "paper": _PAPERS_DIP},
    )


def dips_beat_the_novice(runs: Runs) -> Measurement:
    """Whether the median of the dips is above what the lone novice stays below."""
    dipped, _ = _dips(runs, UNFILTERED)
    there = np.any(dipped, axis=1)
    alone = runs.returns[NOVICE]
    tops, means = np.quantile(alone, NEARLY_ALL, axis=1), alone.mean(axis=1)
    middles = np.array(
        [
            float(np.median(values[own])) if own.any() else np.nan
            for values, own in zip(runs.returns[UNFILTERED], dipped, strict=True)
        ]
    )
    middle = (
        f"in the middle to {rounded_text(float(np.nanmedian(middles)))}"
        if there.any()
        else "so there is nothing to judge"
    )
    return Measurement(
        (Sample(middles > tops, runs.experts, in_part=middles > means, judged=there),),
        f"There are dips in {int(there.sum())} of {there.size} recordings, {middle}; alone the "
        f"novice has {rounded_text(alone.mean())} on average, and less than "
        f"{rounded_text(float(tops.mean()))} in 95 % of the episodes.",
        {"recordings_with_dips": float(there.sum()), "alone": float(alone.mean())},
    )


def better_with_rules(runs: Runs) -> Measurement:
    """The share of the seeds on which unfiltered rules bring a higher return."""
    better = Sample(runs.returns[UNFILTERED] > runs.returns[NOVICE], runs.experts)
    return Measurement(
        (better,),
        f"With the rules the return is higher in {shares(better.interval)} of the episodes, seed "
        f"for seed; alone the novice has {runs.in_words(NOVICE)}, with them "
        f"{runs.in_words(UNFILTERED)}.",
    )


def filtered_and_unfiltered(runs: Runs) -> Measurement:
    """How far the two rule sets are apart."""
    return Measurement(
        (Sample(-_gained(runs), runs.experts),),
        f"{_typical(runs, FILTERED, UNFILTERED)}; the novice alone {runs.in_words(NOVICE)}.",
        _means(runs, FILTERED, UNFILTERED),
    )


# --- LunarLander ---------------------------------------------------------------------------------


def order(runs: Runs) -> Measurement:
    """The mean returns of the expert, with unfiltered, with filtered rules, and alone."""
    means = {arm: runs.returns[arm].mean(axis=1) for arm in (EXPERT, UNFILTERED, FILTERED, NOVICE)}
    each = ", ".join(
        f"{arm} {interval(over_recordings(own, runs.experts))}, failing in {runs.failures(arm)}"
        for arm, own in means.items()
    )
    return Measurement(
        tuple(Sample(more - less, runs.experts) for more, less in pairwise(means.values())),
        f"Mean returns: {each}.",
        {arm: float(own.mean()) for arm, own in means.items()},
    )


def following(runs: Runs) -> Measurement:
    """How far filtered rules are behind unfiltered ones, if these bring anything at all."""
    many, some = (runs.way(runs.typical(arm)) for arm in (UNFILTERED, FILTERED))
    way = over_recordings(many, runs.experts)
    return Measurement(
        (Sample(_gained(runs), runs.experts),),
        f"{_typical(runs, UNFILTERED, FILTERED)}; the lone novice {runs.in_words(NOVICE)}.",
        {"unfiltered_way": way.mean, "filtered_way": float(some.mean())},
        no_better_than="cannot be judged" if way.low <= 0 else "agrees",
    )


def deeper_falls(lander: Runs) -> Measurement | None:
    """How much deeper the lowest tenth of the episodes lies than on Cart Pole."""
    if not lander.beside:
        return None
    (cart,) = lander.beside.values()
    count = min(len(lander.experts), len(cart.experts))  # one may be of a quick run
    depths = {
        arm: (_depth(lander, arm)[:count], _depth(cart, arm)[:count])
        for arm in (FILTERED, UNFILTERED)
    }
    each = ", ".join(
        f"{arm} {percent(float(here.mean()))} (Cart Pole {percent(float(there.mean()))})"
        for arm, (here, there) in depths.items()
    )
    return Measurement(
        tuple(Sample(here - there, lander.experts[:count]) for here, there in depths.values()),
        "The lowest tenth of the episodes lies below the typical one by, of the way from novice to "
        f"expert: {each}.",
        {arm: float(here.mean()) for arm, (here, _) in depths.items()},
    )


def _depth(runs: Runs, arm: str) -> Floats:
    low = np.quantile(runs.returns[arm], 0.1, axis=1)
    return np.asarray(runs.way(runs.typical(arm)) - runs.way(low))


def more_rules(runs: Runs) -> Measurement:
    """How much more unfiltered rules bring than filtered ones."""
    return Measurement(
        (Sample(_gained(runs), runs.experts),),
        f"{_typical(runs, FILTERED, UNFILTERED)}.",
        _means(runs, FILTERED, UNFILTERED),
    )


def by_the_shield_alone(runs: Runs) -> Measurement:
    """How much of the way unfiltered rules bring, if no more episodes fail."""
    way = runs.way(runs.typical(UNFILTERED))
    failed = runs.failed[UNFILTERED].astype(np.float64) - runs.failed[EXPERT]
    more = over_recordings(failed.mean(axis=1), runs.experts)
    return Measurement(
        (Sample(way, runs.experts),),
        f"With unfiltered rules the typical return is {runs.in_words(UNFILTERED)}, "
        f"{percent(float(way.mean()))} of the way from the lone novice ({runs.in_words(NOVICE)}) "
        f"to the expert ({runs.in_words(EXPERT)}).",
        {**_means(runs, UNFILTERED, EXPERT), "more_failures": more.mean},
        no_better_than="partly" if more.high > MORE_FAILURES else "agrees",
    )


# --- BipedalWalker -------------------------------------------------------------------------------


def expert_drops(runs: Runs) -> Measurement:
    """The share of the expert's episodes that are dips."""
    values = runs.returns[EXPERT]
    dropped = Sample(_dips(runs, EXPERT)[0], runs.experts)
    return Measurement(
        (dropped,),
        f"Our experts have a typical return of {runs.in_words(EXPERT)}, a mean of "
        f"{rounded_text(values.mean())} and at least {rounded_text(values.min())}; "
        f"{shares(dropped.interval)} of their episodes are below half of the typical return.",
        {"mean_return": float(values.mean()), "lowest": float(values.min())},
    )


def behind_the_expert(runs: Runs) -> Measurement:
    """How far the novice with unfiltered rules is behind the expert."""
    return Measurement(
        (Sample(1.0 - runs.way(runs.typical(UNFILTERED)), runs.experts),),
        f"Typical returns with divider {runs.divider}: {runs.in_words(UNFILTERED)} with the rules, "
        f"{runs.in_words(EXPERT)} for the expert.",
        _means(runs, UNFILTERED, EXPERT),
    )


def what_rules_bring(runs: Runs, arm: str) -> Measurement:
    """How much of the way rules bring."""
    way = runs.way(runs.typical(arm))
    return Measurement(
        (Sample(way, runs.experts),),
        f"Typical returns with divider {runs.divider}: {runs.in_words(arm)} with the rules, "
        f"{runs.in_words(NOVICE)} without: {percent(float(way.mean()))} of the way to the expert.",
        {"with": runs.over(arm).mean, "without": runs.over(NOVICE).mean},
    )


def half_of_the_way(runs: Runs) -> Measurement:
    """The share of the episodes with rules that get half of the way to the expert."""
    levels = 0.5 * (runs.typical(NOVICE) + runs.typical(EXPERT))
    both = np.concatenate([runs.returns[arm] for arm in (FILTERED, UNFILTERED)], axis=1)
    reached = Sample(both >= levels[:, None], runs.experts)
    return Measurement(
        (reached,),
        f"With divider {runs.divider}, the best of {both.size} episodes with rules returns "
        f"{rounded_text(both.max())}; {shares(reached.interval)} of them get half of the way from "
        f"the lone novice to the expert, to {rounded_text(float(levels.mean()))}.",
        {"best": float(both.max()), "level": float(levels.mean())},
    )


def finer_division(runs: Runs) -> Measurement | None:
    """What finer dividers bring over the paper's."""
    if not runs.beside:
        return None
    every = {f"divider {runs.divider}": runs, **runs.beside}
    coarse = runs.way(runs.typical(UNFILTERED))
    typical = ", ".join(f"{name} {one.in_words(UNFILTERED)}" for name, one in every.items())
    return Measurement(
        tuple(
            Sample(runs.way(finer.typical(UNFILTERED)) - coarse, runs.experts)
            for finer in runs.beside.values()
        ),
        f"Typical returns with unfiltered rules: {typical}.",
        {name.replace(" ", "_"): one.over(UNFILTERED).mean for name, one in every.items()},
    )
