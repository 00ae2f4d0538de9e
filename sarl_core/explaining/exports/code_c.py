"""Rules as one C function: C99, nothing but the language and its own headers."""

from __future__ import annotations

from sarl_core.explaining.exports.arithmetic import assignments, derived_lines, used_operations
from sarl_core.explaining.exports.c_never import never_parts
from sarl_core.explaining.exports.c_text import (
    comment,
    finder_name,
    floats,
    kind_of,
    listed,
    number,
    rule_comment,
)
from sarl_core.explaining.exports.program import (
    CodeLine,
    DimensionProgram,
    Program,
    Replacement,
    action_lines,
    parts_of,
    program_of,
    query_name,
    sign_off_lines,
    state_lines,
)
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.mining.action_words import label_text
from sarl_core.mining.language import conditions_text, counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import Rule
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid

_SIGNATURE = """\
int shield_decide(const float state[SHIELD_FEATURES],
                  const {kind} proposed[SHIELD_ACTIONS],
                  {kind} executed[SHIELD_ACTIONS],
                  int rule[SHIELD_ACTIONS])"""

_HEAD = """\
/* A shield of rules as one function, C99:
 *
{signature}
 *
 *   state     what the agent sees, {features}, each as listed below
 *   proposed  the agent's action, {actions}
 *   executed  the action to execute; may be the same array as proposed
 *   rule      for each action the index of the rule in force, -1 where none applies
 *
 *   It returns 1 if an action was changed, 0 if not. An action that breaks no rule is
 *   passed on as it is. It keeps nothing between calls and may run in several threads.
{never} *   Where a number of the state {none}, it returns
 *   SHIELD_INVALID, and no rule is in force: {invalid}.
 *
 * Made by `python -m sarl_core export`: {rules}{projection}.
 * The rules were learned from examples and guarantee nothing.
{approved} */
#include <float.h>
#include <math.h>
#include <stdint.h>

{fused}/* Thresholds are doubles, compared with the state as it is. Where a compiler computes with
 * other numbers, or takes for granted that all are finite, decisions may differ. */
#if defined(__FAST_MATH__) || \\
    (defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 1)
#error "compile without fast math, and with doubles computed as doubles (on x86: SSE2)"
#endif
"""


_FUSED = """\
/* Some of what is asked is derived from the state, in doubles and step by step. Compile with
 * -ffp-contract=off: fused operations give other numbers. */
"""

_NEVER = """\
 *   Rules that forbid are asked where no rule demands an action. The index is then that of
 *   the rule that is broken, else of the first in force, and a forbidden action becomes what
 *   the expert did most often there of what no rule forbids.
"""

_HELPERS = {
    "min": """\
static double shield_min(double a, double b)
{
    return a != a || a < b ? a : b;
}
""",
    "max": """\
static double shield_max(double a, double b)
{
    return a != a || a > b ? a : b;
}
""",
}

_INVALID: dict[OnInvalid, str] = {
    "raise": "nothing is written to executed, and\n *   nothing should be done (on_invalid: raise)",
    "pass": "the action is passed on as it is, unchecked\n *   (on_invalid: pass)",
}


def rules_to_c(
    rule_set: RuleSet,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
    sign_off: SignOff | None = None,
) -> str:
    """A rule set as C.

    Args:
        rule_set: The rules; those switched off are left out, and keep their index.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: Whether an action passes where it or the state is none, or nothing is given
            to be executed; what is returned says so either way.
        sign_off: Who approved the rules; None to say nothing of it.

    Returns:
        A source file with the function `shield_decide`, which decides as a `Shield` does.

    Raises:
        InputError: As `program_of`.
    """
    program = program_of(rule_set, projection, on_invalid)
    functions = [
        part
        for index, orders in enumerate(zip(program.orders, program.never, strict=True))
        for order in (orders[0], *orders[1])
        for part in _finders(finder_name(index, order.label), order, program)
    ]
    return "\n".join(
        [
            _head(program, sign_off),
            _names(program),
            _table(program),
            *functions,
            *never_parts(program),
            *_derive(program),
            _valid(program),
            _decide(program),
        ]
    )


