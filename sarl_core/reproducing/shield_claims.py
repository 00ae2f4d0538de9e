"""What the paper says of shielded novices (Figures 5 and 6), held against our episodes."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.language import share_text
from sarl_core.reproducing.shields import (
    ARMS,
    EXPERT,
    FILTERED,
    NOVICE,
    UNFILTERED,
    dividers_of,
    returns_of,
)
from sarl_core.reproducing.study import Claim, Frames, judge
from sarl_core.reproducing.words import (
    COMPARED,
    interval,
    number,
    part_of_the_way,
    percent,
    summary,
)
from sarl_core.rollouts.statistics import interquartile_mean

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Returns = dict[str, Floats]

_NOVICE_RANGE = (8.0, 95.0)  # of the paper's lone novice on CartPole
_PAPERS_DIP = 167.0
HALF = 0.5  # of the expert's typical return
OFTEN, _MOSTLY = 0.1, 0.95  # shares of episodes
_SIMILAR = 0.1  # of the way from the novice to the expert
_MOST_OF_THE_WAY = 0.8


def cart_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of CartPole.

    Args:
        frames: With the table of Figure 5.

    Returns:
        Its claims and ours.
    """
    returns = first_returns(frames["5"])
    return (
        _expert_best(returns, "Figure 5"),
        _novice_range(returns),
        _as_the_expert_in_parts(returns, UNFILTERED, "Figure 5"),
        _dips(returns),
        _dips_beat_the_novice(returns),
        _always_better(returns),
        _filtered_similar(returns),
    )


