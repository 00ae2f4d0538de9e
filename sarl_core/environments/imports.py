"""Objects that a caller names as ``module:name``, of the caller's own code.

Only a command line, Python, or the list of whoever runs a server names them: never a file or a
link.
"""

from __future__ import annotations

import importlib
from typing import Any

from sarl_core.errors import InputError


def named_object(text: str, what: str) -> Any:
    """Import what ``module:name`` names.

    Args:
        text: As the caller wrote it; the name may have dots, as of a class in a class.
        what: What it is to be, as "the wrapper".

    Returns:
        The object.

    Raises:
        InputError: If it is not of that form, the module fails, or has no such name.
    """
    module, _, name = text.partition(":")
    if not (name and all(part.isidentifier() for part in [*module.split("."), *name.split(".")])):
        raise InputError(f"{what} {text!r} must be module:name, as my_crane:Crane; write it so")
    try:
        member: Any = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # the caller's code, which may raise anything
        raise InputError(
            f"{what} {text!r} cannot be imported ({reason(error)}); check the name, and that the "
            "module lies in the folder you call from or is installed"
        ) from error
    for part in name.split("."):
        try:
            member = getattr(member, part)
        except AttributeError as error:
            raise InputError(
                f"{what} {text!r} cannot be imported: {module} has no {name}; check the name"
            ) from error
    return member


def reason(error: BaseException) -> str:
    """What went wrong in somebody's code, in one line.

    Args:
        error: Whatever it raised.

    Returns:
        As "ValueError: it is too short".
    """
    text = " ".join(str(error).split()).rstrip(".")
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
