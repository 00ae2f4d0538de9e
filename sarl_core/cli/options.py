"""The options and arguments that several commands share."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial, wraps
from os.path import exists
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_args

import typer

from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.demonstrations.formats.mapping.roles import ColumnRole

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...",
        help="Demonstrations: a file, a folder or its ZIP, or several files that are one set; also "
        'as a pattern ("runs/*.csv").',
        show_default=False,
    ),
]
# Commands that read demonstrations have a parameter `columns` and are `with_columns`.
Columns = Mapping[str, Any]  # of roles
# Commands with an option `--env` are `with_environment`.
EnvOfFile = Annotated[
    Environment | None,
    typer.Option(
        "--env",
        metavar="ENV",
        show_default=False,
        help="Take spaces, names and bounds from this environment where the file has none.",
    ),
]
Env = Annotated[
    Environment,
    typer.Option(
        "--env",
        metavar="ENV",
        show_default=False,
        help="What gymnasium.make takes, module:Id included.",
    ),
]
AgentName = Annotated[
    str,
    typer.Option(
        "--agent",
        metavar="AGENT",
        show_default=False,
        help="novice (uniform random actions), untrained (fresh PPO weights, sampled), expert (the "
        "shipped one), a path to an .npz policy or to a Stable-Baselines3 .zip, or module:name: a "
        "function of yours from observations (B, d) to actions, an object with predict, or what "
        "makes one without arguments.",
    ),
]
Normalise = Annotated[
    str | None,
    typer.Option(
        "--normalise",
        metavar="FILE",
        show_default="what lies beside the .zip under a name that leaves no doubt",
        help="Of a .zip that was trained under VecNormalize: the .pkl with its statistics; none "
        "if its observations were not normalised.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Same seed, same result.")]
Stochastic = Annotated[
    bool,
    typer.Option(
        "--stochastic",
        help="Sample a trained agent's actions instead of taking the likeliest.",
    ),
]
Rules = Annotated[
    Path | None,
    typer.Option(
        "--rules",
        metavar="RULES.json",
        show_default=False,
        help="Shield the agent with these rules.",
    ),
]
ProjectionName = Annotated[
    Literal["centre", "clip", "expert"],
    typer.Option(
        "--projection",
        help="What a continuous action that breaks a rule becomes: the centre of the "
        "rule's interval, the nearest value in it, or the expert's median.",
    ),
]
MaxSteps = Annotated[
    int | None,
    typer.Option(
        "--max-steps",
        min=1,
        show_default="100,000, and 5,000 of a moving picture",
        help="Cut an episode off after so many steps if it has not ended by then; the answer says "
        "so.",
    ),
]
OutsideName = Annotated[
    Literal["act", "abstain"],
    typer.Option(
        "--outside",
        help="What a rule does in a state outside the data it was mined from: change the action "
        "all the same, or leave it to the agent.",
    ),
]
OnInvalidName = Annotated[
    Literal["raise", "pass"],
    typer.Option(
        "--on-invalid",
        help="What to do where an observation is no state (a number is missing or infinite) or an "
        "action none that there is: stop with an error, or let the action pass unchecked.",
    ),
]
ChoiceName = Annotated[
    Literal["return", "failures"],
    typer.Option(
        "--choose",
        help="What comes first where the best is chosen: the highest mean return, or the fewest "
        "failures and among equals the highest mean return. It is reported on other episodes.",
    ),
]
ReportEpisodes = Annotated[
    int,
    typer.Option(
        "--report-episodes",
        help="Fresh episodes, which nothing was chosen by, to report the best on.",
    ),
]
Divider = Annotated[
    int,
    typer.Option(
        "--divider",
        min=2,
        help="Intervals of each continuous action dimension.",
    ),
]
LearnerName = Annotated[
    Literal["exact", "histogram", "auto"],
    typer.Option(
        "--learner",
        help="What grows the trees: exact tries every border between two values; histogram those "
        "between 1,024 bins of a feature, which suits many steps; auto "
        "is exact up to 50,000 steps, then histogram.",
    ),
]
EnvArguments = Annotated[
    str | None,
    typer.Option(
        "--env-args",
        metavar="JSON",
        show_default=False,
        help="What the environment is made with, as a JSON object: '{\"g\": 3.7}'.",
    ),
]
Wrappers = Annotated[
    list[str] | None,
    typer.Option(
        "--wrapper",
        metavar="MODULE:NAME",
        show_default=False,
        help="Put this around the environment: a gymnasium.Wrapper class, or a function that takes "
        "an environment and gives one, imported from where you are. May be given several times, "
        "the innermost first.",
    ),
]
Failure = Annotated[
    str | None,
    typer.Option(
        "--failure",
        metavar="WHAT",
        show_default="what is known of the environment",
        help="What a failure is: a key of info (crashed), a condition on the observation (gap < 1 "
        "or abs(angle) > 0.2), or module:name, a function of (observation, action, reward, "
        "terminated, info). An episode has failed if this is true at one of its steps.",
    ),
]
Cost = Annotated[
    str | None,
    typer.Option(
        "--cost",
        metavar="WHAT",
        show_default="the key cost of info, where there is one",
        help="What a step costs: a key of info, a condition (1 where it is true) or a formula on "
        "the observation, or module:name, as --failure takes it.",
    ),
]
_ColumnsFile = Annotated[
    Path | None,
    typer.Option(
        "--columns",
        metavar="COLUMNS.json",
        show_default=False,
        help="Which column of the file is what, as `check FILE --suggest-columns COLUMNS.json` "
        "writes it for you to edit.",
    ),
]
_ColumnRoles = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        metavar="NAME=ROLE",
        show_default=False,
        help="What one column of the file is; the others are guessed. ROLE is feature, "
        "action, episode, step, reward, terminated, truncated, first, last, time or ignore; with a "
        "unit: speed=feature:m/s, t=time:ms; an amount in whole numbers: "
        "throttle=action:continuous:0:100 (bounds may be left out); numbers that are "
        "choices: gear=action:labels; under another name: 'v=feature:m/s as own speed'. May be "
        "given several times.",
    ),
]
MissingName = Annotated[
    Literal["refuse", "drop"],
    typer.Option(
        "--missing",
        help="What becomes of steps that lack a value (an empty cell, NaN, null, NA) or hold an "
        "infinite one: refuse the file and say where, or drop those steps and say how many they "
        "are; the others keep their numbers.",
    ),
]
_Combine = Annotated[
    list[str] | None,
    typer.Option(
        "--combine",
        metavar="[A,B]",
        show_default=False,
        help="Let rules ask about combinations of two features as well, as 'position plus 0.5 s of "
        "velocity': alone of every two features that are amounts; or of those that are named, with "
        'a comma between them ("vertical position, vertical velocity"). May be given several '
        "times.",
    ),
]
_Formulas = Annotated[
    list[str] | None,
    typer.Option(
        "--feature",
        metavar="NAME [UNIT] = FORMULA",
        show_default=False,
        help='Let rules ask about a formula of yours as well: "time to collision [s] = gap / '
        '(own_speed - lead_speed)". It may have numbers, names of features, + - * /, min, max, abs '
        "and parentheses. It takes the place of a formula of the file that has its name. May be "
        "given several times.",
    ),
]
MINED = ".mined"
"""How files end that hold what is left of steps mined on a cluster."""
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        show_default=False,
        help="Work on a cluster of Dask: the address of its scheduler, as tcp://scheduler:8786; or "
        "local:2 for two processes of this machine, local:2:4GB with so much memory each. It needs "
        "the extra cluster.",
    ),
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        min=1,
        show_default=False,
        help="Processes; as many as there are processors where not given. The result is the same.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document, nothing else.")]


def out_option(text: str, *, metavar: str = "FILE") -> Any:
    """The option that says where a command writes.

    Args:
        text: What it writes, for its help.
        metavar: What stands for the place.

    Returns:
        For `Annotated`.
    """
    return typer.Option("--out", metavar=metavar, show_default=False, help=text)


def with_environment(command: Callable[..., None], *, played: bool = False) -> Callable[..., None]:
    """Let a command take what belongs to ``--env``, and hand it one environment.

    Args:
        command: With a parameter `env` that is `Env`, `EnvOfFile`, or annotated like them.
        played: Whether it plays episodes, which may fail.

    Returns:
        The command as Typer reads it: with a text for `env`, and further options beside it.
    """
    parameters: list[inspect.Parameter] = []
    keyword = inspect.Parameter.KEYWORD_ONLY
    for one in inspect.signature(command, eval_str=True).parameters.values():
        if one.name != "env":
            parameters.append(one.replace(kind=keyword))
            continue
        environment, option = get_args(one.annotation)
        text: Any = str if environment is Environment else str | None
        parameters.append(one.replace(kind=keyword, annotation=Annotated[text, option]))
        beside: dict[str, Any] = {"env_args": EnvArguments, "wrapper": Wrappers}
        beside |= {"failure": Failure, "cost": Cost} if played else {}
        for name, annotation in beside.items():
            parameters.append(inspect.Parameter(name, keyword, default=None, annotation=annotation))

    @wraps(command)
    def run(
        *,
        env: str | None,
        env_args: str | None,
        wrapper: list[str] | None,
        failure: str | None = None,
        cost: str | None = None,
        **others: Any,
    ) -> None:
        beside = {
            "--env-args": env_args,
            "--wrapper": wrapper or None,
            "--failure": failure,
            "--cost": cost,
        }
        for option, value in beside.items():
            if env is None and value is not None:
                raise InputError(f"{option} belongs to an environment; name it with --env")
            if isinstance(value, str) and not value.strip():
                raise InputError(f"{option} is empty; say what it is, or leave it out")
        environment = None
        if env is not None:
            environment = Environment(
                env, env_args or "{}", tuple(wrapper or ()), failure or "", cost or ""
            )
        command(env=environment, **others)

    vars(run)["__signature__"] = inspect.Signature(parameters)
    return run


with_played_environment = partial(with_environment, played=True)
"""The same of a command that plays episodes: what a failure is in them, and what a step costs."""


class Derived(NamedTuple):
    """What a person wants to be derived from the features of demonstrations.

    Attributes:
        pairs: Lists of features that are combined with each other; `EVERY_PAIR` for all.
        formulas: As "time to collision [s] = gap / closing_speed".
    """

    pairs: tuple[str, ...]
    formulas: tuple[str, ...]


EVERY_PAIR = "*"


def with_bare_combine(arguments: Sequence[str]) -> list[str]:
    """A command line in which ``--combine`` alone, as Typer cannot read it, has a value.

    Args:
        arguments: As they were typed.

    Returns:
        The same; names that are combined stand behind it with a comma between them.
    """
    typed = list(arguments)
    for place, argument in enumerate(typed):
        if argument == "--combine" and not _are_names(typed[place + 1 : place + 2]):
            typed[place] = f"--combine={EVERY_PAIR}"
    return typed


def _are_names(behind: Sequence[str]) -> bool:
    """Whether what stands behind ``--combine`` names features, and is no option and no file."""
    if not behind or behind[0].startswith("-"):
        return False
    (text,) = behind
    # What is longer than a file's name can be is an error for `Path.exists`.
    return "," in text or not (set(text) & set("./*\\:") or exists(text))  # noqa: PTH110


def with_derived(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command that mines take what is derived from features.

    Args:
        command: With a parameter `derived`, a `Derived`.

    Returns:
        The command as Typer reads it: with ``--combine`` and ``--feature`` in its place.
    """

    def derived(combine: list[str] | None, feature: list[str] | None) -> Derived:
        return Derived(tuple(combine or ()), tuple(feature or ()))

    return _with_options(command, derived, combine=_Combine, feature=_Formulas)


