"""What a rule is, and the thresholds that rules are mined at."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral, Real
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError, require
from sarl_core.mining.evidence import DataBox, HeldOut

Operator = Literal["<=", ">"]
Kind = Literal["do", "never"]
Origin = Literal["mined", "manual", "probed"]
T = TypeVar("T")

FIRST_REGROWN, LAST_REGROWN = 10**15, 9 * 10**15 - 1
"""Numbers of nodes that were regrown: no tree has as many nodes, and floats hold them exactly."""
_DIGITS = len(str(FIRST_REGROWN))


class Condition(NamedTuple):
    """One query of a rule.

    Attributes:
        feature: Index into the observation vector.
        op: Whether the feature must be at most the threshold, or above it.
        threshold: At full precision; a float32 state is compared with it as it is.
    """

    feature: int
    op: Operator
    threshold: float


class Bounds(NamedTuple):
    """What a rule asks of one feature, all its queries together: low < x <= high.

    Attributes:
        feature: Index into the observation vector.
        low: Exclusive; -inf where there is none.
        high: Inclusive; inf where there is none.
    """

    feature: int
    low: float
    high: float


@dataclass(frozen=True)
class Rule:
    """Conditions joined by *and*, and the label that follows.

    Attributes:
        id: Unique within its rule set; of a mined rule "dimension.node".
        dimension: Action dimension it speaks of.
        conditions: In path order; () applies always.
        action: The label; of a never-rule that which comes first in the place of what it forbids.
        support: Share of all pairs to which it applies.
        confidence: Share of those that carry its label; of a never-rule, that carry none which it
            forbids; of a probed one, in which the expert failed after what it forbids.
        lift: Confidence over the same share of all pairs.
        samples: Number of pairs to which it applies.
        enabled: Whether a shield uses it.
        origin: Whether it was mined, written by a person, or follows from probes.
        demonstrated_value: Of a continuous dimension, the median action shown where it
            applies; None otherwise.
        pinned: Whether a person has given it its place: it comes before those that were only
            mined, in the order of the rule set, as manual ones do.
        box: Where its pairs lay; None where that was not kept.
        held_out: How it fares on episodes held out; None where there are none.
        forbids: The labels that a never-rule forbids, ascending; () for a rule that demands one.
        instead: Of a never-rule the other labels, the most frequent where it applies first: what
            comes in the place of one that it forbids is the first that no other rule forbids.
    """

    id: str
    dimension: int
    conditions: tuple[Condition, ...]
    action: int
    support: float
    confidence: float
    lift: float
    samples: int
    enabled: bool = True
    origin: Origin = "mined"
    demonstrated_value: float | None = None
    pinned: bool = False
    box: DataBox | None = None
    held_out: HeldOut | None = None
    forbids: tuple[int, ...] = ()
    instead: tuple[int, ...] = ()

    @property
    def kind(self) -> Kind:
        """Whether it says what to do, or what never to do."""
        return "never" if self.forbids else "do"

    @property
    def label(self) -> int:
        """The label that it speaks of: what it demands, or the first that it forbids."""
        return self.forbids[0] if self.forbids else self.action

    def obeyed_by(self, labels: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether actions are as it says.

        Args:
            labels: Of its dimension, any shape.

        Returns:
            The same shape.
        """
        if self.forbids:
            return np.asarray(~np.isin(labels, self.forbids))
        return np.asarray(labels == self.action)

    @property
    def placed(self) -> bool:
        """Whether a person wrote it or gave it its place; such rules come first."""
        return self.pinned or self.origin == "manual"

    @property
    def regrown(self) -> bool:
        """Whether it is of a part of the tree that a person regrew; its node's number says so."""
        number = self.id.rpartition(".")[2]
        # Somebody may have given it a name of their own; Python refuses to read the longest.
        numbered = number.isascii() and number.isdigit() and len(number) == _DIGITS
        return self.origin == "mined" and numbered and FIRST_REGROWN <= int(number) <= LAST_REGROWN

    @property
    def length(self) -> int:
        """Number of queries."""
        return len(self.conditions)

    @property
    def joint_support(self) -> float:
        """Share of all pairs to which it applies and that carry its label."""
        return self.support * self.confidence

    @property
    def correct(self) -> int:
        """Number of pairs to which it applies and that carry its label."""
        return round(self.confidence * self.samples)

    @cached_property
    def bounds(self) -> tuple[Bounds, ...]:
        """The conditions with several bounds on one feature made one interval."""
        lows: dict[int, float] = {}
        highs: dict[int, float] = {}
        for feature, op, threshold in self.conditions:
            # Each feature stands in both, in the order of its first query.
            low, high = lows.setdefault(feature, -np.inf), highs.setdefault(feature, np.inf)
            if op == "<=":
                if threshold < high:
                    highs[feature] = threshold
            elif threshold > low:
                lows[feature] = threshold
        return tuple(map(Bounds, lows, lows.values(), highs.values()))

    def applies(self, observations: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether its conditions hold.

        Args:
            observations: Shape (B, d + k), float32: what is observed, and what is derived from it.

        Returns:
            Shape (B,).
        """
        holds = np.ones(len(observations), dtype=np.bool_)
        for feature, op, threshold in self.conditions:
            values = observations[:, feature]
            # What has no value is on neither side.
            holds &= (
                values <= np.float64(threshold) if op == "<=" else values > np.float64(threshold)
            )
        return holds


def along_paths(rules: Iterable[Rule], start: T, step: Callable[[T, Condition], T]) -> Iterator[T]:
    """What is worked out along the path to each rule, once for the beginnings that they share.

    Args:
        rules: In the order of their tree most of a path is that of the rule before; in any other
            order it takes longer and comes to the same.
        start: Where nothing was asked yet.
        step: What comes of that which stands before a condition; it leaves that as it is.

    Yields:
        What stands at the end of each rule's path.
    """
    path: tuple[Condition, ...] = ()
    values = [start]
    for rule in rules:
        shared = 0
        for before, condition in zip(path, rule.conditions, strict=False):
            if before is not condition and before != condition:
                break
            shared += 1
        del values[shared + 1 :]
        path = rule.conditions
        for condition in path[shared:]:
            values.append(step(values[-1], condition))
        yield values[-1]


def share_bounds(rules: Iterable[Rule]) -> None:
    """Work out the `bounds` of many rules, which are then there when they are asked for.

    Args:
        rules: Those of them that have theirs already are left alone.
    """
    lacking = [rule for rule in rules if "bounds" not in vars(rule)]
    start: dict[int, Bounds] = {}
    for rule, by_feature in zip(lacking, along_paths(lacking, start, _narrowed), strict=True):
        vars(rule)["bounds"] = tuple(by_feature.values())


def _narrowed(by_feature: dict[int, Bounds], condition: Condition) -> dict[int, Bounds]:
    """What is asked of each feature, in the order of its first query, with one query more."""
    feature, op, threshold = condition
    _, low, high = by_feature.get(feature, (feature, -np.inf, np.inf))
    if op == "<=":
        high = min(high, threshold)
    else:
        low = max(low, threshold)
    return {**by_feature, feature: Bounds(feature, low, high)}


def take_back_unanswered(
    in_force: NDArray[np.int64], states: NDArray[np.float32], rules: Sequence[Rule]
) -> None:
    """Where a rule was found by walking a tree, but asks about a formula that has no value there.

    A walk goes on to the right of such a query; below it, every rule has the query among its own.

    Args:
        in_force: Index of a rule or -1, (B,); becomes -1 there.
        states: Shape (B, d + k), float32.
        rules: What the indices are of.
    """
    for row in np.flatnonzero(np.isnan(states).any(axis=1) & (in_force >= 0)).tolist():
        conditions = rules[int(in_force[row])].conditions
        if any(np.isnan(states[row, feature]) for feature, _, _ in conditions):
            in_force[row] = -1


def node_of(rule: Rule) -> int:
    """The tree node at which a mined rule was cut.

    Args:
        rule: A mined one.

    Returns:
        Node number in the tree of its dimension; where a part of that was regrown, what its
        `number` has.
    """
    return int(rule.id.rsplit(".", 1)[1])


def as_numbered(rules: Sequence[Rule]) -> Sequence[Rule]:
    """Rules in the order in which they are numbered.

    A mined rule that is pinned goes to the front, and is still called what it was called among the
    mined ones. Rules that a person wrote come after those, as they were written.

    Args:
        rules: In the order in which they are asked.

    Returns:
        The same as they stand, where none is placed, or the others' order does not say where one
        was.
    """
    if not any(rule.placed for rule in rules):
        return rules
    try:
        numbers = {
            rule.id: (rule.origin != "mined", rule.dimension, node_of(rule)) for rule in rules
        }
    except (IndexError, ValueError):
        return rules
    left = [numbers[rule.id] for rule in rules if not rule.placed]
    return sorted(rules, key=lambda rule: numbers[rule.id]) if left == sorted(left) else rules


def name_at(place: int) -> str:
    """What people call a rule.

    Args:
        place: Its place in the set, from 0.

    Returns:
        As "R1" for the first.
    """
    return f"R{place + 1}"


@dataclass(frozen=True)
class Thresholds:
    """The thresholds of a rule set.

    Attributes:
        support: Minimum support.
        confidence: Minimum confidence.
        lift: Minimum lift.
        max_depth: Longest rule, None without limit.
        never: Epsilon of its never-rules: most that the upper bound of a forbidden label's share
            may be; None where there are none.
        demands: Whether there are rules that demand at them, before the never-rules where there
            are some.
    """

    support: float
    confidence: float
    lift: float = 0.0
    max_depth: int | None = None
    never: float | None = None
    demands: bool = True

    def __post_init__(self) -> None:
        """Refuse what no rule set can have.

        Raises:
            InputError: If a threshold is out of range.
        """
        for name, value in (("support", self.support), ("confidence", self.confidence)):
            must = f"the minimum {name} must be a number"
            require(value, Real, must, "give a share from 0 to 1")
            if not 0.0 <= value <= 1.0:
                raise InputError(f"the minimum {name} is {value}; give a share from 0 to 1")
        require(self.lift, Real, "the minimum lift must be a number", "give 0 or more")
        if not (np.isfinite(self.lift) and self.lift >= 0.0):
            raise InputError(f"the minimum lift is {self.lift}; give 0 or more")
        if self.never is not None and not 0.0 < self.never < 1.0:
            raise InputError(
                f"epsilon, the most that a forbidden action's share may be, is {self.never}; give "
                "a share above 0 and below 1, as 0.1"
            )
        if self.max_depth is None:
            return
        must = "the maximum depth must be a whole number"
        require(self.max_depth, Integral, must, "give 0 or more, or none")
        if self.max_depth < 0:
            raise InputError(f"the maximum depth is {self.max_depth}; give 0 or more, or none")


UNFILTERED = Thresholds(support=0.0, confidence=1.0)
"""The paper's Table 1, "unfiltered"."""
FILTERED = Thresholds(support=0.005, confidence=0.95)
"""The paper's Table 1, "filtered"."""
NAMED_SETTINGS = {"filtered": FILTERED, "unfiltered": UNFILTERED}
"""The paper's Table 1, by the words that everything in this project uses for them."""
