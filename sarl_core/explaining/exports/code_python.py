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
from sarl_core.mining.action_words import action_text, label_text, says_text
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
{never}\
    """
    x = numbers(state, FEATURES)
    if x is None or not are_labels((action,) if SINGLE else action):
{answer}\
{derive}\
    rules = [find(x) for find in FIND]
{decide}\
'''

_DEMANDED = """\
    if SINGLE:
        value = VALUES[rules[0]] if rules[0] >= 0 else action
        return (action if action == value else value), rules
    executed = [
        proposed if rule < 0 or proposed == VALUES[rule] else VALUES[rule]
        for proposed, rule in zip(action, rules)
    ]
    return executed, rules
"""

_DEMANDED_OR_ALLOWED = """\
    executed = [action] if SINGLE else list(action)
    for index, rule in enumerate(rules):
        wanted = executed[index]
        if rule < 0:
            executed[index], rules[index] = allowed(x, index, wanted)
        elif wanted != VALUES[rule]:
            executed[index] = VALUES[rule]
    return (executed[0] if SINGLE else executed), rules
"""

_NEVER_NOTE = """
    Rules that forbid are asked where no rule demands an action. The index is then that of the
    rule that is broken, else of the first in force, and a forbidden action becomes what the
    expert did most often there of what no rule forbids{expert}.
"""

_ALLOWED = '''

def allowed(x, index, action):
    """What becomes of an action where no rule demands one, and the rule that it breaks.

    Where it breaks none, the first rule in force or -1.
    """
    forbidden = {{}}
    for label, find in FORBID[index].items():
        rule = find(x)
        if rule >= 0:
            forbidden[label] = rule
{label}\
    if label not in forbidden:
        return action, min(forbidden.values(), default=-1)
    broken = forbidden[label]
    # Where every label is forbidden, the rule of the fewest states decides.
    closest = min(forbidden.values(), key=lambda rule: (NEVER[rule][0], rule))
    free = [other for other in NEVER[broken][1] if other not in forbidden]
    other = free[0] if free else NEVER[closest][1][0]
    if other == label:
        return action, broken
{becomes}\
'''

_CONTINUOUS = '''

def shield(state, action):
    """The action to execute, and the rule in force.

    state: FEATURES numbers; action: one number an action dimension. Both are taken as 32-bit
    floating point, as environments give and take them.

    Returns (executed, rules). An action that breaks no rule is passed on as it is. For each
    action dimension, rules holds the index of the rule in force, or -1 where none applies.
{never}\
    """
    x, proposed = numbers(state, FEATURES), numbers(action, len(FIND))
    if x is None or proposed is None:
{answer}\
{derive}\
    rules = [find(x) for find in FIND]
    executed = list(proposed)
    for index, rule in enumerate(rules):
        if rule < 0:
{unruled}\
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


_LABEL = (
    """\
    actions = ACTIONS[index]
    label = actions.index(action) if action in actions else None
""",
    """\
    return ACTIONS[index][other], broken
""",
)

_INTERVAL = (
    """\
    intervals = INTERVALS[index]
    label = sum(action >= low for _, low, _ in intervals[1:])
""",
    """\
    value, low, high = intervals[other]
    if value is None:  # the nearest that is allowed
        value = min(max(action, low), high)
    return value, broken
""",
)

_UNRULED = """\
            executed[index], rules[index] = allowed(x, index, executed[index])
