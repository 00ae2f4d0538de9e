"""Figures 2 and 3: number and mean length of the rules over support and confidence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from sarl_core.mining.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS
from sarl_core.reproducing.landscape_claims import count_claims, length_claims
from sarl_core.reproducing.landscape_table import (
    COLUMNS,
    environments_in,
    landscape_of,
    measure,
    tree_seeds_in,
)
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    TREE_SEEDS,
    environment_name,
    environments,
)
from sarl_core.reproducing.study import Drawing, Effort, Study

if TYPE_CHECKING:
    import pandas as pd

Size = Literal["rule_count", "mean_length"]


def _parts(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(environment_name(env_id) for env_id in environments_in(frame))


def _draw(frame: pd.DataFrame, part: str, dark: bool, layer: Size) -> tuple[Drawing, ...]:
    from sarl_core.explaining.threshold_figures import LAYERS, heatmap, surface

    env_id = next(one for one in environments_in(frame) if environment_name(one) == part)
    found = landscape_of(frame, env_id)
    what = f"{LAYERS[layer].title}, {part}"
    flat, raised = heatmap(found, layer, dark=dark), surface(found, layer, dark=dark)
    flat.update_layout(height=380)
    raised.update_layout(height=380, scene_camera_eye={"x": 1.4, "y": -1.5, "z": 0.9})
    return (
        Drawing(what, flat, alt=f"{what}: a map over minimum support and minimum confidence"),
        Drawing(f"{what}, as a surface", raised, alt=f"{what}: the same as a surface"),
    )


def _settings(_: Effort) -> dict[str, Any]:
    return {
        "supports": PAPER_SUPPORTS.tolist(),
        "confidences": PAPER_CONFIDENCES.tolist(),
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {"tree": list(TREE_SEEDS)},
    }


def _numbers(frame: pd.DataFrame, layer: Size) -> dict[str, Any]:
    """The greatest value of a layer, where it stands, and how far tree seeds lead apart."""
    found = {}
    for env_id in environments_in(frame):
        one = landscape_of(frame, env_id)
        values = np.asarray(getattr(one, layer), dtype=np.float64)
        row, column = np.unravel_index(int(values.argmax()), values.shape)
        every = np.array(
            [getattr(landscape_of(frame, env_id, seed), layer) for seed in tree_seeds_in(frame)]
        )
        corner, apart = every[:, 0, -1], np.ptp(every, axis=0)
        found[env_id] = {
            "greatest": float(values.max()),
            "at_support": float(one.supports[row]),
            "at_confidence": float(one.confidences[column]),
            "at_support_0_confidence_1": float(values[0, -1]),
            "at_support_0_confidence_1_over_tree_seeds": [
                float(corner.min()),
                float(corner.max()),
            ],
            "mean_range_over_tree_seeds": float(apart.mean()),
            "widest_range_over_tree_seeds": float(apart.max()),
        }
    return found


_ABOUT = (
    "over the paper's grid, minimum supports from 0 to 0.5 and minimum confidences from 0 to 1 by "
    "0.05, for the shipped demonstrations of every environment. The paper draws Cart Pole. Exact: "
    "every cell is what mining at its thresholds gives. Drawn for tree seed 0; the claims are "
    "decided for five, by which trees choose among equally good queries."
)

COUNT = Study(
    name="2",
    place="Figure 2",
    title="Number of rules",
    about=f"How many rules there are {_ABOUT}",
    measure=measure,
    settings=_settings,
    numbers=lambda frame: _numbers(frame, "rule_count"),
    claims=count_claims,
    parts=_parts,
    draw=lambda frame, part, dark: _draw(frame, part, dark, "rule_count"),
    columns=COLUMNS,
)
LENGTH = Study(
    name="3",
    place="Figure 3",
    title="Mean length of a rule",
    about=f"How many conditions a rule has on average {_ABOUT}",
    measure=measure,
    settings=_settings,
    numbers=lambda frame: _numbers(frame, "mean_length"),
    claims=length_claims,
    parts=_parts,
    draw=lambda frame, part, dark: _draw(frame, part, dark, "mean_length"),
    columns=COLUMNS,
)
