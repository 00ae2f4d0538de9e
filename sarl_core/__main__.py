"""``python -m sarl_core``."""

from __future__ import annotations

import sys

from sarl_core.cli.app import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
