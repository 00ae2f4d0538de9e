"""What stands behind a rule: its path, its states, and how they differ from all others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.splits import written_value
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.action_words import label_text
from sarl_core.mining.digits import limit_texts
from sarl_core.mining.language import least_bounds, number_text, query_text
from sarl_core.mining.rules import Bounds, Condition, Rule, node_of
from sarl_core.mining.tree import PolicyTree

_TAIL = 0.002  # of the states at either end, kept from flattening the rest of a histogram
_BINS = 44


class PathStep(NamedTuple):
    """A node on the way from the root to a rule.

    Attributes:
        node: Node number.
        query: The query that led here, in signs; "" at the root.
        samples: Pairs that reach it.
        support: Share of all pairs that reach it.
        confidence: Share of those with the most frequent label.
        label: That label.
        shares: Share of each label, (labels,); zeros where no pair is.
        is_cut: Whether the rule was cut here.
    """

    node: int
    query: str
    samples: int
    support: float
    confidence: float
    label: int
    shares: tuple[float, ...]
    is_cut: bool


@dataclass(frozen=True, eq=False)
class FeatureEvidence:
    """One feature over all states and over those of a rule.

    Attributes:
        feature: Its index.
        bounds: What the rule asks of it.
        edges: Of B bins, (B + 1,); values outside count to the outermost.
        everywhere: Share of all states in each bin, (B,).
        at_rule: Share of the rule's states in each bin, (B,); zeros where no state is its.
        infinite: Share of all states in which a formula is infinite, which the outermost count.
    """

    feature: int
    bounds: Bounds
    edges: NDArray[np.float64]
    everywhere: NDArray[np.float64]
    at_rule: NDArray[np.float64]
    infinite: float


def path_steps(tree: PolicyTree, node: int) -> tuple[PathStep, ...]:
    """The way from the root to a node.

    Args:
        tree: Of the rule's action dimension.
        node: Where the rule was cut.

    Returns:
        The root first, the node last.
    """
    steps = []
    path = tree.path(node)
    for above, here in zip((-1, *path), path, strict=False):
        query = ""
        if above >= 0:
            left = int(tree.children_left[above]) == here
            query = query_text(
                Condition(
                    int(tree.feature[above]), "<=" if left else ">", float(tree.threshold[above])
                ),
                tree.source.features,
            )
        counts = tree.counts[here]
        steps.append(
            PathStep(
                node=here,
                query=query,
                samples=int(tree.samples[here]),
                support=float(tree.support[here]),
                confidence=float(tree.confidence[here]),
                label=int(tree.label[here]),
                shares=tuple(float(count) / max(int(tree.samples[here]), 1) for count in counts),
                is_cut=here == node,
            )
        )
    return tuple(steps)


def feature_evidence(
    demonstrations: Demonstrations, tree: PolicyTree, rule: Rule
) -> tuple[FeatureEvidence, ...]:
    """How the states of a rule differ from all states, in each feature it asks about.

    Args:
        demonstrations: What the tree was grown from.
        tree: Of the rule's action dimension.
        rule: A mined one.

    Returns:
        One entry a feature, in the order of the rule's conditions.
    """
    rows = tree.rows(_node(tree, rule))
    evidence = []
    for bounds in least_bounds(rule, demonstrations.features):
        values = demonstrations.observations[:, bounds.feature]
        edges = _edges(values, values[rows], bounds, _BINS)
        evidence.append(
            FeatureEvidence(
                bounds.feature,
                bounds,
                edges,
                _shares(values, edges),
                _shares(values[rows], edges),
                int(np.isinf(values).sum()) / max(len(values), 1),
            )
        )
    return tuple(evidence)


def _node(tree: PolicyTree, rule: Rule) -> int:
    """Where a rule was cut; its name tells that of a part that was regrown by a number."""
    node = tree.place_of(node_of(rule))
    assert node is not None
    return node


def _edges(
    values: NDArray[np.float32], at_rule: NDArray[np.float32], bounds: Bounds, bins: int
) -> NDArray[np.float64]:
    step = max(1, len(values) // 50_000)  # a sample is enough to find where the tails begin
    sample, at_rule = (some[np.isfinite(some)] for some in (values[::step], at_rule))
    low, high = np.quantile(sample, [_TAIL, 1 - _TAIL]) if len(sample) else (0.0, 0.0)
    low, high = at_rule.min(initial=low), at_rule.max(initial=high)
    inside = [edge for edge in (bounds.low, bounds.high) if np.isfinite(edge)]
    low, high = min(low, *inside), max(high, *inside)
    if not low < high:
        low, high = low - 0.5, high + 0.5
    return np.linspace(low, high, bins + 1)


def _shares(values: NDArray[np.float32], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    bins = len(edges) - 1
    scaled = (values.astype(np.float64) - edges[0]) * (bins / (edges[-1] - edges[0]))
    # What lies beyond the edges, as the infinite values of a formula, counts in the last bin.
    index = np.clip(scaled, 0, bins - 1).astype(np.int64)
    return np.bincount(index, minlength=bins) / max(len(values), 1)


def example_rows(tree: PolicyTree, node: int, count: int = 10) -> NDArray[np.int64]:
    """Some states at a node, spread over the demonstrations.

    Args:
        tree: With N pairs.
        node: Node number.
        count: How many at most.

    Returns:
        Row numbers of the demonstrations, ascending.
    """
    rows = np.sort(tree.rows(node))
    places = np.linspace(0, len(rows) - 1, min(count, len(rows))).round().astype(np.int64)
    return rows[places]


def _decimals(values: NDArray[np.float64]) -> int:
    """So many decimals that the largest finite one of some values has four significant digits."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return min(max(3 - math.floor(math.log10(largest)), 0), 12) if largest > 0 else 0


