"""Which environments a visitor may name.

Gymnasium imports the module of "module:Id". On the command line that is the person's own machine;
here it is the server, and the id may come with a link or in a stranger's file.
"""

from __future__ import annotations

from functools import cache

from sarl_core.agents.offers import Offers
from sarl_core.environments.description import OWN_MODULES, describe_environment
from sarl_core.environments.environment import Environment, EnvironmentOrId
from sarl_core.errors import InputError, SarlError
from sarl_dashboard.state.data import SHIPPED_SETS, uncombined_demonstrations


@cache
def offers() -> Offers:
    """What whoever runs this server offers; the only names of modules that are ever imported."""
    return Offers.of_process()


def registered(env_id: str) -> Environment:
    """An environment that is offered here, or that Gymnasium knows without importing anything.

    Args:
        env_id: From a visitor: typed, in a link, or in a file.

    Returns:
        With the arguments and wrappers that it is offered with.

    Raises:
        InputError: If it names a module that is not offered, or no environment.
    """
    import gymnasium

    env_id = env_id.strip()
    if (offered := offers().environment(env_id)) is not None:
        return offered
    if ":" in env_id:
        raise InputError(
            f"the environment {env_id!r} names a module to import, which the dashboard does only "
            "for those it was started with; give an id that Gymnasium knows by itself, such as "
            f"CartPole-v1, or start it with `sarl app --env {env_id}`"
        )
    if env_id not in gymnasium.registry and env_id not in OWN_MODULES:
        raise InputError(
            f"Gymnasium knows no environment {env_id!r}; give an id with its version, such as "
            "CartPole-v1"
        )
    return Environment(env_id)


AS_DEMONSTRATED = "as demonstrated"


def usual_environments() -> tuple[str, ...]:
    """Ids of those that are offered, and of those with demonstrations."""
    own = (environment.id for environment in offers().environments)
    return tuple(dict.fromkeys((*own, *(env_id for _, env_id in SHIPPED_SETS.values()))))


def environment_of(choice: str | None) -> Environment:
    """The environment that was chosen.

    Raises:
        InputError: If the demonstrations do not say theirs, or the dashboard does not take it.
    """
    if choice and choice != AS_DEMONSTRATED:
        return registered(choice)
    demonstrations = uncombined_demonstrations()
    if demonstrations is None or not demonstrations.env_id:
        raise InputError(
            "the demonstrations do not say which environment they are from; choose "
            "one, or type its id"
        )
    return registered(demonstrations.env_id)


def continuous(choice: str | None) -> bool:
    """Whether the environment takes continuous actions; False where it cannot be used."""
    try:
        return not describe_environment(environment_of(choice)).is_discrete
    except SarlError:
        return False


def demonstrated(env_id: EnvironmentOrId, seed: int, episodes: int) -> bool:
    """Whether the chosen demonstrations were recorded on some of these seeds."""
    demonstrations = uncombined_demonstrations()
    return (
        demonstrations is not None
        and demonstrations.seed is not None
        and demonstrations.env_id == str(env_id)
        and demonstrations.seed < seed + episodes
        and seed < demonstrations.seed + demonstrations.whole.episodes
    )
