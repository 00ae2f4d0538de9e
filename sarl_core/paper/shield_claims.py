"""What the paper says of shielded novices (Figures 5 and 6), held against our episodes."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from sarl_core.mining.language import share_text
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
from sarl_core.paper.verdicts import (
    Claim,
    Finding,
    Floats,
    Truths,
    above,
    claim,
    in_most,
    over_recordings,
    share_over_recordings,
    together,
    within,
)
from sarl_core.paper.words import interval, number, percent, shares

_NOVICE_RANGE = (8.0, 95.0)  # of the paper's lone novice on CartPole
_PAPERS_DIP = 167.0
HALF = 0.5  # of the expert's typical return
OFTEN, SOMETIMES = 0.1, 0.05  # shares of episodes that are some, and that are too few to be
_NEARLY_ALL, _MOST = 0.95, 0.8  # shares of episodes
# Parts of the way from the lone novice's typical return to the expert's.
AS_GOOD = 0.05
SIMILAR, OTHER = 0.1, 0.5
_CLOSELY = 0.2
_MOST_OF_THE_WAY = 0.8
_MORE_FAILURES = 0.05  # of the episodes

WAY = "in parts of the way from the lone novice's typical return (IQM) to the expert's"


def cart_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of CartPole.

    Args:
        frames: With the table of Figure 5.

    Returns:
        Its claims and ours.
    """
    runs = first_runs(frames, "5")
    return (
        _expert_best(runs, "Figure 5"),
        _novice_range(runs),
        _as_the_expert_in_parts(runs, UNFILTERED, "Figure 5"),
        _dips(runs),
        _dips_beat_the_novice(runs),
        _always_better(runs),
        _filtered_similar(runs),
    )


def lander_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of LunarLander.

    Args:
        frames: With the table of Figure 6; one claim needs that of Figure 5 too.

    Returns:
        Its claims and ours.
    """
    runs = first_runs(frames, "6")
    claims = [
        _order(runs),
        _closely_followed(runs),
        _as_the_expert_in_parts(runs, FILTERED, "Figure 6"),
        _more_rules(runs),
        _by_the_shield_alone(runs),
    ]
    if "5" in frames:
        claims.insert(3, _deeper_falls(runs, first_runs(frames, "5")))
    return tuple(claims)


def first_runs(frames: Frames, name: str) -> Runs:
    """The episodes of each arm with the first divider of a figure's table."""
    return runs_of(frames[name], dividers_of(frames[name])[0])


# --- CartPole ------------------------------------------------------------------------------------


def _expert_best(runs: Runs, where: str) -> Claim:
    others = [arm for arm in ARMS if arm != EXPERT]
    ahead = 1.0 - np.max([runs.way(runs.typical(arm)) for arm in others], axis=0)
    return claim(
        in_most(ahead > 0, runs.experts, in_part=ahead >= -AS_GOOD),
        paper="The expert performs best.",
        where=where,
        ours="Typical returns: "
        + ", ".join(f"{arm} {runs.told(arm)}" for arm in (EXPERT, *others))
        + ".",
        measured="Holds in a recording if the typical return of the expert is above that of every "
        f"other, in part if it is no more than {percent(AS_GOOD)} of the way from the lone novice "
        "to the expert below the best.",
        numbers={arm: runs.over(arm).mean for arm in ARMS},
    )


def _novice_range(runs: Runs) -> Claim:
    values = runs.returns[NOVICE]
    low, high = _NOVICE_RANGE
    inside = (values >= low) & (values <= high)
    return claim(
        share_above(inside, runs.experts, agrees=_NEARLY_ALL, partly=_MOST),
        paper="The lone novice's return varies between 8 and 95.",
        where="text on Figure 5",
        ours=f"It varies between {number(values.min())} and {number(values.max())}; "
        f"{share_text(float(inside.mean()))} of {values.size} episodes are within the paper's "
        "range.",
        measured="The share of the episodes with a return from 8 to 95.",
        numbers={"least": float(values.min()), "greatest": float(values.max())},
    )


def share_above(
    found: Truths, experts: tuple[str, ...], *, agrees: float, partly: float
) -> Finding:
    """Hold the share of episodes in which something is so, (R, E), against two bounds."""
    return above(
        found.mean(axis=1),
        experts,
        agrees=agrees,
        partly=partly,
        interval=share_over_recordings(found, experts),
    )


def _as_the_expert_in_parts(runs: Runs, name: str, where: str) -> Claim:
    levels = np.quantile(runs.returns[EXPERT], 0.25, axis=1, keepdims=True)
    reached = runs.returns[name] >= levels
    said = (
        "With unfiltered rules, the novice does as well as the expert in parts."
        if name == UNFILTERED
        else "With filtered rules, the novice reaches the level of the expert in places."
    )
    return claim(
        share_above(reached, runs.experts, agrees=OFTEN, partly=SOMETIMES),
        paper=said,
        where=where,
        ours=f"{shares(share_over_recordings(reached, runs.experts))} of its episodes reach what "
        f"three quarters of the expert's do ({number(levels.mean())}); it has "
        f"{runs.told(name)}, the expert {runs.told(EXPERT)}.",
        measured="The share of the episodes that reach the lower quartile of the expert's.",
        numbers={"level": float(levels.mean())},
    )


