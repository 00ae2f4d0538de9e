"""What the commands answer, as documents for JSON and as text for people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.cli import terminal
from sarl_core.demonstrations.warnings import find_warnings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sarl_core.cli.answers.evidence import Tried
    from sarl_core.demonstrations.dataset import ActionDimension, Demonstrations
    from sarl_core.demonstrations.formats.mapping.preview import ColumnPreview
    from sarl_core.mining.rule_set import RuleSet
    from sarl_core.mining.tree import PolicyTree
    from sarl_core.mining.validation.cross_fitting import Judged
    from sarl_core.rendering.replay import Replay
    from sarl_core.shielding.leeway import Leeway
    from sarl_core.shielding.shield import Shield

_MOST_RULES = 5


def describe_demonstrations(demonstrations: Demonstrations, path: Path | str) -> dict[str, Any]:
    """What is in demonstrations.

    Args:
        demonstrations: N pairs.
        path: Their file, or what several are called together.

    Returns:
        A document for JSON.
    """
    from sarl_core.demonstrations.derived import formula_texts
    from sarl_core.explaining.words.states import word_shares
    from sarl_core.mining.validation.contradictions import identical_contradictions

    finished = demonstrations.episode_finished
    returns = demonstrations.episode_returns
    return {
        "file": str(path),
        "env_id": demonstrations.env_id,
        "agent": demonstrations.agent,
        "seed": demonstrations.seed,
        "steps": len(demonstrations),
        "episodes": demonstrations.n_episodes,
        "episodes_finished": None if finished is None else int(finished.sum()),
        "lengths": _spread(demonstrations.episode_lengths),
        "returns": None if returns is None else _spread(returns, finished),
        "features": [
            {
                "name": feature.name,
                "unit": feature.unit,
                "word": feature.indicator is not None,
                **_spread(column),
            }
            for feature, column in zip(
                demonstrations.features, demonstrations.observations.T, strict=True
            )
        ],
        "words": word_shares(demonstrations),
        "formulas": list(formula_texts(demonstrations.derived)),
        "actions": [
            _describe_action(dimension, column)
            for dimension, column in zip(
                demonstrations.action_dimensions, demonstrations.action_columns.T, strict=True
            )
        ],
        "columns": [
            {"column": one.column, "use": one.use, "why": one.why} for one in demonstrations.columns
        ],
        "contradictions": int(identical_contradictions(demonstrations).any(axis=1).sum()),
        **describe_oddities(demonstrations),
        "digest": demonstrations.digest,
    }


def describe_oddities(demonstrations: Demonstrations) -> dict[str, Any]:
    """How demonstrations were read, and what is odd about them.

    Args:
        demonstrations: N pairs.

    Returns:
        A document for JSON; notes on reading stand among the warnings too.
    """
    return {
        "notes": list(demonstrations.notes),
        "warnings": list(find_warnings(demonstrations)),
    }


def print_oddities(document: dict[str, Any]) -> None:
    """Print what `describe_oddities` found, if it found anything.

    Args:
        document: What it gave.
    """
    notes = document["notes"]
    terminal.print_lines([f"note: {note}" for note in notes])
    terminal.print_lines(
        [f"warning: {warning}" for warning in document["warnings"] if warning not in notes]
    )


def _describe_action(dimension: ActionDimension, values: NDArray[Any]) -> dict[str, Any]:
    if dimension.kind == "discrete":
        shares = np.bincount(dimension.labels_of(values), minlength=len(dimension.labels)) / len(
            values
        )
        return {
            "name": dimension.name,
            "kind": "discrete",
            "labels": [
                {"action": action, "name": name, "share": share}
                for action, name, share in zip(
                    dimension.actions, dimension.labels, shares.tolist(), strict=True
                )
            ],
        }
    return {
        "name": dimension.name,
        "kind": "interval",
        "low": dimension.low,
        "high": dimension.high,
        "bounds_from": dimension.bounds_from,
        **_spread(values),
    }


def _spread(values: NDArray[Any], counted_in: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Least, median, mean and largest value; of the finished episodes, where some are."""
    numbers = values.astype(np.float64)
    if counted_in is not None and counted_in.any():
        numbers = numbers[counted_in]
    return {
        "min": float(numbers.min()),
        "median": float(np.median(numbers)),
        "mean": float(numbers.mean()),
        "max": float(numbers.max()),
    }