"""

_EXPERT = " (the middle of that interval)"


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
        for index, orders in enumerate(zip(program.orders, program.never, strict=True))
        for order in (orders[0], *orders[1])
        for part in _finders(_finder(index, order.label), order, program)
    ]
    docstring, answer = _INVALID[on_invalid]
    body = _CONTINUOUS if program.continuous else _DISCRETE
    finders = ", ".join(_finder(index) for index in range(len(program.orders)))
    note = _NEVER_NOTE.format(
        expert=_EXPERT if program.projection == "expert" and program.continuous else ""
    )
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
                *_never(program),
                _NUMBERS
                + _allowed(program)
                + body.format(
                    answer=answer,
                    derive="    derive(x)\n" if program.derives else "",
                    never=note if program.forbids else "",
                    decide=_DEMANDED_OR_ALLOWED if program.forbids else _DEMANDED,
                    unruled=_UNRULED if program.forbids else "",
                ),
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
        f"    {None if rule.forbids else _row(outcome, continuous=program.continuous)},"
        f"  # {index}: {_rule_comment(rule, program.rule_set)}{'' if rule.enabled else ', off'}"
        for index, (rule, outcome) in enumerate(rules)
    ]
    forbids = any(rule.forbids for rule in program.rule_set.rules)
    if not program.continuous:
        but = "; None: it forbids" if forbids else ""
        return [f"# What each rule says to do{but}.", "VALUES = (", *rows, ")", ""]
    return [
        "# What each rule makes of an action: one from low to high is kept (and beyond, where it",
        "# is open), any other becomes the value, or the nearest where that is None.",
        *(["# Rules that forbid have None."] if forbids else []),
        "OUTCOMES = (  # value, low, high, open_low, open_high",
        *rows,
        ")",
        "",
    ]


def _row(outcome: Replacement, *, continuous: bool) -> str:
    if not continuous:
        return str(int(outcome.low))
    flags = [str(outcome.open_low), str(outcome.open_high)]
    return f"({', '.join([*_numbers(outcome), *flags])})"


def _numbers(outcome: Replacement) -> list[str]:
    """What an action becomes, where that is one value, and the ends of what is left."""
    return ["None" if one is None else _number(one) for one in outcome[:3]]


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


def _finders(name: str, order: DimensionProgram, program: Program) -> list[str]:
    """The functions that find the rule of one action dimension."""
    always = any(not rule.conditions for _, rule in order.scanned)
    what = (
        "the rule in force"
        if order.label is None
        else f"the rule that forbids {label_text(order.label, order.dimension)}"
    )
    finders = []
    for number, part in enumerate([[]] if always else parts_of(order.nodes)):
        lines = ["", f"def {_part(name, number)}(x):"]
        if number == 0:
            lines.append(f"    # {one_line(order.dimension.name)}: {one_line(what)}.")
            for place, rule in order.scanned:
                lines += _scan(place, rule, program.rule_set)
        lines += [line for step in part for line in _lines(step, name, program)]
        finders.append("\n".join([*lines, ""]))
    return finders


def _finder(index: int, label: int | None = None) -> str:
    return f"rule_of_{index}" if label is None else f"never_{index}_{label}"


def _part(name: str, number: int) -> str:
    return f"{name}_{number}" if number else name


def _never(program: Program) -> list[str]:
    """The tables of rules that forbid; nothing where none does."""
    if not program.forbids:
        return []
    rows = [
        f"    {place}: ({rule.samples}, {rule.instead}),  # {_rule_comment(rule, program.rule_set)}"
        for place, rule in enumerate(program.rule_set.rules)
        if rule.forbids and rule.enabled
    ]
    names = [
        ", ".join(f"{order.label}: {_finder(index, order.label)}" for order in orders)
        for index, orders in enumerate(program.never)
    ]
    lines = [
        "# For each action what finds the rule that forbids a label.",
        f"FORBID = ({' '.join(f'{{{one}}},' for one in names)})",
        "# Of each rule that forbids the number of states that it was learned from, and the labels",
        "# in the place of a forbidden one, the most frequent first.",
        "NEVER = {",
        *rows,
        "}",
    ]
    if not program.continuous:
        actions = tuple(tuple(int(one.low) for one in labels) for labels in program.allowed)
        return [*lines, "# The actions that labels stand for.", f"ACTIONS = {actions}"]
    intervals = [
        line
        for order, labels in zip(program.orders, program.allowed, strict=True)
        for line in (
            "    (",
            *(
                f"        ({', '.join(_numbers(one))}),"
                f"  # {one_line(action_text(label, order.dimension))}"
                for label, one in enumerate(labels)
            ),
            "    ),",
        )
    ]
    return [
        *lines,
        "# What an action becomes by its new label: the value, or the nearest from low to high",
        "# where that is None.",
        "INTERVALS = (  # for each label value, low, high",
        *intervals,
        ")",
    ]


def _allowed(program: Program) -> str:
    """The function that decides where rules only forbid; nothing where none does."""
    if not program.forbids:
        return ""
    label, becomes = _INTERVAL if program.continuous else _LABEL
    return _ALLOWED.format(label=label, becomes=becomes)


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


def _lines(step: CodeLine, name: str, program: Program) -> list[str]:
    space, rule_set = "    " * (step.level + 1), program.rule_set
    match step.kind:
        case "if":
            statement = query_name(rule_set.source.features[step.feature])
            query = f"{space}if x[{step.feature}] <= {_number(step.threshold)}:  # {statement}"
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
            return [f"{space}return {_part(name, step.target)}(x)"]
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
