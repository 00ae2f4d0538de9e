"""What the paper says of shielded novices on BipedalWalker (Figure 7), beside our episodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sarl_core.explaining.language import share_text
from sarl_core.reproducing.shield_claims import HALF, OFTEN, Returns
from sarl_core.reproducing.shields import (
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


def walker_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of BipedalWalker.

    Args:
        frames: With the table of Figure 7.

    Returns:
        Its claims and ours.
    """
    frame = frames["7"]
    paper, finer = dividers_of(frame)[0], dividers_of(frame)[1:]
    returns = returns_of(frame, paper)
    claims = [
        _expert_drops(returns),
        _below_the_expert(returns, paper),
        _no_help(returns, UNFILTERED, paper),
        _no_help(returns, FILTERED, paper),
        _no_fluctuation(returns, paper),
    ]
    if finer:
        claims.append(_finer_division(frame, paper, finer))
    return tuple(claims)


def _expert_drops(returns: Returns) -> Claim:
    values = returns[EXPERT]
    deep = HALF * float(interquartile_mean(values))
    share = float((values < deep).mean())
    return Claim(
        paper="The expert shows strong drops and does not solve the task.",
        where="text on Figure 7",
        ours=f"Our expert has a mean return of {number(values.mean())} and at least "
        f"{number(values.min())}; {share_text(share)} of its episodes are below half of its "
        "typical return.",
        verdict=judge(share >= OFTEN, share > 0),
        decided_by=f"Agrees if {percent(OFTEN)} of the episodes are below half of its typical "
        "return, partly if one is.",
        numbers={"mean": float(values.mean()), "lowest": float(values.min()), "share": share},
    )


def _below_the_expert(returns: Returns, divider: int) -> Claim:
    many, expert = summary(returns[UNFILTERED]), summary(returns[EXPERT])
    return Claim(
        paper="With unfiltered rules the novice is clearly below the expert.",
        where="Figure 7",
        ours=f"Typical returns with divider {divider}: {interval(many)} with the rules, "
        f"{interval(expert)} for the expert.",
        verdict=judge(many.high < expert.low, many.iqm < expert.iqm),
        decided_by=f"{COMPARED}; agrees if that with the rules lies below the expert's.",
        numbers={"unfiltered": many.iqm, "expert": expert.iqm},
    )


def _no_help(returns: Returns, name: str, divider: int) -> Claim:
    shielded, novice, expert = (summary(returns[arm]) for arm in (name, NOVICE, EXPERT))
    way = part_of_the_way(shielded.iqm, novice.iqm, expert.iqm)
    return Claim(
        paper=f"With {name} rules there is no improvement over the lone novice.",
        where="Figure 7",
        ours=f"Typical returns with divider {divider}: {interval(shielded)} with the rules, "
        f"{interval(novice)} without: "
        f"{percent(way)} of the way to the expert.",
        verdict=judge(shielded.low <= novice.high, way < 0.5),
        decided_by=f"{COMPARED}; agrees if that with the rules does not lie above that without, "
        "partly if it does, but by less than half of the way to the expert.",
        numbers={"with": shielded.iqm, "without": novice.iqm, "way": way},
    )


def _no_fluctuation(returns: Returns, divider: int) -> Claim:
    level = 0.5 * sum(float(interquartile_mean(returns[name])) for name in (NOVICE, EXPERT))
    best = max(float(returns[name].max()) for name in (FILTERED, UNFILTERED))
    shares = [float((returns[name] >= level).mean()) for name in (FILTERED, UNFILTERED)]
    return Claim(
        paper="The curves with rules show no fluctuation upwards.",
        where="text on Figure 7",
        ours=f"With divider {divider}, the best of their episodes returns {number(best)}; half of "
        f"the way from the lone novice to the expert would be {number(level)}.",
        verdict=judge(best < level, max(shares) < OFTEN),
        decided_by="Agrees if no episode gets half of the way from the lone novice's typical "
        f"return to the expert's, partly if fewer than {percent(OFTEN)} do.",
        numbers={"best": best, "level": level},
    )


def _finer_division(frame: pd.DataFrame, paper: int, finer: tuple[int, ...]) -> Claim:
    found = {
        divider: summary(returns_of(frame, divider)[UNFILTERED]) for divider in (paper, *finer)
    }
    told = ", ".join(f"divider {divider} {interval(one)}" for divider, one in found.items())
    holds = [found[divider].low > found[paper].high for divider in finer]
    return Claim(
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        ours=f"Typical returns with unfiltered rules: {told}.",
        verdict=judge(all(holds), any(holds)),
        decided_by=f"{COMPARED}; agrees if every finer divider lies above the paper's, partly if "
        "one does.",
        numbers={f"divider_{divider}": one.iqm for divider, one in found.items()},
    )
