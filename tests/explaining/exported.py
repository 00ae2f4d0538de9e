"""Running exported rules: the C through the machine's compiler, the Python, the ONNX model."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core import RuleSet, Shield
from sarl_core.explaining.code_c import rules_to_c
from sarl_core.explaining.code_python import rules_to_python
from sarl_core.explaining.onnx_export import rules_to_onnx
from sarl_core.shielding.projection import Projection

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes", "-O0"]
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
        int changed = shield_decide(state, proposed, executed, rule);
        fwrite(executed, sizeof(number), {actions}, stdout);
        fwrite(rule, sizeof(int), {actions}, stdout);
        fwrite(&changed, sizeof(int), 1, stdout);
    }}
    return 0;
}}
"""
Answers = tuple[NDArray[Any], NDArray[np.int64]]


def run_c(
    rule_set: RuleSet,
    projection: Projection,
    states: NDArray[np.float32],
    proposed: NDArray[Any],
    folder: Path,
) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[np.bool_]]:
    """Compile the export, warnings being errors, and decide every state with it."""
    d, m = states.shape[1], proposed.shape[1]
    continuous = proposed.dtype.kind == "f"
    (folder / "shield.c").write_text(rules_to_c(rule_set, projection), encoding="utf-8")
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
    return found["executed"], found["rule"].astype(np.int64), found["changed"].astype(np.bool_)


def run_python(
    rule_set: RuleSet, projection: Projection, states: NDArray[np.float32], proposed: NDArray[Any]
) -> Answers:
    """Execute the export and decide state by state."""
    names: dict[str, Any] = {}
    exec(compile(rules_to_python(rule_set, projection), "shield.py", "exec"), names)
    single = proposed.dtype.kind == "i" and proposed.shape[1] == 1
    executed, rules = [], []
    for state, action in zip(states.tolist(), proposed.tolist(), strict=True):
        done, rule = names["shield"](state, action[0] if single else action)
        executed.append([done] if single else done)
        rules.append(rule)
    return np.array(executed, dtype=proposed.dtype), np.array(rules, dtype=np.int64)


def run_onnx(
    rule_set: RuleSet, projection: Projection, states: NDArray[np.float32], proposed: NDArray[Any]
) -> Answers:
    """Decide every state with the model."""
    import onnxruntime

    session = onnxruntime.InferenceSession(
        rules_to_onnx(rule_set, projection), providers=["CPUExecutionProvider"]
    )
    executed, rules = session.run(["executed", "rule"], {"state": states, "proposed": proposed})
    return executed, rules


def expected(
    rule_set: RuleSet, projection: Projection, states: NDArray[np.float32], proposed: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[np.bool_]]:
    """What the shield itself decides."""
    with np.errstate(invalid="ignore"):  # of states that are infinite
        decision = Shield(rule_set, projection=projection).decide_batch(states, proposed)
    return decision.executed, decision.rules, decision.intervened


def same(ours: NDArray[Any], theirs: NDArray[Any]) -> bool:
    """Whether two arrays are equal in every number, those that are none included."""
    return ours.dtype == theirs.dtype and np.array_equal(
        ours, theirs, equal_nan=ours.dtype.kind == "f"
    )


def random_states(rule_set: RuleSet, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """States far and wide, near the thresholds and on them, some with what is no number."""
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
    odd = rng.random((count, d)) < 0.01
    states[odd] = rng.choice([np.nan, np.inf, -np.inf], int(odd.sum()))
    return states.astype(np.float32)