def _dipped(runs: Runs) -> tuple[Truths, Floats]:
    """Which episodes with unfiltered rules are dips, (R, E), and below which return, (R, 1)."""
    deep = HALF * runs.typical(EXPERT)[:, None]
    return runs.returns[UNFILTERED] < deep, deep


def _dips(runs: Runs) -> Claim:
    dipped, deep = _dipped(runs)
    lowest = float(runs.returns[UNFILTERED].min())
    return claim(
        in_most(dipped.any(axis=1), runs.experts, existence=True),
        paper="With unfiltered rules there are sharp dips in some episodes, to a return of 167.",
        where="text on Figure 5",
        ours=f"The lowest return is {number(lowest)}; "
        f"{shares(share_over_recordings(dipped, runs.experts))} of the episodes are below "
        f"{number(deep.mean())}, half of the expert's typical return.",
        measured="Holds in a recording if one of its episodes at least is below half of the "
        "expert's typical return.",
        numbers={"lowest": lowest, "share": float(dipped.mean()), "paper": _PAPERS_DIP},
    )


def _dips_beat_the_novice(runs: Runs) -> Claim:
    dipped, _ = _dipped(runs)
    there = dipped.any(axis=1)
    alone = runs.returns[NOVICE]
    tops, means = np.quantile(alone, _NEARLY_ALL, axis=1), alone.mean(axis=1)
    middles = np.array(
        [
            float(np.median(values[dips])) if dips.any() else np.nan
            for values, dips in zip(runs.returns[UNFILTERED], dipped, strict=True)
        ]
    )
    found = in_most(
        middles > tops,
        runs.experts,
        in_part=middles > means,
        judged=there,
    )
    return claim(
        found,
        paper="Even in these dips the novice with unfiltered rules does clearly better than alone.",
        where="text on Figure 5",
        ours=f"There are dips in {int(there.sum())} of {there.size} recordings"
        + (
            f", in the middle to {number(float(np.nanmedian(middles)))}"
            if there.any()
            else ", so there is nothing to judge"
        )
        + f"; alone the novice has {number(alone.mean())} on average, and less than "
        f"{number(float(tops.mean()))} in 95 % of the episodes.",
        measured="Holds in a recording with dips if their median is above what the lone novice "
        "stays below in 95 % of its episodes, in part if it is above the lone novice's mean.",
        numbers={"recordings_with_dips": float(there.sum()), "alone": float(alone.mean())},
    )


def _always_better(runs: Runs) -> Claim:
    better = runs.returns[UNFILTERED] > runs.returns[NOVICE]
    return claim(
        share_above(better, runs.experts, agrees=_NEARLY_ALL, partly=_MOST),
        paper="Unfiltered rules improve the novice's performance consistently.",
        where="text on Figure 5",
        ours="With the rules the return is higher in "
        f"{shares(share_over_recordings(better, runs.experts))} of the episodes, seed for seed; "
        f"alone the novice has {runs.told(NOVICE)}, with them {runs.told(UNFILTERED)}.",
        measured="The share of the seeds on which the return is higher with the rules.",
    )


def _filtered_similar(runs: Runs) -> Claim:
    apart = runs.way(runs.typical(FILTERED)) - runs.way(runs.typical(UNFILTERED))
    return claim(
        within(apart, runs.experts, agrees=SIMILAR, partly=OTHER),
        paper="With filtered rules the result is similar to that with unfiltered ones.",
        where="text on Figure 5",
        ours=f"Typical returns: filtered {runs.told(FILTERED)}, unfiltered "
        f"{runs.told(UNFILTERED)}; the novice alone {runs.told(NOVICE)}.",
        measured=f"How far the two are apart, {WAY}.",
        numbers={
            "filtered": runs.over(FILTERED).mean,
            "unfiltered": runs.over(UNFILTERED).mean,
        },
    )


# --- LunarLander ---------------------------------------------------------------------------------


def _order(runs: Runs) -> Claim:
    arms = (EXPERT, UNFILTERED, FILTERED, NOVICE)
    means = {name: runs.returns[name].mean(axis=1) for name in arms}
    steps = [
        above(means[higher] - means[lower], runs.experts, agrees=0, partly=0)
        for higher, lower in pairwise(arms)
    ]
    shown = sum(step.verdict == "agrees" for step in steps)
    turned = any(step.verdict == "does not agree" for step in steps)
    found = together(
        steps,
        "Agrees if the whole 95 % interval over recordings and experts of each of the three "
        "differences of means lies above 0, partly if of two; does not agree if one lies below 0; "
        "else it cannot be judged.",
    )
    if found.verdict == "partly" and shown < 2:
        found = replace(found, verdict="does not agree" if turned else "cannot be judged")
    told = ", ".join(
        f"{name} {interval(over_recordings(means[name], runs.experts))}, failing in "
        f"{shares(share_over_recordings(runs.failed[name], runs.experts))}"
        for name in arms
    )
    return claim(
        found,
        paper="The average return is highest for the expert, then with unfiltered rules, then with "
        "filtered rules, and lowest for the lone novice.",
        where="Figure 6",
        ours=f"Mean returns: {told}.",
        measured="The mean returns of one recording, each against the next.",
        numbers={name: float(values.mean()) for name, values in means.items()},
    )


