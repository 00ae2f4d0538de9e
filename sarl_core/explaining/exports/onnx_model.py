"""Rules as an ONNX model, which many runtimes can execute; needs the package `onnx`.

Thresholds are float32 in ONNX. The largest float32 number that is at most a threshold divides
float32 states exactly as the threshold itself does, so nothing is lost.
"""

from __future__ import annotations

import json

import numpy as np

from sarl_core.demonstrations.dataset import (
    derived_document,
    derived_features,
    observed_features,
)
from sarl_core.demonstrations.derived import Definition
from sarl_core.errors import WorkError
from sarl_core.explaining.exports.arithmetic import Operand, calculations
from sarl_core.explaining.exports.onnx_graph import OperatorGraph, find
from sarl_core.explaining.exports.onnx_never import allow
from sarl_core.explaining.exports.program import Program, program_of
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid

# Versions of the operators that runtimes have known for years.
_OPERATORS, _TREES, _FORMAT = 13, 1, 7


def rules_to_onnx(
    rule_set: RuleSet,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
    sign_off: SignOff | None = None,
) -> bytes:
    """A rule set as an ONNX model.

    Args:
        rule_set: The rules; those switched off are left out, and keep their index.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: Whether the action passes where it or the state is none (``pass``). A model
            cannot stop with an error: for ``raise``, `executed` is then no action at all, NaN or
            the least int64.
        sign_off: Who approved the rules; None to say nothing of it.

    Returns:
        A model with the inputs `state` (B, d) float32 and `proposed` (B, m), int64 or float32,
        and the outputs `executed` (B, m), alike, `rule` (B, m) int64, -1 where none applies, and
        `invalid` (B, 1), whether a number is not finite or an action none that there is.

    Raises:
        InputError: As `program_of`.
        WorkError: If the package `onnx` is missing.
    """
    program = program_of(rule_set, projection, on_invalid)
    try:
        import onnx
        from onnx import TensorProto, helper
    except ImportError as error:
        raise WorkError(
            "an ONNX file needs the package onnx, which is not installed; run `pip install onnx`, "
            "or choose another format"
        ) from error
    rule_set = program.rule_set
    graph = OperatorGraph(helper)
    if program.derives:
        _derive(graph, program)
    for index, order in enumerate(program.orders):
        find(graph, index, order)
    outputs = [f"rule_of_{i}" for i in range(len(program.orders))]
    graph.add("Concat", outputs, "rule_found", axis=1)
    graph.add("Not", [_valid(graph, program)], "invalid")
    nothing = graph.table("no_rule", np.array([NO_RULE], dtype=np.int64))
    if not program.forbids:
        rules = graph.add("Where", ["valid", "rule_found", nothing], "rule")
        _execute(graph, program, _replaced(graph, program, rules))
    else:
        decided = allow(graph, program, "rule_found", _replaced(graph, program, "rule_found"))
        graph.add("Where", ["valid", "rule_decided", nothing], "rule")
        _execute(graph, program, decided)
    d, m = program.width, len(program.orders)
    kind = TensorProto.FLOAT if program.continuous else TensorProto.INT64
    info = helper.make_tensor_value_info
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "shield",
            [info("state", TensorProto.FLOAT, ["B", d]), info("proposed", kind, ["B", m])],
            [
                info("executed", kind, ["B", m]),
                info("rule", TensorProto.INT64, ["B", m]),
                info("invalid", TensorProto.BOOL, ["B", 1]),
            ],
            [onnx.numpy_helper.from_array(value, name) for name, value in graph.tables.items()],
        ),
        opset_imports=[
            helper.make_opsetid("", _OPERATORS),
            helper.make_opsetid("ai.onnx.ml", _TREES),
        ],
        ir_version=_FORMAT,
        producer_name="sarl_core",
        doc_string="A shield of rules, learned from examples; it guarantees nothing. "
        + _INVALID[on_invalid],
    )
    features = rule_set.source.features
    helper.set_model_props(
        model,
        {
            "environment": rule_set.source.env_id,
            "on_invalid": on_invalid,
            **({"approved": signed} if (signed := sign_off_text(sign_off)) else {}),
            "features": json.dumps(
                [{"name": f.name, "unit": f.unit} for f in observed_features(features)]
            ),
            **(
                {"derived": json.dumps(list(map(derived_document, derived_features(features))))}
                if program.derives
                else {}
            ),
            "actions": json.dumps([order.dimension.name for order in program.orders]),
            **({} if program.continuous else {"labels": json.dumps(_labels(program))}),
            "rules": json.dumps([rule.id for rule in rule_set.rules]),
        },
    )
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content


