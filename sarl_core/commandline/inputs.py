"""What the arguments of several commands name, read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.shielding.shield import Shield


def read_demonstrations(file: Path, env_id: str | None) -> Demonstrations:
    """Read a file of demonstrations.

    Args:
        file: As the argument names it.
        env_id: Of the option ``--env``, or None.

    Returns:
        What is in it.

    Raises:
        InputError: If it cannot be read, or is wrong.
    """
    from sarl_core.demonstrations.formats import load_demonstrations

    return load_demonstrations(file, env_id=env_id)


def read_shield(
    rules: Path | None, projection: Literal["centre", "clip", "expert"]
) -> Shield | None:
    """Read a rule file into a shield.

    Args:
        rules: Of the option ``--rules``, or None.
        projection: What becomes of a continuous action that breaks a rule.

    Returns:
        The shield, or None without rules.

    Raises:
        InputError: If the file cannot be read or is no rule file.
    """
    if rules is None:
        return None
    from sarl_core.mining.rules import RuleSet
    from sarl_core.shielding.shield import Shield

    return Shield(RuleSet.load(rules), projection=projection)
