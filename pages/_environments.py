"""Which environments a visitor may name.

Gymnasium imports the module of "module:Id". On the command line that is the person's own machine;
here it is the server, and the id may come with a link or in a stranger's file.
"""

from __future__ import annotations

from sarl_core.errors import InputError


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
