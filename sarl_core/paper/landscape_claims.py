"""What the paper says of the number and the length of rules (Figures 2 and 3), beside ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.landscape import Landscape
from sarl_core.mining.language import counted
from sarl_core.paper.landscape_table import landscapes_of
from sarl_core.paper.replicates import environment_name
from sarl_core.paper.study import Frames, experts_in
from sarl_core.paper.verdicts import Claim, Finding, above, claim, in_most, together

if TYPE_CHECKING:
    pass

_PAPER_ENVIRONMENT = "CartPole-v1"  # the one that the paper draws
_MIDDLE = (0.25, 0.75)  # of the confidence scale
_NEAR = 0.9  # of the greatest value
_ALIKE, _SOMEWHAT = 0.8, 0.5  # rank correlations

_IN_ALL = (
    "Counted over recordings in each environment: agrees if it holds in 5 of 6, and with every "
    "expert at least once, everywhere; does not agree if nowhere in more than 1 of 6; else partly."
)
_SHIPPED = "in the shipped recording"

Found = Mapping[str, Mapping[int, Landscape]]
Experts = Mapping[str, tuple[str, ...]]


def _everywhere(found: Found, experts: Experts, holds: Callable[[Landscape], bool]) -> Finding:
    """In which recordings of all environments something holds."""
    return together(
        [
            in_most([holds(one) for one in own.values()], experts[env_id])
            for env_id, own in found.items()
        ],
        _IN_ALL,
    )


def _cart(found: Found) -> list[Landscape]:
    """The landscapes that the paper draws, the shipped recording's first."""
    return list(found[_PAPER_ENVIRONMENT].values())


def _over(values: list[float], decimals: int = 0) -> str:
    """The least and the most over recordings, or the one that they all are, for people."""
    ends = dict.fromkeys(f"{value:,.{decimals}f}" for value in (min(values), max(values)))
    return " to ".join(ends)


# --- the claims of Figure 2 ----------------------------------------------------------------------


def count_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the number of rules.

    Args:
        frames: With the table of Figure 2.

    Returns:
        Its claims and ours.
    """
    found, experts = landscapes_of(frames["2"]), experts_in(frames["2"])
    return (
        _most_rules(found, experts),
        _fewer_with_less_confidence(found, experts),
        _fewer_with_more_confidence(found, experts),
        _fewer_with_more_support(found, experts),
    )


def _most_rules(found: Found, experts: Experts) -> Claim:
    corners = [float(one.rule_count[0, -1]) for one in _cart(found)]
    return claim(
        _everywhere(found, experts, lambda one: _is_corner(one.rule_count)),
        paper="A rule set has the most rules where nothing is filtered, at support 0 and "
        "confidence 1.",
        where="Figure 2",
        ours=f"Cart Pole has {_over(corners)} rules there, and at most "
        f"{_over([float(one.rule_count.max()) for one in _cart(found)])} anywhere.",
        measured="Holds in a recording if no other cell has more rules.",
        numbers={
            f"rules_{env_id}": float(next(iter(own.values())).rule_count[0, -1])
            for env_id, own in found.items()
        },
        constructed="where less is asked, a path is cut earlier, and paths that part below the cut "
        "share a rule",
    )


def _fewer_with_less_confidence(found: Found, experts: Experts) -> Claim:
    cart = _cart(found)[0]
    row = cart.rule_count[0]
    drop = int(np.diff(row).argmax())
    return claim(
        _everywhere(found, experts, lambda one: bool((np.diff(one.rule_count[0]) >= 0).all())),
        paper="At support 0, the number of rules falls continuously as less confidence is asked.",
        where="Figure 2",
        ours=f"On Cart Pole, {_SHIPPED}, it falls from {int(row[-1]):,} to {int(row[0]):,}; the "
        f"largest single drop is from {int(row[drop + 1]):,} to {int(row[drop]):,} rules, between "
        f"confidence {cart.confidences[drop + 1]:g} and {cart.confidences[drop]:g}.",
        measured="Holds in a recording if the number never rises from one confidence of the grid "
        "to the next lower one.",
        numbers={
            "rules_at_confidence_1": float(row[-1]),
            "rules_at_confidence_0": float(row[0]),
            "largest_drop": float(np.diff(row).max()),
        },
        constructed="where less is asked, a path is cut earlier, and paths that part below the cut "
        "share a rule",
    )


def _fewer_with_more_confidence(found: Found, experts: Experts) -> Claim:
    carts = _cart(found)
    middle = int(np.searchsorted(carts[0].confidences, 0.5))
    fewer = np.array([one.rule_count[:, -1] < one.rule_count[:, middle] for one in carts])
    more = np.array([one.rule_count[:, -1] > one.rule_count[:, middle] for one in carts])
    return claim(
        in_most(
            fewer.all(axis=1),
            experts[_PAPER_ENVIRONMENT],
            in_part=fewer.any(axis=1),
        ),
        paper="If more confidence is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"On Cart Pole, asking confidence 1 in place of {carts[0].confidences[middle]:g} "
        f"gives fewer rules at {_over(fewer.sum(axis=1).tolist())} of {fewer.shape[1]} minimum "
        f"supports, and more at {_over(more.sum(axis=1).tolist())}."
        + (
            " At support 0 it gives more, as the paper says one sentence before."
            if more[:, 0].all()
            else ""
        ),
        measured="Compares the two on Cart Pole; holds in a recording if there are fewer at every "
        "minimum support of the grid, in part if at some.",
        numbers={"fewer_at": float(fewer[0].sum()), "more_at": float(more[0].sum())},
    )


def _fewer_with_more_support(found: Found, experts: Experts) -> Claim:
    cart = _cart(found)[0]
    return claim(
        _everywhere(found, experts, lambda one: bool((np.diff(one.rule_count, axis=0) <= 0).all())),
        paper="If more support is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"On Cart Pole at confidence 1, {_SHIPPED}, it falls from "
        f"{int(cart.rule_count[0, -1]):,} at support 0 to "
        f"{counted(int(cart.rule_count[1, -1]), 'rule')} at {cart.supports[1]:g}.",
        measured="Holds in a recording if the number never rises from one support of the grid to "
        "the next, at any confidence.",
        numbers={
            "rules_at_0": float(cart.rule_count[0, -1]),
            "rules_at_next": float(cart.rule_count[1, -1]),
        },
        constructed="support shrinks along a path, so a rule that is lost leaves none below it",
    )


# --- the claims of Figure 3 ----------------------------------------------------------------------


def length_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the length of rules.

    Args:
        frames: With the table of Figure 3.

    Returns:
        Its claims and ours.
    """
    found, experts = landscapes_of(frames["3"]), experts_in(frames["3"])
    return (
        _longest_rules(found, experts),
        _middle(found, experts),
        _same_way(found, experts),
    )


