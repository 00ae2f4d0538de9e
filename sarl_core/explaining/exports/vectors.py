"""Test vectors: states at every threshold, and what the shield decides there.

Whoever carries rules into other code can see whether it decides as the original does, where that
is hardest: at the thresholds and one float32 step either side.
"""

from __future__ import annotations

import csv
import io
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import observed_features
from sarl_core.explaining.exports.derived_thresholds import DerivedThresholds
from sarl_core.explaining.exports.program import DimensionProgram, largest_float32, program_of
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, RuleNode
from sarl_core.mining.rules import Condition
from sarl_core.mining.tree import LEAF
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid, Shield

_INFINITY = np.float32(np.inf)
_ODD = (np.nan, np.inf, -np.inf)


@dataclass(frozen=True, eq=False)
class Vectors:
    """States and actions, and what the shield makes of them.

    Attributes:
        states: Shape (B, d), float32.
        proposed: Shape (B, m), int64 or float32.
        rules: Index of the rule in force or -1, (B, m) int64.
        executed: Shape (B, m), int64 or float32; where nothing is to be executed, as proposed.
        invalid: Whether the state is no state, or the action none that there is, (B,).
        on_invalid: What becomes of those; nothing is executed for ``raise``.
    """

    states: NDArray[np.float32]
    proposed: NDArray[Any]
    rules: NDArray[np.int64]
    executed: NDArray[Any]
    invalid: NDArray[np.bool_]
    on_invalid: OnInvalid

    def __len__(self) -> int:
        """Number of vectors."""
        return len(self.states)


def make_vectors(
    rule_set: RuleSet, projection: Projection = "centre", on_invalid: OnInvalid = "raise"
) -> Vectors:
    """States at every threshold, one step above it and one below, and what is no state or action.

    The other features of a state are such that it reaches the threshold on the way to a rule, which
    applies on one side of it; of thresholds on derived features as nearly as there are such states
    (`DerivedThresholds`).
    Behind them come states with a number that is none or infinite, and actions that are none. Where
    rules forbid, every label is proposed in each state.

    Args:
        rule_set: The rules.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.

    Returns:
        With what `Shield` decides; the same every time.

    Raises:
        InputError: As `program_of`.
    """
    program = program_of(rule_set, projection, on_invalid)
    rule_set = program.rule_set
    rng = np.random.default_rng(0)
    typical = _typical_values(rule_set)
    derived = DerivedThresholds(rule_set.source.features, typical)
    rows = [typical]
    for order in program.searches:
        for path, query, rest in _queries(order):
            if all(one.feature < len(typical) for one in (*path, query, *rest)):
                rows += _at((*path, *rest), query.feature, query.threshold, typical, rng)
            else:
                rows += derived.states(path, query, rest, rng)
    for feature in range(len(typical)):
        for value in _ODD:
            odd = typical.copy()
            odd[feature] = value
            rows.append(odd)
    none = _no_actions(rule_set, rng)
    valid = np.array(rows, dtype=np.float32)
    actions = proposed_actions(rule_set, len(rows), rng)
    if program.forbids:
        # What is done follows from the label, and not from the state alone.
        valid = np.repeat(valid, program.most_labels, axis=0)
        actions = _every_label(rule_set, len(valid), rng)
    states = np.concatenate([valid, np.tile(typical, (len(none), 1))])
    proposed = np.concatenate([actions, none])
    return decided(rule_set, projection, on_invalid, states, proposed)


def decided(
    rule_set: RuleSet,
    projection: Projection,
    on_invalid: OnInvalid,
    states: NDArray[np.float32],
    proposed: NDArray[Any],
) -> Vectors:
    """What the shield makes of states and actions.

    Args:
        rule_set: The rules.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.
        states: Shape (B, d).
        proposed: Shape (B, m).

    Returns:
        All of it.
    """
    shield = Shield(rule_set, projection=projection, on_invalid="pass")
    decision = shield.decide_batch(states, proposed)
    invalid = np.array([why is not None for why in decision.invalid], dtype=np.bool_)
    return Vectors(states, proposed, decision.rules, decision.executed, invalid, on_invalid)


