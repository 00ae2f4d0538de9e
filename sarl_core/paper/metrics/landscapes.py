"""The number and the length of rules over the thresholds (Figures 2 and 3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import counted
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_core.paper.criteria import InMost, Measurement, Sample
from sarl_core.paper.landscape_table import landscapes_of
from sarl_core.paper.replicates import environment_name
from sarl_core.paper.study import experts_in
from sarl_core.paper.words import number_range

if TYPE_CHECKING:
    import pandas as pd

_PAPER_ENVIRONMENT = "CartPole-v1"  # the one that the paper draws
_MIDDLE = (0.25, 0.75)  # of the confidence scale
_SHIPPED = "in the shipped recording"
NEAR = 0.9  # of the greatest value


@dataclass(frozen=True, eq=False)
class EnvironmentLandscapes:
    """The landscapes of an environment, one a recording, the shipped one's first.

    Attributes:
        landscapes: One a recording.
        experts: Of each.
    """

    landscapes: tuple[Landscape, ...]
    experts: tuple[str, ...]

    def sample(
        self,
        value: Callable[[Landscape], float],
        in_part: Callable[[Landscape], bool] | None = None,
    ) -> Sample:
        """A number or a truth of each landscape."""
        return Sample(
            np.array([value(one) for one in self.landscapes]),
            self.experts,
            in_part and np.array([in_part(one) for one in self.landscapes]),
        )


Environments = Mapping[str, EnvironmentLandscapes]


def recorded(frame: pd.DataFrame) -> Environments:
    """The landscapes in the table of a figure."""
    experts = experts_in(frame)
    return {
        env_id: EnvironmentLandscapes(tuple(own.values()), experts[env_id])
        for env_id, own in landscapes_of(frame).items()
    }


def _everywhere(
    environments: Environments, holds: Callable[[Landscape], bool]
) -> tuple[Sample, ...]:
    return tuple(own.sample(holds) for own in environments.values())


def _cart(environments: Environments) -> tuple[Landscape, ...]:
    return environments[_PAPER_ENVIRONMENT].landscapes


def most_rules(environments: Environments) -> Measurement:
    """Whether no cell has more rules than the corner where nothing is filtered."""
    corners = [one.rule_count[0, -1] for one in _cart(environments)]
    greatest = [one.rule_count.max() for one in _cart(environments)]
    return Measurement(
        _everywhere(environments, lambda one: _is_corner(one.rule_count)),
        f"Cart Pole has {number_range(corners)} rules there, and at most "
        f"{number_range(greatest)} anywhere.",
        {
            f"rules_{env_id}": float(own.landscapes[0].rule_count[0, -1])
            for env_id, own in environments.items()
        },
    )


def fewer_with_less_confidence(environments: Environments) -> Measurement:
    """Whether the number falls with the confidence at support 0."""
    cart = _cart(environments)[0]
    row = cart.rule_count[0]
    drop = int(np.diff(row).argmax())
    return Measurement(
        _everywhere(environments, lambda one: bool((np.diff(one.rule_count[0]) >= 0).all())),
        f"On Cart Pole, {_SHIPPED}, it falls from {int(row[-1]):,} to {int(row[0]):,}; the "
        f"largest single drop is from {int(row[drop + 1]):,} to {int(row[drop]):,} rules, between "
        f"confidence {cart.confidences[drop + 1]:g} and {cart.confidences[drop]:g}.",
        {
            "rules_at_confidence_1": float(row[-1]),
            "rules_at_confidence_0": float(row[0]),
            "largest_drop": float(np.diff(row).max()),
        },
    )


def fewer_with_more_confidence(environments: Environments) -> Measurement:
    """At how many supports confidence 1 gives fewer rules than the middle of the scale."""
    cart = _cart(environments)
    middle = int(np.searchsorted(cart[0].confidences, 0.5))
    fewer = np.array([one.rule_count[:, -1] < one.rule_count[:, middle] for one in cart])
    more = np.array([one.rule_count[:, -1] > one.rule_count[:, middle] for one in cart])
    before = " At support 0 it gives more, as the paper says one sentence before."
    experts = environments[_PAPER_ENVIRONMENT].experts
    return Measurement(
        (Sample(np.all(fewer, axis=1), experts, in_part=np.any(fewer, axis=1)),),
        f"On Cart Pole, asking confidence 1 in place of {cart[0].confidences[middle]:g} gives "
        f"fewer rules at {number_range(fewer.sum(axis=1))} of {fewer.shape[1]} minimum supports, "
        f"and more at {number_range(more.sum(axis=1))}.{before if more[:, 0].all() else ''}",
        {"fewer_at": float(fewer[0].sum()), "more_at": float(more[0].sum())},
    )


def fewer_with_more_support(environments: Environments) -> Measurement:
    """Whether the number falls as support rises."""
    cart = _cart(environments)[0]
    first, following = (int(cart.rule_count[row, -1]) for row in (0, 1))
    return Measurement(
        _everywhere(environments, lambda one: bool((np.diff(one.rule_count, axis=0) <= 0).all())),
        f"On Cart Pole at confidence 1, {_SHIPPED}, it falls from {first:,} at support 0 to "
        f"{counted(following, 'rule')} at {cart.supports[1]:g}.",
        {"rules_at_0": float(first), "rules_at_next": float(following)},
    )


def longest_rules(environments: Environments) -> Measurement:
    """Whether no cell has longer rules than the corner where nothing is filtered."""
    corners = [float(one.mean_length[0, -1]) for one in _cart(environments)]
    greatest = [float(one.mean_length.max()) for one in _cart(environments)]
    samples = tuple(
        own.sample(
            lambda one: _is_corner(one.mean_length),
            lambda one: bool(one.mean_length[0, -1] >= NEAR * one.mean_length.max()),
        )
        for own in environments.values()
    )
    agreeing = sum(InMost().finding(sample).verdict == "agrees" for sample in samples)
    return Measurement(
        samples,
        f"On Cart Pole they have {number_range(corners, 1)} conditions there on average, and up to "
        f"{number_range(greatest, 1)} elsewhere. The verdict is the paper's in {agreeing} of "
        f"{len(samples)} environments.",
        {"at_support_0_confidence_1": corners[0], "greatest": greatest[0]},
    )


def longest_in_the_middle(environments: Environments) -> Measurement:
    """Whether rules are longest in the middle of the confidence scale above support 0."""
    cart = _cart(environments)
    places = np.array([_greatest_at(one) for one in cart])
    inside = (places >= _MIDDLE[0]) & (places <= _MIDDLE[1])
    moved = places < cart[0].confidences[-1]
    experts = environments[_PAPER_ENVIRONMENT].experts
    return Measurement(
        (Sample(np.all(inside, axis=1), experts, in_part=np.any(moved, axis=1)),),
        "On Cart Pole they stand in the middle half of the scale at "
        f"{number_range(inside.sum(axis=1))} of {places.shape[1]} minimum supports above 0, and "
        f"below confidence 1 at {number_range(moved.sum(axis=1))}; {_SHIPPED} they go from "
        f"{places[0, 0]:.2f} at support {cart[0].supports[1]:g} to {places[0, -1]:.2f} at "
        f"{cart[0].supports[-1]:g}.",
        {
            "in_the_middle": float(inside.sum(axis=1).mean()),
            "below_1": float(moved.sum(axis=1).mean()),
        },
    )


def _greatest_at(landscape: Landscape) -> NDArray[np.float64]:
    """The confidence with the longest rules at each support above the first; the mean of ties."""
    lengths = landscape.mean_length[1:]
    ties = lengths == lengths.max(axis=1, keepdims=True)
    return np.asarray((ties * landscape.confidences).sum(axis=1) / ties.sum(axis=1))


def number_and_length(environments: Environments) -> Measurement:
    """How alike number and length rank over the cells."""
    samples = {env_id: own.sample(_rank_correlation) for env_id, own in environments.items()}
    means = {env_id: sample.interval.mean for env_id, sample in samples.items()}
    least = min(means, key=lambda env_id: means[env_id])
    return Measurement(
        tuple(samples.values()),
        "Over the grid, number and length rank alike with a correlation of "
        f"{rounded_text(means[_PAPER_ENVIRONMENT], 2)} on Cart Pole (1 is the same order); the "
        f"least is {rounded_text(means[least], 2)}, on {environment_name(least)}.",
        means,
    )


def _rank_correlation(one: Landscape) -> float:
    """Spearman's, of number and length over the cells."""
    from scipy.stats import rankdata

    ranks = rankdata(np.array([one.rule_count.ravel(), one.mean_length.ravel()]), axis=1)
    return float(np.corrcoef(ranks)[0, 1])


def _is_corner(values: NDArray[Any]) -> bool:
    return bool(values[0, -1] == values.max())
