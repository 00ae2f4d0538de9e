"""How much return a number of rules brings: the curve beside the shipped compact rule sets.

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

FOLDER = Path(__file__).resolve().parents[2]
OUT = FOLDER / "data" / "rules" / "budgets.json"
PLANS = {
    "cartpole": (Plan(2, rounds=8, episodes=20, validation=128), (2, 3, 4, 8, 16)),
    "lunar_lander": (Plan(2, rounds=16, episodes=40, validation=128), (8, 16, 24, 48, 96, 192)),
    "bipedal_walker": (
        Plan(2, rounds=8, episodes=10, validation=48, divider=15),
        (16, 32, 64, 128, 256),
    ),
}


def main(jobs: int) -> None:
    """Run what is missing, and write the file after every point."""
    known: dict[str, Any] = json.loads(OUT.read_text()) if OUT.is_file() else {"environments": {}}
    for name, (plan, budgets) in PLANS.items():
        demonstrations = load_demonstrations(FOLDER / "data" / "demonstrations" / f"{name}.parquet")
        points = known["environments"].setdefault(demonstrations.env_id, [])
        for budget in budgets:
            if any(point["budget"] == budget for point in points):
                continue
            aggregation = aggregate(demonstrations, replace(plan, max_rules=budget), jobs=jobs)
            if not aggregation.is_finished:
                sys.exit(f"stopped; the points before are in {OUT}")
            card = aggregation_card(aggregation, command="python -m docs.scripts.budgets")
            points.append(
                {
                    "budget": budget,
                    "rules": max(card["rules_per_dimension"]),
                    "divider": plan.divider,
                    **card["reported"],
                }
            )
            points.sort(key=lambda point: int(point["budget"]))
            with whole_file(OUT) as unfinished:
                unfinished.write_text(json.dumps(known, indent=1) + "\n")
            print(name, points, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
