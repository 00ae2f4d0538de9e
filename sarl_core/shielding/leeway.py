"""What rules leave an agent to choose from, and whether the expert would have kept to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.applications import labels_of
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.shielding.shield import Shield


@dataclass(frozen=True)
class Leeway:
    """What rules say of demonstrated pairs, each mean over the action dimensions.

    Attributes:
        coverage: Share of the pairs to which a rule applies.
        fidelity: Share of these that are as the rules say; NaN where none applies.
        freedom: Mean over the pairs of log(labels still allowed) / log(labels).
    """

    coverage: float
    fidelity: float
    freedom: float


def allowed_actions(shield: Shield, observations: ArrayLike, count: int) -> NDArray[np.bool_]:
    """What a shield lets pass in each state.

    Args:
        shield: For one discrete action, counted from 0.
        observations: Shape (B, d).
        count: Number of actions.

    Returns:
        Shape (B, count); at least one in each state. Where everything is forbidden, what the
        shield executes then.

    Raises:
        InputError: As `Shield.decide_batch`.
    """
    states = np.asarray(observations)
    proposed = np.repeat(np.arange(count), len(states))
    # Asked of the shield itself, so that the two never differ.
    decision = shield.decide_batch(np.tile(states, (count, 1)), proposed)
    return ~decision.intervened.reshape(count, len(states)).T


def leeway_of(rule_set: RuleSet, demonstrations: Demonstrations) -> Leeway:
    """Hold rules against what the expert did.

    Rules that forbid overlap, so that what they cover together is seen in the pairs alone.

    Args:
        rule_set: In the order of the same features and action dimensions.
        demonstrations: N pairs.

    Returns:
        What they say of them.

    Raises:
        InputError: If the pairs are for other rules.
    """
    shield = Shield(rule_set, on_invalid="pass")
    states = demonstrations.raw_observations
    decision = shield.decide_batch(states, demonstrations.actions)
    covered = decision.rules >= 0
    labels = labels_of(rule_set, demonstrations)
    obeyed = int(obeying_labels(rule_set)[decision.rules[covered], labels[covered]].sum())
    count = int(covered.sum())
    return Leeway(
        coverage=float(covered.mean()),
        fidelity=obeyed / count if count else float("nan"),
        freedom=float(shield.freedom(states, decision.rules).mean()),
    )
