"""What rules leave an agent to choose from, and whether the expert would have kept to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.applications import labels_of
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.mining.rule_tree import NO_RULE
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


@dataclass(frozen=True)
class LabelsLeft:
    """What never-rules take away in one state, of one action dimension with L labels.

    Attributes:
        forbidden: The labels that are replaced, ascending, and the index of the rule that forbids
            each.
        left: The others, at least one.
    """

    forbidden: tuple[tuple[int, int], ...]
    left: tuple[int, ...]

    @property
    def freedom(self) -> float:
        """What is left to choose from: log(labels left) / log(labels), 1 of a single label."""
        labels = len(self.left) + len(self.forbidden)
        return float(np.log(len(self.left)) / np.log(labels)) if labels > 1 else 1.0


def labels_left(shield: Shield, state: NDArray[np.float32], dimension: int) -> LabelsLeft | None:
    """What may be done in one state.

    Args:
        shield: Any.
        state: Shape (d,).
        dimension: Index of the action dimension.

    Returns:
        None where no never-rule applies there, or one that demands decides.

    Raises:
        InputError: As `Shield.decide`.
    """
    rule_set = shield.rule_set
    (in_force,) = shield.rules_in_force(state[None])
    rule = int(in_force[dimension])
    if rule < 0 or not rule_set.rules[rule].forbids:
        return None
    # Every label is proposed: what is executed as it is, is left.
    wanted = [_proposable(one) for one in rule_set.actions]
    count = len(wanted[dimension])
    proposed = np.array([[values[0] for values in wanted]] * count)
    proposed[:, dimension] = wanted[dimension]
    states = np.repeat(state[None], count, axis=0)
    decided = shield.decide_batch(states, proposed if len(wanted) > 1 else proposed[:, 0])
    executed = rule_set.actions[dimension].labels_of(
        np.reshape(decided.executed, proposed.shape)[:, dimension]
    )
    changed = executed != np.arange(count)
    return LabelsLeft(
        tuple(
            (int(label), int(decided.rules[label, dimension])) for label in np.flatnonzero(changed)
        ),
        tuple(np.flatnonzero(~changed).tolist()),
    )


def labels_left_of_each(shield: Shield, states: NDArray[np.float32]) -> list[NDArray[np.bool_]]:
    """What may be done in each of many states, whatever rules decide there.

    Args:
        shield: With m action dimensions.
        states: Shape (B, d).

    Returns:
        Of each dimension with L labels which of them are executed as they are, (B, L); at least one
        in each state.
    """
    actions = shield.rule_set.actions
    wanted = [_proposable(one) for one in actions]
    left = [np.zeros((len(states), len(values)), dtype=np.bool_) for values in wanted]
    for turn in range(max(map(len, wanted))):  # asked of the shield itself, as above
        labels = [min(turn, len(values) - 1) for values in wanted]
        proposed = np.array([[values[at] for values, at in zip(wanted, labels, strict=True)]])
        proposed = np.repeat(proposed, len(states), axis=0)
        decided = shield.decide_batch(states, proposed if len(wanted) > 1 else proposed[:, 0])
        executed = np.reshape(decided.executed, proposed.shape)
        for place, (action, label) in enumerate(zip(actions, labels, strict=True)):
            left[place][:, label] = action.labels_of(executed[:, place]) == label
    return left


def left_codes(left: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Numbers for the labels that are left, the same for the same ones.

    Args:
        left: Which are, (B, L).

    Returns:
        The label where one is left, a number past the last label where several are, and -1 where
        all are, (B,).
    """
    count = left.shape[1]
    kinds, of_each = np.unique(left, axis=0, return_inverse=True)
    codes = [
        int(kind.argmax())
        if kind.sum() == 1
        else NO_RULE
        if kind.all()
        else count + int.from_bytes(blake2b(kind.tobytes(), digest_size=6).digest())
        for kind in kinds
    ]
    return np.array(codes, dtype=np.int64)[of_each.reshape(-1)]


def _proposable(dimension: LabelledDimension) -> Sequence[float]:
    """An action of each label."""
    if not dimension.is_interval:
        return dimension.actions
    return [(low + high) / 2 for low, high in pairwise(dimension.edges)]


def leeway_in(rule_set: RuleSet, states: NDArray[np.float32]) -> Leeway:
    """What rules leave in states of which nobody knows what an expert would do.

    Args:
        rule_set: Any.
        states: Shape (B, d).

    Returns:
        With a fidelity of NaN.
    """
    shield = Shield(rule_set, on_invalid="pass")
    rules = shield.rules_in_force(states)
    freedom = float(shield.freedom(states, rules).mean())
    return Leeway(coverage=float((rules >= 0).mean()), fidelity=float("nan"), freedom=freedom)


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
