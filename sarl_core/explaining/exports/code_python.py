"""Rules as one Python function that needs nothing but Python."""

from __future__ import annotations

import math

from sarl_core.environments.formulas import Formula
from sarl_core.explaining.exports.arithmetic import assignments, derived_lines, used_operations
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
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import conditions_text, counted, one_line
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import Rule
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid

# No name from outside stands in the first two lines: there, Python looks for an encoding.
_HEAD = '''\
"""A shield of rules as one function: `shield(state, action)`.

Made by `python -m sarl_core export`; it needs nothing but Python 3.
The rules were learned from examples and guarantee nothing.
{invalid}"""

from array import array
from math import {functions}
'''

_INVALID: dict[OnInvalid, tuple[str, str]] = {
    "raise": (
        """\
Where the state is not so many finite numbers, or the action is none that there is, it
raises ValueError (on_invalid: raise).
""",
        """\
        raise ValueError("the state or the action is none that the rules can be asked about")
""",
    ),
    "pass": (
        """\
Where the state is not so many finite numbers, or the action is none that there is, the
action is passed on as it is, and no rule is in force (on_invalid: pass).
""",
        """\
        return action, [-1] * len(FIND)
""",
    ),
}

_NUMBERS = '''\


def numbers(values, count):
    """So many finite numbers in 32-bit floating point, or None where they are something else."""
    try:
        found = array("f", [] if isinstance(values, (bytes, bytearray)) else values)
    except (TypeError, ValueError, OverflowError):
        return None
    return found if len(found) == count and all(map(isfinite, found)) else None
'''

_HELPERS = {
    "/": '''
def quotient(a, b):
    """Divided as computers do: by zero it is infinite, or no number."""
    if b:
        return a / b
    return nan if not a or isnan(a) else copysign(inf, a) * copysign(1.0, b)

''',
    "min": '''
def least(a, b):
    """The lesser of two; what is no number stays so."""
    return a if isnan(a) or a < b else b

''',
    "max": '''
def most(a, b):
    """The larger of two; what is no number stays so."""
    return a if isnan(a) or a > b else b

''',
}

_DISCRETE = '''

def is_label(value, first, last):
    """Whether a value is one of the actions there are."""
    try:
        return bool(first <= value <= last) and int(value) == value
    except (TypeError, ValueError, OverflowError):
        return False


def are_labels(actions):
    """Whether each value is one of the actions there are."""
    try:
        return len(actions) == len(LABELS) and all(
            is_label(value, first, last) for value, (first, last) in zip(actions, LABELS)
        )
    except TypeError:
        return False


def shield(state, action):
    """The action to execute, and the rule in force.

    state: FEATURES numbers, taken as 32-bit floating point, as environments give them.
    action: the agent's action, a whole number; with several actions a sequence of them.

    Returns (executed, rules). An action that breaks no rule is passed on as it is. For each
    action, rules holds the index of the rule in force, or -1 where none applies.
    """
    x = numbers(state, FEATURES)
    if x is None or not are_labels((action,) if SINGLE else action):
{answer}\
{derive}\
    rules = [find(x) for find in FIND]
    if SINGLE:
        value = VALUES[rules[0]] if rules[0] >= 0 else action
        return (action if action == value else value), rules
    executed = [
        proposed if rule < 0 or proposed == VALUES[rule] else VALUES[rule]
        for proposed, rule in zip(action, rules)
    ]
    return executed, rules
'''

_CONTINUOUS = '''

def shield(state, action):
    """The action to execute, and the rule in force.

    state: FEATURES numbers; action: one number an action dimension. Both are taken as 32-bit
    floating point, as environments give and take them.

    Returns (executed, rules). An action that breaks no rule is passed on as it is. For each
    action dimension, rules holds the index of the rule in force, or -1 where none applies.
    """
    x, proposed = numbers(state, FEATURES), numbers(action, len(FIND))
    if x is None or proposed is None:
{answer}\
{derive}\
    rules = [find(x) for find in FIND]
    executed = list(proposed)
    for index, rule in enumerate(rules):
        if rule < 0:
            continue
        value, low, high, open_low, open_high = OUTCOMES[rule]
        wanted = executed[index]
        if (open_low or wanted >= low) and (open_high or wanted <= high):
            continue
        if value is None:  # the nearest that is allowed
            value = min(max(wanted, low), high)
        executed[index] = value
    return executed, rules
'''


