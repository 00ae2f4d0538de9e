"""What the paper says of shielded novices on BipedalWalker (Figure 7), beside our episodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sarl_core.paper.shield_claims import (
    HALF,
    OFTEN,
    OTHER,
    SIMILAR,
    SOMETIMES,
    WAY,
    share_above,
)
from sarl_core.paper.shields import (
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
    above,
    below,
    claim,
    share_over_recordings,
    together,
)
from sarl_core.paper.words import number, percent, shares

if TYPE_CHECKING:
    import pandas as pd

_CLEARLY = 0.2  # of the way from the lone novice to the expert


def walker_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of BipedalWalker.

    Args:
        frames: With the table of Figure 7.

    Returns:
        Its claims and ours.
    """
    frame = frames["7"]
    paper, finer = dividers_of(frame)[0], dividers_of(frame)[1:]
    runs = runs_of(frame, paper)
    claims = [
        _expert_drops(runs),
        _below_the_expert(runs, paper),
        _no_help(runs, UNFILTERED, paper),
        _no_help(runs, FILTERED, paper),
        _no_fluctuation(runs, paper),
    ]
    if finer:
        claims.append(_finer_division(frame, paper, finer))
    return tuple(claims)


def _expert_drops(runs: Runs) -> Claim:
    values = runs.returns[EXPERT]
    dropped = values < HALF * runs.typical(EXPERT)[:, None]
    return claim(
        share_above(dropped, runs.experts, agrees=OFTEN, partly=SOMETIMES),
        paper="The expert shows strong drops and does not solve the task.",
        where="text on Figure 7",
        ours=f"Our experts have a typical return of {runs.told(EXPERT)}, a mean of "
        f"{number(values.mean())} and at least {number(values.min())}; "
        f"{shares(share_over_recordings(dropped, runs.experts))} of their episodes are below half "
        "of the typical return.",
        measured="The share of the episodes below half of the expert's typical return.",
        numbers={"mean_return": float(values.mean()), "lowest": float(values.min())},
    )


def _below_the_expert(runs: Runs, divider: int) -> Claim:
    behind = 1.0 - runs.way(runs.typical(UNFILTERED))
    return claim(
        above(behind, runs.experts, agrees=_CLEARLY, partly=0),
        paper="With unfiltered rules the novice is clearly below the expert.",
        where="Figure 7",
        ours=f"Typical returns with divider {divider}: {runs.told(UNFILTERED)} with the rules, "
        f"{runs.told(EXPERT)} for the expert.",
        measured=f"How far it is behind the expert, {WAY}.",
        numbers={"unfiltered": runs.over(UNFILTERED).mean, "expert": runs.over(EXPERT).mean},
    )


def _no_help(runs: Runs, name: str, divider: int) -> Claim:
    way = runs.way(runs.typical(name))
    return claim(
        below(way, runs.experts, agrees=SIMILAR, partly=OTHER),
        paper=f"With {name} rules there is no improvement over the lone novice.",
        where="Figure 7",
        ours=f"Typical returns with divider {divider}: {runs.told(name)} with the rules, "
        f"{runs.told(NOVICE)} without: {percent(float(way.mean()))} of the way to the expert.",
        measured=f"What the rules bring, {WAY}.",
        numbers={"with": runs.over(name).mean, "without": runs.over(NOVICE).mean},
    )


def _no_fluctuation(runs: Runs, divider: int) -> Claim:
    levels = 0.5 * (runs.typical(NOVICE) + runs.typical(EXPERT))
    both = np.concatenate([runs.returns[name] for name in (FILTERED, UNFILTERED)], axis=1)
    reached = both >= levels[:, None]
    share = share_over_recordings(reached, runs.experts)
    return claim(
        below(reached.mean(axis=1), runs.experts, agrees=SOMETIMES, partly=OFTEN, interval=share),
        paper="The curves with rules show no fluctuation upwards.",
        where="text on Figure 7",
        ours=f"With divider {divider}, the best of {both.size} episodes with rules returns "
        f"{number(both.max())}; {shares(share)} of them get half of the way from the lone novice "
        f"to the expert, to {number(float(levels.mean()))}.",
        measured="The share of the episodes with rules that get half of the way from the lone "
        "novice's typical return to the expert's.",
        numbers={"best": float(both.max()), "level": float(levels.mean())},
    )


def _finer_division(frame: pd.DataFrame, paper: int, finer: tuple[int, ...]) -> Claim:
    runs = {divider: runs_of(frame, divider) for divider in (paper, *finer)}
    told = ", ".join(f"divider {divider} {one.told(UNFILTERED)}" for divider, one in runs.items())
    coarse = runs[paper].typical(UNFILTERED)
    gains = [
        above(
            runs[paper].way(runs[divider].typical(UNFILTERED)) - runs[paper].way(coarse),
            runs[paper].experts,
            agrees=0,
            partly=0,
        )
        for divider in finer
    ]
    return claim(
        together(gains, f"{gains[0].rule} So for every finer divider; partly, if for some."),
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        ours=f"Typical returns with unfiltered rules: {told}.",
        measured=f"What a finer divider brings over the paper's with unfiltered rules, {WAY}.",
        numbers={f"divider_{divider}": one.over(UNFILTERED).mean for divider, one in runs.items()},
    )
