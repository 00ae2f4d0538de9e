"""A formula on the features of the data at hand, to begin with."""

from __future__ import annotations

import re

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.unit_algebra import quotient
from sarl_core.environments.formulas import Constant, FeatureValue, Node, Operation, written
from sarl_core.errors import InputError
from sarl_core.mining.combining.candidates import pairs_of_like_kind
from sarl_dashboard.cache import cached

_NO_NAME = re.compile(r"[=\[\]<>]")
_LONGEST = 60  # signs of a name, so that the whole formula is seen on a line
_GUARD = 0.1  # of the spread of what is divided by


@cached()
def example_formula(demonstrations: Demonstrations) -> str:
    """An example that can be taken as it is.

    Args:
        demonstrations: N steps of d observed features.

    Returns:
        As "gap over speed [s] = gap / max(abs(speed), 0.3)": of the features that are amounts the
        two of which a quotient says most, as a distance over a speed; "" where there are no two.
    """
    observed = demonstrations.observed
    pairs = [
        pair
        for one, other in pairs_of_like_kind(demonstrations)
        for pair in ((one, other), (other, one))
    ]
    if not pairs:
        return ""
    first, second = min(pairs, key=lambda pair: _rank(observed[pair[0]], observed[pair[1]]))
    spread = float(np.std(demonstrations.raw_observations[:, second], dtype=np.float64))
    guard = Constant(float(f"{_GUARD * spread:.0e}"))
    size = Operation("abs", (FeatureValue(second),))
    root: Node = Operation("/", (FeatureValue(first), Operation("max", (size, guard))))
    try:
        formula = written(root, [feature.name for feature in observed])
    except InputError:  # a name that no formula can hold
        return ""
    name = f"{observed[first].name} over {observed[second].name}"
    if len(name) > _LONGEST or _NO_NAME.search(name):
        name = "quotient"
    unit = quotient(observed[first].unit, observed[second].unit) or ""
    return f"{name}{f' [{unit}]' if unit else ''} = {formula}"


def _rank(one: Feature, other: Feature) -> int:
    """How little a quotient of two says: 0 of a distance over a speed."""
    unit = quotient(one.unit, other.unit) if one.unit and other.unit else None
    if unit == "s":
        return 0
    return 1 if unit else 2