def example_columns(
    demonstrations: Demonstrations, tree: PolicyTree, rule: Rule, count: int = 10
) -> dict[str, list[object]]:
    """Example states of a rule as columns.

    Args:
        demonstrations: What the tree was grown from.
        tree: Of the rule's action dimension.
        rule: A mined one.
        count: How many at most.

    Returns:
        What the expert did, whether that is what the rule says, every feature that is observed or
        that the rule asks about, rounded for display or in words, those of the rule first, and at
        last episode and step.
    """
    rows = example_rows(tree, _node(tree, rule), count)
    dimension = tree.dimension
    values = tree.demonstrated[rows]
    labels = dimension.labels_of(values)
    assert demonstrations.steps is not None
    did = (
        list(map(number_text, values.tolist()))
        if dimension.is_interval
        else [label_text(label, dimension) for label in labels.tolist()]
    )
    columns: dict[str, list[object]] = {
        "Expert did": list(did),
        "As the rule says": rule.obeyed_by(labels).tolist(),
    }
    queried = [bounds.feature for bounds in rule.bounds]
    order = {feature: place for place, feature in reversed([*enumerate(queried)])}
    for column in sorted(
        (
            one
            for one in state_columns(demonstrations.features)
            if one.features[0].derived is None or one.places[0] in order
        ),
        key=lambda one: min(order.get(at, len(queried)) for at in one.places),
    ):
        index = column.places[0]
        name = f"{column.title} ({column.unit})" if column.unit else column.title
        if name in (*columns, "Episode", "Step"):
            name = f"{name} [{index}]"  # a column of a table has a name of its own
        if column.of_words:
            columns[name] = list(column.words(demonstrations.observations[rows]))
            continue
        values = demonstrations.observations[rows, index].astype(np.float64)
        limits = [
            float(limit)
            for bounds in rule.bounds
            if bounds.feature == index
            for limit in limit_texts(bounds, tree.source.features[index])
        ]
        least = 0.5 * 10.0 ** -_decimals(values)  # nothing beside the largest of them
        columns[name] = [
            written_value(value, limits, fewest=4) if abs(value) >= least or limits else 0.0
            for value in values.tolist()
        ]
    columns["Episode"] = demonstrations.episodes[rows].tolist()
    columns["Step"] = demonstrations.steps[rows].tolist()
    return columns
