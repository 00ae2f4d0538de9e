"""``python -m benchmarks``: measure everything and print the table."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from importlib import import_module

from benchmarks.measure import Row, print_rows

# Where each row is made, in the order of the design.
ROWS = {
    "tree-included": "mining.tree_included",
    "tree-given": "mining.tree_given",
    "plane": "mining.plane",
    "large": "large.mining",
    "cluster": "large.on_a_cluster",
    "combinations": "mining.combinations",
    "decision": "shielding.decision",
    "batch": "shielding.batch",
    "episodes": "rollouts.episodes",
    "gif": "rollouts.gif",
    "browser": "browser.slider",
    "what-if": "pages.what_if",
    "edit": "pages.edit",
    "difference": "pages.difference",
    "export": "pages.export",
    "evidence": "pages.evidence",
    "rules": "pages.rules",
    "many-rules": "many_rules.many_rules",
    "names": "pages.names",
    "report": "pages.report",
    "replay": "pages.replay",
    "recorder": "pages.recorder",
    "ablation": "rollouts.ablation",
    "import": "startup.imports",
    "visitors": "visitors.sliders",
    "uploads": "visitors.uploads",
    "memory": "memory.whole_way",
    "cold-start": "browser.cold_start",
    "intervals": "evidence.intervals",
}


def main() -> int:
    """Print the table.

    Returns:
        0 if every row could be measured, whether or not its figure is reached; else 1.
    """
    options = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    options.add_argument("--only", choices=ROWS, action="append", help="measure this row")
    options.add_argument("--quick", action="store_true", help="fewer repeats: a rough look")
    chosen = options.parse_args()
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    rows: list[Row] = []
    failed = 0
    for name in chosen.only or ROWS:
        print(f"measuring {name} ...", file=sys.stderr, flush=True)
        try:
            rows.extend(_measure(ROWS[name])(chosen.quick))
        except Exception as error:
            failed += 1
            print(f"error: {name}: {type(error).__name__}: {error}", file=sys.stderr)
    print_rows(rows)
    return 1 if failed else 0


def _measure(home: str) -> Callable[[bool], Iterable[Row]]:
    module, function = home.split(".")
    found: Callable[[bool], Iterable[Row]] = getattr(
        import_module(f"benchmarks.{module}"), function
    )
    return found


if __name__ == "__main__":
    sys.exit(main())
