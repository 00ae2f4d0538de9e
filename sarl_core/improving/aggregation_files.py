"""What an aggregation leaves behind: the rules, and the card that says how they came about."""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sarl_core.errors import WorkError
from sarl_core.files import whole_file
from sarl_core.improving.aggregation import Aggregation, AggregationRound
from sarl_core.mining.rule_files.writing import write_rules
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import summarise


def card_path(rules: Path) -> Path:
    """Where the card of a rule file stands: `name.card.json` beside `name.json`."""
    return rules.with_suffix(".card.json")


def stopped_path(out: Path) -> Path:
    """Where to write what a stopped run has found, so that nothing finished is lost.

    Args:
        out: Where it would have been written at its end.

    Returns:
        `out` if there is no such file and no card of one; else `name.stopped.json` beside it.
    """
    if not out.exists() and not card_path(out).exists():
        return out
    return out.with_name(f"{out.stem}.stopped{out.suffix}")


class Saved(NamedTuple):
    """What was written.

    Attributes:
        rules: The rule file.
        card: What its card says.
    """

    rules: Path
    card: dict[str, Any]


def save_aggregation(aggregation: Aggregation, out: Path, *, command: str) -> Saved:
    """Write the rule file and its card: both, or neither.

    Args:
        aggregation: To be kept.
        out: The rule file, `.json`. That of a stopped run takes no other's place: see
            `stopped_path`.
        command: That makes it again; stands in the card.

    Returns:
        Where the rules are, and the card.

    Raises:
        InputError: If the folder does not exist.
        WorkError: If it cannot be written to.
    """
    if not aggregation.is_finished:
        out = stopped_path(out)
    for path in (out, card_path(out)):
        if path.is_dir():
            raise WorkError(f"{path} is a folder and cannot be written; choose another name")
    card = aggregation_card(aggregation, command=command)
    # Both are written before the first takes its place.
    with whole_file(out) as rules:
        write_rules(aggregation.rule_set, rules)
        with whole_file(card_path(out)) as beside:
            beside.write_text(json.dumps(card, indent=2) + "\n", encoding="utf-8")
    return Saved(out, card)


def chosen_by(aggregation: Aggregation) -> str:
    """What the rules were chosen by, as it stands after "chosen by".

    Args:
        aggregation: Finished or stopped.
    """
    first = "failures, then the mean" if aggregation.plan.choose == "failures" else "mean"
    up_to = f"the {first} of up to {aggregation.plan.validation} episodes"
    if aggregation.seeds.validation is None:
        if aggregation.seeds.refinement is None:
            return "the episodes of their round only"
        return "the episodes of a refinement that was not finished"
    return f"{up_to} of validation"


def aggregation_card(aggregation: Aggregation, *, command: str) -> dict[str, Any]:
    """How rules came about and what they achieve, ready for JSON.

    Args:
        aggregation: The aggregation.
        command: That makes it again.

    Returns:
        `seeds` has the first seed of every part of the run. `validation_mean` and what is said of
        a part are null where the run was stopped before.
    """
    plan, rules = aggregation.plan, aggregation.rule_set
    return {
        "what": f"{_most_rules(aggregation)} rules an action dimension for {aggregation.env_id}",
        "command": command,
        "env_id": aggregation.env_id,
        "rules": len(rules),
        "rules_per_dimension": [len(rules.of_dimension(i)) for i in range(len(rules.actions))],
        "cut": rules.cut,
        "mean_length": round(rules.mean_length, 2),
        "fidelity": round(rules.fidelity, 4),
        "budget": plan.max_rules,
        "divider": plan.divider,
        "projection": plan.projection,
        "seed": plan.seed,
        **({} if plan.max_steps is None else {"max_steps": plan.max_steps}),
        **({"combined": _combined(aggregation)} if plan.combined else {}),
        **({"first_rules": aggregation.first_rules} if aggregation.first_rules else {}),
        **({"left_out": aggregation.left_out} if aggregation.left_out else {}),
        "episodes_a_round": plan.episodes,
        "turns": plan.turns,
        **({"search_episodes": plan.search_episodes} if plan.turns else {}),
        **({} if plan.search_limit is None else {"search_limit": plan.search_limit}),
        **({} if plan.search_starts is None else {"search_starts": plan.search_starts}),
        **({} if not plan.search_steps else {"search_steps": plan.search_steps}),
        **(
            {}
            if plan.search_generations is None
            else {"search_generations": plan.search_generations}
        ),
        **({} if plan.search_worth is None else {"search_worth": plan.search_worth}),
        "rounds": [_round(one) for one in aggregation.rounds],
        "chosen_round": aggregation.chosen,
        "refined": aggregation.refined,
        "chosen_by": chosen_by(aggregation),
        "validation_mean": None
        if aggregation.validation_mean is None
        else round(aggregation.validation_mean, 2),
        "reported_on": f"{plan.report} episodes used for nothing else"
        if aggregation.is_finished
        else None,
        "reported": None
        if aggregation.reported is None
        else reported_entries(aggregation.reported),
        "seeds": aggregation.seeds._asdict(),
        "demonstrations": {
            "digest": rules.source.digest,
            "steps": rules.source.steps,
            "episodes": rules.source.episodes,
        },
        "versions": versions_used(),
        "made": datetime.now(UTC).date().isoformat(),
    }


def _combined(aggregation: Aggregation) -> list[list[str]]:
    """The pairs of features of which combinations could be asked about."""
    features = aggregation.rule_set.source.features
    return [[features[place].name for place in pair] for pair in aggregation.plan.combined]


def _most_rules(aggregation: Aggregation) -> int:
    rules = aggregation.rule_set
    return max(len(rules.of_dimension(index)) for index in range(len(rules.actions)))


def _round(one: AggregationRound) -> dict[str, Any]:
    spread = summarise(one.returns)
    return {
        "number": one.number,
        "pairs": one.pairs,
        "rules": one.rules,
        "mean": round(spread.mean, 2),
        "std": round(spread.std, 2),
        "coverage": round(one.coverage, 4),
        "disagreement": round(one.disagreement, 4),
        **({} if one.failures is None else {"failures": one.failures.count}),
    }


def versions_used() -> dict[str, str]:
    """Of the programs that what a card says hangs on."""
    import gymnasium
    import sklearn

    return {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "gymnasium": gymnasium.__version__,
        "scikit-learn": sklearn.__version__,
    }


def reported_entries(episodes: Episodes) -> dict[str, Any]:
    """What a card says of episodes that nothing was chosen by.

    Args:
        episodes: Of a report.
    """
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
        **{
            name: value if isinstance(value, int) else round(value, 4)
            for name, value in episodes.summary().items()
            if name.startswith(("failure", "cost"))
            or name in ("cut", "undecided", "intervention_rate", "freedom", "worst_tenth")
        },
    }
