"""What importing the package costs."""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from benchmarks.measure import Row, duration, seconds


def imports(quick: bool) -> Iterable[Row]:
    """Importing the package, against importing scikit-learn's trees, in fresh interpreters."""

    def fresh(name: str) -> float:
        command = [sys.executable, "-c", f"import {name}"]
        root = Path(__file__).resolve().parents[1]
        return seconds(lambda: subprocess.run(command, check=True, cwd=root))

    fresh("sarl_core")
    fresh("sklearn.tree")
    pairs = [(fresh("sarl_core"), fresh("sklearn.tree")) for _ in range(3 if quick else 9)]
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    yield Row(
        "import sarl_core",
        "import sklearn.tree",
        "share",
        ours / theirs,
        1.1,
        f"{duration(ours)} against {duration(theirs)}, interpreter included",
    )
