"""Fuzz every reader, each in a process of its own: ``python -m tests.fuzz``.

What makes a reader fail is kept in ``.fuzz/NAME``, and becomes a test once the fault is mended.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from sarl_core.limits import READ_LIMIT
from tests.fuzz.readers import READERS

FOLDER = Path(".fuzz")
ROUND = 60  # seconds of a process: the fuzzer itself takes more and more memory
LIMITS = ("-timeout=60", "-rss_limit_mb=2000", "-max_len=60000", "-print_final_stats=1")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("names", nargs="*", metavar="NAME", help=", ".join(READERS))
    arguments.add_argument("--minutes", type=float, default=10.0, help="for each reader")
    given = arguments.parse_args()
    failed = [name for name in given.names or READERS if not fuzz(name, given.minutes)]
    print(f"\nfound something in: {', '.join(failed)}" if failed else "\nfound nothing")
    return 1 if failed else 0


def fuzz(name: str, minutes: float) -> bool:
    """Whether a reader stood for so many minutes."""
    kept, found = FOLDER / name / "corpus", FOLDER / name / "found"
    for folder in (kept, found):
        folder.mkdir(parents=True, exist_ok=True)
    for place, seed in enumerate(READERS[name].seeds()):
        (kept / f"seed-{place}").write_bytes(seed)
    print(f"\n{name}, {minutes:g} minutes", flush=True)
    command = [sys.executable, "-m", "tests.fuzz.one", name, str(kept), *LIMITS]
    command += [f"-artifact_prefix={found}/"]
    end = time.monotonic() + 60 * minutes
    while (left := end - time.monotonic()) > 1:
        done = subprocess.run(
            [*command, f"-max_total_time={max(1, round(min(left, ROUND)))}"],
            check=False,
            env=os.environ | {READ_LIMIT: "0.25"},
        )
        if done.returncode:
            return False
    return True


if __name__ == "__main__":
    sys.exit(main())
