"""Figures 2 and 3: number and mean length of the rules over support and confidence."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS
from sarl_core.paper.claims import FIGURE_2, FIGURE_3, Rows, decided
from sarl_core.paper.landscape_table import (
    COLUMNS,
    cells_exchanged,
    landscapes_of,
    measure,
)
from sarl_core.paper.metrics.landscapes import Environments, recorded
from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    environment_name,
    environments,
    recorded_seeds,
)
from sarl_core.paper.study import Drawing, Effort, Study

if TYPE_CHECKING:
    import pandas as pd

Size = Literal["rule_count", "mean_length"]


def _parts(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(environment_name(env_id) for env_id in landscapes_of(frame))


def _draw(frame: pd.DataFrame, part: str, dark: bool, layer: Size) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.thresholds import LAYERS, heatmap, surface

    landscape = next(
        next(iter(own.values()))
        for env_id, own in landscapes_of(frame).items()
        if environment_name(env_id) == part
    )
    what = f"{LAYERS[layer].title}, {part}"
    flat, raised = heatmap(landscape, layer, dark=dark), surface(landscape, layer, dark=dark)
    flat.update_layout(height=380)
    raised.update_layout(height=380, scene_camera_eye={"x": 1.4, "y": -1.5, "z": 0.9})
    return (
        Drawing(what, flat, alt=f"{what}: a map over minimum support and minimum confidence"),
        Drawing(f"{what}, as a surface", raised, alt=f"{what}: the same as a surface"),
    )


def _settings(effort: Effort) -> dict[str, Any]:
    return {
        "supports": PAPER_SUPPORTS.tolist(),
        "confidences": PAPER_CONFIDENCES.tolist(),
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {
            "tree": 0,
            "recordings": recorded_seeds(environments(), effort.recordings),
        },
    }


def _numbers(frame: pd.DataFrame, layer: Size) -> dict[str, Any]:
    """The greatest value of a layer, where it stands, and how far recordings lead apart."""
    numbers = {}
    for env_id, own in landscapes_of(frame).items():
        one = next(iter(own.values()))
        values = np.asarray(getattr(one, layer), dtype=np.float64)
        row, column = np.unravel_index(int(values.argmax()), values.shape)
        every = np.array([getattr(each, layer) for each in own.values()])
        corner, apart = every[:, 0, -1], np.ptp(every, axis=0)
        numbers[env_id] = {
            "greatest": float(values.max()),
            "at_support": float(one.supports[row]),
            "at_confidence": float(one.confidences[column]),
            "at_support_0_confidence_1": float(values[0, -1]),
            "at_support_0_confidence_1_over_recordings": [
                float(corner.min()),
                float(corner.max()),
            ],
            "mean_range_over_recordings": float(apart.mean()),
            "widest_range_over_recordings": float(apart.max()),
        }
    return numbers


_ABOUT = (
    "over the paper's grid, minimum supports from 0 to 0.5 and minimum confidences from 0 to 1 by "
    "0.05, for every environment. The paper draws Cart Pole. Exact: every cell is what mining at "
    "its thresholds gives. Drawn for the shipped recording; the claims are decided over several "
    "recordings of several experts."
)


def _study(name: str, title: str, what: str, layer: Size, rows: Rows[Environments]) -> Study:
    return Study(
        name=name,
        place=f"Figure {name}",
        title=title,
        about=f"{what} {_ABOUT}",
        measure=measure,
        settings=_settings,
        numbers=partial(_numbers, layer=layer),
        claims=lambda frames: decided(rows, recorded(frames[name])),
        exchanged=cells_exchanged,
        parts=_parts,
        draw=partial(_draw, layer=layer),
        columns=COLUMNS,
    )


COUNT = _study("2", "Number of rules", "How many rules there are", "rule_count", FIGURE_2)
LENGTH = _study(
    "3",
    "Mean length of a rule",
    "How many conditions a rule has on average",
    "mean_length",
    FIGURE_3,
)