def _head(program: Program, sign_off: SignOff | None) -> str:
    rule_set = program.rule_set
    signature = _SIGNATURE.format(kind=kind_of(program)).replace("\n", "\n *   ")
    if program.continuous:
        replaced = {
            "centre": "the middle of the rule's interval",
            "clip": "the nearest value in the rule's interval",
            "expert": "what the expert typically did there",
        }[program.projection]
        projection = f";\n * an action that breaks a rule becomes {replaced}"
        if program.forbids:
            where = "the nearest value in" if program.projection == "clip" else "the middle of"
            projection += f",\n * and a forbidden one {where} the interval in its place"
    else:
        projection = ""
    return _HEAD.format(
        signature=f" *   {signature};",
        features=counted(program.width, "number"),
        fused=_FUSED if program.derives else "",
        never=_NEVER if program.forbids else "",
        actions=counted(len(program.orders), "number"),
        none="or of the action is not finite"
        if program.continuous
        else "is not finite, or an action none that there is",
        invalid=_INVALID[program.on_invalid],
        rules=f"{counted(len(rule_set), 'rule')} for "
        f"{comment(rule_set.source.env_id) or 'an unnamed environment'}",
        projection=projection,
        approved="".join(f" * {comment(line)}\n" for line in sign_off_lines(sign_off)),
    )


def _names(program: Program) -> str:
    features = [f" *   {comment(line)}" for line in state_lines(program.rule_set.source.features)]
    derived = [f" *   {comment(line)}" for line in derived_lines(program.rule_set.source.features)]
    actions = [f" *   {comment(line)}" for line in action_lines(program.rule_set.actions)]
    size = len(program.rule_set.source.features)
    prototype = _SIGNATURE.format(kind=kind_of(program))
    return "\n".join(
        [
            "/* The state:",
            *features,
            *([" * Derived from it:", *derived] if derived else []),
            " * The actions:",
            *actions,
            " */",
            "enum {",
            f"    SHIELD_FEATURES = {program.width},",
            *(
                [f"    SHIELD_VALUES = {size}, /* with those that are derived */"]
                if derived
                else []
            ),
            f"    SHIELD_ACTIONS = {len(program.orders)},",
            *(
                [f"    SHIELD_LABELS = {program.most_labels}, /* of an action, at most */"]
                if program.forbids
                else []
            ),
            f"    SHIELD_RULES = {len(program.rule_set)},",
            "    SHIELD_INVALID = -1",
            "};",
            "",
            f"{prototype};",
            "",
        ]
    )


def _table(program: Program) -> str:
    """What each rule makes of an action."""
    lines = [
        "/* What each rule that demands an action makes of it; of rules that forbid there is 0. */"
        if any(rule.forbids for rule in program.rule_set.rules)
        else "/* What each rule makes of an action: one that it allows is kept, any other is"
        " replaced. */"
    ]
    rows = [
        f"    {_row(outcome, program)},"
        f" /* {index}: {rule_comment(rule, program.rule_set)}{'' if rule.enabled else ', off'} */"
        for index, (rule, outcome) in enumerate(
            zip(program.rule_set.rules, program.outcomes, strict=True)
        )
    ]
    if not program.continuous:
        return "\n".join(
            [*lines, "static const int64_t shield_value[SHIELD_RULES] = {", *rows, "};", ""]
        )
    value = "" if program.projection == "clip" else "float value; "
    lines += [
        "static const struct {",
        f"    {value}float low, high;     /* allowed: low to high */",
        "    int open_low, open_high; /* 1: and all beyond */",
        "} shield_rule[SHIELD_RULES] = {",
        *rows,
        "};",
        "",
        "static int shield_keeps(int rule, float action)",
        "{",
        "    return (shield_rule[rule].open_low || !(action < shield_rule[rule].low)) &&",
        "           (shield_rule[rule].open_high || action <= shield_rule[rule].high);",
        "}",
        "",
    ]
    if program.projection == "clip":
        lines += [
            "static float shield_nearest(int rule, float action)",
            "{",
            "    if (!(action > shield_rule[rule].low))",
            "        action = shield_rule[rule].low;",
            "    return action < shield_rule[rule].high ? action : shield_rule[rule].high;",
            "}",
            "",
        ]
    return "\n".join(lines)