_DOUBLE, _FLOAT = 11, 1  # of ONNX
_OPERATOR = {"+": "Add", "-": "Sub", "*": "Mul", "/": "Div"}


def _derive(graph: OperatorGraph, program: Program) -> None:
    """Add what works out the derived features, in doubles: `state_values`, (B, d + k + f).

    Behind the d features and the k derived ones stands for each of the f formulas 1 where it has
    no value, else 0: the trees cannot ask what is no number.
    """
    features = program.rule_set.source.features
    graph.add("Cast", ["state"], "exact_state", to=_DOUBLE)
    parts, missing = ["state"], list[str]()
    for place, feature in enumerate(features):
        if feature.derived is None:
            continue
        name = f"derived_{place}"
        exact = _worked_out(graph, feature.derived, name)
        parts.append(graph.add("Cast", [exact], name, to=_FLOAT))
        if place in program.formulas:
            graph.flags[place] = len(features) + len(missing)
            equal = graph.add("Equal", [name, name], f"{name}_is_number")
            none = graph.add("Not", [equal], f"{name}_is_none")
            missing.append(graph.add("Cast", [none], f"{name}_missing", to=_FLOAT))
    graph.values = graph.add("Concat", [*parts, *missing], "state_values", axis=1)


def _worked_out(graph: OperatorGraph, definition: Definition, name: str) -> str:
    """The operations of one derived feature; what the last one is called, (B, 1)."""

    def operand(one: Operand) -> str:
        if one.kind == "earlier":
            return f"{name}_{one.value}"
        if one.kind == "number":
            text = f"{name}_number_{one.value!r}"
            return graph.table(text, np.array([[one.value]], dtype=np.float64))
        column = f"column_{one.value}"
        if column not in graph.columns:
            graph.columns.add(column)
            place = graph.table(f"place_{one.value}", np.array([one.value], dtype=np.int64))
            graph.add("Gather", ["exact_state", place], column, axis=1)
        return column

    steps = calculations(definition)
    for number, step in enumerate(steps):
        output, inputs = f"{name}_{number}", list(map(operand, step.operands))
        if step.name == "abs":
            graph.add("Abs", inputs, output)
        elif len(inputs) == 1:
            graph.add("Neg", inputs, output)
        elif step.name in _OPERATOR:
            graph.add(_OPERATOR[step.name], inputs, output)
        else:  # which of two, with NaN and zeros: not as the operators of that name have it
            how = {"min": "Less", "max": "Greater"}[step.name]
            equal = graph.add("Equal", [inputs[0], inputs[0]], f"{output}_is_number")
            none = graph.add("Not", [equal], f"{output}_is_none")
            first = graph.add(how, inputs, f"{output}_compared")
            chosen = graph.add("Or", [none, first], f"{output}_first")
            graph.add("Where", [chosen, *inputs], output)
    return f"{name}_{len(steps) - 1}"


_INVALID: dict[OnInvalid, str] = {
    "raise": "Where `invalid` is true, nothing should be done: `executed` is no action "
    "(on_invalid: raise).",
    "pass": "Where `invalid` is true, no rule was asked, and the action passes as it is "
    "(on_invalid: pass).",
}


def _labels(program: Program) -> list[dict[str, str]]:
    """For each action dimension the name of each action."""
    dimensions = [order.dimension for order in program.orders]
    return [
        {str(action): name for action, name in zip(one.actions, one.label_names, strict=True)}
        for one in dimensions
    ]