def print_demonstrations(document: dict[str, Any]) -> None:
    """Print what `describe_demonstrations` found.

    Args:
        document: What it gave.
    """
    from sarl_core.mining.language import share_text

    origin = document["env_id"] or "an environment that the file does not name"
    by = f", by {document['agent']}" if document["agent"] else ""
    terminal.print_lines(
        [
            f"{document['file']}: {document['steps']:,} steps of {origin}{by}",
            "",
        ]
    )
    terminal.print_facts(_facts(document))
    terminal.print_table(
        ("feature", "least", "median", "largest"),
        [
            (
                f"{entry['name']} ({entry['unit']})" if entry["unit"] else entry["name"],
                *_numbers(entry),
            )
            for entry in document["features"]
            if not entry["word"]
        ],
    )
    for column, shares in document["words"].items():
        terminal.print_table(
            (column, "share"), [(word, share_text(share)) for word, share in shares.items()]
        )
    _print_actions(document["actions"])
    if document["columns"]:
        terminal.print_table(
            ("column", "taken for", "why"),
            [(one["column"], one["use"], one["why"]) for one in document["columns"]],
        )
    print_oddities(document)
    if not document["warnings"]:
        terminal.print_lines(["No warnings."])


def print_suggestion(previews: Sequence[ColumnPreview], out: Path) -> None:
    """Print what the columns of a table seem to be.

    Args:
        previews: Of the columns.
        out: The file that says so.
    """
    terminal.print_table(
        ("column", "holds", "first values", "role", "why"),
        [
            (
                one.name,
                one.holds,
                ", ".join(one.first),
                "unclear" if one.role is None else str(one.role),
                one.why,
            )
            for one in previews
        ],
    )
    terminal.print_lines([f"Wrote {out}: edit it, then give it to --columns."])


def _print_actions(actions: list[dict[str, Any]]) -> None:
    from sarl_core.mining.language import share_text

    for action in actions:
        if action["kind"] == "discrete":
            terminal.print_table(
                (action["name"], "action", "share"),
                [
                    (label["name"], str(label["action"]), share_text(label["share"]))
                    for label in action["labels"]
                ],
            )
    from sarl_core.decimals import decimal_text, float32_decimal

    intervals = [action for action in actions if action["kind"] == "interval"]
    if intervals:
        terminal.print_table(
            ("action", "bounds", "bounds from", "least", "median", "largest"),
            [
                (
                    action["name"],
                    " to ".join(
                        decimal_text(float32_decimal(action[end])) for end in ("low", "high")
                    ),
                    action["bounds_from"],
                    *_numbers(action),
                )
                for action in intervals
            ],
        )


def _facts(document: dict[str, Any]) -> list[tuple[str, str]]:
    finished = document["episodes_finished"]
    unfinished = "" if finished is None else f" ({finished:,} of them finished)"
    facts = [("episodes", f"{document['episodes']:,}{unfinished}")]
    for name, decimals in (("lengths", 0), ("returns", 1)):
        spread = document[name]
        if spread is not None:
            least, most = (f"{spread[end]:,.{decimals}f}" for end in ("min", "max"))
            facts.append((name, f"mean {spread['mean']:,.1f}, from {least} to {most}"))
    facts.append(
        (
            "contradictions",
            f"{document['contradictions']:,} states were shown with another action too",
        )
    )
    facts += [("formula", text) for text in document["formulas"]]
    return [*facts, ("digest", document["digest"])]


def _numbers(spread: dict[str, float]) -> tuple[str, str, str]:
    from sarl_core.decimals import decimal_text
    from sarl_core.demonstrations.splits import written_value

    numbers = [spread[name] for name in ("min", "median", "max")]
    least, median, largest = (
        decimal_text(written_value(one, [other for other in numbers if other != one], fewest=4))
        for one in numbers
    )
    return least, median, largest


