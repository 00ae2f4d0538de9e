"""Which environments a visitor may name.

Gymnasium imports the module of "module:Id". On the command line that is the person's own machine;
here it is the server, and the id may come with a link or in a stranger's file.
"""

from __future__ import annotations

from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_dashboard.state.data import SHIPPED_SETS, chosen_demonstrations


def registered(env_id: str) -> str:
    """An environment's id, if Gymnasium knows it without importing anything.

    Args:
        env_id: From a visitor: typed, in a link, or in a file.

    Returns:
        The same id, without blanks around it.

    Raises:
        InputError: If it names a module, or no environment.
    """
    import gymnasium

    env_id = env_id.strip()
    if ":" in env_id:
        raise InputError(
            f"the environment {env_id!r} names a module to import, which the dashboard does not "
            "do; give an id that Gymnasium knows by itself, such as CartPole-v1, or use the "
            "command line"
        )
    if env_id not in gymnasium.registry:
        raise InputError(
            f"Gymnasium knows no environment {env_id!r}; give an id with its version, such as "
            "CartPole-v1"
        )
    return env_id


AS_DEMONSTRATED = "as demonstrated"
ENVIRONMENTS = (AS_DEMONSTRATED, *(env_id for _, env_id in SHIPPED_SETS.values()))


def environment_of(choice: str | None) -> str:
    """The environment's id.

    Raises:
        InputError: If the demonstrations do not say theirs, or the dashboard does not take it.
    """
    if choice and choice != AS_DEMONSTRATED:
        return registered(choice)
    demonstrations = chosen_demonstrations()
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


def demonstrated(env_id: str, seed: int, episodes: int) -> bool:
    """Whether the chosen demonstrations were recorded on some of these seeds."""
    demonstrations = chosen_demonstrations()
    return (
        demonstrations is not None
        and demonstrations.seed is not None
        and demonstrations.env_id == env_id
        and demonstrations.seed < seed + episodes
        and seed < demonstrations.seed + demonstrations.n_episodes
    )
