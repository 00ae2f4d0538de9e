"""What an aggregation leaves behind: the rules, and the card that says how they came about."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from sarl_core.rollouts.aggregation import REPORT_SEED, VALIDATION_SEED, Aggregation, Round
from sarl_core.rollouts.files import write_card
from sarl_core.rollouts.statistics import summarise


def card_path(rules: Path) -> Path:
    """Where the card of a rule file stands: `name.card.json` beside `name.json`."""
    return rules.with_suffix(".card.json")


def save_aggregation(found: Aggregation, out: Path, *, command: str) -> dict[str, Any]:
    """Write the rule file and its card.

    Args:
        found: To be kept.
        out: The rule file, `.json`.
        command: That makes it again; stands in the card.

    Returns:
        The card.

    Raises:
        InputError: If the folder does not exist.
        WorkError: If it cannot be written to.
    """
    card = aggregation_card(found, command=command)
    found.rule_set.save(out)
    write_card(card_path(out), card)
    return card


def aggregation_card(found: Aggregation, *, command: str) -> dict[str, Any]:
    """How rules came about and what they achieve, ready for JSON.

    Args:
        found: The aggregation.
        command: That makes it again.

    Returns:
        `reported` is null where the run was stopped before.
    """
    import gymnasium
    import sklearn

    plan, rules = found.plan, found.rule_set
    return {
        "what": f"{_most_rules(found)} rules an action dimension for {found.env_id}",
        "command": command,
        "env_id": found.env_id,
        "rules": len(rules),
        "rules_per_dimension": [len(rules.of_dimension(i)) for i in range(len(rules.actions))],
        "cut": rules.cut,
        "mean_length": round(rules.mean_length, 2),
        "fidelity": round(rules.fidelity, 4),
        "budget": plan.max_rules,
        "divider": plan.divider,
        "projection": plan.projection,
        "seed": plan.seed,
        "episodes_a_round": plan.episodes,
        "generations": plan.generations,
        "rounds": [_round(one) for one in found.rounds],
        "chosen_round": found.chosen,
        "refined": found.refined,
        "chosen_by": f"mean of up to {plan.validation} episodes, seeds {VALIDATION_SEED} and up",
        "validation_mean": None
        if found.validation_mean is None
        else round(found.validation_mean, 2),
        "reported_on": f"{plan.report} episodes, seeds {REPORT_SEED} and up, used for nothing else",
        "reported": _reported(found),
        "demonstrations": {
            "digest": rules.source.digest,
            "steps": rules.source.steps,
            "episodes": rules.source.episodes,
        },
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "gymnasium": gymnasium.__version__,
            "scikit-learn": sklearn.__version__,
        },
        "made": datetime.now(UTC).date().isoformat(),
    }


def _most_rules(found: Aggregation) -> int:
    rules = found.rule_set
    return max(len(rules.of_dimension(index)) for index in range(len(rules.actions)))


def _round(one: Round) -> dict[str, Any]:
    spread = summarise(one.returns)
    return {
        "number": one.number,
        "pairs": one.pairs,
        "rules": one.rules,
        "mean": round(spread.mean, 2),
        "std": round(spread.std, 2),
        "coverage": round(one.coverage, 4),
        "disagreement": round(one.disagreement, 4),
    }


def _reported(found: Aggregation) -> dict[str, Any] | None:
    episodes = found.reported
    if episodes is None:
        return None
    spread = summarise(episodes.returns)
    return {
        "episodes": len(episodes),
        "mean": round(spread.mean, 2),
        "std": round(spread.std, 2),
        "iqm": round(spread.iqm, 2),
        "iqm_low": round(spread.low, 2),
        "iqm_high": round(spread.high, 2),
        "min": round(float(episodes.returns.min()), 2),
        "max": round(float(episodes.returns.max()), 2),
    }
