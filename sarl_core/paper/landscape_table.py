"""The table of Figures 2 and 3, and the landscapes in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.thresholds.landscape import (
    PAPER_CONFIDENCES,
    PAPER_SUPPORTS,
    Landscape,
    threshold_landscape,
)
from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    demonstrations_of,
    environments,
    replicates_of,
    trees_of,
)
from sarl_core.paper.study import Effort
from sarl_core.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
COLUMNS = ("environment", "expert", "recording", "divider", "support", "confidence", *_LAYERS)


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """The landscapes of every shipped environment over the paper's grid, one a recording.

    Args:
        effort: How many recordings.
        progress: Called with (landscapes done, in all); returning False stops.

    Returns:
        One row a cell: `environment`, `expert`, `recording`, `divider` (0 for discrete actions),
        `support`, `confidence`, `rule_count`, `mean_length`, `coverage`, `fidelity`.
    """
    import pandas as pd

    wanted = [one for env_id in environments() for one in replicates_of(env_id, effort.recordings)]
    parts = []
    report(progress, 0, len(wanted))
    for done, replicate in enumerate(wanted, 1):
        landscape = threshold_landscape(trees_of(replicate), PAPER_SUPPORTS, PAPER_CONFIDENCES)
        supports, confidences = np.meshgrid(
            landscape.supports, landscape.confidences, indexing="ij"
        )
        discrete = demonstrations_of(replicate).is_discrete
        parts.append(
            pd.DataFrame(
                {
                    "environment": replicate.env_id,
                    "expert": replicate.name,
                    "recording": replicate.recording,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    "support": supports.ravel(),
                    "confidence": confidences.ravel(),
                    **{layer: getattr(landscape, layer).ravel() for layer in _LAYERS},
                }
            )
        )
        report(progress, done, len(wanted))
    return pd.concat(parts, ignore_index=True)


def landscapes_of(frame: pd.DataFrame) -> dict[str, dict[int, Landscape]]:
    """The landscapes in a table.

    Args:
        frame: What `measure` gives.

    Returns:
        By environment and recording, in the table's order; without the parts of single action
        dimensions.
    """
    landscapes: dict[str, dict[int, Landscape]] = {}
    for _, rows in frame.groupby(["environment", "recording"], sort=False):
        env_id, recording = str(rows["environment"].iloc[0]), int(rows["recording"].iloc[0])
        landscapes.setdefault(env_id, {})[recording] = _landscape(rows)
    return landscapes


def _landscape(rows: pd.DataFrame) -> Landscape:
    supports, confidences = np.unique(rows["support"]), np.unique(rows["confidence"])

    def layer(name: str) -> NDArray[Any]:
        return rows[name].to_numpy().reshape(len(supports), len(confidences))

    return Landscape(
        supports=supports,
        confidences=confidences,
        rule_count=layer("rule_count").astype(np.int64),
        mean_length=layer("mean_length").astype(np.float64),
        coverage=layer("coverage").astype(np.float64),
        fidelity=layer("fidelity").astype(np.float64),
    )


def cells_exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same numbers at other thresholds, dealt out alike in all landscapes."""
    cells = len(frame.drop_duplicates(["support", "confidence"]))
    order = rng.permutation(cells)
    layers = list(_LAYERS)
    values = frame[layers].to_numpy().reshape(-1, cells, len(layers))[:, order]
    dealt = frame.copy()
    dealt[layers] = values.reshape(-1, len(layers))
    return dealt
