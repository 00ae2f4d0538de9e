"""Makes the reports in docs/reports and what they compare: `python -m docs.scripts.reports`."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from sarl_core import RuleSet
from sarl_core.cli.app import main
from sarl_core.files import whole_file
from sarl_core.rollouts.seeds import FRESH
from sarl_core.studies.comparison import Arm, compare

ROOT = Path(__file__).resolve().parents[2]
EPISODES = {"driving": 300}  # crashes are rare there
USUAL_EPISODES = 100


def sarl(line: str) -> None:
    """Run a command of the product."""
    if main(shlex.split(line)):
        raise SystemExit(f"failed: {line}")


def comparison(env_id: str, rules: Path, called: str, out: Path, episodes: int) -> None:
    """Novice and expert, each alone and under the rules, on the same seeds."""
    shields = (("no shield", None), (called, RuleSet.load(rules)))
    arms = [
        Arm(f"{agent}, {name}", agent, rule_set)
        for agent in ("novice", "expert")
        for name, rule_set in shields
    ]
    results = compare(env_id, arms, episodes=episodes, seed=FRESH, jobs=os.cpu_count() or 1)
    frame = results.to_frame()
    frame.insert(0, "projection", [arm.projection if arm.rules else "" for arm in arms])
    frame.insert(0, "seed", FRESH)
    frame.insert(0, "environment", env_id)
    with whole_file(out) as unfinished:
        frame.to_csv(unfinished, index=False)


def report(task: str, rules: str, env_id: str, called: str) -> None:
    """One report and its comparison."""
    csv, out = (f"docs/reports/{task}.{suffix}" for suffix in ("csv", "html"))
    episodes = EPISODES.get(task, USUAL_EPISODES)
    comparison(env_id, Path(rules), called, Path(csv), episodes)
    data = f"data/demonstrations/{task}.parquet"
    sarl(f"report {rules} --demonstrations {data} --comparison {csv} --date '' --out {out}")


if __name__ == "__main__":
    os.chdir(ROOT)  # so that the commands in the reports are those of a checkout
    report("lunar_lander", "data/rules/lunar_lander_compact.json", "LunarLander-v3", "compact")
    report("driving", "data/rules/driving_compact.json", "Driving-v0", "compact")
    filtered = "cartpole_filtered.json"
    try:
        mined = f"mine data/demonstrations/cartpole.parquet --setting filtered --out {filtered}"
        sarl(mined)
        report("cartpole", filtered, "CartPole-v1", "filtered")
    finally:
        Path(filtered).unlink(missing_ok=True)
