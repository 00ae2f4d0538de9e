from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from sarl_core import Demonstrations


@st.composite
def labelled_states(draw, max_steps=60):
    """A few states on a coarse grid (so that queries tie) with labels that contradict at times."""
    seed = draw(st.integers(0, 2**32 - 1))
    n = draw(st.integers(2, max_steps))
    d = draw(st.integers(1, 4))
    n_labels = draw(st.integers(1, 4))
    levels = draw(st.sampled_from([2, 3, 10, 1000]))
    rng = np.random.default_rng(seed)
    observations = (rng.integers(0, levels, (n, d)) / 7).astype(np.float32)
    labels = rng.integers(0, n_labels, n)
    return Demonstrations(
        observations,
        labels,
        np.zeros(n, dtype=int),
        label_names=(tuple(map(str, range(n_labels))),),
    )
