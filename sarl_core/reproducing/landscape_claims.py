"""What the paper says of the number and the length of rules (Figures 2 and 3), beside ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.language import counted
from sarl_core.mining.landscape import Landscape
from sarl_core.reproducing.landscape_table import environments_in, landscape_of, tree_seeds_in
from sarl_core.reproducing.shipped import environment_name
from sarl_core.reproducing.study import Claim, Frames, judge
from sarl_core.reproducing.words import percent

if TYPE_CHECKING:
    import pandas as pd

_PAPER_ENVIRONMENT = "CartPole-v1"  # the one that the paper draws
_MIDDLE = (0.25, 0.75)  # of the confidence scale
_NEAR = 0.9  # of the greatest value
_ALIKE, _SOMEWHAT = 0.8, 0.5  # rank correlations

# --- what all claims have in common --------------------------------------------------------------


def _for_every_seed(
    frame: pd.DataFrame, judged: Callable[[dict[str, Landscape]], tuple[Claim, ...]]
) -> tuple[Claim, ...]:
    """Claims on the first tree seed's landscapes, whose verdicts hold for the others too."""
    by_seed = [
        judged({env_id: landscape_of(frame, env_id, seed) for env_id in environments_in(frame)})
        for seed in tree_seeds_in(frame)
    ]
    return tuple(_together(claims) for claims in zip(*by_seed, strict=True))


def _together(claims: Sequence[Claim]) -> Claim:
    first, verdicts = claims[0], [claim.verdict for claim in claims]
    if len(claims) == 1:
        return first
    alike = verdicts.count(first.verdict)
    if alike == len(claims):
        told = f" The verdict is the same with all of {len(claims)} tree seeds."
    else:
        told = f" This is tree seed 0; of {len(claims)}, {alike} lead to its verdict."
    return replace(
        first,
        ours=first.ours + told,
        verdict=first.verdict if alike == len(claims) else "partly",
        decided_by=f"{first.decided_by} Decided for each of {len(claims)} tree seeds, by which "
        "trees choose among equally good queries; partly if they lead to different verdicts.",
        numbers={**first.numbers, "tree_seeds_of_this_verdict": float(alike)},
    )


# --- the claims of Figure 2 ----------------------------------------------------------------------


def count_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the number of rules.

    Args:
        frames: With the table of Figure 2.

    Returns:
        Its claims and ours.
    """
    return _for_every_seed(
        frames["2"],
        lambda found: (
            _most_rules(found),
            _fewer_with_less_confidence(found),
            _fewer_with_more_confidence(found),
            _fewer_with_more_support(found),
        ),
    )


def _most_rules(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool(_is_corner(one.rule_count)) for env_id, one in found.items()}
    cart = found[_PAPER_ENVIRONMENT].rule_count
    return Claim(
        paper="A rule set has the most rules where nothing is filtered, at support 0 and "
        "confidence 1.",
        where="Figure 2",
        ours=f"Cart Pole has {int(cart[0, -1]):,} rules there, the most of all settings; so it is "
        f"in {_of(holds)}."
        if holds[_PAPER_ENVIRONMENT]
        else f"Cart Pole has {int(cart[0, -1]):,} rules there and up to {int(cart.max()):,} "
        f"elsewhere; it is as the paper says in {_of(holds)}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if no other cell has more rules, in every environment; partly, in some.",
        numbers={f"rules_{env_id}": float(one.rule_count[0, -1]) for env_id, one in found.items()},
    )


def _fewer_with_less_confidence(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool((np.diff(one.rule_count[0]) >= 0).all()) for env_id, one in found.items()}
    cart = found[_PAPER_ENVIRONMENT]
    row = cart.rule_count[0]
    drop = int(np.diff(row).argmax())
    return Claim(
        paper="At support 0, the number of rules falls continuously as less confidence is asked.",
        where="Figure 2",
        ours=f"It never rises on the way down, in {_of(holds)}. On Cart Pole it falls from "
        f"{int(row[-1]):,} to {int(row[0]):,}; the largest single drop is from "
        f"{int(row[drop + 1]):,} to {int(row[drop]):,} rules, between confidence "
        f"{cart.confidences[drop + 1]:g} and {cart.confidences[drop]:g}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if the number never rises from one confidence of the grid to the next "
        "lower one, in every environment; partly, in some.",
        numbers={
            "rules_at_confidence_1": float(row[-1]),
            "rules_at_confidence_0": float(row[0]),
            "largest_drop": float(np.diff(row).max()),
        },
    )


def _fewer_with_more_confidence(found: dict[str, Landscape]) -> Claim:
    one = found[_PAPER_ENVIRONMENT]
    middle = int(np.searchsorted(one.confidences, 0.5))
    fewer = one.rule_count[:, -1] < one.rule_count[:, middle]
    more = one.rule_count[:, -1] > one.rule_count[:, middle]
    return Claim(
        paper="If more confidence is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"On Cart Pole, asking confidence 1 in place of {one.confidences[middle]:g} gives "
        f"fewer rules at {int(fewer.sum())} of {len(fewer)} minimum supports, and more at "
        f"{int(more.sum())}."
        + (
            " At support 0 it gives more, as the paper says one sentence before." if more[0] else ""
        ),
        verdict=judge(bool(fewer.all()), bool(fewer.any())),
        decided_by="Compares the two on Cart Pole; agrees if there are fewer at every minimum "
        "support of the grid, partly at some.",
        numbers={"fewer_at": float(fewer.sum()), "more_at": float(more.sum())},
    )


def _fewer_with_more_support(found: dict[str, Landscape]) -> Claim:
    holds = {
        env_id: bool((np.diff(one.rule_count, axis=0) <= 0).all()) for env_id, one in found.items()
    }
    supports, cart = found[_PAPER_ENVIRONMENT].supports, found[_PAPER_ENVIRONMENT].rule_count
    return Claim(
        paper="If more support is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"The number never rises with the support, at any confidence, in {_of(holds)}. On "
        f"Cart Pole at confidence 1 it falls from {int(cart[0, -1]):,} at support 0 to "
        f"{counted(int(cart[1, -1]), 'rule')} at {supports[1]:g}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if the number never rises from one support of the grid to the next, in "
        "every environment; partly, in some.",
        numbers={"rules_at_0": float(cart[0, -1]), "rules_at_next": float(cart[1, -1])},
    )


# --- the claims of Figure 3 ----------------------------------------------------------------------


def length_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the length of rules.

    Args:
        frames: With the table of Figure 3.

    Returns:
        Its claims and ours.
    """
    return _for_every_seed(
        frames["3"], lambda found: (_longest_rules(found), _middle(found), _same_way(found))
    )