def _row(outcome: Replacement, program: Program) -> str:
    if not program.continuous:
        return f"INT64_C({outcome.low})"
    flags = [str(int(outcome.open_low)), str(int(outcome.open_high))]
    return listed([*floats(outcome), *flags])


def _derive(program: Program) -> list[str]:
    """The function that works out what is derived from the state; none where nothing is."""
    if not program.derives:
        return []
    features = program.rule_set.source.features
    operations = used_operations(features)
    functions = {"min": "shield_min", "max": "shield_max", "abs": "fabs"}
    lines = [text for name, text in _HELPERS.items() if name in operations]
    lines += [
        "/* What is derived from the state: in doubles, and then rounded to a float. */",
        "static void shield_derive(const float *state, float *x)",
        "{",
        "    for (int i = 0; i < SHIELD_FEATURES; i++)",
        "        x[i] = state[i];",
    ]
    for place, feature in enumerate(features):
        if feature.derived is None:
            continue
        steps = assignments(feature.derived, "(double)x[{}]".format, number, functions)
        lines.append(f"    {{ /* {comment(feature.name)} */")
        lines += [f"        double t{step} = {text};" for step, text in enumerate(steps)]
        lines += [f"        x[{place}] = (float)t{len(steps) - 1};", "    }"]
    return ["\n".join([*lines, "}", ""])]


def _finders(name: str, order: DimensionProgram, program: Program) -> list[str]:
    """The functions that find the rule of one action dimension, called ones first."""
    always = any(not rule.conditions for _, rule in order.scanned)
    parts = [[]] if always else parts_of(order.nodes)
    what = (
        "the rule in force"
        if order.label is None
        else f"the rule that forbids {label_text(order.label, order.dimension)}"
    )
    finders = []
    for part in reversed(range(len(parts))):
        lines = [
            f"/* {comment(order.dimension.name)}: {comment(what)}. */"
            if part == 0
            else "/* Further down. */",
            f"static int {_part(name, part)}(const float *x)",
            "{",
        ]
        if part == 0:
            if always or not order.asks:
                lines.append("    (void)x;")
            lines += [line for place, rule in order.scanned for line in _scan(place, rule, program)]
        lines += [line for step in parts[part] for line in _lines(step, name, program)]
        finders.append("\n".join([*lines, "}", ""]))
    return finders


def _part(name: str, number: int) -> str:
    return f"{name}_{number}" if number else name


def _scan(place: int, rule: Rule, program: Program) -> list[str]:
    rule_set = program.rule_set
    text = f"return {place}; /* {rule_comment(rule, rule_set)} */"
    if not rule.conditions:
        return [f"    {text}"]
    queries = [
        # Of two numbers one is at most the other, or above it; what is no number is neither.
        _query(feature, threshold, op)
        if feature in program.formulas or op == "<="
        else f"!({_query(feature, threshold)})"
        for feature, op, threshold in rule.conditions
    ]
    return [
        f"    /* {comment(conditions_text(rule, rule_set))} */",
        f"    if ({' && '.join(queries)})",
        f"        {text}",
    ]


