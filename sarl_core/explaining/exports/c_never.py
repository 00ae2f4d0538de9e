"""What rules forbid, in C."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.explaining.exports.c_text import (
    comment,
    finder_name,
    floats,
    kind_of,
    listed,
    rule_comment,
)
from sarl_core.explaining.exports.program import Program, Replacement
from sarl_core.mining.action_words import action_text
from sarl_core.mining.labels import LabelledDimension

_ALLOWED = """\
/* What becomes of an action where no rule demands one, and the rule that it breaks, else the
 * first in force. Where every label is forbidden, the rule of the fewest states decides. */
static {kind} shield_allowed(int i, const float *x, {kind} action, int *rule)
{{
    int by[SHIELD_LABELS], closest = -1, label = 0, other = -1;
    for (int k = 0; k < SHIELD_LABELS; k++) {{
        const int one = by[k] = shield_find[i][k] ? shield_find[i][k](x) : -1;
        if (one < 0)
            continue;
        if (*rule < 0 || one < *rule)
            *rule = one;
        if (closest < 0 || shield_never[one].states < shield_never[closest].states ||
            (shield_never[one].states == shield_never[closest].states && one < closest))
            closest = one;
    }}
    while ({further})
        label++;
    if (label == shield_labels[i] || by[label] < 0)
        return action;
    *rule = by[label];
    for (int k = 0; other < 0 && shield_never[*rule].instead[k] >= 0; k++)
        if (by[shield_never[*rule].instead[k]] < 0)
            other = shield_never[*rule].instead[k];
    if (other < 0)
        other = shield_never[closest].instead[0];
    if (other == label)
        return action;
{becomes}\
}}
"""


def never_parts(program: Program) -> list[str]:
    """What decides where rules only forbid.

    Args:
        program: All rules.

    Returns:
        Tables and the function `shield_allowed`, which follow the functions that find rules;
        nothing where no rule forbids.
    """
    if not program.forbids:
        return []
    rows = [
        f"    [{place}] = {{INT64_C({rule.samples}), {listed([*rule.instead, -1])}}},"
        f" /* {rule_comment(rule, program.rule_set)} */"
        for place, rule in enumerate(program.rule_set.rules)
        if rule.forbids and rule.enabled
    ]
    names = [
        {order.label: finder_name(index, order.label) for order in orders}
        for index, orders in enumerate(program.never)
    ]
    table = [listed(by.get(label, 0) for label in range(program.most_labels)) for by in names]
    lines = [
        "/* Of each rule that forbids the number of states that it was learned from, and the",
        " * labels in the place of a forbidden one, the most frequent first; -1 ends them. */",
        "static const struct {",
        "    int64_t states;",
        "    int instead[SHIELD_LABELS];",
        "} shield_never[SHIELD_RULES] = {",
        *rows,
        "};",
        "/* What finds the rule that forbids a label of an action; 0 where none ever does. */",
        "static int (*const shield_find[SHIELD_ACTIONS][SHIELD_LABELS])(const float *x) = {",
        *(f"    {one}," for one in table),
        "};",
        "/* How many labels each action has, and what they stand for. */",
        f"static const int shield_labels[SHIELD_ACTIONS] = {listed(map(len, program.allowed))};",
    ]
    if not program.continuous:
        lines.append("static const int64_t shield_action[SHIELD_ACTIONS][SHIELD_LABELS] = {")
        lines += [
            f"    {listed(f'INT64_C({one.low})' for one in labels)}," for labels in program.allowed
        ]
        further = "label < shield_labels[i] && action != shield_action[i][label]"
        becomes = ["    return shield_action[i][other];"]
    else:
        further = "label + 1 < shield_labels[i] && action >= shield_label[i][label + 1].low"
        becomes = ["    return shield_label[i][other].value;"]
        value = "value, "
        if program.projection == "clip":
            value = ""
            becomes = [
                "    if (!(action > shield_label[i][other].low))",
                "        action = shield_label[i][other].low;",
                "    return action < shield_label[i][other].high ? action"
                " : shield_label[i][other].high;",
            ]
        lines += [
            "static const struct {",
            f"    float {value}low, high;",
            "} shield_label[SHIELD_ACTIONS][SHIELD_LABELS] = {",
            *(
                line
                for order, allowed in zip(program.orders, program.allowed, strict=True)
                for line in _interval_rows(order.dimension, allowed)
            ),
        ]
    lines += ["};", ""]
    function = _ALLOWED.format(
        kind=kind_of(program), further=further, becomes="".join(f"{one}\n" for one in becomes)
    )
    return ["\n".join(lines), function]


def _interval_rows(dimension: LabelledDimension, allowed: Sequence[Replacement]) -> list[str]:
    """A line a label of one action dimension."""
    rows = [
        f"        {listed(floats(one))}, /* {comment(action_text(label, dimension))} */"
        for label, one in enumerate(allowed)
    ]
    return ["    {", *rows, "    },"]
