"""``python -m sarl_core``, and ``sarl`` once installed."""

from __future__ import annotations

import sys

from sarl_core.cli.app import main


def run() -> None:
    """Run the command line that this process was started with."""
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    run()
