"""The command that starts the dashboard."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import workers_at
from sarl_core.cli.options import ClusterAddress, Cost, EnvArguments, Failure, Wrappers
from sarl_core.clusters import VARIABLE
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError, WorkError

if TYPE_CHECKING:
    from sarl_core.agents.offers import Offers
    from sarl_core.serving.settings import ServerSettings


def app(
    port: Annotated[
        int, typer.Option("--port", min=1, max=65535, help="Where it listens, on this machine.")
    ] = 8501,
    env: Annotated[
        list[str] | None,
        typer.Option(
            "--env",
            metavar="ENV",
            show_default=False,
            help="Let visitors use this environment, module:Id included. May be given several "
            "times; nothing else of your own is ever imported.",
        ),
    ] = None,
    env_args: EnvArguments = None,
    wrapper: Wrappers = None,
    failure: Failure = None,
    cost: Cost = None,
    agent: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            metavar="NAME=MODULE:NAME",
            show_default=False,
            help="Let visitors use this agent of your own under this name. May be given several "
            "times.",
        ),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            "--settings",
            metavar="FILE",
            envvar="SARL_SETTINGS",
            show_default=False,
            help="A .toml or .json file that says the same: environments, each with its id, "
            "arguments, wrappers, failure and cost, and agents; and limits, how much visitors "
            "may ask for.",
        ),
    ] = None,
    cluster: ClusterAddress = None,
) -> None:
    """Start the dashboard; Ctrl-C ends it.

    Example: `python -m sarl_core app --port 8600`
    """
    from sarl_core.serving.limits import VARIABLE as LIMITS

    script = _script()
    with terminal.working("Starting"):
        said = _settings(settings)
        offers = _offers(
            env or [], env_args, wrapper or [], failure, cost, agent or [], said.offers
        )
        if said.for_many:
            offers[LIMITS] = said.limits.to_text()
        if cluster is not None and cluster.startswith("local:"):
            raise InputError(
                "a dashboard works in processes of this machine anyway; give the address of a "
                "scheduler, or leave --cluster out"
            )
        if cluster is not None:
            with workers_at(
                cluster
            ):  # one that cannot be reached is said here, and not to visitors
                offers[VARIABLE] = cluster
    terminal.print_lines([f"The dashboard is at http://localhost:{port} (Ctrl-C ends it)."])
    sys.stdout.flush()
    command = [
        *(sys.executable, "-m", "streamlit", "run", str(script), "--server.port", str(port)),
        *("--server.maxUploadSize", str(said.limits.upload_mb)),
    ]
    with subprocess.Popen(command, env=os.environ | offers) as server:
        try:
            code = server.wait()
        except KeyboardInterrupt:
            server.terminate()
            return
    if code:
        raise WorkError(f"the dashboard ended with code {code}; what it printed says why")


def _settings(path: Path | None) -> ServerSettings:
    """What the settings file says, where there is one."""
    from sarl_core.serving.settings import ServerSettings, read_settings

    return ServerSettings() if path is None else read_settings(path)


def _offers(
    envs: list[str],
    env_args: str | None,
    wrappers: list[str],
    failure: str | None,
    cost: str | None,
    agents: list[str],
    listed: Offers,
) -> dict[str, str]:
    """What visitors may use, tried, and handed to the server by a variable of its environment."""
    from sarl_core.agents.offers import VARIABLE, Offers, named_agents
    from sarl_core.environments.description import describe_environment
    from sarl_core.environments.imports import named_object
    from sarl_core.environments.signals import check_signals

    beside = (env_args, wrappers or None, failure, cost)
    if len(envs) != 1 and any(value is not None for value in beside):
        raise InputError(
            "--env-args, --wrapper, --failure and --cost belong to one --env; for several, write "
            "them in a file and give it with --settings"
        )
    offers = Offers(
        (
            *listed.environments,
            *(
                Environment(one, env_args or "{}", tuple(wrappers), failure or "", cost or "")
                for one in envs
            ),
        ),
        (*listed.agents, *named_agents(agents).items()),
    )
    for environment in offers.environments:
        describe_environment(environment)
        check_signals(environment)
    for name, spec in offers.agents:
        named_object(spec, f"the agent {name}")
    return {VARIABLE: offers.to_text()}


def _script() -> Path:
    """The script that Streamlit runs: within the installed package, or in the checkout."""
    for needed in ("streamlit", "sarl_dashboard"):
        if importlib.util.find_spec(needed) is None:
            raise ModuleNotFoundError(f"No module named {needed!r}", name=needed)
    spec = importlib.util.find_spec("sarl_dashboard")
    assert spec is not None
    assert spec.origin is not None
    package = Path(spec.origin).parent
    installed = package / "app.py"
    return installed if installed.is_file() else package.parent / "app.py"
