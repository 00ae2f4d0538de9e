"""Demonstrations of every kind of space, for property tests."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sarl_core.demonstrations.dataset import Demonstrations

SPACES = (
    "discrete",
    "discrete from 3",
    "multi-discrete",
    "one label in a vector",
    "continuous",
    "continuous vector",
    "whole continuous",
)

_LARGEST = 2.0**99  # what is larger stands for no reading, and is refused
_finite = st.floats(-_LARGEST, _LARGEST, width=32)
_letters = st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zs", "Zl", "Zp"))
# A name that is a number only counts; those have tests of their own.
names = st.text(_letters, min_size=1, max_size=8).filter(
    lambda text: not any(sign.isnumeric() for sign in text)
)


@st.composite
def demonstrations(draw: st.DrawFn, space: str) -> Demonstrations:
    n, d = draw(st.integers(2, 30)), draw(st.integers(1, 4))
    lengths = draw(st.lists(st.integers(1, 10), min_size=n, max_size=n))
    episodes = np.repeat(np.arange(n) * draw(st.integers(1, 5)), lengths)[:n]
    m = {"multi-discrete": 3, "continuous vector": 2}.get(space, 1)
    fields: dict[str, Any] = {}
    if space.startswith(("continuous", "whole")):
        values = st.integers(-3, 3).map(float) if space.startswith("whole") else _finite
        actions = draw(hnp.arrays(np.float32, (n, m), elements=values))
        if draw(st.booleans()):
            fields |= {"action_low": (-4e38,) * m, "action_high": (4e38,) * m}
    else:
        first = 3 if space == "discrete from 3" else 0
        shape = (n,) if space.startswith("discrete") else (n, m)
        actions = draw(hnp.arrays(np.int64, shape, elements=st.integers(first, first + 4)))
        fields |= {
            "label_first": (first,) * m,
            "label_names": draw(st.tuples(*[st.lists(names, min_size=5, max_size=5)] * m)),
        }
    per_step = {
        "rewards": hnp.arrays(np.float64, n, elements=st.floats(-_LARGEST, _LARGEST)),
        "terminated": hnp.arrays(np.bool_, n),
        "truncated": hnp.arrays(np.bool_, n),
    }
    for name, strategy in per_step.items():
        if draw(st.booleans()):
            fields[name] = draw(strategy)
    return Demonstrations(
        draw(hnp.arrays(np.float32, (n, d), elements=_finite)),
        actions,
        episodes,
        feature_names=tuple(draw(st.lists(names, min_size=d, max_size=d, unique=True))),
        feature_units=tuple(draw(st.lists(st.text(_letters, max_size=3), min_size=d, max_size=d))),
        action_names=tuple(draw(st.lists(names, min_size=m, max_size=m, unique=True))),
        env_id=draw(st.sampled_from(["", "CartPole-v1", "module:Thing-v0"])),
        agent=draw(st.text(_letters, max_size=9)),
        seed=draw(st.none() | st.integers(0, 2**63)),
        notes=tuple(draw(st.lists(names, max_size=2))),
        **fields,
    )