def _closely_followed(runs: Runs) -> Claim:
    many, some = runs.way(runs.typical(UNFILTERED)), runs.way(runs.typical(FILTERED))
    found = within(many - some, runs.experts, agrees=_CLOSELY, partly=OTHER)
    gained = over_recordings(many, runs.experts)
    if gained.low <= 0:  # there is nothing that they could follow
        found = replace(found, verdict="cannot be judged")
    return claim(
        found,
        paper="The novice with filtered rules follows closely behind the one with unfiltered "
        "rules.",
        where="text on Figure 6",
        ours=f"Typical returns: unfiltered {runs.told(UNFILTERED)}, filtered "
        f"{runs.told(FILTERED)}; the lone novice {runs.told(NOVICE)}.",
        measured=f"How far the two are apart, {WAY}; not judged unless unfiltered rules are shown "
        "to bring anything at all.",
        numbers={"unfiltered_way": gained.mean, "filtered_way": float(some.mean())},
    )


def _deeper_falls(lander: Runs, cart: Runs) -> Claim:
    count = min(len(lander.experts), len(cart.experts))  # one may be of a quick run
    depths = {
        name: (_depth(lander, name)[:count], _depth(cart, name)[:count])
        for name in (FILTERED, UNFILTERED)
    }
    parts = [
        above(here - there, lander.experts[:count], agrees=0, partly=0)
        for here, there in depths.values()
    ]
    told = ", ".join(
        f"{name} {percent(float(here.mean()))} (Cart Pole {percent(float(there.mean()))})"
        for name, (here, there) in depths.items()
    )
    return claim(
        together(parts, f"{parts[0].rule} So for both rule sets; partly, if for one."),
        paper="Falls downwards are more pronounced than on CartPole.",
        where="text on Figure 6",
        ours="The lowest tenth of the episodes lies below the typical one by, of the way from "
        f"novice to expert: {told}.",
        measured="The distance from the typical return to the lowest tenth of a recording's "
        f"episodes, {WAY}, less that of a recording on Cart Pole.",
        numbers={name: float(here.mean()) for name, (here, _) in depths.items()},
    )


def _depth(runs: Runs, name: str) -> Floats:
    low = np.quantile(runs.returns[name], 0.1, axis=1)
    return np.asarray(runs.way(runs.typical(name)) - runs.way(low))


def _more_rules(runs: Runs) -> Claim:
    gained = runs.way(runs.typical(UNFILTERED)) - runs.way(runs.typical(FILTERED))
    return claim(
        above(gained, runs.experts, agrees=0, partly=-AS_GOOD),
        paper="More rules improve the performance of the agent.",
        where="text on Figure 6",
        ours=f"Typical returns: filtered {runs.told(FILTERED)}, unfiltered "
        f"{runs.told(UNFILTERED)}.",
        measured=f"How much more the unfiltered rules bring than the filtered ones, {WAY}.",
        numbers={
            "filtered": runs.over(FILTERED).mean,
            "unfiltered": runs.over(UNFILTERED).mean,
        },
    )


def _by_the_shield_alone(runs: Runs) -> Claim:
    way = runs.way(runs.typical(UNFILTERED))
    found = above(way, runs.experts, agrees=1 - AS_GOOD, partly=_MOST_OF_THE_WAY)
    more = over_recordings(
        (runs.failed[UNFILTERED].astype(np.float64) - runs.failed[EXPERT]).mean(axis=1),
        runs.experts,
    )
    if found.verdict == "agrees" and more.high > _MORE_FAILURES:
        found = replace(found, verdict="partly")
    return claim(
        found,
        paper="The expert's performance can be reached by the shield alone.",
        where="Lessons Learned",
        ours=f"With unfiltered rules the typical return is {runs.told(UNFILTERED)}, "
        f"{percent(float(way.mean()))} of the way from the lone novice ({runs.told(NOVICE)}) to "
        f"the expert ({runs.told(EXPERT)}).",
        measured=f"The typical return with unfiltered rules, {WAY}; agrees only if it is also "
        f"shown that no more than {percent(_MORE_FAILURES)} more of the episodes fail.",
        numbers={
            "unfiltered": runs.over(UNFILTERED).mean,
            "expert": runs.over(EXPERT).mean,
            "more_failures": more.mean,
        },
    )