def describe_rules(
    rule_set: RuleSet,
    path: Path,
    tried: Tried | None = None,
    judged: Judged | None = None,
    leeway: Leeway | None = None,
) -> dict[str, Any]:
    """What was mined, without the rules themselves.

    Args:
        rule_set: The rules.
        path: Their file, or what several are called together.
        tried: Which episodes were held out, if any were.
        judged: What the rules are worth elsewhere, if that was asked.
        leeway: What never-rules say of what they were mined from.

    Returns:
        A document for JSON.
    """
    from sarl_core.cli.answers.evidence import describe_judged, describe_tried

    thresholds = rule_set.thresholds
    return {
        "file": str(path),
        "env_id": rule_set.source.env_id,
        "steps": rule_set.source.steps,
        "thresholds": {
            "support": thresholds.support,
            "confidence": thresholds.confidence,
            "lift": thresholds.lift,
            "max_depth": thresholds.max_depth,
            **(
                {}
                if thresholds.never is None
                else {"never": thresholds.never, "demands": thresholds.demands}
            ),
        },
        "divider": rule_set.divider,
        "learner": rule_set.learner,
        "rules": rule_set.rule_count,
        "mean_length": rule_set.mean_length,
        "coverage": (leeway or rule_set).coverage,
        "fidelity": (leeway or rule_set).fidelity,
        **({} if leeway is None else {"freedom": leeway.freedom}),
        "rules_per_dimension": {
            action.name: len(rule_set.of_dimension(index))
            for index, action in enumerate(rule_set.actions)
        },
        **({"held_out": describe_tried(rule_set, tried)} if tried is not None else {}),
        **(
            {"cross_fitted": describe_judged(judged, (leeway or rule_set).fidelity)}
            if judged is not None
            else {}
        ),
    }


def print_learner(trees: Sequence[PolicyTree]) -> None:
    """Print what grew trees, where that is not the exact learner.

    Args:
        trees: Of the same demonstrations.
    """
    from sarl_core.explaining.words.growth import learner_text

    if trees[0].learner != "exact":
        terminal.print_facts([("learner", learner_text(trees[0].learner))])


def print_rules(
    rule_set: RuleSet,
    path: Path,
    tried: Tried | None = None,
    judged: Judged | None = None,
    *,
    elsewhere: str = "--cross-fit",
    leeway: Leeway | None = None,
) -> None:
    """Print what was mined, and the rules that apply most often, in words.

    Args:
        rule_set: The rules.
        path: Their file, or what several are called together.
        tried: Which episodes were held out, if any were.
        judged: What the rules are worth elsewhere, if that was asked.
        elsewhere: The option that would say it.
        leeway: What never-rules say of what they were mined from.
    """
    from sarl_core.cli.answers.evidence import (
        judged_facts,
        none_left,
        rule_line,
        tried_facts,
    )
    from sarl_core.explaining.words.cross_fit import parting_text
    from sarl_core.mining.language import share_text

    facts = [
        ("rules", f"{rule_set.rule_count:,}"),
        ("mean length", f"{rule_set.mean_length:.2f} conditions"),
        (
            "coverage",
            f"{share_text((leeway or rule_set).coverage)} of the demonstrated states have a rule",
        ),
    ]
    if leeway is not None and len(rule_set):
        facts += [
            ("fidelity", f"{share_text(leeway.fidelity)} of these are as the rules say"),
            ("freedom", f"{share_text(leeway.freedom)} of the choice is left there"),
        ]
    elif len(rule_set):
        facts.append(
            ("fidelity", f"{share_text(rule_set.fidelity)} of these carry the rule's action")
        )
    if tried is not None:
        facts += tried_facts(rule_set, tried)
    if judged is not None:
        facts += judged_facts(judged)
    terminal.print_lines([f"Wrote {path}"])
    terminal.print_facts(facts)
    others = [one for one in (judged, tried and tried.judged) if one is not None]
    fidelity = (leeway or rule_set).fidelity
    warnings = [text for one in others if (text := parting_text(fidelity, one))]
    terminal.print_lines([f"warning: {text}" for text in warnings[:1]])
    if not others and len(rule_set):
        terminal.print_lines(
            [
                "Coverage and fidelity are of the states that the rules were mined from, which "
                f"flatters; {elsewhere} says what they are elsewhere."
            ]
        )
    if not len(rule_set):
        terminal.print_lines([none_left(tried, forbids=leeway is not None)])
        return
    often = sorted(rule_set.rules, key=lambda rule: -rule.samples)[:_MOST_RULES]
    terminal.print_lines(["", "The rules that apply most often:"])
    terminal.print_lines(
        f"  {number}. {rule_line(rule, rule_set)}" for number, rule in enumerate(often, 1)
    )


