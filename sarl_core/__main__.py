"""``python -m sarl_core``, and ``sarl`` once installed."""

from __future__ import annotations

import sys
from pathlib import Path

from sarl_core.cli.app import main


def run() -> None:
    """Run the command line that this process was started with."""
    # `sarl` finds the module of `--env module:Id` where `python -m` does: where it was called.
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:
        sys.path.append(here)
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    run()
