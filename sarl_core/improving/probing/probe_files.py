"""What probes leave behind: the rules, and the card that says how they came about."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sarl_core.files import whole_file
from sarl_core.improving.aggregation_files import card_path, reported_entries, versions_used
from sarl_core.improving.probing.probing import ProbeRound, Probing
from sarl_core.mining.rule_files.writing import write_rules
from sarl_core.rollouts import seeds


def save_probing(probing: Probing, out: Path, *, command: str) -> dict[str, Any]:
    """Write the rule file and its card: both, or neither.

    Args:
        probing: To be kept.
        out: The rule file, `.json`.
        command: That makes it again; stands in the card.

    Returns:
        The card.

    Raises:
        InputError: If the folder does not exist.
        WorkError: If it cannot be written to.
    """
    card = probing_card(probing, command=command)
    with whole_file(out) as rules:
        write_rules(probing.rule_set, rules)
        with whole_file(card_path(out)) as beside:
            beside.write_text(json.dumps(card, indent=2) + "\n", encoding="utf-8")
    return card


def probing_card(probing: Probing, *, command: str) -> dict[str, Any]:
    """How rules came about and what they achieve, ready for JSON.

    Args:
        probing: Finished.
        command: That makes it again.
    """
    plan, rules = probing.plan, probing.rule_set
    run = (("rounds", seeds.ROUNDS), ("validation", seeds.VALIDATION), ("report", seeds.REPORT))
    return {
        "what": f"{len(rules)} never-rules from probes for {rules.source.env_id}",
        "command": command,
        "env_id": rules.source.env_id,
        "rules": len(rules),
        "rules_per_dimension": [len(rules.of_dimension(i)) for i in range(len(rules.actions))],
        "mean_length": round(rules.mean_length, 2),
        **{name: value for name, value in asdict(plan).items() if value is not None}
        | {"rounds": [_round(one) for one in probing.rounds]},
        "chosen_round": probing.chosen.number,
        "chosen_by": "the failures, then the freedom, of the agent under its rules in "
        f"{plan.validation} episodes of validation",
        "reported_on": f"{plan.report} episodes used for nothing else",
        "reported": reported_entries(probing.reported),
        "seeds": {name: seeds.of_run(first, plan.seed) for name, first in run},
        "probes": {
            "states": len(probing.outcomes),
            "failed": [round(float(one.mean()), 4) for one in probing.outcomes.failed],
        },
        "versions": versions_used(),
        "made": datetime.now(UTC).date().isoformat(),
    }


def _round(one: ProbeRound) -> dict[str, Any]:
    return {
        "number": one.number,
        "states": one.states,
        "rules": len(one.rule_set),
        "failures": int(one.played.failed.sum()),
        "mean": round(float(one.played.returns.mean()), 2),
        "freedom": round(one.freedom, 4),
    }
