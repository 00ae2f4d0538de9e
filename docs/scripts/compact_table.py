"""Writes what the compact sets achieve into the guide: ``python -m docs.scripts.compact_table``.

The numbers are those of data/rules/seeds.json and data/rules/budgets.json, which
``docs.scripts.compact_sets`` and ``docs.scripts.budgets`` have measured.
"""

from __future__ import annotations

import json
from math import sqrt
from pathlib import Path
from typing import Any

from docs.scripts.compact_sets import LEARNING_SEEDS, RULES, SEEDS, SETS, median
from sarl_core.explaining.figures.png import figure_to_png
from sarl_core.explaining.figures.rule_budgets import (
    BudgetPoint,
    PublishedPoint,
    budget_figure,
    budget_points,
)
from sarl_core.files import whole_file
from sarl_core.mining.language import sentence, share_text
from sarl_core.mining.rule_set import load_rules

FOLDER = Path(__file__).resolve().parents[2]
PAGE, README = FOLDER / "docs" / "results" / "compact_rules.md", FOLDER / "README.md"
BEGIN = "<!-- made by: python -m docs.scripts.compact_table -->"
END = "<!-- end of what is made -->"
TASKS = {
    "cartpole": ("Cart Pole", "CartPole-v1"),
    "lunar_lander": ("Lunar Lander", "LunarLander-v3"),
    "lunar_lander_continuous": ("Lunar Lander, continuous", "LunarLanderContinuous-v3"),
    "pendulum": ("Pendulum", "Pendulum-v1"),
    "bipedal_walker": ("Bipedal Walker", "BipedalWalker-v3"),
    "driving": ("Driving", "Driving-v0"),
}
COSTA = "Costa et al. 2024"
PUBLISHED = {
    "cartpole": ((PublishedPoint(3, 500.0, COSTA), "500 ± 0", "–"),),
    "lunar_lander": (
        (PublishedPoint(19, 237.7, COSTA), "237.7 ± 72.5", "91 %"),
        (PublishedPoint(94, 245.0, COSTA), "245 ± 40.5", "–"),
    ),
}
EACH = {"lunar_lander_continuous": " for each engine", "bipedal_walker": " for each joint"}
LANDING = ("lunar_lander", "lunar_lander_continuous")  # of which 200 counts as solved
IN_FULL = {
    "cartpole_combined": "The rules of Cart Pole:",
    "lunar_lander_few_combined": "The rules of Lunar Lander with the fewest:",
}
HEAD = (
    *("task", "rules", "features a condition", "mean return, 95 % interval", "200 or more"),
    "failures, 95 % interval",
)
SEEDS_HEAD = "each of five learning seeds, rules: mean (failures)"


def main() -> None:
    """Write the table into the page and the README, and the pictures."""
    for path, written in ((PAGE, with_rules), (README, with_table)):
        text = written(path.read_text(encoding="utf-8"))
        with whole_file(path) as unfinished:
            unfinished.write_text(text, encoding="utf-8")
    for task in TASKS:
        front(task)


def with_table(page: str) -> str:
    """A page with the table of what is known between its marks."""
    return _between_marks(page, compact_table(_known(), every_seed=False))


def with_rules(page: str) -> str:
    """A page with the table, every seed in it, and the smallest sets between its marks."""
    rules = "\n\n".join(f"{title}\n\n{rule_list(name)}" for name, title in IN_FULL.items())
    return _between_marks(page, f"{compact_table(_known(), every_seed=True)}\n\n{rules}")


def _between_marks(page: str, text: str) -> str:
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.split(END)[1]}"


def _known() -> dict[str, list[dict[str, Any]]]:
    known: dict[str, list[dict[str, Any]]] = json.loads(SEEDS.read_text(encoding="utf-8"))
    return known


def rule_list(name: str) -> str:
    """The sentences of a set, the rule that applies to most states first."""
    rules = load_rules(RULES / f"{name}.json")
    ranked = sorted(rules.rules, key=lambda rule: -rule.samples)
    return "\n".join(f"- {sentence(rule, rules, evidence=False)}" for rule in ranked)


