"""Every figure and table of the paper that holds data, in its order, and what it leaves open."""

from __future__ import annotations

from sarl_core.errors import InputError
from sarl_core.paper.claims import FIGURE_5, FIGURE_6, FIGURE_7, decided
from sarl_core.paper.division import DIVIDING
from sarl_core.paper.landscapes import COUNT, LENGTH
from sarl_core.paper.learning import LEARNING
from sarl_core.paper.metrics.shields import first_runs, lander_runs, walker_runs
from sarl_core.paper.settings_table import SETTINGS
from sarl_core.paper.shields import study
from sarl_core.paper.study import Study

_ALL = (
    COUNT,
    LENGTH,
    SETTINGS,
    LEARNING,
    study("5", "CartPole-v1", lambda frames: decided(FIGURE_5, first_runs(frames["5"]))),
    study("6", "LunarLander-v3", lambda frames: decided(FIGURE_6, lander_runs(frames))),
    study(
        "7",
        "BipedalWalker-v3",
        lambda frames: decided(FIGURE_7, walker_runs(frames["7"])),
        dividers=(2, 3, 5),
        more=" The paper divides each action into 2 intervals; 3 and 5 are here too. A shielded "
        "action becomes the centre of its interval.",
    ),
    DIVIDING,
)
STUDIES: dict[str, Study] = {one.name: one for one in _ALL}


def find_study(name: str) -> Study:
    """The study of a name.

    Args:
        name: As "2"; "figure 2" and "Fig. 2" mean the same, "1" the drawing of the method.

    Returns:
        The study.

    Raises:
        InputError: If there is none of this name.
    """
    short = name.strip().lower().removeprefix("figure").removeprefix("fig.")
    short = "-".join(short.replace("_", " ").split())
    if short in STUDIES:
        return STUDIES[short]
    known = ", ".join(STUDIES)
    if short == "1":
        raise InputError(
            f"Figure 1 of the paper is a drawing of the method and holds no data; choose from "
            f"{known}"
        )
    raise InputError(f"the paper has no figure {name!r} to reproduce; choose from {known}")