def with_columns(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command that reads demonstrations take what a person says of their columns.

    Args:
        command: With a parameter `columns`, the roles that were said.

    Returns:
        The command as Typer reads it: with ``--columns`` and ``--column`` in its place.
    """

    def columns(columns_file: Path | None, column: list[str] | None) -> dict[str, ColumnRole]:
        from sarl_core.demonstrations.formats.mapping.roles import load_roles, roles_from_options

        roles = {} if columns_file is None else load_roles(columns_file)
        return roles | roles_from_options(column or ())

    return _with_options(command, columns, columns_file=_ColumnsFile, column=_ColumnRoles)


def _with_options(
    command: Callable[..., None], value: Callable[..., Any], **options: Any
) -> Callable[..., None]:
    """A command with options in the place of the parameter that has the name of `value`.

    Args:
        command: With that parameter.
        value: Called with what the options hold; gives what the parameter is to hold.
        options: How Typer reads each of them; None where it is not given.

    Returns:
        The command as Typer reads it.
    """
    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        one.replace(kind=keyword)
        for one in inspect.signature(command, eval_str=True).parameters.values()
        if one.name != value.__name__
    ]
    for name, annotation in options.items():
        parameters.append(inspect.Parameter(name, keyword, default=None, annotation=annotation))

    @wraps(command)
    def run(**arguments: Any) -> None:
        holds = value(**{name: arguments.pop(name) for name in options})
        command(**{value.__name__: holds}, **arguments)

    vars(run)["__signature__"] = inspect.Signature(parameters)
    return run