def lander_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of LunarLander.

    Args:
        frames: With the table of Figure 6; one claim needs that of Figure 5 too.

    Returns:
        Its claims and ours.
    """
    returns = first_returns(frames["6"])
    claims = [
        _order(returns),
        _closely_followed(returns),
        _as_the_expert_in_parts(returns, FILTERED, "Figure 6"),
        _more_rules(returns),
        _by_the_shield_alone(returns),
    ]
    if "5" in frames:
        claims.insert(3, _deeper_falls(returns, first_returns(frames["5"])))
    return tuple(claims)


def first_returns(frame: pd.DataFrame) -> Returns:
    """The returns of each arm with the first divider of a table."""
    return returns_of(frame, dividers_of(frame)[0])


# --- CartPole ------------------------------------------------------------------------------------


def _expert_best(returns: Returns, where: str) -> Claim:
    found = {name: summary(values) for name, values in returns.items()}
    expert = found.pop(EXPERT)
    best = max(found.values(), key=lambda interval: interval.iqm)
    rest = ", ".join(f"{name} {number(interval.iqm)}" for name, interval in found.items())
    return Claim(
        paper="The expert performs best.",
        where=where,
        ours=f"Typical returns: expert {number(expert.iqm)}, {rest}.",
        verdict=judge(expert.iqm > best.iqm, expert.high >= best.low),
        decided_by="Agrees if the expert's typical return (IQM) is above that of every other; "
        "partly if the best of the others equals it or their 95 % intervals meet.",
        numbers={"expert": expert.iqm, "best_other": best.iqm},
    )


def _novice_range(returns: Returns) -> Claim:
    values = returns[NOVICE]
    low, high = _NOVICE_RANGE
    inside = float(((values >= low) & (values <= high)).mean())
    return Claim(
        paper="The lone novice's return varies between 8 and 95.",
        where="text on Figure 5",
        ours=f"It varies between {number(values.min())} and {number(values.max())}; "
        f"{share_text(inside)} of the episodes are within the paper's range.",
        verdict=judge(inside == 1.0, inside >= _MOSTLY),
        decided_by=f"Agrees if every episode is from 8 to 95, partly if {percent(_MOSTLY)} are.",
        numbers={"least": float(values.min()), "greatest": float(values.max()), "inside": inside},
    )


def _as_the_expert_in_parts(returns: Returns, name: str, where: str) -> Claim:
    level = float(np.quantile(returns[EXPERT], 0.25))
    share = float((returns[name] >= level).mean())
    said = (
        "With unfiltered rules, the novice does as well as the expert in parts."
        if name == UNFILTERED
        else "With filtered rules, the novice reaches the level of the expert in places."
    )
    return Claim(
        paper=said,
        where=where,
        ours=f"{share_text(share)} of its episodes reach {number(level)}, as three quarters of the "
        "expert's do.",
        verdict=judge(share >= OFTEN, share > 0),
        decided_by=f"Agrees if {percent(OFTEN)} of the episodes reach the expert's lower quartile, "
        "partly if one does.",
        numbers={"share": share, "level": level},
    )


def _dips(returns: Returns) -> Claim:
    values = returns[UNFILTERED]
    deep = HALF * float(interquartile_mean(returns[EXPERT]))
    share = float((values < deep).mean())
    low = float(values.min())
    return Claim(
        paper="With unfiltered rules there are sharp dips in some episodes, to a return of 167.",
        where="text on Figure 5",
        ours=f"The lowest return is {number(low)}; {share_text(share)} of the episodes are below "
        f"{number(deep)}, half of the expert's typical return.",
        verdict=judge(share > 0, low < float(interquartile_mean(returns[EXPERT]))),
        decided_by="Agrees if an episode is below half of the expert's typical return, partly if "
        "one is below that return.",
        numbers={"lowest": low, "share": share, "paper": _PAPERS_DIP},
    )


def _dips_beat_the_novice(returns: Returns) -> Claim:
    low = float(returns[UNFILTERED].min())
    alone = returns[NOVICE]
    return Claim(
        paper="Even in these dips the novice with unfiltered rules does clearly better than alone.",
        where="text on Figure 5",
        ours=f"Its lowest return is {number(low)}; alone the novice has {number(alone.max())} at "
        f"most and {number(alone.mean())} on average.",
        verdict=judge(low > alone.max(), low > alone.mean()),
        decided_by="Agrees if the lowest return with the rules is above the highest without, "
        "partly if it is above the mean without.",
        numbers={"lowest": low, "alone_at_most": float(alone.max())},
    )


def _always_better(returns: Returns) -> Claim:
    better = float((returns[UNFILTERED] > returns[NOVICE]).mean())
    return Claim(
        paper="Unfiltered rules improve the novice's performance consistently.",
        where="text on Figure 5",
        ours=f"With the rules the return is higher in {share_text(better)} of the episodes, seed "
        "for seed.",
        verdict=judge(better == 1.0, better >= _MOSTLY),
        decided_by=f"Agrees if it is higher on every seed, partly on {percent(_MOSTLY)}.",
        numbers={"share": better},
    )


def _filtered_similar(returns: Returns) -> Claim:
    some, many = summary(returns[FILTERED]), summary(returns[UNFILTERED])
    novice, expert = (float(interquartile_mean(returns[name])) for name in (NOVICE, EXPERT))
    apart = abs(
        part_of_the_way(some.iqm, novice, expert) - part_of_the_way(many.iqm, novice, expert)
    )
    return Claim(
        paper="With filtered rules the result is similar to that with unfiltered ones.",
        where="text on Figure 5",
        ours=f"Typical returns: filtered {interval(some)}, unfiltered {interval(many)}; the "
        f"novice alone has {number(novice)}.",
        verdict=judge(apart <= _SIMILAR, some.iqm - novice >= 0.5 * (many.iqm - novice)),
        decided_by=f"Agrees if the two are within {percent(_SIMILAR)} of the way from the lone "
        "novice to the expert, partly if the filtered rules bring half of what the unfiltered "
        "ones do.",
        numbers={"filtered": some.iqm, "unfiltered": many.iqm, "apart": apart},
    )


# --- LunarLander ---------------------------------------------------------------------------------


def _order(returns: Returns) -> Claim:
    means = {name: float(values.mean()) for name, values in returns.items()}
    ordered = [means[name] for name in (EXPERT, UNFILTERED, FILTERED, NOVICE)]
    holds = [above > below for above, below in pairwise(ordered)]
    told = ", ".join(f"{name} {number(means[name])}" for name in reversed(ARMS))
    return Claim(
        paper="The average return is highest for the expert, then with unfiltered rules, then with "
        "filtered rules, and lowest for the lone novice.",
        where="Figure 6",
        ours=f"Mean returns: {told}.",
        verdict=judge(all(holds), sum(holds) >= 2),
        decided_by="Agrees if the means have this order, partly if two of its three steps hold.",
        numbers=means,
    )


def _closely_followed(returns: Returns) -> Claim:
    novice, some, many = (summary(returns[name]) for name in (NOVICE, FILTERED, UNFILTERED))
    gained = part_of_the_way(some.iqm, novice.iqm, many.iqm)
    return Claim(
        paper="The novice with filtered rules follows closely behind the one with unfiltered "
        "rules.",
        where="text on Figure 6",
        ours=f"Typical returns: unfiltered {interval(many)}, filtered {interval(some)}; the lone "
        f"novice has {interval(novice)}. Filtered rules bring "
        f"{share_text(max(gained, 0.0))} of what the unfiltered ones do.",
        verdict=judge(gained >= _MOST_OF_THE_WAY, gained >= 0.5),
        decided_by=f"Agrees if filtered rules bring {percent(_MOST_OF_THE_WAY)} of what unfiltered "
        "ones bring to the lone novice's typical return, partly if half.",
        numbers={"filtered": some.iqm, "unfiltered": many.iqm, "novice": novice.iqm},
    )


def _deeper_falls(lander: Returns, cart: Returns) -> Claim:
    depths = [_depth(returns, FILTERED) for returns in (cart, lander)]
    deeper = [_depth(returns, UNFILTERED) for returns in (cart, lander)]
    return Claim(
        paper="Falls downwards are more pronounced than on CartPole.",
        where="text on Figure 6",
        ours="The lowest tenth of the episodes lies below the typical one by, of the way from "
        f"novice to expert: filtered {percent(depths[1])} (Cart Pole {percent(depths[0])}), "
        f"unfiltered {percent(deeper[1])} (Cart Pole {percent(deeper[0])}).",
        verdict=judge(
            depths[1] > depths[0] and deeper[1] > deeper[0],
            depths[1] > depths[0] or deeper[1] > deeper[0],
        ),
        decided_by="The distance from the typical return to the lowest tenth of the episodes, in "
        "units of that from the lone novice to the expert; agrees if it is larger than on "
        "CartPole for both rule sets, partly for one.",
        numbers={"filtered": depths[1], "unfiltered": deeper[1]},
    )


def _depth(returns: Returns, name: str) -> float:
    typical = {arm: float(interquartile_mean(values)) for arm, values in returns.items()}
    low = float(np.quantile(returns[name], 0.1))
    ends = typical[NOVICE], typical[EXPERT]
    return part_of_the_way(typical[name], *ends) - part_of_the_way(low, *ends)


def _more_rules(returns: Returns) -> Claim:
    some, many = summary(returns[FILTERED]), summary(returns[UNFILTERED])
    return Claim(
        paper="More rules improve the performance of the agent.",
        where="text on Figure 6",
        ours=f"Typical returns: filtered {interval(some)}, unfiltered {interval(many)}.",
        verdict=judge(many.low > some.high, many.iqm > some.iqm),
        decided_by=f"{COMPARED}; agrees if that of the unfiltered rules lies above that of the "
        "filtered ones, partly if only the typical return does.",
        numbers={"filtered": some.iqm, "unfiltered": many.iqm},
    )


def _by_the_shield_alone(returns: Returns) -> Claim:
    novice, expert = (float(interquartile_mean(returns[name])) for name in (NOVICE, EXPERT))
    many = summary(returns[UNFILTERED])
    way = part_of_the_way(many.iqm, novice, expert)
    meets = many.high >= summary(returns[EXPERT]).low
    return Claim(
        paper="The expert's performance can be reached by the shield alone.",
        where="Lessons Learned",
        ours=f"With unfiltered rules the typical return is {interval(many)}, "
        f"{percent(way)} of the way from the lone novice ({number(novice)}) to the expert "
        f"({number(expert)}).",
        verdict=judge(meets, way >= _MOST_OF_THE_WAY),
        decided_by=f"{COMPARED}; agrees if those of expert and unfiltered rules meet, partly from "
        f"{percent(_MOST_OF_THE_WAY)} of the way.",
        numbers={"unfiltered": many.iqm, "expert": expert, "way": way},
    )