def print_episodes(
    document: dict[str, Any], env_id: str, title: str, shield: Shield | None = None
) -> None:
    """Print what `Episodes.to_dict` holds.

    Args:
        document: What it gave.
        env_id: Environment.
        title: Above the table.
        shield: In force, or None.
    """
    from sarl_core.mining.language import share_text
    from sarl_core.rollouts.failures import safety_facts

    summary = document["summary"]
    terminal.print_lines([title])
    if "file" in document:
        terminal.print_lines([f"Wrote {document['file']}: {document['count']:,} episodes"])
    rows = document.get("episodes", [])
    count = document.get("count", len(rows))
    if rows:
        terminal.print_table(_columns(rows), [_episode(row, _columns(rows)) for row in rows])
    interval = f"95 % interval {summary['iqm_low']:.2f} to {summary['iqm_high']:.2f}"
    terminal.print_facts(
        [
            ("mean return", f"{summary['mean']:.2f} (standard deviation {summary['std']:.2f})"),
            ("IQM of the returns", f"{summary['iqm']:.2f} ({interval})"),
            *safety_facts(summary, count, env_id, shielded=shield is not None),
            ("interventions", f"{share_text(summary['intervention_rate'])} of the steps"),
            *(
                []
                if shield is None
                else [("interventions outside the data", _outside(summary, shield))]
            ),
            ("coverage", f"{share_text(summary['coverage'])} of the steps have a rule"),
            *(
                []
                if "invalid_steps" not in summary
                else [("not checked", _invalid(summary["invalid_steps"]))]
            ),
        ]
    )
    print_notes(document["notes"])


def print_notes(notes: Sequence[str]) -> None:
    """Print what else a person should know, a line each.

    Args:
        notes: Clauses.
    """
    terminal.print_lines([f"note: {note}" for note in notes])


def _outside(summary: dict[str, float], shield: Shield) -> str:
    """How many interventions lie outside the rules' data."""
    from sarl_core.mining.language import share_text

    if not shield.keeps_boxes:
        return "not known: this rule file keeps no data boxes"
    left = ", where the action was left as it is" if shield.outside == "abstain" else ""
    return f"{share_text(summary['outside_rate'])} of the interventions{left}"


def _invalid(count: int) -> str:
    """In how many steps no rule was asked."""
    from sarl_core.mining.language import counted

    if not count:
        return "none: every state and every action was a valid one"
    return (
        f"{counted(count, 'step')}, where the observation was no state or the action none that "
        "there is; the action passed as it was"
    )


def _columns(rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """What is told of each episode: also whether it failed, and what it cost, where it is known."""
    known = tuple(name for name in ("failed",) if any(name in row for row in rows))
    if any(row.get("cost", row.get("failed")) != row.get("failed") for row in rows):
        known += ("cost",)
    return ("seed", "return", "length", *known, "interventions", "covered")


def _episode(row: dict[str, Any], columns: Sequence[str]) -> tuple[str, ...]:
    cells = {name: f"{row[name]:,}" for name in ("length", "interventions", "covered")}
    cells |= {"seed": str(row["seed"]), "return": f"{row['return']:.2f}"}
    cells["failed"] = {True: "yes", False: "no", None: "–"}[row.get("failed")]
    cells["cost"] = f"{row['cost']:,.2f}" if "cost" in row else "–"
    return tuple(cells[name] for name in columns)


def describe_replay(replay: Replay, path: Path, shielded: Sequence[bool]) -> dict[str, Any]:
    """What was rendered.

    Args:
        replay: One episode, or two side by side.
        path: The picture.
        shielded: Whether each panel has a shield.

    Returns:
        A document for JSON.
    """
    return {
        "file": str(path),
        "seconds": replay.seconds,
        "pictures": len(replay),
        "episodes": [
            {"agent": episode.agent, "shielded": has_shield, **episode.to_dict()["episodes"][0]}
            for episode, has_shield in zip(replay.episodes, shielded, strict=False)
        ],
        "notes": list(dict.fromkeys(note for one in replay.episodes for note in one.remarks)),
    }


def print_replay(document: dict[str, Any]) -> None:
    """Print what `describe_replay` found.

    Args:
        document: What it gave.
    """
    terminal.print_lines([f"Wrote {document['file']}: {document['seconds']:.1f} s"])
    columns = _columns(document["episodes"])
    terminal.print_table(
        ("agent", *columns),
        [
            (
                f"{entry['agent']}{', shielded' if entry['shielded'] else ''}",
                *_episode(entry, columns),
            )
            for entry in document["episodes"]
        ],
    )
    terminal.print_lines(
        [
            f"not checked: {_invalid(entry['invalid'])}"
            for entry in document["episodes"]
            if "invalid" in entry
        ]
    )
    print_notes(document["notes"])
