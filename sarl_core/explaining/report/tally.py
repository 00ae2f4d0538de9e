"""What a report counts: the rules on the demonstrations it is about, each state under its rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.applications import applications
from sarl_core.mining.edit_counts import is_plain
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.rule_order import Fitted, rules_for
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.episode_counts import count_applied
from sarl_core.shielding.leeway import Leeway, leeway_of
from sarl_core.shielding.shield import Shield


class Share(NamedTuple):
    """So many of so many.

    Attributes:
        part: How many.
        whole: Of how many.
    """

    part: int
    whole: int

    @property
    def value(self) -> float:
        """0 to 1; NaN of nothing."""
        return self.part / self.whole if self.whole else float("nan")


@dataclass(frozen=True, eq=False)
class Tally:
    """Rules counted on N demonstrated pairs with m action dimensions.

    Attributes:
        same: Whether the rules were mined from these very demonstrations, or all of them.
        sampled: Whether they are a sample of those, which was counted where it was mined.
        split: Whether they were mined from some of these episodes and tried on all the others.
        rules: Index of the rule in force or -1, (N, m) int64.
        labels: What the expert did, (N, m) int64.
        shares: Of each rule, in how many of its states the expert did what it says, or did not
            what it forbids.
        by_episode: The same of each rule, counted by episodes.
        in_force: Number of rules that are switched on.
        leeway: What rules leave, where some of those in force forbid; None where all demand.
    """

    same: bool
    sampled: bool
    split: bool
    rules: NDArray[np.int64]
    labels: NDArray[np.int64]
    shares: tuple[Share, ...]
    by_episode: tuple[HeldOut, ...]
    in_force: int
    leeway: Leeway | None = None

    def covered(self, dimension: int) -> Share:
        """In how many states a rule of a dimension applies."""
        column = self.rules[:, dimension]
        return Share(int((column >= 0).sum()), len(column))

    def rows(self, rule: int, dimension: int) -> NDArray[np.int64]:
        """The states of a rule, ascending."""
        return np.flatnonzero(self.rules[:, dimension] == rule)

    @property
    def coverage(self) -> float:
        """Share of states with a rule, averaged over action dimensions."""
        return float((self.rules >= 0).mean())

    @property
    def decides(self) -> bool:
        """Whether the rules name an action in every state, so that nobody else has a choice."""
        return self.leeway is None and self.coverage == 1.0

    @property
    def followed(self) -> Share:
        """In how many of the covered states the expert did as the rules say."""
        whole = int((self.rules >= 0).sum())
        if self.leeway is not None:  # rules that forbid overlap: their states do not add up
            return Share(round(self.leeway.fidelity * whole) if whole else 0, whole)
        return Share(sum(share.part for share in self.shares), whole)


def report_rules(rule_set: RuleSet, demonstrations: Demonstrations) -> Fitted:
    """The rules as a report speaks of them: in the order of the demonstrations' features.

    Args:
        rule_set: The rules.
        demonstrations: N pairs.

    Returns:
        Under their own names.

    Raises:
        InputError: If features or actions are others.
    """
    fitted = rules_for(rule_set, demonstrations)
    for rules, data in zip(fitted.rule_set.actions, demonstrations.action_dimensions, strict=True):
        if not rules.is_interval and rules.actions != data.actions:
            raise InputError(
                f"the action {rules.name!r} has {rules.n_labels} values in the rules and "
                f"{len(data.labels)} in the demonstrations; give the demonstrations the rules "
                "were mined from"
            )
    return fitted


def same_environment(rule_set: RuleSet, demonstrations: Demonstrations) -> bool:
    """Whether rules and demonstrations are known to be of one environment.

    Args:
        rule_set: The rules.
        demonstrations: Any.

    Returns:
        False also where one of them does not say.
    """
    return bool(demonstrations.env_id) and rule_set.source.env_id == demonstrations.env_id


def tally(rule_set: RuleSet, demonstrations: Demonstrations) -> Tally:
    """Count rules on demonstrations.

    Args:
        rule_set: The rules; those that are switched off count nothing.
        demonstrations: N pairs of the same features and actions.

    Returns:
        The counts; a state belongs to the rule a shield would find for it, and to all rules that
        forbid something there.

    Raises:
        InputError: If features or actions differ.
    """
    rule_set = report_rules(rule_set, demonstrations).rule_set
    actions = demonstrations.action_columns
    in_force = Shield(rule_set).rules_in_force(demonstrations.observations)
    labels = np.stack(
        [one.labels_of(actions[:, index]) for index, one in enumerate(rule_set.actions)], axis=1
    )
    count = len(rule_set.rules)
    row, dimension = np.nonzero(in_force >= 0)
    rule = in_force[row, dimension]
    if rule_set.forbids:
        rule, row, dimension = _with_forbidding(rule, row, dimension, rule_set, demonstrations)
    right = obeying_labels(rule_set)[rule, labels[row, dimension]]
    by_episode = count_applied(count, rule, row, right, demonstrations).held_out()
    shares = tuple(Share(one.correct, one.samples) for one in by_episode)
    same = rule_set.source.digest == demonstrations.whole.digest
    return Tally(
        same=same,
        sampled=same and len(demonstrations) < rule_set.source.steps,
        split=_is_split(rule_set, demonstrations, shares),
        rules=in_force,
        labels=labels,
        shares=shares,
        by_episode=tuple(by_episode),
        in_force=sum(rule.enabled for rule in rule_set.rules),
        leeway=leeway_of(rule_set, demonstrations)
        if any(rule.forbids and rule.enabled for rule in rule_set.rules)
        else None,
    )


def _with_forbidding(
    rule: NDArray[np.int64],
    row: NDArray[np.int64],
    dimension: NDArray[np.int64],
    rule_set: RuleSet,
    demonstrations: Demonstrations,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Give each rule that forbids all states to which it applies, and not one of several."""
    forbids = np.array([bool(one.forbids) for one in rule_set.rules])
    usable = forbids & np.array([one.enabled for one in rule_set.rules])
    of_rule = np.array([one.dimension for one in rule_set.rules])
    applied = applications(rule_set, demonstrations.observations)
    more, demands = usable[applied.rule], ~forbids[rule]
    subject = applied.rule[more]
    return (
        np.concatenate([rule[demands], subject]),
        np.concatenate([row[demands], applied.row[more]]),
        np.concatenate([dimension[demands], of_rule[subject]]),
    )


def _is_split(rule_set: RuleSet, demonstrations: Demonstrations, shares: Sequence[Share]) -> bool:
    """Whether what was mined from and what was held out add up to the demonstrations."""
    if not 0 < rule_set.source.episodes < demonstrations.n_episodes:
        return False
    plain = is_plain(rule_set)
    tried = [
        (rule.samples + rule.held_out.samples, rule.correct + rule.held_out.correct)
        == (share if plain else _wherever_it_applies(rule, rule_set, demonstrations))[::-1]
        for rule, share in zip(rule_set.rules, shares, strict=True)
        if rule.held_out is not None and rule.origin == "mined" and rule.enabled
    ]
    return bool(tried) and all(tried)


def _wherever_it_applies(rule: Rule, rule_set: RuleSet, demonstrations: Demonstrations) -> Share:
    """How a rule fares in all states to which it applies, also where another one decides."""
    holds = rule.applies(demonstrations.observations)
    values = demonstrations.action_columns[holds, rule.dimension]
    labels = rule_set.actions[rule.dimension].labels_of(values)
    return Share(int(rule.obeyed_by(labels).sum()), int(holds.sum()))
