"""Memory that is free goes to the system."""

from __future__ import annotations

import subprocess
import sys

MEGABYTE = 10**6
# One large array, freed, is what lets GNU's C library keep those that follow.
SCRIPT = """
import numpy as np, psutil
from sarl_core.memory import give_back_large_arrays
give_back_large_arrays()
here = psutil.Process()
before = here.memory_info().rss
np.ones(30_000_000, np.uint8)
many = [np.ones(8_000_000, np.uint8) for _ in range(20)]
del many[:-1]
print(here.memory_info().rss - before)
"""


def test_large_arrays_go_to_the_system_while_others_stay() -> None:
    # A process of its own: what the parameter is here stays as it is.
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], check=True, capture_output=True, text=True
    )
    assert int(done.stdout) < 20 * MEGABYTE
