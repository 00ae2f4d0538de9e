"""What never-rules forbid, as operators of an ONNX model."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.exports.onnx_graph import OperatorGraph, find
from sarl_core.explaining.exports.program import Program
from sarl_core.mining.rule_tree import NO_RULE

_FLOAT = 1  # of ONNX


def allow(graph: OperatorGraph, program: Program, rules: str, decided: str) -> str:
    """Add what becomes of the action where no rule demands one.

    Args:
        graph: To add to. It gets `rule_decided`, (B, m), too: the rule that demands, else the
            never-rule that is broken, else the first in force.
        program: All rules.
        rules: Name of the indices of demanding rules, (B, m), -1 where none applies.
        decided: Name of what became of the action by those, (B, m).

    Returns:
        Name of what becomes of it by all rules, (B, m).
    """
    columns = [
        _Column(graph, program, index).decided(rules, decided)
        for index in range(len(program.orders))
    ]
    graph.add("Concat", [rule for rule, _ in columns], "rule_decided", axis=1)
    return graph.add("Concat", [action for _, action in columns], "action_decided", axis=1)


class _Column:
    """The operators of one action dimension with L labels."""

    def __init__(self, graph: OperatorGraph, program: Program, index: int) -> None:
        """Begin with none.

        Args:
            graph: To add to.
            program: All rules.
            index: Of the action dimension.
        """
        self._graph, self._program, self._index = graph, program, index
        self._labels = program.allowed[index]

    def decided(self, rules: str, decided: str) -> tuple[str, str]:
        """Add all of them.

        Args:
            rules: As of `allow`.
            decided: As of `allow`.

        Returns:
            Names of the rule and of the action, (B, 1) each.
        """
        place = self._table("place", np.array([self._index], dtype=np.int64))
        demanded = self._add("Gather", [rules, place], "demanded", axis=1)
        action = self._add("Gather", [decided, place], "demanded_action", axis=1)
        if not self._program.never[self._index]:
            return demanded, action
        proposed = self._add("Gather", ["proposed", place], "proposed", axis=1)
        forbidding = self._forbidding(demanded)
        free = self._add("Less", [forbidding, self._zero], "free")
        carried = self._carried(proposed)
        of_own = self._add("Where", [carried, forbidding, self._nothing], "of_own")
        broken = self._add("ReduceMax", [of_own], "broken", axes=[1], keepdims=1)
        unbroken = self._add("Less", [broken, self._zero], "unbroken")
        undemanded = self._add("Less", [demanded, self._zero], "undemanded")
        first = self._first(forbidding, free)
        never = self._add("Where", [unbroken, first, broken], "never_rule")
        rule = self._add("Where", [undemanded, never, demanded], "rule")
        value = self._value(proposed, carried, self._other(forbidding, free, broken))
        allowed = self._add("Where", [unbroken, proposed, value], "allowed")
        return rule, self._add("Where", [undemanded, allowed, action], "action")

    def _forbidding(self, demanded: str) -> str:
        """The rule that forbids each label or -1, (B, L)."""
        finders = {each.label: each for each in self._program.never[self._index]}
        nothing = self._add("Min", [demanded, self._nothing], "never_forbidden")
        rules = [
            find(self._graph, f"{self._index}_{label}", finders[label])
            if label in finders
            else nothing
            for label in range(len(self._labels))
        ]
        return self._add("Concat", rules, "forbidding", axis=1)

    def _carried(self, proposed: str) -> str:
        """Whether the action carries each label, (B, L)."""
        if not self._program.continuous:
            actions = np.array([int(one.low) for one in self._labels], dtype=np.int64)
            return self._add("Equal", [proposed, self._table("actions", actions)], "carried")
        inner = np.array([one.low for one in self._labels[1:]], dtype=np.float32)
        infinity = np.array([np.inf], dtype=np.float32)
        least = self._table("least", np.concatenate([-infinity, inner]))
        beyond = self._table("beyond", np.concatenate([inner, infinity]))
        under = self._add("Less", [proposed, beyond], "under")
        reached = self._add("GreaterOrEqual", [proposed, least], "reached")
        return self._add("And", [under, reached], "carried")

    def _first(self, forbidding: str, free: str) -> str:
        """The first rule in force or -1, (B, 1)."""
        count = self._table("rule_count", np.array([len(self._program.rule_set)], dtype=np.int64))
        rules = self._add("Where", [free, count, forbidding], "rules_or_count")
        least = self._add("ReduceMin", [rules], "least_rule", axes=[1], keepdims=1)
        some = self._add("Less", [least, count], "some")
        return self._add("Where", [some, least, self._nothing], "first")

    def _other(self, forbidding: str, free: str, broken: str) -> str:
        """The label in the place of the forbidden one, (B, 1)."""
        rules, size = self._program.rule_set.rules, len(self._labels)
        # The most frequent label is the first of those that are free.
        places = np.full((len(rules), size), size, dtype=np.float32)
        never = [
            index
            for index, rule in enumerate(rules)
            if rule.forbids and rule.dimension == self._index
        ]
        for index in never:
            places[index, list(rules[index].instead)] = np.arange(len(rules[index].instead))
        some = self._add("Max", [broken, self._zero], "some_rule")
        row = self._add("Squeeze", [some, self._table("axis", np.array([1]))], "row")
        order = self._add("Gather", [self._table("places", places), row], "order")
        last = self._table("last", np.array([size], dtype=np.float32))
        choice = self._add("Where", [free, order, last], "choice")
        best = self._add("ArgMin", [choice], "best", axis=1, keepdims=1)
        least = self._add("ReduceMin", [choice], "least_choice", axes=[1], keepdims=1)
        chosen = self._add("Less", [least, last], "chosen")
        # Where none is, the rule of the fewest states decides, of equal ones the first.
        never.sort(key=lambda index: rules[index].samples)
        ranks = np.zeros(len(rules), dtype=np.int64)
        ranks[never] = np.arange(len(never))
        instead = np.array([rules[index].action for index in never], dtype=np.int64)
        applying = self._add("Max", [forbidding, self._zero], "applying")
        ranked = self._add("Gather", [self._table("ranks", ranks), applying], "ranked")
        closest = self._add("ReduceMin", [ranked], "closest", axes=[1], keepdims=1)
        otherwise = self._add("Gather", [self._table("instead", instead), closest], "otherwise")
        return self._add("Where", [chosen, best, otherwise], "other")

    def _value(self, proposed: str, carried: str, other: str) -> str:
        """The action that carries a label in the place of the proposed one, (B, 1)."""
        if not self._program.continuous:
            return self._add("Gather", [self._name("actions"), other], "value")

        def looked_up(name: str) -> str:
            values = np.array([getattr(one, name) for one in self._labels], dtype=np.float32)
            return self._add("Gather", [self._table(f"{name}_table", values), other], name)

        if self._program.projection == "clip":
            low, high = looked_up("low"), looked_up("high")
            over_low = self._add("Greater", [proposed, low], "over_low")
            raised = self._add("Where", [over_low, proposed, low], "raised")
            under_high = self._add("Less", [raised, high], "under_high")
            value = self._add("Where", [under_high, raised, high], "nearest")
        else:
            value = looked_up("value")
        numbers = self._add("Cast", [carried], "carried_number", to=_FLOAT)
        label = self._add("ArgMax", [numbers], "label", axis=1, keepdims=1)
        same = self._add("Equal", [label, other], "same")
        return self._add("Where", [same, proposed, value], "becomes")

    @property
    def _nothing(self) -> str:
        return self._graph.table("no_rule", np.array([NO_RULE], dtype=np.int64))

    @property
    def _zero(self) -> str:
        return self._graph.table("zero", np.array([0], dtype=np.int64))

    def _name(self, name: str) -> str:
        return f"{name}_of_action_{self._index}"

    def _table(self, name: str, values: NDArray[Any]) -> str:
        return self._graph.table(self._name(name), values)

    def _add(self, operator: str, inputs: list[str], output: str, **options: Any) -> str:
        return self._graph.add(operator, inputs, self._name(output), **options)
