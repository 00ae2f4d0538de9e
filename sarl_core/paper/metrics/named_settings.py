"""The two named rule sets (Table 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from sarl_core.mining.language import share_text
from sarl_core.paper.criteria import Measurement, Sample
from sarl_core.paper.replicates import environment_name
from sarl_core.paper.verdicts import Floats
from sarl_core.paper.words import number_range

if TYPE_CHECKING:
    import pandas as pd

Environments = Mapping[str, "pd.DataFrame"]
"""By environment, a row a recording, and for each column of the table one of either setting."""


def named_sets(frame: pd.DataFrame) -> Environments:
    """The rule sets in the table."""
    return {
        str(env_id): rows.pivot(index="recording", columns="setting")
        for env_id, rows in frame.groupby("environment", sort=False)
    }


def _samples(environments: Environments, shares: Mapping[str, Floats]) -> tuple[Sample, ...]:
    return tuple(
        Sample(share, tuple(environments[env_id]["expert", "unfiltered"].tolist()))
        for env_id, share in shares.items()
    )


def compact(environments: Environments) -> Measurement:
    """The share of the unfiltered rules that filtering leaves."""
    shares, sizes = {}, []
    for env_id, rows in environments.items():
        some, many = (rows["rule_count", name] for name in ("filtered", "unfiltered"))
        lengths = [
            number_range(rows["mean_length", name], 1) for name in ("filtered", "unfiltered")
        ]
        shares[env_id] = (some / many).to_numpy(dtype=np.float64)
        sizes.append(
            f"{environment_name(env_id)} {number_range(some)} of {number_range(many)} "
            f"({' and '.join(lengths)})"
        )
    return Measurement(
        _samples(environments, shares),
        "Filtered rules of the unfiltered ones, and the mean lengths of both, from the least to "
        f"the most of the recordings: {'; '.join(sizes)}.",
        {f"share_{env_id}": float(share.mean()) for env_id, share in shares.items()},
    )


def covered(environments: Environments) -> Measurement:
    """The share of the demonstrated states with an unfiltered rule."""
    shares = {
        env_id: rows["coverage", "unfiltered"].to_numpy(dtype=np.float64)
        for env_id, rows in environments.items()
    }
    least = min(shares, key=lambda env_id: float(shares[env_id].min()))
    lowest = float(shares[least].min())
    where = f"; least on {environment_name(least)}, where some equal states were shown with "
    return Measurement(
        _samples(environments, shares),
        f"Its rules cover {share_text(lowest)} of the demonstrated states or more"
        + (f"{where}different actions." if lowest < 1 else "."),
        {f"coverage_{env_id}": float(share.mean()) for env_id, share in shares.items()},
    )