def _longest_rules(found: Found, experts: Experts) -> Claim:
    carts = _cart(found)
    corners = [float(one.mean_length[0, -1]) for one in carts]
    greatest = [float(one.mean_length.max()) for one in carts]
    near = {
        env_id: in_most(
            [_is_corner(one.mean_length) for one in own.values()],
            experts[env_id],
            in_part=[
                bool(one.mean_length[0, -1] >= _NEAR * one.mean_length.max())
                for one in own.values()
            ],
        )
        for env_id, own in found.items()
    }
    return claim(
        together(list(near.values()), _IN_ALL),
        paper="Rules are longest, too, at support 0 and confidence 1.",
        where="Figure 3",
        ours=f"On Cart Pole they have {_over(corners, 1)} conditions there on average, and up to "
        f"{_over(greatest, 1)} elsewhere. The verdict is the paper's in "
        f"{sum(one.verdict == 'agrees' for one in near.values())} of {len(near)} environments.",
        measured="Holds in a recording if no other cell has longer rules, in part if none has "
        f"rules longer by more than a tenth of its own (at least {_NEAR:g} of the greatest).",
        numbers={"at_support_0_confidence_1": corners[0], "greatest": greatest[0]},
    )


def _middle(found: Found, experts: Experts) -> Claim:
    carts = _cart(found)
    places = np.array([greatest_at(one) for one in carts])
    inside = (places >= _MIDDLE[0]) & (places <= _MIDDLE[1])
    moved = places < carts[0].confidences[-1]
    return claim(
        in_most(
            inside.all(axis=1),
            experts[_PAPER_ENVIRONMENT],
            in_part=moved.any(axis=1),
        ),
        paper="Above support 0, the longest rules move to the middle of the confidence scale.",
        where="Figure 3",
        ours="On Cart Pole they stand in the middle half of the scale at "
        f"{_over(inside.sum(axis=1).tolist())} of {places.shape[1]} minimum supports above 0, and "
        f"below confidence 1 at {_over(moved.sum(axis=1).tolist())}; {_SHIPPED} they go from "
        f"{places[0, 0]:.2f} at support {carts[0].supports[1]:g} to {places[0, -1]:.2f} at "
        f"{carts[0].supports[-1]:g}.",
        measured="The confidence with the longest rules, the mean of several if they tie; holds in "
        "a recording if it lies from 0.25 to 0.75 at every support of the grid above 0, in part if "
        "it is below 1 at some.",
        numbers={
            "in_the_middle": float(inside.sum(axis=1).mean()),
            "below_1": float(moved.sum(axis=1).mean()),
        },
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


def _same_way(found: Found, experts: Experts) -> Claim:
    parts = {
        env_id: above(
            np.array([_alike(one) for one in own.values()]),
            experts[env_id],
            agrees=_ALIKE,
            partly=_SOMEWHAT,
            show=_signed,
        )
        for env_id, own in found.items()
    }
    means = {env_id: one.interval.mean for env_id, one in parts.items() if one.interval is not None}
    least = min(means, key=lambda env_id: means[env_id])
    rule = next(iter(parts.values())).rule
    return claim(
        together(list(parts.values()), f"{rule} So in every environment; partly, if in some."),
        paper="Support and confidence influence the number of rules and their length in the same "
        "way.",
        where="text on Figure 3",
        ours="Over the grid, number and length rank alike with a correlation of "
        f"{_signed(means[_PAPER_ENVIRONMENT])} on Cart Pole (1 is the same order); the least is "
        f"{_signed(means[least])}, on {environment_name(least)}.",
        measured="The rank correlation over the cells.",
        numbers=means,
    )


def _alike(one: Landscape) -> float:
    """Spearman's rank correlation of number and length over the cells."""
    from scipy.stats import rankdata

    ranks = rankdata(np.array([one.rule_count.ravel(), one.mean_length.ravel()]), axis=1)
    return float(np.corrcoef(ranks)[0, 1])


def _signed(correlation: float) -> str:
    return f"{correlation:.2f}".replace("-", "−")


def _is_corner(values: NDArray[Any]) -> bool:
    return bool(values[0, -1] == values.max())
