"""A crane, from an operator's log to rules and to the audit of another operator.

There is no simulator that an agent could act in and nobody trained anything: all there is are two
CSV files, as a data logger would write them. The logger here is simulated, so that the example
runs anywhere; put your own file in its place.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from sarl_core import audit, load_demonstrations, mine_rules

ACTIONS = ("raise", "raise slowly", "hold", "lower")
COLUMNS = ("run", "time", "load (t)", "wind (m/s)", "height (m)", "swing (deg)", "ground")


def careful(load: float, wind: float, height: float, swing: float, ground: str) -> str:
    """What the site's rule book asks for."""
    if wind > 14:
        return "lower" if height > 2 else "hold"
    if swing > 6 or (load > 6 and wind > 9):
        return "hold"
    if height > 18 or (ground == "soft" and load > 4):
        return "raise slowly"
    return "raise"


def hurried(load: float, wind: float, height: float, swing: float, ground: str) -> str:
    """The same, by somebody who wants to go home: the wind has to be worse."""
    return careful(load, wind - 2.5, height, swing - 1.5, ground)


def lifts(operator, runs: int, seed: int, windy: float) -> Iterator[list[object]]:
    """Rows of a log: a decision every two seconds until the load is up, or the time is.

    Args:
        operator: Decides; errs in one step of a hundred.
        runs: Number of lifts.
        seed: Of the weather and of the errors.
        windy: The wind of the windiest lift, on average over the lift, in m/s.
    """
    rng = np.random.default_rng(seed)
    clock = datetime(2026, 3, 2, 7, 0)
    for run in range(runs):
        load, ground = rng.uniform(1, 9), rng.choice(["firm", "soft"], p=[0.7, 0.3])
        calm = rng.uniform(3, windy)
        wind, height, swing = calm, 0.0, rng.uniform(0, 2)
        for _ in range(120):
            action = operator(load, wind, height, swing, ground)
            if rng.random() < 0.01:
                action = str(rng.choice(ACTIONS))
            measured = [f"{value:.2f}" for value in (load, wind, height, swing)]
            yield [f"lift {run + 1}", clock.isoformat(" "), *measured, ground, action]
            speed = {"raise": 0.6, "raise slowly": 0.25, "hold": 0.0, "lower": -0.5}[action]
            height = max(0.0, height + 2 * speed)
            wind = max(0.0, wind + 0.15 * (calm - wind) + rng.normal(0, 1.1))
            swing = abs(0.8 * swing + 0.06 * wind * rng.normal(1, 0.5) + abs(speed) * rng.normal())
            clock += timedelta(seconds=2)
            if height >= 20:
                break
        clock += timedelta(minutes=7)


def write_log(path: str, rows: Iterator[list[object]]) -> None:
    """Write what the data logger wrote."""
    with Path(path).open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow([*COLUMNS, "operator_action"])
        table.writerows(rows)


write_log("crane.csv", lifts(careful, runs=150, seed=1, windy=15))
write_log("crane_night_shift.csv", lifts(hurried, runs=40, seed=2, windy=15))

day = load_demonstrations("crane.csv")
rules = mine_rules(day, supp_min=0.005, conf_min=0.95)
print(rules.to_text())
night = audit(rules, load_demonstrations("crane_night_shift.csv"))
print(f"the night shift broke the rules in {night.broken / night.steps:.1%} of {night.steps} steps")
