"""The table of Figures 2 and 3, and the landscapes in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.landscape import (
    PAPER_CONFIDENCES,
    PAPER_SUPPORTS,
    Landscape,
    threshold_landscape,
)
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    TREE_SEEDS,
    demonstrations_of,
    environments,
    trees_of,
)
from sarl_core.reproducing.study import Effort
from sarl_core.rollouts.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
COLUMNS = ("environment", "divider", "tree_seed", "support", "confidence", *_LAYERS)


def measure(_: Effort, progress: Progress | None) -> pd.DataFrame:
    """The landscapes of every shipped environment over the paper's grid, one a tree seed.

    Args:
        _: Takes a minute, whatever the effort.
        progress: Called with (landscapes done, in all); returning False stops.

    Returns:
        One row a cell: `environment`, `divider` (0 for discrete actions), `tree_seed`, `support`,
        `confidence`, `rule_count`, `mean_length`, `coverage`, `fidelity`.
    """
    import pandas as pd

    wanted = [(env_id, seed) for env_id in environments() for seed in TREE_SEEDS]
    parts = []
    report(progress, 0, len(wanted))
    for done, (env_id, seed) in enumerate(wanted, 1):
        trees = trees_of(env_id, seed=seed)
        found = threshold_landscape(trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)
        supports, confidences = np.meshgrid(found.supports, found.confidences, indexing="ij")
        discrete = demonstrations_of(env_id).is_discrete
        parts.append(
            pd.DataFrame(
                {
                    "environment": env_id,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    "tree_seed": seed,
                    "support": supports.ravel(),
                    "confidence": confidences.ravel(),
                    **{layer: getattr(found, layer).ravel() for layer in _LAYERS},
                }
            )
        )
        report(progress, done, len(wanted))
    return pd.concat(parts, ignore_index=True)


def landscape_of(frame: pd.DataFrame, env_id: str, seed: int | None = None) -> Landscape:
    """The landscape of one environment, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.
        seed: Of its trees; the first in the table where not given.

    Returns:
        Without the parts of single action dimensions.
    """
    rows = frame[frame["environment"] == env_id]
    rows = rows[rows["tree_seed"] == (tree_seeds_in(frame)[0] if seed is None else seed)]
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


def environments_in(frame: pd.DataFrame) -> tuple[str, ...]:
    """The environments of a table, in its order."""
    return tuple(frame["environment"].unique().tolist())


def tree_seeds_in(frame: pd.DataFrame) -> tuple[int, ...]:
    """The tree seeds of a table, in its order."""
    return tuple(int(seed) for seed in frame["tree_seed"].unique())
