"""What two rule sets have in common: rules added, removed and changed.

Rules are paired in three rounds. First those that ask the same, whatever path led there. Then
those whose regions share more than half of the states that either of them reaches, the largest
share first. Then those that neither of the sets reaches on the states at hand and whose paths ask
about the same features in the same order, where each set has just one left of that kind. What
stays without a partner was added or removed.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import observed_features
from sarl_core.demonstrations.derived import definitions_of
from sarl_core.environments.feature_order import NamedFeatures, only_counts
from sarl_core.errors import InputError
from sarl_core.mining.editing.manual_rules import region_of
from sarl_core.mining.editing.shared_words import in_shared_words
from sarl_core.mining.rule_order import Fitted, fitted_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

What = Literal["conditions", "action", "switched", "place", "origin"]
Regions = tuple[NDArray[np.int64], NDArray[np.int64]]

_HALF = 0.5


class RuleChange(NamedTuple):
    """A rule that is in both sets and not the same in both.

    Attributes:
        before: As it is in the first set.
        after: As it is in the second.
        what: What differs: its ``conditions``, the ``action`` it says, whether it is ``switched``
            on, its ``place`` (pinned or not, or its order among the placed rules), its ``origin``.
    """

    before: Rule
    after: Rule
    what: tuple[What, ...]


@dataclass(frozen=True)
class Difference:
    """How the second of two rule sets differs from the first.

    Attributes:
        added: Rules that only the second has.
        removed: Rules that only the first has.
        changed: Rules of both that differ.
        same: Number of rules that are the same in both.
    """

    added: tuple[Rule, ...]
    removed: tuple[Rule, ...]
    changed: tuple[RuleChange, ...]
    same: int


def comparable(first: RuleSet, second: RuleSet) -> Fitted:
    """Put a rule set into the order of another's features, or refuse to compare them.

    Names may have been edited: where both say the same environment, the places of features and
    the numbers of labels tell.

    Args:
        first: A rule set.
        second: Another.

    Returns:
        The second set, in the first one's order.

    Raises:
        InputError: If their features, actions or intervals differ.
    """
    known = first.source.env_id != "" and first.source.env_id == second.source.env_id
    observed = [observed_features(each.source.features) for each in (first, second)]
    if len(observed[0]) != len(observed[1]):
        raise _of_other_features(first, second)
    if len(first.actions) != len(second.actions):
        raise InputError(
            f"the two rule sets are for {len(first.actions)} and {len(second.actions)} action "
            "dimensions; give two of the same environment"
        )
    fitted = fitted_rules(
        second,
        NamedFeatures(
            "the first rules",
            tuple(feature.name for feature in observed[0]),
            first.source.env_id,
        ),
        tuple(action.name for action in first.actions),
        rules="the second rules",
    )
    others = "" not in (first.source.env_id, second.source.env_id) and not known
    if others and fitted.rule_set is not second:
        raise _of_other_features(first, second)
    second = fitted.rule_set
    if definitions_of(first.source.features) != definitions_of(second.source.features):
        raise InputError(
            "the two rule sets derive different features; let them derive the same: "
            "in_shared_words(first, second)"
        )
    for one, other in zip(first.actions, second.actions, strict=True):
        if one.edges != other.edges:
            divided = [
                f"{action.n_labels} {'intervals' if action.is_interval else 'labels'}"
                for action in (one, other)
            ]
            if one.n_labels == other.n_labels:
                divided = ["intervals with some edges", "intervals with others"]
            raise InputError(
                f"the action {one.name!r} has {divided[0]} in one rule set and {divided[1]} in the "
                "other; mine both with the same divider and bounds"
            )
        same_labels = one.is_interval or one.actions == other.actions
        named = not known and not any(map(only_counts, (one.label_names, other.label_names)))
        if not same_labels or (named and one.label_names != other.label_names):
            raise InputError(
                f"the two rule sets are for different actions ({_listed(one.label_names)}; "
                f"{_listed(other.label_names)}); give two of the same environment"
            )
    return fitted


def _of_other_features(first: RuleSet, second: RuleSet) -> InputError:
    names = (tuple(one.name for one in each.source.features) for each in (first, second))
    words = "".join(f"; {note}" for note in in_shared_words(first, second).notes)
    return InputError(
        f"the two rule sets are for different features ({'; '.join(map(_listed, names))}{words}); "
        "give two of the same environment"
    )


def _listed(names: tuple[str, ...] | list[str], most: int = 4) -> str:
    return f"{len(names)}: {', '.join(names[:most])}" + (", ..." if len(names) > most else "")


def rule_difference(
    first: RuleSet,
    second: RuleSet,
    regions: tuple[Regions, Regions] | None = None,
    *,
    states: int = 0,
) -> Difference:
    """Pair the rules of two sets.

    Args:
        first: A rule set.
        second: Another, of the same features and actions.
        regions: For each set every rule (its index) with every state to which it applies (its
            row), two arrays of equal length; None where there are no states.
        states: Number of states.

    Returns:
        What was added, removed and changed on the way from the first to the second.

    Raises:
        InputError: If the two are for different features or actions.
    """
    second = comparable(first, second).rule_set
    pairing = _Pairing(first, second)
    pairing.by_conditions()
    if regions is not None:
        pairing.by_region(*regions, states)
    pairing.by_path(*(regions or (None, None)))
    pairs = sorted(pairing.pairs)
    moved = _moved(first, second, pairs)
    changed = []
    for here, there in pairs:
        before, after = first.rules[here], second.rules[there]
        what = _what(before, after, moved=(here, there) in moved)
        if what:
            changed.append(RuleChange(before, after, what))
    return Difference(
        added=tuple(second.rules[there] for there in sorted(pairing.free[1])),
        removed=tuple(first.rules[here] for here in sorted(pairing.free[0])),
        changed=tuple(changed),
        same=len(pairs) - len(changed),
    )


class _Pairing:
    """Rules of two sets on their way to a partner."""

    def __init__(self, first: RuleSet, second: RuleSet) -> None:
        self._rules = (first.rules, second.rules)
        self.free = (set(range(len(first))), set(range(len(second))))
        self.pairs: list[tuple[int, int]] = []

    def _pair(self, here: int, there: int) -> None:
        self.pairs.append((here, there))
        self.free[0].discard(here)
        self.free[1].discard(there)

    def by_conditions(self) -> None:
        """The same region; of several with the same one, first those that say the same."""
        for with_action in (True, False):
            known: dict[object, list[int]] = defaultdict(list)
            for there in sorted(self.free[1], reverse=True):
                known[_region_key(self._rules[1][there], with_action)].append(there)
            for here in sorted(self.free[0]):
                partners = known[_region_key(self._rules[0][here], with_action)]
                if partners:
                    self._pair(here, partners.pop())

    def by_region(self, first: Regions, second: Regions, states: int) -> None:
        """The largest share of common states, more than half of those that either reaches."""
        from scipy.sparse import csr_array

        reach = [
            csr_array(
                (np.ones(len(rules), dtype=np.int64), (rules, rows)), shape=(len(ruled), states)
            )
            for (rules, rows), ruled in zip((first, second), self._rules, strict=True)
        ]
        common = (reach[0] @ reach[1].T).tocoo()
        sizes = [np.asarray(one.sum(axis=1)).reshape(-1) for one in reach]
        either = sizes[0][common.row] + sizes[1][common.col] - common.data
        share = common.data / np.maximum(either, 1)
        for at in np.lexsort((common.col, common.row, -share)).tolist():
            if share[at] <= _HALF:
                break
            here, there = int(common.row[at]), int(common.col[at])
            alike = _kind(self._rules[0][here]) == _kind(self._rules[1][there])
            if alike and here in self.free[0] and there in self.free[1]:
                self._pair(here, there)

    def by_path(self, first: Regions | None, second: Regions | None) -> None:
        """The same questions in the same order, of rules that nothing tells more about."""
        waiting: list[dict[object, list[int]]] = []
        for rules, free, regions in zip(self._rules, self.free, (first, second), strict=True):
            reached = set(() if regions is None else np.unique(regions[0]).tolist())
            known: dict[object, list[int]] = defaultdict(list)
            for index in sorted(free - reached):
                rule = rules[index]
                path = tuple((condition.feature, condition.op) for condition in rule.conditions)
                known[_kind(rule), path].append(index)
            waiting.append(known)
        for kind, ours in waiting[0].items():
            theirs = waiting[1].get(kind, [])
            if len(ours) == len(theirs) == 1:
                self._pair(ours[0], theirs[0])


def _region_key(rule: Rule, with_action: bool) -> object:
    says = rule.action if with_action and not rule.forbids else None
    return _kind(rule), region_of(rule), says


def _kind(rule: Rule) -> object:
    """Rules of other kinds are never the same one: to forbid, one has to forbid the same."""
    return rule.dimension, tuple(sorted(rule.forbids))


def _moved(first: RuleSet, second: RuleSet, pairs: list[tuple[int, int]]) -> set[tuple[int, int]]:
    """Pairs of placed rules whose order among those of both sets is another."""
    moved: set[tuple[int, int]] = set()
    for dimension in range(len(first.actions)):
        placed = [
            pair
            for pair in pairs
            if first.rules[pair[0]].placed
            and second.rules[pair[1]].placed
            and first.rules[pair[0]].dimension == dimension
        ]
        in_second = sorted(placed, key=lambda pair: pair[1])
        moved |= {pair for pair, other in zip(placed, in_second, strict=True) if pair != other}
    return moved


def _what(before: Rule, after: Rule, *, moved: bool) -> tuple[What, ...]:
    differs: dict[What, bool] = {
        "conditions": region_of(before) != region_of(after),
        "action": before.action != after.action and not before.forbids,
        "switched": before.enabled != after.enabled,
        "place": moved or before.pinned != after.pinned,
        "origin": before.origin != after.origin,
    }
    return tuple(what for what, differing in differs.items() if differing)