def proposed_actions(
    rule_set: RuleSet, count: int, rng: np.random.Generator
) -> NDArray[np.int64] | NDArray[np.float32]:
    """Actions to check: every label in turn; continuous ones at the edges, beside and beyond.

    Args:
        rule_set: Knows the actions.
        count: How many, B.
        rng: Where chance comes from.

    Returns:
        Shape (B, m), int64 or float32.
    """
    columns = [_values(dimension) for dimension in rule_set.actions]
    kind = np.float32 if rule_set.actions[0].is_interval else np.int64
    return np.stack([rng.choice(values, count).astype(kind) for values in columns], axis=1)


def _every_label(rule_set: RuleSet, count: int, rng: np.random.Generator) -> NDArray[Any]:
    """Actions of one label after the other, (count, m); continuous ones as `proposed_actions`."""
    actions = proposed_actions(rule_set, count, rng)
    for index, dimension in enumerate(rule_set.actions):
        values = _values(dimension)
        labels = dimension.labels_of(values)
        for label in range(dimension.n_labels):
            rows = np.arange(label, count, dimension.n_labels)
            if (labels == label).any():  # too narrow an interval holds no float32 number
                actions[rows, index] = rng.choice(values[labels == label], len(rows))
    return actions


def _no_actions(rule_set: RuleSet, rng: np.random.Generator) -> NDArray[Any]:
    """Actions one of whose values is none that there is: beyond all labels, or not finite."""
    rows = []
    for index, dimension in enumerate(rule_set.actions):
        first, count = (0, 0) if dimension.is_interval else dimension.reach
        for value in _ODD if dimension.is_interval else (first - 1, first + count):
            action = proposed_actions(rule_set, 1, rng)
            action[0, index] = value
            rows.append(action)
    return np.concatenate(rows)


