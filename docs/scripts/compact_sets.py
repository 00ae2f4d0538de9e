"""Makes the compact rule sets in data/rules, each over five seeds; the median one is shipped.

Run from the top folder: ``python -m docs.scripts.compact_sets [--jobs N] [SET ...]``. What every
seed achieved is added to data/rules/seeds.json as soon as it is known, and what is there is not
run again; delete a set's entry to begin it anew. Single rule sets are made by the commands that
their cards name.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.files import whole_file
from sarl_core.improving.aggregation import Aggregation, aggregate
from sarl_core.improving.aggregation_files import card_path, save_aggregation
from sarl_core.improving.plan import Plan
from sarl_core.mining.combining.candidates import pairs_by_name, pairs_of_like_kind
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.seeds import REPORT

FOLDER = Path(__file__).resolve().parents[2]
RULES = FOLDER / "data" / "rules"
SEEDS = RULES / "seeds.json"
LEARNING_SEEDS = range(5)
OPTIONS = {
    "rounds": "rounds",
    "episodes": "episodes",
    "divider": "divider",
    "turns": "refine",
    "search_episodes": "search-episodes",
    "search_limit": "search-limit",
    "search_starts": "search-starts",
    "search_steps": "search-steps",
    "search_generations": "search-generations",
    "search_worth": "search-worth",
    "validation": "validation",
    "report": "report-episodes",
    "choose": "choose",
    "seed": "seed",
}
SOLVED = 200.0  # a return from which a landing counts as one, where others report it


@dataclass(frozen=True)
class RuleSetPlan:
    """How a rule set is made.

    Attributes:
        task: Name of its demonstrations.
        plan: Of the aggregation.
        combine: "every" two features; names of features; or "" for none.
    """

    task: str
    plan: Plan
    combine: str = ""


_CARTPOLE = Plan(
    2, rounds=24, episodes=10, turns=1, validation=4_000, report=3_000, choose="failures"
)
_LANDER = Plan(2, rounds=16, episodes=24, turns=2, validation=512, report=1_000, choose="failures")
_CONTINUOUS_LANDER = replace(_LANDER, divider=16, max_rules=16, search_episodes=8)
_PENDULUM = Plan(16, rounds=16, episodes=20, divider=16, turns=3, validation=512, report=1_000)
_BODY = (
    "hull angle, hull angular velocity, horizontal velocity, vertical velocity, hip 1 angle, "
    "hip 1 speed, knee 1 angle, knee 1 speed, leg 1 ground contact, hip 2 angle, hip 2 speed, "
    "knee 2 angle, knee 2 speed, leg 2 ground contact"
)
_WALKER = Plan(
    32,
    rounds=16,
    episodes=12,
    divider=15,
    turns=3,
    search_episodes=8,
    search_limit=400,  # a quarter of its time: it walks as it begins
    validation=64,
    report=1_000,
    choose="failures",
)
SETS = {
    "cartpole_combined": RuleSetPlan("cartpole", _CARTPOLE, "every"),
    "cartpole_compact": RuleSetPlan(
        "cartpole", replace(_CARTPOLE, max_rules=3, search_limit=1_500)
    ),
    "lunar_lander_combined": RuleSetPlan(
        "lunar_lander", replace(_LANDER, max_rules=24, turns=3, validation=1_024), "every"
    ),
    "lunar_lander_few_combined": RuleSetPlan(
        "lunar_lander", replace(_LANDER, max_rules=8), "every"
    ),
    "lunar_lander_compact": RuleSetPlan(
        "lunar_lander",
        replace(_LANDER, max_rules=19, rounds=64, turns=2, search_episodes=8, search_starts=32),
    ),
    "lunar_lander_continuous_combined": RuleSetPlan(
        "lunar_lander_continuous", _CONTINUOUS_LANDER, "every"
    ),
    "bipedal_walker_combined": RuleSetPlan("bipedal_walker", _WALKER, _BODY),
    "pendulum_combined": RuleSetPlan(
        "pendulum", replace(_PENDULUM, turns=2, search_episodes=64), "every"
    ),
    "pendulum_compact": RuleSetPlan("pendulum", _PENDULUM),
}


def main() -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(SETS))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--work", type=Path, default=FOLDER / "out" / "rules")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    for name in arguments.sets or SETS:
        measure_expert(SETS[name], arguments.jobs)
        make(name, arguments.work, arguments.jobs)


def make(name: str, work: Path, jobs: int) -> None:
    """One rule set over all seeds, of which the median is copied to data/rules."""
    for seed in LEARNING_SEEDS:
        one = SETS[name]
        plan = replace(one.plan, seed=seed)
        known = [each for each in _known().get(name, []) if each["seed"] == seed]
        if any(each["command"] != command(name, plan) for each in known):
            raise SystemExit(f"the plan of {name} has changed; delete it from {SEEDS}")
        if known:
            continue
        start = load_demonstrations(FOLDER / "data" / "demonstrations" / f"{one.task}.parquet")
        if one.combine:
            every = one.combine == "every"
            pairs = pairs_of_like_kind(start) if every else pairs_by_name(start, [one.combine])
            plan = replace(plan, combined=pairs)
        aggregation = aggregate(start, plan, jobs=jobs)
        if not aggregation.is_finished:
            raise SystemExit(f"stopped; what was finished before is in {SEEDS}")
        save_aggregation(aggregation, work / f"{name}_{seed}.json", command=command(name, plan))
        _add(name, {"seed": seed, "command": command(name, plan), **achieved(aggregation)})
    middle = median(_known()[name])
    made = work / f"{name}_{middle['seed']}.json"
    if not made.is_file():
        raise SystemExit(f"{made} is gone; delete {name} from {SEEDS} and make it again")
    for path in (made, card_path(made)):
        target = RULES / path.name.replace(made.stem, name)
        with whole_file(target) as unfinished:
            unfinished.write_bytes(path.read_bytes())


def measure_expert(one: RuleSetPlan, jobs: int) -> None:
    """What the expert of a task achieves alone, in the episodes of the report."""
    name = f"{one.task}_expert"
    if name in _known():
        return
    env_id = load_demonstrations(FOLDER / "data" / "demonstrations" / f"{one.task}.parquet").env_id
    played = rollout(
        env_id, "expert", episodes=one.plan.report, seed=REPORT, keep_steps=False, jobs=jobs
    )
    _add(name, {"seed": None, "rules": None, **outcome(played)})


def command(name: str, plan: Plan) -> str:
    """The command that makes one seed of a set."""
    defaults = {field.name: field.default for field in fields(Plan)}
    options = [
        f"--{option} {getattr(plan, field)}"
        for field, option in OPTIONS.items()
        if getattr(plan, field) != defaults[field]
    ]
    if combine := SETS[name].combine:
        options.insert(0, "--combine" if combine == "every" else f'--combine "{combine}"')
    return (
        f"python -m sarl_core aggregate data/demonstrations/{SETS[name].task}.parquet "
        f"--out data/rules/{name}.json --max-rules {plan.max_rules} {' '.join(options)}"
    )


def achieved(aggregation: Aggregation) -> dict[str, Any]:
    """What a set achieves in the episodes that nothing was chosen by."""
    assert aggregation.reported is not None
    rules = aggregation.rule_set
    most = max(len(rules.of_dimension(index)) for index in range(len(rules.actions)))
    return {"rules": most, **outcome(aggregation.reported)}


def outcome(played: Episodes) -> dict[str, Any]:
    """Returns and failures of episodes."""
    returns, failures = played.returns, played.failures
    return {
        "episodes": len(returns),
        "mean": round(float(returns.mean()), 2),
        "std": round(float(returns.std(ddof=1)), 2),
        "least": round(float(returns.min()), 2),
        "solved": round(float((returns >= SOLVED).mean()), 4),
        "failures": None if failures is None else failures.count,
        "failure_low": None if failures is None else round(failures.low, 5),
        "failure_high": None if failures is None else round(failures.high, 5),
    }


def median(seeds: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The seed in the middle, by failures and then by the return."""
    ranked = sorted(seeds, key=lambda one: (one["failures"] or 0, -one["mean"]))
    return ranked[len(ranked) // 2]


def _known() -> dict[str, list[dict[str, Any]]]:
    known: dict[str, list[dict[str, Any]]] = (
        json.loads(SEEDS.read_text(encoding="utf-8")) if SEEDS.is_file() else {}
    )
    return known


def _add(name: str, seed: dict[str, Any]) -> None:
    known = _known()
    known.setdefault(name, []).append(seed)
    with whole_file(SEEDS) as unfinished:
        unfinished.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    print(name, seed, flush=True)


if __name__ == "__main__":
    main()