def _valid(graph: OperatorGraph, program: Program) -> str:
    """Add what tells whether the rules can be asked at all: `valid`, (B, 1)."""

    def every(holds: str, name: str) -> str:
        numbers = graph.add("Cast", [holds], f"{name}_as_number", to=1)  # float
        least = graph.add("ReduceMin", [numbers], f"{name}_least", axes=[1], keepdims=1)
        half = graph.table("half", np.array([0.5], dtype=np.float32))
        return graph.add("Greater", [least, half], f"{name}_valid")

    def finite(values: str) -> str:
        # What is infinite or no number leaves no zero when it is taken from itself.
        left = graph.add("Sub", [values, values], f"{values}_left")
        nothing = graph.table("no_difference", np.array([0], dtype=np.float32))
        return graph.add("Equal", [left, nothing], f"{values}_finite")

    if program.continuous:
        holds = finite("proposed")
    else:
        first, last = (np.array(ends, dtype=np.int64) for ends in zip(*program.labels, strict=True))
        under = graph.add("Less", ["proposed", graph.table("first_label", first)], "under_first")
        over = graph.add("Greater", ["proposed", graph.table("last_label", last)], "over_last")
        holds = graph.add("Not", [graph.add("Or", [under, over], "no_label")], "is_label")
    parts = [every(finite("state"), "state"), every(holds, "proposed")]
    return graph.add("And", parts, "valid")


def _execute(graph: OperatorGraph, program: Program, decided: str) -> None:
    """Add the action to execute: what was decided, where it could be."""
    otherwise = "proposed"
    if program.on_invalid == "raise":
        none = np.float32(np.nan) if program.continuous else np.iinfo(np.int64).min
        otherwise = graph.table("no_action", np.array([none]))
    graph.add("Where", ["valid", decided, otherwise], "executed")


def _replaced(graph: OperatorGraph, program: Program, rules: str) -> str:
    """Add what becomes of the action by the rules that demand one: `decided`, (B, m).

    Args:
        graph: To add to.
        program: All rules.
        rules: What the indices of those in force are called, (B, m).
    """
    zero = graph.table("zero", np.array([0], dtype=np.int64))
    none = graph.add("Less", [rules, zero], "none")
    place = graph.add("Max", [rules, zero], "place")  # valid where there is none, too
    if program.continuous:
        return _replaced_continuous(graph, program, none, place)
    values = np.array([int(outcome.low) for outcome in program.outcomes], dtype=np.int64)
    value = graph.add("Gather", [graph.table("values", values), place], "value")
    return graph.add("Where", [none, "proposed", value], "decided")


def _replaced_continuous(graph: OperatorGraph, program: Program, none: str, place: str) -> str:

    def looked_up(name: str, kind: type[np.generic]) -> str:
        values = [getattr(outcome, name) for outcome in program.outcomes]
        table = graph.table(f"{name}_table", np.array(values, dtype=kind))
        return graph.add("Gather", [table, place], name)

    low, high = looked_up("low", np.float32), looked_up("high", np.float32)
    open_low, open_high = looked_up("open_low", np.bool_), looked_up("open_high", np.bool_)
    under = graph.add("Less", ["proposed", low], "under")
    not_under = graph.add("Not", [under], "not_under")
    not_over = graph.add("LessOrEqual", ["proposed", high], "not_over")
    keeps_low = graph.add("Or", [open_low, not_under], "keeps_low")
    keeps_high = graph.add("Or", [open_high, not_over], "keeps_high")
    allowed = graph.add("And", [keeps_low, keeps_high], "allowed")
    unchanged = graph.add("Or", [none, allowed], "kept")
    if program.projection == "clip":
        over_low = graph.add("Greater", ["proposed", low], "over_low")
        raised = graph.add("Where", [over_low, "proposed", low], "raised")
        under_high = graph.add("Less", [raised, high], "under_high")
        value = graph.add("Where", [under_high, raised, high], "value")
    else:
        value = looked_up("value", np.float32)
    return graph.add("Where", [unchanged, "proposed", value], "decided")