def rules_to_python(
    rule_set: RuleSet,
    projection: Projection = "centre",
    on_invalid: OnInvalid = "raise",
    sign_off: SignOff | None = None,
) -> str:
    """A rule set as Python.

    Args:
        rule_set: The rules; those switched off are left out, and keep their index.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: Whether a state or an action that is none raises an error or lets the action
            pass.
        sign_off: Who approved the rules; None to say nothing of it.

    Returns:
        A module with the function `shield`, which decides as a `Shield` does.

    Raises:
        InputError: As `program_of`.
    """
    program = program_of(rule_set, projection, on_invalid)
    functions = [
        part
        for index, order in enumerate(program.orders)
        for part in _finders(index, order, program)
    ]
    docstring, answer = _INVALID[on_invalid]
    body = _CONTINUOUS if program.continuous else _DISCRETE
    finders = ", ".join(_finder(index, 0) for index in range(len(program.orders)))
    return (
        "\n".join(
            [
                _HEAD.format(invalid=docstring, functions=_imported(program)),
                *[f"# {line}" for line in sign_off_lines(sign_off)],
                *_names(program),
                *_table(program),
                *functions,
                *_derive(program),
                "",
                f"FIND = ({finders},)",
                _NUMBERS
                + body.format(answer=answer, derive="    derive(x)\n" if program.derives else ""),
            ]
        ).rstrip()
        + "\n"
    )


def _names(program: Program) -> list[str]:
    rule_set = program.rule_set
    lines = [
        f"# {counted(len(rule_set), 'rule')} for "
        f"{one_line(rule_set.source.env_id) or 'an unnamed environment'}. The state:"
    ]
    lines += [f"#   {line}" for line in state_lines(rule_set.source.features)]
    derived = [f"#   {line}" for line in derived_lines(rule_set.source.features)]
    lines += ["# Derived from it:", *derived] if derived else []
    lines.append("# The actions:")
    lines += [f"#   {line}" for line in action_lines(rule_set.actions)]
    lines.append(f"FEATURES = {program.width}")
    if not program.continuous:
        lines.append(f"SINGLE = {len(program.orders) == 1}")
        lines.append(f"LABELS = {program.labels!r}")
    return [*lines, ""]


def _table(program: Program) -> list[str]:
    """What each rule makes of an action."""
    rules = zip(program.rule_set.rules, program.outcomes, strict=True)
    rows = [
        f"    {_row(outcome, continuous=program.continuous)},"
        f"  # {index}: {_rule_comment(rule, program.rule_set)}{'' if rule.enabled else ', off'}"
        for index, (rule, outcome) in enumerate(rules)
    ]
    if not program.continuous:
        return ["# What each rule says to do.", "VALUES = (", *rows, ")", ""]
    return [
        "# What each rule makes of an action: one from low to high is kept (and beyond, where it",
        "# is open), any other becomes the value, or the nearest where that is None.",
        "OUTCOMES = (  # value, low, high, open_low, open_high",
        *rows,
        ")",
        "",
    ]


def _row(outcome: Replacement, *, continuous: bool) -> str:
    if not continuous:
        return str(int(outcome.low))
    value = "None" if outcome.value is None else _number(outcome.value)
    numbers = [value, _number(outcome.low), _number(outcome.high)]
    return f"({', '.join([*numbers, str(outcome.open_low), str(outcome.open_high)])})"


