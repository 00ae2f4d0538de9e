"""Commands that make demonstrations and look at them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import (
    is_mined_file,
    path_of,
    read_agent,
    read_demonstrations,
    with_wanted,
)
from sarl_core.cli.options import (
    AgentName,
    Columns,
    Derived,
    Env,
    EnvOfFile,
    Files,
    Json,
    MissingName,
    Normalise,
    Seed,
    Stochastic,
    out_option,
    with_columns,
    with_derived,
    with_environment,
    with_played_environment,
)
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.demonstrations.dataset import Demonstrations


@with_played_environment
def record(
    env: Env,
    agent: AgentName,
    out: Annotated[Path, out_option("A .parquet, .csv or .npz file.")],
    normalise: Normalise = None,
    steps: Annotated[int, typer.Option("--steps", min=1, help="How many to record.")] = 15_000,
    seed: Seed = 0,
    stochastic: Stochastic = False,
    as_json: Json = False,
) -> None:
    """Run an agent and save what it saw and did as demonstrations.

    Example: `python -m sarl_core record --env CartPole-v1 --agent expert --stochastic --steps 5000
    --out cartpole.parquet`
    """
    terminal.check_output(out, (".parquet", ".csv", ".npz"))
    with terminal.working("Recording") as advance:
        from sarl_core.demonstrations.formats import save_demonstrations
        from sarl_core.improving.aggregation_files import stopped_path
        from sarl_core.rollouts.recording import RecordingFaultError
        from sarl_core.rollouts.recording import record as record_demonstrations

        try:
            demonstrations = record_demonstrations(
                env,
                read_agent(agent, env, normalise, stochastic=stochastic, seed=seed),
                steps=steps,
                seed=seed,
                progress=advance,
            )
        except RecordingFaultError as error:
            written = stopped_path(out)
            save_demonstrations(error.recorded, written)
            raise InputError(
                f"{error}; the {len(error.recorded):,} steps before it are in {written}"
            ) from error
        save_demonstrations(demonstrations, out)
    _tell_demonstrations(demonstrations, out, as_json)


@with_environment
@with_columns
@with_derived
def check(
    files: Files,
    columns: Columns,
    derived: Derived,
    missing: MissingName = "refuse",
    env: EnvOfFile = None,
    suggest: Annotated[
        Path | None,
        typer.Option(
            "--suggest-columns",
            metavar="COLUMNS.json",
            show_default=False,
            help="Only write what each column seems to be, for you to edit and give to --columns.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Read and check demonstrations, and print what is in them.

    A file and what is read from it may take 1 GiB of memory, here and in every other command; the
    environment variable `SARL_READ_LIMIT_GIB` sets another limit.

    Example: `python -m sarl_core check data/demonstrations/lunar_lander.parquet`
    """
    if suggest is not None:
        _suggest_columns(files, columns, suggest, as_json)
        return
    if any(map(is_mined_file, files)):
        _tell_mined(files, as_json)
        return
    demonstrations = with_wanted(read_demonstrations(files, env, columns, missing), derived)
    _tell_demonstrations(demonstrations, path_of(files), as_json)


def _suggest_columns(files: list[Path], columns: Columns, out: Path, as_json: bool) -> None:
    terminal.check_output(out, (".json",))
    from sarl_core.cli.answers.summaries import print_suggestion
    from sarl_core.demonstrations.formats import preview_columns
    from sarl_core.demonstrations.formats.mapping.roles import save_roles

    previews = preview_columns(files, columns=columns)
    save_roles(
        out, {one.name: one.role for one in previews}, {one.name: one.why for one in previews}
    )
    if as_json:
        terminal.print_json({"out": str(out), "columns": [one.document for one in previews]})
    else:
        print_suggestion(previews, out)


def _tell_mined(files: list[Path], as_json: bool) -> None:
    from sarl_core.cli.answers.mined import describe_mined, print_mined
    from sarl_core.mining.distributed.mined_files import load_mined_data

    document = describe_mined(load_mined_data(files[0]), files[0])
    if as_json:
        terminal.print_json(document)
    else:
        print_mined(document)


def _tell_demonstrations(demonstrations: Demonstrations, path: Path | str, as_json: bool) -> None:
    from sarl_core.cli.answers.summaries import describe_demonstrations, print_demonstrations

    document = describe_demonstrations(demonstrations, path)
    if as_json:
        terminal.print_json(document)
    else:
        print_demonstrations(document)
