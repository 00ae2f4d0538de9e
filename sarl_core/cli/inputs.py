"""What the arguments of several commands name, read."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from sarl_core.cli import terminal
from sarl_core.cli.options import EVERY_PAIR, MINED, Derived
from sarl_core.cli.stand_ins import called, said
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from sarl_core.agents.agent import Agent
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.demonstrations.formats.mapping.roles import Roles
    from sarl_core.explaining.words.sign_off import SignOff
    from sarl_core.mining.combining.candidates import Pair
    from sarl_core.mining.rule_set import RuleSet
    from sarl_core.shielding.shield import Shield


def read_agent(
    agent: str,
    env_id: EnvironmentOrId,
    normalise: str | None,
    *,
    stochastic: bool = False,
    seed: int = 0,
) -> Agent:
    """Make an agent, and say on standard error how its file was read.

    Args:
        agent: Of the option ``--agent``.
        env_id: Where it acts.
        normalise: Of the option ``--normalise``, or None.
        stochastic: Whether a trained policy is sampled.
        seed: Of the untrained weights.

    Returns:
        The agent.

    Raises:
        InputError: If there is no such agent, or it does not fit the environment.
    """
    from sarl_core.agents.agent import PolicyAgent
    from sarl_core.agents.own import is_own, own_agent
    from sarl_core.rollouts.trial import make_agent

    if is_own(agent) and normalise is None:
        return own_agent(agent, env_id, stochastic=stochastic)
    made = make_agent(agent, env_id, stochastic=stochastic, seed=seed, normalise=normalise)
    if isinstance(made, PolicyAgent):
        terminal.print_notes(made.notes)
    return made


def path_of(files: Sequence[Path], *, short: bool = False) -> str:
    """What files are called in an answer.

    Args:
        files: As the argument names them.
        short: Whether the folder is left out.

    Returns:
        The path of one; of several, that of the first, and how many more there are.
    """
    first = called(files[0], short=short)
    return first if len(files) == 1 else f"{first} and {len(files) - 1:,} more"


def read_demonstrations(
    files: Path | list[Path],
    env_id: EnvironmentOrId | None,
    columns: Roles,
    missing: Literal["refuse", "drop"] = "refuse",
) -> Demonstrations:
    """Read a file of demonstrations, or several that are one set.

    Args:
        files: As the argument names them.
        env_id: Of the option ``--env``, or None.
        columns: What was said of columns with ``--columns`` and ``--column``.
        missing: Of the option ``--missing``.

    Returns:
        What is in it.

    Raises:
        InputError: If it cannot be read, or is wrong.
    """
    from sarl_core.demonstrations.formats import load_demonstrations

    if isinstance(files, list) and len(files) == 1:
        files = files[0]  # which may be a pattern
    return load_demonstrations(files, env_id=env_id, columns=columns, missing=missing)


def is_mined_file(path: Path) -> bool:
    """Whether a path is called as files are that hold what is left of steps."""
    return path.suffix.lower() == MINED


def workers_at(address: str | None) -> AbstractContextManager[Executor | None]:
    """The processes of a cluster for episodes, for the time of a block.

    Args:
        address: Of the option ``--cluster``; None for this process.

    Returns:
        Gives an executor, or None.
    """
    if address is None:
        return nullcontext(None)
    from sarl_core.clusters import cluster_executor

    return cluster_executor(address)


def sign_off_of(rule_set: RuleSet) -> SignOff | None:
    """Who approved rules as they stand; why that is not known is said on standard error.

    Args:
        rule_set: With every edit.

    Returns:
        None where the library of this machine cannot be read: all else can be done without it.
    """
    from sarl_core.library.contents import sign_off_at_hand

    try:
        return sign_off_at_hand(rule_set)
    except (SarlError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        terminal.print_notes([f"whether the rules are approved is not known: {why}"])
        return None


def with_wanted(
    demonstrations: Demonstrations, derived: Derived, *, divider: int = 2
) -> Demonstrations:
    """Put what a person wants derived behind the features of demonstrations.

    Args:
        demonstrations: As they were read.
        derived: Of the options ``--combine`` and ``--feature``.
        divider: Of the option ``--divider``.

    Returns:
        The same steps; the same object where nothing is wanted.

    Raises:
        InputError: If a formula is none, or a feature is unknown.
    """
    if derived.formulas:
        from sarl_core.demonstrations.dataset import with_formulas

        demonstrations = with_formulas(demonstrations, derived.formulas)
    if derived.pairs:
        from sarl_core.mining.combining.choice import with_combinations

        pairs = pairs_of(demonstrations, derived)
        demonstrations = with_combinations(demonstrations, pairs=pairs, divider=divider)
    return demonstrations


def pairs_of(demonstrations: Demonstrations, derived: Derived) -> tuple[Pair, ...]:
    """The pairs of features that a person wants combined; () for none."""
    from sarl_core.mining.combining.candidates import pairs_by_name, pairs_of_like_kind

    named = [text for text in derived.pairs if text != EVERY_PAIR]
    pairs = pairs_by_name(demonstrations, named)
    if EVERY_PAIR in derived.pairs:
        pairs = tuple(dict.fromkeys((*pairs, *pairs_of_like_kind(demonstrations))))
    return pairs


def read_shield(
    rules: Path | None,
    projection: Literal["centre", "clip", "expert"],
    outside: Literal["act", "abstain"] = "act",
    on_invalid: Literal["raise", "pass"] = "raise",
) -> Shield | None:
    """Read a rule file into a shield.

    Args:
        rules: Of the option ``--rules``, or None.
        projection: What becomes of a continuous action that breaks a rule.
        outside: What a rule does in a state outside its data.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.

    Returns:
        The shield, or None without rules.

    Raises:
        InputError: If the file cannot be read, is no rule file, or keeps no data boxes where
            rules are to abstain outside them.
    """
    if rules is None:
        return None
    from sarl_core.mining.rule_set import RuleSet
    from sarl_core.shielding.shield import Shield

    shield = Shield(
        RuleSet.load(rules), projection=projection, outside=outside, on_invalid=on_invalid
    )
    if outside == "abstain" and not shield.keeps_boxes:
        raise InputError(
            f"{rules}: this rule file keeps no data boxes, so --outside abstain would do nothing; "
            "mine the rules again, or leave the option out"
        )
    return shield


def typed_again(context: typer.Context) -> str:
    """The command as it can be typed again.

    Args:
        context: Of a command that was called.

    Returns:
        Without defaults, and without what changes the speed or the answer's form alone.
    """
    words = [f"python -m sarl_core {context.info_name}"]
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if (
            parameter.name in ("as_json", "jobs", "cluster")
            or value is None
            or value == parameter.default
        ):
            continue
        option = [] if parameter.param_type_name == "argument" else [parameter.opts[0]]
        for one in value if isinstance(value, (list, tuple)) else [value]:
            words += [*option, shlex.quote(said(str(one)))]
    return " ".join(words)