def _imported(program: Program) -> str:
    """What the module needs of `math`."""
    operations = used_operations(program.rule_set.source.features)
    names = {"isfinite"}
    names |= {"isnan"} if program.formulas else set()
    names |= {"copysign", "inf", "nan"} if "/" in operations else set()
    return ", ".join(sorted(names))


def _derive(program: Program) -> list[str]:
    """The function that works out what is derived from the state; none where nothing is."""
    if not program.derives:
        return []
    features = program.rule_set.source.features
    operations = used_operations(features)
    functions = {"/": "quotient", "min": "least", "max": "most", "abs": "abs"}
    lines = [text for name, text in _HELPERS.items() if name in operations]
    lines += [
        "",
        "def derive(x):",
        '    """Put behind the state what is derived from it, each rounded to 32 bits."""',
    ]
    for feature in features:
        if feature.derived is not None:
            steps = assignments(feature.derived, "x[{}]".format, _number, functions)
            lines.append(f"    # {one_line(feature.name)}")
            lines += [f"    t{step} = {text}" for step, text in enumerate(steps)]
            lines.append(f"    x.append(t{len(steps) - 1})")
    return ["\n".join([*lines, ""])]


def _finders(index: int, order: DimensionProgram, program: Program) -> list[str]:
    """The functions that find the rule of one action dimension."""
    always = any(not rule.conditions for _, rule in order.scanned)
    finders = []
    for number, part in enumerate([[]] if always else parts_of(order.nodes)):
        lines = ["", f"def {_finder(index, number)}(x):"]
        if number == 0:
            lines.append(f"    # {one_line(order.dimension.name)}: the rule in force.")
            for place, rule in order.scanned:
                lines += _scan(place, rule, program.rule_set)
        lines += [line for step in part for line in _lines(step, index, program)]
        finders.append("\n".join([*lines, ""]))
    return finders


def _finder(index: int, number: int) -> str:
    return f"rule_of_{index}" + (f"_{number}" if number else "")


def _scan(place: int, rule: Rule, rule_set: RuleSet) -> list[str]:
    text = f"return {place}  # {_rule_comment(rule, rule_set)}"
    if not rule.conditions:
        return [f"    {text}"]
    queries = [
        # Of two numbers one is at most the other, or above it; what is no number is neither.
        f"x[{feature}] > {_number(threshold)}"
        if op == ">" and isinstance(rule_set.source.features[feature].derived, Formula)
        else f"{'not ' if op == '>' else ''}x[{feature}] <= {_number(threshold)}"
        for feature, op, threshold in rule.conditions
    ]
    return [
        f"    # {one_line(conditions_text(rule, rule_set))}",
        f"    if {' and '.join(queries)}:",
        f"        {text}",
    ]


def _lines(step: CodeLine, index: int, program: Program) -> list[str]:
    space, rule_set = "    " * (step.level + 1), program.rule_set
    match step.kind:
        case "if":
            name = query_name(rule_set.source.features[step.feature])
            query = f"{space}if x[{step.feature}] <= {_number(step.threshold)}:  # {name}"
            if step.feature not in program.formulas:
                return [query]
            return [
                f"{space}if isnan(x[{step.feature}]):  # a formula without a value: no rule",
                f"{space}    return -1",
                query,
            ]
        case "else":
            return [f"{space}else:"]
        case "end":
            return []
        case "part":
            return [f"{space}return {_finder(index, step.target)}(x)"]
        case "rule":
            if step.target == NO_RULE:
                return [f"{space}return -1"]
            rule = rule_set.rules[step.target]
            return [f"{space}return {step.target}  # {_rule_comment(rule, rule_set)}"]


def _number(value: float) -> str:
    return f'float("{value}")' if math.isinf(value) else repr(float(value))


def _rule_comment(rule: Rule, rule_set: RuleSet) -> str:
    action = says_text(rule, rule_set.actions[rule.dimension])
    return one_line(f"{rule_set.name_of(rule)}: {action}")
