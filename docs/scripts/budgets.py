"""What a number of rules brings: the curves beside the shipped compact rule sets.

Run from the top folder: ``python -m docs.scripts.budgets``. Every point is an aggregation of its
own, and its return is that of the episodes it reports, which nothing was chosen by. Points that
are there already are not run again; delete data/rules/budgets.json to begin anew.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.files import whole_file
from sarl_core.improving.aggregation import aggregate
from sarl_core.improving.aggregation_files import aggregation_card
from sarl_core.improving.plan import Plan
from sarl_core.mining.combining.candidates import pairs_of_like_kind

FOLDER = Path(__file__).resolve().parents[2]
OUT = FOLDER / "data" / "rules" / "budgets.json"
_LANDER = Plan(2, rounds=16, episodes=24, validation=128, choose="failures")
# By failures the walker that stands still would be best: it never falls.
_WALKER = Plan(2, rounds=8, episodes=8, validation=48, divider=15)
PLANS: dict[str, tuple[Plan, tuple[int, ...], tuple[int, ...]]] = {
    "cartpole": (
        Plan(2, rounds=8, episodes=20, validation=128, choose="failures"),
        (2, 3, 4, 8, 16),
        (2, 3, 4, 8),
    ),
    "lunar_lander": (_LANDER, (8, 16, 24, 48, 96, 192), (4, 8, 16, 24, 48)),
    "lunar_lander_continuous": (
        replace(_LANDER, divider=16),
        (4, 8, 16, 32, 64),
        (4, 8, 16, 32),
    ),
    "pendulum": (
        Plan(2, rounds=10, episodes=20, validation=128, divider=16),
        (4, 8, 16, 32, 64),
        (4, 8, 16, 32),
    ),
    "bipedal_walker": (_WALKER, (16, 32, 64, 128, 256), (16, 32, 64)),
    "driving": (
        Plan(2, rounds=6, episodes=40, validation=128, choose="failures"),
        (4, 8, 16, 24),
        (4, 8, 16),
    ),
}


def main(jobs: int) -> None:
    """Run what is missing, and write the file after every point."""
    known: dict[str, Any] = json.loads(OUT.read_text()) if OUT.is_file() else {"environments": {}}
    for name, (plan, one, two) in PLANS.items():
        demonstrations = load_demonstrations(FOLDER / "data" / "demonstrations" / f"{name}.parquet")
        points = known["environments"].setdefault(demonstrations.env_id, [])
        pairs = pairs_of_like_kind(demonstrations)
        for budget, combined in [
            *((count, ()) for count in one),
            *((count, pairs) for count in two),
        ]:
            if any(
                (point["budget"], point["combined"]) == (budget, bool(combined)) for point in points
            ):
                continue
            aggregation = aggregate(
                demonstrations, replace(plan, max_rules=budget, combined=combined), jobs=jobs
            )
            if not aggregation.is_finished:
                sys.exit(f"stopped; the points before are in {OUT}")
            card = aggregation_card(aggregation, command="python -m docs.scripts.budgets")
            points.append(
                {
                    "budget": budget,
                    "combined": bool(combined),
                    "rules": max(card["rules_per_dimension"]),
                    "divider": plan.divider,
                    **card["reported"],
                }
            )
            points.sort(key=lambda point: (point["combined"], point["budget"]))
            with whole_file(OUT) as unfinished:
                unfinished.write_text(json.dumps(known, indent=1) + "\n")
            print(name, budget, bool(combined), card["reported"], flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