def _lines(step: CodeLine, name: str, program: Program) -> list[str]:
    space, rule_set = "    " * (step.level + 1), program.rule_set
    match step.kind:
        case "if":
            statement = comment(query_name(rule_set.source.features[step.feature]))
            query = f"{space}if ({_query(step.feature, step.threshold)}) {{ /* {statement} */"
            if step.feature not in program.formulas:
                return [query]
            return [
                f"{space}if (isnan(x[{step.feature}])) /* a formula without a value: no rule */",
                f"{space}    return -1;",
                query,
            ]
        case "else":
            return [f"{space}}} else {{"]
        case "end":
            return [f"{space}}}"]
        case "part":
            return [f"{space}return {_part(name, step.target)}(x);"]
        case "rule":
            if step.target == NO_RULE:
                return [f"{space}return -1;"]
            rule = rule_set.rules[step.target]
            return [f"{space}return {step.target}; /* {rule_comment(rule, rule_set)} */"]


def _query(feature: int, threshold: float, op: str = "<=") -> str:
    return f"(double)x[{feature}] {op} {number(threshold)}"


def _valid(program: Program) -> str:
    """Whether the rules can be asked at all."""
    table = []
    refusal = "!isfinite(proposed[i])"
    if not program.continuous:
        refusal = "proposed[i] < shield_first[i] || proposed[i] > shield_last[i]"
        first, last = (
            ", ".join(f"INT64_C({end})" for end in ends)
            for ends in zip(*program.labels, strict=True)
        )
        table = [
            "/* The actions there are. */",
            f"static const int64_t shield_first[SHIELD_ACTIONS] = {{{first}}};",
            f"static const int64_t shield_last[SHIELD_ACTIONS] = {{{last}}};",
            "",
        ]
    return "\n".join(
        [
            *table,
            f"static int shield_is_valid(const float *state, const {kind_of(program)} *proposed)",
            "{",
            "    for (int i = 0; i < SHIELD_FEATURES; i++)",
            "        if (!isfinite(state[i]))",
            "            return 0;",
            "    for (int i = 0; i < SHIELD_ACTIONS; i++)",
            f"        if ({refusal})",
            "            return 0;",
            "    return 1;",
            "}",
            "",
        ]
    )


def _decide(program: Program) -> str:
    x = "x" if program.derives else "state"
    calls = [
        f"    rule[{index}] = {finder_name(index)}({x});" for index in range(len(program.orders))
    ]
    if not program.continuous:
        keeps, becomes = "proposed[i] == shield_value[rule[i]]", "shield_value[rule[i]]"
    elif program.projection == "clip":
        keeps, becomes = (
            "shield_keeps(rule[i], proposed[i])",
            "shield_nearest(rule[i], proposed[i])",
        )
    else:
        keeps, becomes = "shield_keeps(rule[i], proposed[i])", "shield_rule[rule[i]].value"
    passes = program.on_invalid == "pass"
    unruled = [f"        if (rule[i] < 0 || {keeps}) {{"]
    if program.forbids:
        unruled = [
            "        if (rule[i] < 0) {",
            f"            const {kind_of(program)} allowed ="
            f" shield_allowed(i, {x}, proposed[i], &rule[i]);",
            "            changed |= allowed != proposed[i];",
            "            executed[i] = allowed;",
            f"        }} else if ({keeps}) {{",
        ]
    return "\n".join(
        [
            _SIGNATURE.format(kind=kind_of(program)),
            "{",
            "    int changed = 0;",
            *(["    float x[SHIELD_VALUES];"] if program.derives else []),
            "    if (!shield_is_valid(state, proposed)) {",
            "        for (int i = 0; i < SHIELD_ACTIONS; i++)",
            f"            rule[i] = -1{', executed[i] = proposed[i]' if passes else ''};",
            "        return SHIELD_INVALID;",
            "    }",
            *(["    shield_derive(state, x);"] if program.derives else []),
            *calls,
            "    for (int i = 0; i < SHIELD_ACTIONS; i++) {",
            *unruled,
            "            executed[i] = proposed[i];",
            "        } else {",
            f"            executed[i] = {becomes};",
            "            changed = 1;",
            "        }",
            "    }",
            "    return changed;",
            "}",
            "",
        ]
    )
