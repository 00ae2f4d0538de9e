"""The difference of two rule sets as columns of tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import extend
from sarl_core.explaining.words.difference import said_text, what_text
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.action_words import label_text, says_text
from sarl_core.mining.language import conditions_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import Rule
from sarl_core.shielding.disagreement import Disagreement

KINDS = ("added", "removed", "changed")
NO_ID = "–"


def rule_rows(disagreement: Disagreement, kinds: tuple[str, ...] = KINDS) -> dict[str, list[Any]]:
    """Rules that were added, removed or changed.

    Args:
        disagreement: The comparison.
        kinds: Which of them.

    Returns:
        Column name to one value a rule; of each kind the largest rules first.
    """
    difference = disagreement.difference
    entries: list[tuple[str, Rule, RuleSet, str]] = []
    if "changed" in kinds:
        entries += [
            (
                "changed",
                change.after,
                disagreement.second,
                what_text(change, disagreement, beside=True),
            )
            for change in difference.changed
        ]
    for kind, rules, rule_set in (
        ("added", difference.added, disagreement.second),
        ("removed", difference.removed, disagreement.first),
    ):
        if kind in kinds:
            entries += [
                (kind, rule, rule_set, "") for rule in sorted(rules, key=lambda one: -one.samples)
            ]
    return {
        "What": [kind for kind, *_ in entries],
        "Rule": [rule_set.name_of(rule) for _, rule, rule_set, _ in entries],
        "Action": [
            says_text(rule, rule_set.actions[rule.dimension]) for _, rule, rule_set, _ in entries
        ],
        "When": [conditions_text(rule, rule_set) for _, rule, rule_set, _ in entries],
        "Change": [text for *_, text in entries],
        "States": [rule.samples for _, rule, _, _ in entries],
    }


def example_rows(
    disagreement: Disagreement,
    dimension: int,
    states: NDArray[np.float32],
    *,
    names: tuple[str, str],
    demonstrations: Demonstrations | None = None,
    most: int = 50,
) -> dict[str, list[Any]]:
    """Some states of which the two say different things.

    Args:
        disagreement: The comparison.
        dimension: Action dimension.
        states: What was compared, (B, d).
        names: What the two sets are called.
        demonstrations: Where the states are theirs: episode, step and what the expert did.
        most: Number of states, spread evenly over all there are.

    Returns:
        Column name to one value a state.
    """
    rows = np.flatnonzero(disagreement.differs[:, dimension])
    if len(rows) > most:
        rows = rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]
    columns: dict[str, list[Any]] = {}
    if demonstrations is not None:
        assert demonstrations.steps is not None
        columns["Episode"] = demonstrations.episodes[rows].tolist()
        columns["Step"] = demonstrations.steps[rows].tolist()
    for name, rule_set, rules, labels in zip(
        names,
        (disagreement.first, disagreement.second),
        disagreement.rules,
        disagreement.labels,
        strict=True,
    ):
        action = rule_set.actions[dimension]
        choices = disagreement.choices[dimension]
        says = [said_text(label, action, choices) for label in labels[rows, dimension].tolist()]
        columns[f"{_capital(name)} says"] = says
        columns[f"Rule, {name}"] = [
            ", ".join(map(rule_set.name_of, _deciding(rule_set, index, state))) or NO_ID
            for index, state in zip(rules[rows, dimension].tolist(), states[rows], strict=True)
        ]
    if demonstrations is not None:
        action = disagreement.first.actions[dimension]
        did = action.labels_of(demonstrations.action_columns[rows, dimension]).tolist()
        columns["Expert did"] = [
            label_text(label, action) if 0 <= label < action.n_labels else NO_ID for label in did
        ]
    for column in state_columns(disagreement.first.source.features):
        columns[column.title] = (
            list(column.words(states[rows]))
            if column.of_words
            else states[rows, column.places[0]].tolist()
        )
    return columns


def _deciding(rule_set: RuleSet, index: int, state: NDArray[np.float32]) -> list[Rule]:
    """The rule that decides a state; of rules that forbid, all that apply."""
    if index == NO_RULE:
        return []
    first = rule_set.rules[index]
    if not first.forbids:
        return [first]
    extended = extend(state[None], rule_set.source.features)
    return [
        rule
        for rule in rule_set.rules
        if rule.forbids
        and rule.enabled
        and rule.dimension == first.dimension
        and rule.applies(extended)[0]
    ]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