def compact_table(known: dict[str, list[dict[str, Any]]], *, every_seed: bool) -> str:
    """The sets of which every seed is known, each task's expert and what others have published."""
    head = [*HEAD, *([SEEDS_HEAD] if every_seed else [])]
    rows = [head, ["---"] * len(head)]
    for task, (title, _) in TASKS.items():
        sets = [
            (name, known[name])
            for name, one in SETS.items()
            if one.task == task and len(known.get(name, ())) == len(LEARNING_SEEDS)
        ]
        for name, seeds in sorted(sets, key=lambda one: median(one[1])["rules"]):
            chosen = median(seeds)
            features = "two" if SETS[name].combine else "one"
            every = ", ".join(map(seed_text, sorted(seeds, key=lambda one: int(one["seed"]))))
            achieved = outcome_cells(task, chosen)
            rules = f"{chosen['rules']}{EACH.get(task, '')}"
            rows.append([title, rules, features, *achieved, every])
        if sets:
            for point, mean, solved in PUBLISHED.get(task, ()):
                rows.append([f"*{point.name}*", str(point.rules), "one", mean, solved, "–", "–"])
            (expert,) = known[f"{task}_expert"]
            rows.append(["*the expert*", "–", "–", *outcome_cells(task, expert), "–"])
    return "\n".join(f"| {' | '.join(row[: len(head)])} |" for row in rows)


def outcome_cells(task: str, one: dict[str, Any]) -> tuple[str, str, str]:
    """Return, how often it is solved, and failures."""
    solved = share_text(one["solved"]) if task in LANDING else "–"
    return mean_text(one), solved, failure_text(one)


def seed_text(one: dict[str, Any]) -> str:
    """What the rules of one learning seed achieve, and how many they are."""
    failures = "" if one["failures"] is None else f" ({one['failures']:,})"
    return f"{one['rules']}: {one['mean']:,.1f}{failures}"


def mean_text(one: dict[str, Any]) -> str:
    """A mean with its interval."""
    half = 1.96 * one["std"] / sqrt(one["episodes"])
    low, high = one["mean"] - half, one["mean"] + half
    return f"{one['mean']:,.1f} ({low:,.1f} to {high:,.1f})"


def failure_text(one: dict[str, Any]) -> str:
    """Failures of how many episodes, with the interval of the rate."""
    if one["failures"] is None:
        return "–"
    between = f"{100 * one['failure_low']:.2g} to {100 * one['failure_high']:.2g} %"
    return f"{one['failures']:,} of {one['episodes']:,} ({between})"


def front(task: str) -> None:
    """The picture of return and failures against the number of rules."""
    env_id = TASKS[task][1]
    points = budget_points(json.loads((RULES / "budgets.json").read_text("utf-8")), env_id)
    known = _known()
    refined = [
        BudgetPoint(
            rules=chosen["rules"],
            mean=chosen["mean"],
            std=chosen["std"],
            episodes=chosen["episodes"],
            failures=chosen["failures"],
            failure_low=chosen["failure_low"] or 0.0,
            failure_high=1.0 if chosen["failure_high"] is None else chosen["failure_high"],
            combined=bool(one.combine),
            refined=True,
        )
        for name, one in SETS.items()
        if one.task == task and len(known.get(name, ())) == len(LEARNING_SEEDS)
        for chosen in [median(known[name])]
    ]
    if not points and not refined:
        return
    figure = budget_figure(
        sorted((*points, *refined), key=lambda point: point.rules),
        published=[point for point, *_ in PUBLISHED.get(task, ())],
    )
    with whole_file(FOLDER / "docs" / "pictures" / f"front_{task}.png") as unfinished:
        unfinished.write_bytes(figure_to_png(figure.update_layout(width=640)))


if __name__ == "__main__":
    main()
