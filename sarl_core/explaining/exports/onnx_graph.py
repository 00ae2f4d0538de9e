"""What an ONNX model is put together from: operators, tables, and trees that find rules."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.exports.program import DimensionProgram, largest_float32
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import Rule
from sarl_core.mining.tree import LEAF

_FURTHER = 10_000_000  # numbers of nodes that no rule has


@dataclass
class OperatorGraph:
    """Operators and tables, as they are put together.

    Attributes:
        helper: Of the package `onnx`.
        nodes: So far.
        tables: By their names.
        values: What the trees walk with.
        columns: Of the state, in doubles, that there are already.
        flags: Of each formula the column of `state_values` that says whether it has no value.
    """

    helper: Any
    nodes: list[Any] = field(default_factory=list)
    tables: dict[str, NDArray[Any]] = field(default_factory=dict)
    values: str = "state"
    columns: set[str] = field(default_factory=set)
    flags: dict[int, int] = field(default_factory=dict)

    def add(self, operator: str, inputs: Sequence[str], output: str, **options: Any) -> str:
        """Add an operator and give the name of what it puts out."""
        self.nodes.append(self.helper.make_node(operator, list(inputs), [output], **options))
        return output

    def table(self, name: str, values: NDArray[Any]) -> str:
        """Add a table and give its name."""
        self.tables[name] = values
        return name

    def trees(self, trees: OperatorTrees, output: str) -> str:
        """Add trees that walk with the state."""
        return self.add(
            "TreeEnsembleRegressor",
            [self.values],
            output,
            domain="ai.onnx.ml",
            n_targets=trees.count,
            aggregate_function="SUM",
            post_transform="NONE",
            **trees.attributes(),
        )


class OperatorTrees:
    """Trees in the form of the operator: each adds a number to one column of the output."""

    def __init__(self, flags: Mapping[int, int], missing: float) -> None:
        """Take in what has to be known of formulas.

        Args:
            flags: As those of the graph.
            missing: What a tree gives where it asks about a formula without a value.
        """
        self._flags, self._missing = flags, missing
        self.count = 0
        self.nodes_treeids: list[int] = []
        self.nodes_nodeids: list[int] = []
        self.nodes_featureids: list[int] = []
        self.nodes_values: list[float] = []
        self.nodes_modes: list[str] = []
        self.nodes_truenodeids: list[int] = []
        self.nodes_falsenodeids: list[int] = []
        self.target_treeids: list[int] = []
        self.target_nodeids: list[int] = []
        self.target_ids: list[int] = []
        self.target_weights: list[float] = []

    def query(self, node: int, feature: int, threshold: float, below: int, above: int) -> None:
        """A node that leads on; before one that asks about a formula stands whether it has one."""
        if feature in self._flags:
            further = _FURTHER + 2 * len(self.nodes_nodeids)
            self._node(node, self._flags[feature], 0.5, "BRANCH_LEQ", further, further + 1)
            self.leaf(further + 1, self._missing)
            node = further
        self._node(node, feature, float(largest_float32(threshold)), "BRANCH_LEQ", below, above)

    def attributes(self) -> dict[str, Any]:
        """What the operator takes."""
        return {
            name: values
            for name, values in vars(self).items()
            if name.startswith(("nodes_", "target_"))
        }

    def leaf(self, node: int, weight: float) -> None:
        """A node that ends."""
        self._node(node, 0, 0.0, "LEAF", 0, 0)
        self.target_treeids.append(self.count)
        self.target_nodeids.append(node)
        self.target_ids.append(self.count)
        self.target_weights.append(float(weight))

    def end(self) -> None:
        """The tree is complete; the next begins."""
        first = bisect_left(self.nodes_treeids, self.count)
        if max(self.nodes_nodeids[first:]) >= _FURTHER:
            self._number(first, bisect_left(self.target_treeids, self.count))
        self.count += 1

    def _number(self, first: int, first_leaf: int) -> None:
        """Number the nodes of the latest tree without gaps, in their order."""
        numbers = {node: place for place, node in enumerate(self.nodes_nodeids[first:])}
        for start, ids in (
            (first, self.nodes_nodeids),
            (first_leaf, self.target_nodeids),
            (first, self.nodes_truenodeids),
            (first, self.nodes_falsenodeids),
        ):
            ids[start:] = [numbers[node] for node in ids[start:]]

    def _node(
        self, node: int, feature: int, value: float, mode: str, below: int, above: int
    ) -> None:
        self.nodes_treeids.append(self.count)
        self.nodes_nodeids.append(node)
        self.nodes_featureids.append(feature)
        self.nodes_values.append(float(value))
        self.nodes_modes.append(mode)
        self.nodes_truenodeids.append(below)
        self.nodes_falsenodeids.append(above)


def find(graph: OperatorGraph, index: int | str, order: DimensionProgram) -> str:
    """Add what finds the rule that applies.

    Args:
        graph: To add to.
        index: Tells the operators of this from those of others.
        order: Among which rules it is.

    Returns:
        `rule_of_<index>`, (B, 1) int64, -1 where none applies.
    """
    trees = OperatorTrees(graph.flags, NO_RULE)
    if len(order.nodes) == 1:  # a tree of one leaf, which some runtimes do not take
        trees.query(0, 0, 0.0, 1, 2)
        trees.leaf(1, order.nodes[0].rule)
        trees.leaf(2, order.nodes[0].rule)
    for place, node in enumerate(order.nodes if len(order.nodes) > 1 else ()):
        if node.feature == LEAF:
            trees.leaf(place, node.rule)
        else:
            trees.query(place, node.feature, node.threshold, node.left, node.right)
    trees.end()
    walked = graph.trees(trees, f"walked_{index}")
    name = f"rule_of_{index}"
    if not order.scanned:
        return graph.add("Cast", [walked], name, to=7)  # int64
    tree = graph.add("Cast", [walked], f"tree_{index}", to=7)
    trees = OperatorTrees(graph.flags, 0.0)
    for _, rule in order.scanned:
        _chain(trees, rule)
    applies = graph.trees(trees, f"applies_{index}")
    # The first column with the largest number is the first rule that applies.
    first = graph.add("ArgMax", [applies], f"first_{index}", axis=1, keepdims=1)
    places = np.array([place for place, _ in order.scanned], dtype=np.int64)
    scanned = graph.add("Gather", [graph.table(f"scanned_{index}", places), first], f"scan_{index}")
    most = graph.add("ReduceMax", [applies], f"most_{index}", axes=[1], keepdims=1)
    half = graph.table("half", np.array([0.5], dtype=np.float32))
    some = graph.add("Greater", [most, half], f"some_{index}")
    return graph.add("Where", [some, scanned, tree], name)


def _chain(trees: OperatorTrees, rule: Rule) -> None:
    """A tree that is 1 where a rule applies and 0 elsewhere."""
    length = max(rule.length, 1)
    if not rule.conditions:
        trees.query(0, 0, 0.0, 1, length + 1)
        trees.leaf(1, 1.0)
        trees.leaf(length + 1, 1.0)
    for depth, (feature, op, threshold) in enumerate(rule.conditions):
        on, off = depth + 1, length + 1 + depth
        below, above = (on, off) if op == "<=" else (off, on)
        trees.query(depth, feature, threshold, below, above)
        trees.leaf(off, 0.0)
    if rule.conditions:
        trees.leaf(length, 1.0)
    trees.end()
