"""Running exported rules: the C through the machine's compiler, the Python, the ONNX model."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core import RuleSet, Shield
from sarl_core.explaining.exports.code_c import rules_to_c
from sarl_core.explaining.exports.code_python import rules_to_python
from sarl_core.explaining.exports.onnx_model import rules_to_onnx
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes", "-O0"]
STRICT += ["-ffp-contract=off"]  # as the head of a file that derives features says
HARNESS = """
#include <stdint.h>
#include <stdio.h>
typedef {kind} number;
int shield_decide(const float state[], const number proposed[], number executed[], int rule[]);
int main(void)
{{
    static float state[{features}];
    static number proposed[{actions}], executed[{actions}];
    static int rule[{actions}];
    while (fread(state, sizeof(float), {features}, stdin) == {features}) {{
        if (fread(proposed, sizeof(number), {actions}, stdin) != {actions})
            return 1;
        for (int i = 0; i < {actions}; i++)
            executed[i] = 77;
        int changed = shield_decide(state, proposed, executed, rule);
        fwrite(executed, sizeof(number), {actions}, stdout);
        fwrite(rule, sizeof(int), {actions}, stdout);
        fwrite(&changed, sizeof(int), 1, stdout);
    }}
    return 0;
}}
"""


class Answers(NamedTuple):
    """What is said of B states; where it is `invalid`, `executed` may be anything."""

    executed: NDArray[Any]
    rules: NDArray[np.int64]
    invalid: NDArray[np.bool_]


class Said(NamedTuple):
    """Likewise, with whether actions were changed."""

    executed: NDArray[Any]
    rules: NDArray[np.int64]
    invalid: NDArray[np.bool_]
    changed: NDArray[np.bool_]


def run_c(
    rule_set: RuleSet,
    projection: Projection,
    states: NDArray[np.float32],
    proposed: NDArray[Any],
    folder: Path,
    on_invalid: OnInvalid = "raise",
) -> Said:
    """Compile the export, warnings being errors, and decide every state with it."""
    d, m = states.shape[1], proposed.shape[1]
    continuous = proposed.dtype.kind == "f"
    source = rules_to_c(rule_set, projection, on_invalid)
    (folder / "shield.c").write_text(source, encoding="utf-8")
    (folder / "main.c").write_text(
        HARNESS.format(kind="float" if continuous else "int64_t", features=d, actions=m)
    )
    done = subprocess.run(
        ["cc", *STRICT, "shield.c", "main.c", "-o", "shield"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:2000]
    kind = np.float32 if continuous else np.int64
    record = np.dtype([("state", np.float32, (d,)), ("action", kind, (m,))])
    answer = np.dtype(
        [("executed", kind, (m,)), ("rule", np.int32, (m,)), ("changed", np.int32)], align=False
    )
    given = np.empty(len(states), dtype=record)
    given["state"], given["action"] = states, proposed
    said = subprocess.run(
        [folder / "shield"], input=given.tobytes(), capture_output=True, check=True
    ).stdout
    found = np.frombuffer(said, dtype=answer)
    assert set(np.unique(found["changed"]).tolist()) <= {-1, 0, 1}
    if on_invalid == "raise":  # nothing was written
        assert (found["executed"][found["changed"] == -1] == 77).all()
    return Said(
        found["executed"],
        found["rule"].astype(np.int64),
        found["changed"] == -1,
        found["changed"] == 1,
    )


def run_python(
    rule_set: RuleSet,
    projection: Projection,
    states: NDArray[np.float32],
    proposed: NDArray[Any],
    on_invalid: OnInvalid = "raise",
) -> Answers:
    """Execute the export and decide state by state."""
    names: dict[str, Any] = {}
    exec(compile(rules_to_python(rule_set, projection, on_invalid), "shield.py", "exec"), names)
    single = proposed.dtype.kind == "i" and proposed.shape[1] == 1
    executed, rules, invalid = [], [], []
    for state, action in zip(states.tolist(), proposed.tolist(), strict=True):
        given = action[0] if single else action
        try:
            done, rule = names["shield"](state, given)
            invalid.append(False)  # where actions pass, nothing else tells which did
        except ValueError:
            assert on_invalid == "raise"
            done, rule = given, [-1] * proposed.shape[1]
            invalid.append(True)
        executed.append([done] if single else done)
        rules.append(rule)
    return Answers(
        np.array(executed, dtype=proposed.dtype),
        np.array(rules, dtype=np.int64),
        np.array(invalid),
    )


def run_onnx(
    rule_set: RuleSet,
    projection: Projection,
    states: NDArray[np.float32],
    proposed: NDArray[Any],
    on_invalid: OnInvalid = "raise",
) -> Answers:
    """Decide every state with the model."""
    import onnxruntime

    session = onnxruntime.InferenceSession(
        rules_to_onnx(rule_set, projection, on_invalid), providers=["CPUExecutionProvider"]
    )
    executed, rules, invalid = session.run(
        ["executed", "rule", "invalid"], {"state": states, "proposed": proposed}
    )
    if on_invalid == "raise":
        nothing = executed[invalid[:, 0]]
        none = np.isnan(nothing) if nothing.dtype.kind == "f" else nothing == -(2**63)
        assert none.all()
    return Answers(executed, rules, invalid[:, 0])


def expected(
    rule_set: RuleSet, projection: Projection, states: NDArray[np.float32], proposed: NDArray[Any]
) -> Said:
    """What the shield itself decides, which lets pass what is invalid."""
    shield = Shield(rule_set, projection=projection, on_invalid="pass")
    decision = shield.decide_batch(states, proposed)
    invalid = np.array([why is not None for why in decision.invalid])
    return Said(decision.executed, decision.rules, invalid, decision.intervened)


def agree(ours: Answers | Said, theirs: Said, *, passing: bool = False, told: bool = True) -> None:
    """Whether an export says what the shield says.

    Args:
        ours: Of the export.
        theirs: Of the shield.
        passing: Whether invalid actions pass; else nothing is said to be executed.
        told: Whether the export tells what is invalid.
    """
    rows = slice(None) if passing else ~theirs.invalid
    assert same(ours.executed[rows], theirs.executed[rows])
    assert same(ours.rules, theirs.rules)
    if told:
        assert same(ours.invalid, theirs.invalid)


def same(ours: NDArray[Any], theirs: NDArray[Any]) -> bool:
    """Whether two arrays are equal in every number, those that are none included."""
    return ours.dtype == theirs.dtype and np.array_equal(
        ours, theirs, equal_nan=ours.dtype.kind == "f"
    )


def random_states(rule_set: RuleSet, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """States far and wide, near the thresholds and on them, one in 20 with what is no number."""
    d = len(rule_set.source.features)
    states = rng.normal(size=(count, d)) * 10.0 ** rng.integers(-3, 3, size=(count, 1))
    asked: dict[int, list[float]] = {}
    for rule in rule_set.rules:
        for feature, _, threshold in rule.conditions:
            asked.setdefault(feature, []).append(threshold)
    near = rng.random((count, d)) < 0.7
    for feature, thresholds in asked.items():
        with np.errstate(over="ignore"):
            at = rng.choice(thresholds, count).astype(np.float32)
            side = rng.integers(0, 3, count)
            at = np.where(side == 1, np.nextafter(at, np.float32(np.inf)), at)
            at = np.where(side == 2, np.nextafter(at, np.float32(-np.inf)), at)
        states[:, feature] = np.where(near[:, feature], at, states[:, feature])
    odd = rng.random((count, d)) < 0.05 / d
    states[odd] = rng.choice([np.nan, np.inf, -np.inf], int(odd.sum()))
    return states.astype(np.float32)
