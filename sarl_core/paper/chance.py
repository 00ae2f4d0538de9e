"""How many claims would agree by chance.

Deal out the names of what a claim compares anew, the arms, the rule sets, the thresholds, alike in
all recordings, and ask it again: the share of the deals in which it agrees is what chance brings. A
claim of an order agrees in few of them, and one that asks little in many. What follows from the
method alone agrees whatever was demonstrated, and counts as 1.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from msgspec.structs import replace

from sarl_core.mining.language import counted, share_text
from sarl_core.paper.study import Frames, Study, experts_in
from sarl_core.paper.verdicts import Claim, enough

DEALS = 100


def with_chance(study: Study, frames: Frames, *, deals: int = DEALS) -> tuple[Claim, ...]:
    """A study's claims, each with how often it would agree by chance.

    Args:
        study: The study.
        frames: The tables at hand, its own among them.
        deals: How often names are dealt out anew; the same ones every time.

    Returns:
        What `Study.claims` gives, with `by_chance`; without it where there are too few recordings
        for anything to agree.
    """
    claims = study.claims(frames)
    if not all(enough(experts) for experts in experts_in(frames[study.name]).values()):
        return claims
    agreed = np.zeros(len(claims))
    for deal in range(deals):
        dealt = study.exchanged(frames[study.name], np.random.default_rng(deal))
        again = study.claims({**frames, study.name: dealt})
        agreed += [claim.verdict == "agrees" for claim in again]
    return tuple(
        replace(claim, by_chance=1.0 if claim.constructed else float(count / deals))
        for claim, count in zip(claims, agreed, strict=True)
    )


def chance_text(claims: Iterable[Claim]) -> str:
    """How many claims would agree by chance, in a sentence or two.

    Args:
        claims: All that are counted.

    Returns:
        For people; "" if it was worked out for none of them.
    """
    every = tuple(claims)
    known = [claim for claim in every if claim.by_chance is not None]
    if not known:
        return ""
    chances = sum(claim.by_chance or 0.0 for claim in known)
    constructed = sum(bool(claim.constructed) for claim in known)
    what = counted(len(known), "claim")
    if len(known) < len(every):
        what = f"the {what} that have enough recordings"
    return (
        f"By chance, with the names of what is compared dealt out at random, {chances:.1f} of "
        f"{what} would agree: {constructed} that follow from the method, whatever is "
        f"demonstrated, and {chances - constructed:.1f} of the other {len(known) - constructed}."
    )


def how_decided(claim: Claim) -> str:
    """By which rule a claim was decided, and how often it would agree by chance.

    Args:
        claim: Any.

    Returns:
        For people.
    """
    if claim.constructed:
        return f"{claim.decided_by} It holds whatever is demonstrated: {claim.constructed}."
    if claim.by_chance is None:
        return claim.decided_by
    return f"{claim.decided_by} By chance it would agree {share_text(claim.by_chance)} of the time."