def _longest_rules(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool(_is_corner(one.mean_length)) for env_id, one in found.items()}
    one = found[_PAPER_ENVIRONMENT]
    corner, greatest = float(one.mean_length[0, -1]), float(one.mean_length.max())
    row, column = np.unravel_index(int(one.mean_length.argmax()), one.mean_length.shape)
    return Claim(
        paper="Rules are longest, too, at support 0 and confidence 1.",
        where="Figure 3",
        ours=f"On Cart Pole they have {corner:.1f} conditions there on average, and {greatest:.1f} "
        f"at support {one.supports[row]:g} and confidence {one.confidences[column]:g}. The "
        f"greatest mean stands where the paper says in {_of(holds)}.",
        verdict=judge(all(holds.values()), any(holds.values()) or bool(corner >= _NEAR * greatest)),
        decided_by="Agrees if no other cell has longer rules, in every environment; partly, in "
        f"some, or if Cart Pole's stand within {percent(1 - _NEAR)} of the greatest.",
        numbers={"at_support_0_confidence_1": corner, "greatest": greatest},
    )


def _middle(found: dict[str, Landscape]) -> Claim:
    one = found[_PAPER_ENVIRONMENT]
    places = greatest_at(one)
    inside = (places >= _MIDDLE[0]) & (places <= _MIDDLE[1])
    moved = places < one.confidences[-1]
    return Claim(
        paper="Above support 0, the longest rules move to the middle of the confidence scale.",
        where="Figure 3",
        ours=f"On Cart Pole they stand in the middle half of the scale at {int(inside.sum())} of "
        f"{len(places)} minimum supports above 0, and below confidence 1 at {int(moved.sum())}: "
        f"from {places[0]:.2f} at support {one.supports[1]:g} to {places[-1]:.2f} at "
        f"{one.supports[-1]:g}.",
        verdict=judge(bool(inside.all()), bool(moved.any())),
        decided_by="The confidence with the longest rules, the mean of several if they tie; agrees "
        "if it lies from 0.25 to 0.75 at every support of the grid above 0, partly if it is below "
        "1 at some.",
        numbers={"in_the_middle": float(inside.sum()), "below_1": float(moved.sum())},
    )


def greatest_at(landscape: Landscape) -> NDArray[np.float64]:
    """At which confidence rules are longest, for each minimum support above the first.

    Args:
        landscape: S supports.

    Returns:
        Shape (S - 1,); the mean of several confidences that tie.
    """
    lengths = landscape.mean_length[1:]
    ties = lengths == lengths.max(axis=1, keepdims=True)
    return np.asarray((ties * landscape.confidences).sum(axis=1) / ties.sum(axis=1))


def _same_way(found: dict[str, Landscape]) -> Claim:
    from scipy.stats import spearmanr

    alike = {
        env_id: float(spearmanr(one.rule_count.ravel(), one.mean_length.ravel()).statistic)
        for env_id, one in found.items()
    }
    cart, least = alike[_PAPER_ENVIRONMENT], min(alike, key=lambda env_id: alike[env_id])
    return Claim(
        paper="Support and confidence influence the number of rules and their length in the same "
        "way.",
        where="text on Figure 3",
        ours=f"Over the grid, number and length rank alike with a correlation of {cart:.2f} on "
        f"Cart Pole (1 is the same order); the least is {_signed(alike[least])}, on "
        f"{environment_name(least)}.",
        verdict=judge(
            min(alike.values()) >= _ALIKE, cart >= _SOMEWHAT or max(alike.values()) >= _ALIKE
        ),
        decided_by=f"Rank correlation over the cells; agrees from {_ALIKE} in every environment, "
        f"partly from {_SOMEWHAT} on Cart Pole or {_ALIKE} in some.",
        numbers=alike,
    )


def _signed(correlation: float) -> str:
    return f"{correlation:.2f}".replace("-", "−")


def _is_corner(values: NDArray[Any]) -> bool:
    return bool(values[0, -1] == values.max())


def _of(holds: dict[str, bool]) -> str:
    return f"{sum(holds.values())} of {len(holds)} environments"