def vectors_to_csv(vectors: Vectors) -> str:
    """Test vectors as CSV.

    Args:
        vectors: B of them.

    Returns:
        A header (state_0..., proposed_0..., rule_0..., executed_0..., invalid) and one line a
        vector; all numbers read back as the same ones. `invalid` is 1 where the state is no state
        or the action none; where that is an error, nothing is said to be executed.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    blocks = {
        "state": vectors.states,
        "proposed": vectors.proposed,
        "rule": vectors.rules,
        "executed": vectors.executed,
    }
    names = [f"{name}_{i}" for name, block in blocks.items() for i in range(block.shape[1])]
    writer.writerow([*names, "invalid"])
    for invalid, *row in zip(vectors.invalid.tolist(), *blocks.values(), strict=True):
        cells = [_cell(value) for part in row for value in part]
        if invalid and vectors.on_invalid == "raise":
            cells[-vectors.executed.shape[1] :] = [""] * vectors.executed.shape[1]
        writer.writerow([*cells, int(invalid)])
    return text.getvalue()


def _cell(value: Any) -> str:
    # The shortest float32 that reads back: "0.1", "nan", "-inf", "3".
    return str(int(value)) if isinstance(value, np.int64) else str(value).removesuffix(".0")


def _values(dimension: LabelledDimension) -> NDArray[Any]:
    if not dimension.is_interval:
        return np.array(dimension.actions, dtype=np.int64)
    edges = np.array(dimension.edges, dtype=np.float32)
    width = edges[-1] - edges[0] or np.float32(1)
    return np.concatenate(
        [
            edges,
            np.nextafter(edges, _INFINITY),
            np.nextafter(edges, -_INFINITY),
            np.array([dimension.centre(label) for label in range(dimension.n_labels)]),
            np.array([edges[0] - width, edges[-1] + width]),
        ]
    ).astype(np.float32)


def _typical_values(rule_set: RuleSet) -> NDArray[np.float32]:
    """A value amid the thresholds of each feature, 0 where nothing is asked."""
    by_feature: dict[int, list[float]] = {}
    for rule in rule_set.rules:
        for feature, _, threshold in rule.conditions:
            by_feature.setdefault(feature, []).append(threshold)
    values = np.zeros(len(observed_features(rule_set.source.features)), dtype=np.float32)
    for feature, thresholds in by_feature.items():
        if feature < len(values):
            values[feature] = largest_float32(float(np.median(thresholds)))
    return values


def _queries(
    order: DimensionProgram,
) -> Iterator[tuple[Sequence[Condition], Condition, Sequence[Condition]]]:
    """Every query with the way to it, and from there to a rule, of those tried and of the tree."""
    for _, rule in order.scanned:
        for depth, (feature, _, threshold) in enumerate(rule.conditions):
            query = Condition(feature, "<=", threshold)
            yield rule.conditions[:depth], query, rule.conditions[depth + 1 :]
    waiting: list[tuple[RuleNode, tuple[Condition, ...]]] = [(order.nodes[0], ())]
    while waiting:
        node, path = waiting.pop()
        if node.feature == LEAF:
            continue
        yield path, Condition(node.feature, "<=", node.threshold), _rest(order.nodes, node)
        for condition, child in _sides(node):
            waiting.append((order.nodes[child], (*path, condition)))


def _sides(node: RuleNode) -> tuple[tuple[Condition, int], tuple[Condition, int]]:
    """What holds on either side of a query, and the node there."""
    feature, threshold = node.feature, node.threshold
    return (
        (Condition(feature, "<=", threshold), node.left),
        (Condition(feature, ">", threshold), node.right),
    )


def _rest(nodes: Sequence[RuleNode], query: RuleNode) -> tuple[Condition, ...]:
    """The conditions between a query and the nearest rule that begins at its threshold."""
    waiting: deque[tuple[RuleNode, str, tuple[Condition, ...]]] = deque(
        (nodes[child], side.op, ()) for side, child in _sides(query)
    )
    while waiting:
        node, op, path = waiting.popleft()
        if node.rule != NO_RULE:
            return path
        if node.feature == LEAF:
            continue
        for condition, child in _sides(node):
            # The same side of the same feature again leads away from the threshold.
            if condition[:2] != (query.feature, op):
                waiting.append((nodes[child], op, (*path, condition)))
    return ()


def _at(
    path: Sequence[Condition],
    feature: int,
    threshold: float,
    typical: NDArray[np.float32],
    rng: np.random.Generator,
) -> list[NDArray[np.float32]]:
    """States that reach a query: at its threshold, a step below and a step above."""
    low: dict[int, float] = {}
    high: dict[int, float] = {}
    for bounded, op, value in path:
        if op == "<=":
            high[bounded] = min(value, high.get(bounded, np.inf))
        else:
            low[bounded] = max(value, low.get(bounded, -np.inf))
    state = typical.copy()
    for bounded in low.keys() | high.keys():
        state[bounded] = _between(
            low.get(bounded, -np.inf), high.get(bounded, np.inf), float(typical[bounded]), rng
        )
    at = largest_float32(threshold)
    places = []
    with np.errstate(over="ignore"):  # above the largest number is infinity
        numbers = (np.nextafter(at, -_INFINITY), at, np.nextafter(at, _INFINITY))
    for number in numbers:
        copy = state.copy()
        copy[feature] = number
        places.append(copy)
    return places


def _between(low: float, high: float, typical: float, rng: np.random.Generator) -> np.float32:
    """A float32 number above `low` and at most `high`, if there is one."""
    if low < typical <= high and rng.random() < 0.5:
        return np.float32(typical)
    width = high - low
    if not np.isfinite(width):
        width = max(1.0, abs(high if np.isfinite(high) else low))
    share = float(rng.uniform(0.1, 0.9)) * width
    value = largest_float32(high - share if np.isfinite(high) else low + share)
    return value if low < float(value) <= high else largest_float32(high)
