"""The part of a report that lets others make it again: fingerprints, versions, seeds, commands."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

from sarl_core.demonstrations.dataset import Demonstrations, with_formulas
from sarl_core.demonstrations.derived import formula_texts
from sarl_core.demonstrations.formats.mapping.roles import Roles, as_options
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.environments.environment import Environment
from sarl_core.environments.formulas import Formula
from sarl_core.explaining.report.comparison import Result
from sarl_core.explaining.report.tally import Tally
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.growing.growth import EXACT_UP_TO
from sarl_core.mining.language import counted, threshold_text
from sarl_core.mining.never.never_rules import forbids_alone, mine_at
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.mining.tree import PolicyTree
from sarl_core.rollouts.seeds import FRESH

_PACKAGES = ("numpy", "scikit-learn", "gymnasium", "pillow", "jinja2")
_PROGRAM = "python -m sarl_core"


def facts(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    tally: Tally,
    *,
    rules_name: str,
    demonstrations_name: str,
    seeds: tuple[int, int] | None,
    compared: Sequence[Result] = (),
    notes: Sequence[str] = (),
) -> tuple[tuple[str, str], ...]:
    """What tells a report from any other.

    Args:
        rule_set: The rules.
        demonstrations: Of the report.
        tally: The rules on them.
        rules_name: Of the rule file, "" where there is none.
        demonstrations_name: Of their file, likewise.
        seeds: First and last of the episodes that were played; None where none were.
        compared: Results of the report.
        notes: What is to be said of how rules and demonstrations were matched.

    Returns:
        Names and values.
    """
    source = rule_set.source
    entries = [
        ("Demonstrations", _named(demonstrations.whole.digest, demonstrations_name)),
        ("Rules", _named(rules_digest(rule_set), rules_name)),
    ]
    if not tally.same:
        size = f"{source.steps:,} steps in {counted(source.episodes, 'episode')}"
        entries.append(("Rules were made from", _named(source.digest, size)))
    files = dict.fromkeys(one.file for one in compared if one.file is not None)
    entries += [("Comparison", _named(one.digest, one.name)) for one in files]
    if demonstrations.seed is not None:
        entries.append(("Seed of the demonstrations", str(demonstrations.seed)))
    if seeds is not None:
        entries.append(("Seeds of the pictures", f"{seeds[0]} to {seeds[1]}"))
    entries += [("Which feature is which", note) for note in notes]
    versions = [f"Python {platform.python_version()}"]
    versions += [f"{package} {_version(package)}" for package in _PACKAGES]
    return (*entries, ("Versions", ", ".join(versions)))


def how_to_measure(env_id: str, *, measured: bool, certified: bool) -> tuple[str, ...]:
    """What is to be done to know what rules are worth, as far as that is not known.

    Args:
        env_id: Environment, "" where it is not known.
        measured: Whether somebody was run under the rules.
        certified: Whether a rate of failures is certified.

    Returns:
        Sentences with commands.
    """
    sentences = []
    if not measured and not env_id:
        sentences.append(
            "The demonstrations name no environment to run anybody in. Hold the rules against a "
            "log of what somebody did (“sarl audit”), or run an agent in a simulation of yours "
            "with the rules and without (“sarl evaluate --env”), and add the results with "
            "“--comparison”."
        )
    elif not measured:
        sentences.append(
            "Run an agent with the rules and without on the same seeds, on the page Measure or "
            f"with “sarl evaluate --env {env_id} --agent novice --seed {FRESH} --json”, once with "
            "“--rules” and once without, and add both results with “--comparison”."
        )
    if not certified and env_id:
        sentences.append(
            "Whether failures stay below a rate that one can bear is tested by “sarl certify”; its "
            "certificate is added with “--certificate”."
        )
    return tuple(sentences)


def _named(digest: str, name: str) -> str:
    return f"{digest} ({name})" if name else digest


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def command_line(
    command: str, argument: str | Path, options: Mapping[str, object | Sequence[object] | None]
) -> str:
    """A command as one types it.

    Args:
        command: As "report".
        argument: Its file.
        options: Name to value; several in a list or tuple, None for none, True for the name alone.

    Returns:
        One line, with whatever a shell would take for more than a name in quotes.
    """
    words = [command, str(argument)]
    for name, value in options.items():
        values = value if isinstance(value, (list, tuple)) else [value]
        for one in values:
            if one is not None:
                words += [name] if one is True else [name, str(one)]
    return f"{_PROGRAM} {shlex.join(words)}"


def mining_command(
    rule_set: RuleSet,
    rules: str | Path,
    demonstrations: str | Path,
    given: Demonstrations,
    *,
    env: Environment | None = None,
    columns: Roles | None = None,
    missing: Missing = "refuse",
    read: Demonstrations | None = None,
) -> str | None:
    """How rules were mined, as far as they tell themselves; `commands_that_hold` tries it.

    Args:
        rule_set: The rules.
        rules: Their file.
        demonstrations: The file of the demonstrations.
        given: The demonstrations.
        env: That was named when they were read, which gives names and bounds; None for none.
        columns: What was said of their columns.
        missing: What became of steps that lack a value.
        read: The demonstrations as their file has them; without derived features where None.

    Returns:
        One line; None for rules from other data, of a budget, tried on episodes kept aside, or
        edited by hand.
    """
    plain = all(
        rule.origin == "mined"
        and rule.enabled
        and not (rule.pinned or rule.regrown)
        and (rule.held_out is None or given.sample_of is not None)
        for rule in rule_set.rules
    )
    if rule_set.cut != "thresholds" or rule_set.source.digest != given.whole.digest or not plain:
        return None
    if given.sample_of is not None:  # everything else was settled when it was mined
        return command_line("mine", demonstrations, _limits(rule_set) | {"--out": rules})
    derived = _derived_options(given, read or given.deriving(()), rule_set.divider)
    if derived is None:
        return None
    continuous = any(action.is_interval for action in rule_set.actions)
    return command_line(
        "mine",
        demonstrations,
        {
            **_limits(rule_set),
            "--divider": rule_set.divider if continuous else None,
            "--learner": _learner_option(rule_set),
            **derived,
            "--column": as_options(columns or {}),
            "--missing": None if missing == "refuse" else missing,
            **({} if env is None else env.options),
            "--out": rules,
        },
    )


def _limits(rule_set: RuleSet) -> dict[str, object]:
    """The thresholds as options."""
    limits = rule_set.thresholds
    named = next((name for name, pair in NAMED_SETTINGS.items() if pair == limits), None)
    return {
        "--setting": named,
        "--support": None if named else threshold_text(limits.support),
        "--confidence": None
        if named or forbids_alone(rule_set)
        else threshold_text(limits.confidence),
        "--never": None if limits.never is None else threshold_text(limits.never),
        "--lift": threshold_text(limits.lift) if limits.lift else None,
        "--max-depth": limits.max_depth,
    }


def _learner_option(rule_set: RuleSet) -> str | None:
    """None where "auto" takes this learner, whatever is installed."""
    few = rule_set.source.steps <= EXACT_UP_TO
    return None if few and rule_set.learner == "exact" else rule_set.learner


def _derived_options(
    given: Demonstrations, read: Demonstrations, divider: int
) -> dict[str, object] | None:
    """How derived features are asked for; None where no options would give them."""
    formulas = formula_texts([one for one in given.derived if one not in read.derived])
    base = with_formulas(read, formulas)
    before = len(base.derived)
    combined = [one.definition for one in given.derived[before:]]
    if given.derived[:before] != base.derived or any(isinstance(o, Formula) for o in combined):
        return None
    options: dict[str, object] = {"--feature": list(formulas)}
    if not combined:
        return options
    names = [feature.name for feature in base.observed]
    pairs = [(first, second) for first, second in dict.fromkeys(o.features for o in combined)]
    named = [f"{names[first]}, {names[second]}" for first, second in pairs]
    for chosen, option in ((None, [True]), (pairs, named)):
        if with_combinations(base, pairs=chosen, divider=divider).derived == given.derived:
            return options | {"--combine": option}
    return None


def commands_that_hold(
    commands: Sequence[str], rule_set: RuleSet, trees: Sequence[PolicyTree] | None
) -> tuple[str, ...]:
    """Commands without a mining command that would make other rules than these.

    Rounding, merging, leaving rules out: what was done to rules after mining need not show. So
    they are mined again.

    Args:
        commands: One line each.
        rule_set: The rules, under the names they came with.
        trees: Grown from the demonstrations; None for rules that no thresholds cut.

    Returns:
        Those that make what they say.
    """
    mining = f"{_PROGRAM} mine "
    if not any(line.startswith(mining) for line in commands) or mined_again(rule_set, trees):
        return tuple(commands)
    return tuple(line for line in commands if not line.startswith(mining))


def mined_again(rule_set: RuleSet, trees: Sequence[PolicyTree] | None) -> bool:
    """Whether trees give the same rules, under the same names.

    Args:
        rule_set: The rules.
        trees: Grown from demonstrations; None for rules that no thresholds cut.

    Returns:
        False without trees.
    """
    if not trees:
        return False
    again = mine_at(trees, rule_set.thresholds)
    one, other = (
        [
            (rule.id, rule.dimension, rule.conditions, rule.action, rule.forbids)
            for rule in rules.rules
        ]
        for rules in (again, rule_set)
    )
    return one == other and (again.actions, again.source.features) == (
        rule_set.actions,
        rule_set.source.features,
    )
