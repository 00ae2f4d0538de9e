"""The part of a report that says which rules were kept, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sarl_core.documents import fitting
from sarl_core.explaining.colours import layer_colour
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.tally import Tally
from sarl_core.mining.edit_counts import edits_sentence
from sarl_core.mining.language import counted, number_text, share_text, threshold_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import FILTERED, NAMED_SETTINGS, UNFILTERED, Thresholds
from sarl_core.mining.thresholds.landscape import Landscape, threshold_landscape
from sarl_core.mining.tree import PolicyTree
from sarl_core.rollouts.failures import rate_text

# Fine where the rules change fast: at small supports and high confidences.
_CHOSEN = "these thresholds"
_SUPPORTS = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
_CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)


@dataclass(frozen=True)
class Cell:
    """A pair of thresholds.

    Attributes:
        count: Number of rules, short.
        ground: Its colour.
        ink: Of the number on it.
        chosen: Whether it is the pair in force.
    """

    count: str
    ground: str
    ink: str
    chosen: bool


@dataclass(frozen=True)
class Plane:
    """The number of rules at pairs of thresholds.

    Attributes:
        supports: Headings of the columns.
        rows: Minimum confidence and its cells, the strictest first.
    """

    supports: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


@dataclass(frozen=True)
class Neighbour:
    """What thresholds give.

    Attributes:
        name: As "half the support", or "these".
        thresholds: In words.
        rules: Their number.
        length: Conditions a rule.
        covered: Share of states with a rule.
        followed: Share of those in which the expert did what the rule says.
        chosen: Whether they are in force.
    """

    name: str
    thresholds: str
    rules: str
    length: str
    covered: str
    followed: str
    chosen: bool


@dataclass(frozen=True)
class ThresholdsPart:
    """Which rules were kept, and why.

    Attributes:
        sentences: In words.
        plane: None where no thresholds cut the rules.
        plane_text: What the plane shows, in words.
        neighbours: What other thresholds give.
        card: Names and values from the card of the rule file.
    """

    sentences: tuple[str, ...]
    plane: Plane | None
    plane_text: str
    neighbours: tuple[Neighbour, ...]
    card: tuple[tuple[str, str], ...]


def thresholds_part(
    rule_set: RuleSet,
    tally: Tally,
    trees: Sequence[PolicyTree] | None,
    card: Mapping[str, Any] | None,
) -> ThresholdsPart:
    """Which rules were kept, and why.

    Args:
        rule_set: The rules.
        tally: Of them on the demonstrations of the report.
        trees: Grown from those demonstrations; None for rules that no thresholds cut.
        card: Of the rule file, None without one.

    Returns:
        The part of the report.
    """
    entries = fitting(card, RuleSetCard)
    facts = tuple(_card_facts(entries, forbids=rule_set.forbids))
    edits = edits_sentence(rule_set)
    then = (edits,) if edits else ()
    if rule_set.forbids:
        return ThresholdsPart((*_forbidding(rule_set), *then), None, "", (), facts)
    if rule_set.cut == "leaves" or trees is None:
        return ThresholdsPart((*_built(rule_set, entries), *then), None, "", (), facts)
    limits = rule_set.thresholds
    supports = [support for support in _SUPPORTS if support >= _least(trees)]
    landscape = _landscape(trees, limits, supports, _CONFIDENCES)
    same = (
        ""
        if tally.same
        else " All of this counts every demonstration of this report. The rules of this report "
        "were made from others, or from a part of them: the same thresholds make other rules here, "
        "whose numbers are not theirs."
    )
    text = (
        "Each cell holds the number of rules that its pair of thresholds gives; darker is more. "
        f"The framed cell is the pair that was chosen.{same}"
    )
    if edits:
        text += " It counts the rules as they were mined, before the changes by hand."
    sentences = (*_cut(rule_set), *then)
    return ThresholdsPart(
        sentences, _plane(landscape, limits), text, _neighbours(trees, limits), facts
    )


# --- thresholds --------------------------------------------------------------------------------


def _cut(rule_set: RuleSet) -> tuple[str, ...]:
    limits, steps = rule_set.thresholds, rule_set.source.steps
    least = math.ceil(limits.support * steps - 1e-9)
    sentences = [
        "Rules come from a decision tree: conditions on the state, tried one after the other. "
        "Each way through the tree ends at the first point that is good enough to be a rule.",
        f"A rule was kept if it applies to at least {share_text(limits.support)} of the "
        f"states that the rules were made from ({counted(max(least, 1), 'state')} of {steps:,}; "
        "this share is its support), and if the expert did what the rule says in at least "
        f"{share_text(limits.confidence)} of those (its confidence).",
    ]
    if limits.lift > 0:
        sentences.append(
            "It also had to name its action at least "
            f"{number_text(limits.lift)} times as often as the action occurs in all states "
            "(its lift)."
        )
    if limits.max_depth is not None:
        sentences.append(f"No rule may have more than {counted(limits.max_depth, 'condition')}.")
    named = [name for name, pair in NAMED_SETTINGS.items() if pair == limits]
    sentences.append(
        f"This is the setting “{named[0]}” of the paper behind the method."
        if named
        else "These thresholds were chosen by whoever made the rules; they are not one of the two "
        "settings that the paper behind the method names."
    )
    if any(action.is_interval for action in rule_set.actions):
        sentences.append(
            f"Each continuous action was divided into {rule_set.divider} equal intervals, and a "
            "rule names one of them."
        )
    return tuple(sentences)


def _forbidding(rule_set: RuleSet) -> tuple[str, ...]:
    """How rules came about of which some forbid."""
    limits = rule_set.thresholds
    sentences: list[str] = []
    if any(not rule.forbids for rule in rule_set.rules):
        sentences += _cut(rule_set)
    if any(rule.origin == "probed" for rule in rule_set.rules):
        sentences.append(
            "Rules that forbid follow from probes here: in states that an agent came to, each "
            "action was tried, and the expert went on from there. A leaf of a decision tree over "
            "the outcomes forbids an action where the expert failed after it in more than "
            f"{share_text(limits.confidence)} of the states, and never what the expert does most "
            "often there."
        )
    elif limits.never is not None:
        sentences.append(
            "Rules that forbid come from a decision tree: conditions on the state, tried one after "
            "the other. A rule was kept if it applies to at least "
            f"{share_text(limits.support)} of the {counted(rule_set.source.steps, 'state')} (its "
            "support), and if the expert did what it forbids in at most "
            f"{share_text(limits.never)} of those (epsilon), counted by the upper bound of what so "
            "few or so many states can tell."
        )
    sentences.append(
        "How many rules other thresholds would give is not drawn here: that picture is about rules "
        "that demand an action."
    )
    return tuple(sentences)


def _landscape(
    trees: Sequence[PolicyTree],
    limits: Thresholds,
    supports: Sequence[float],
    confidences: Sequence[float],
) -> Landscape:
    """The landscape of a grid that has the thresholds in force among its lines."""
    return threshold_landscape(
        trees,
        np.unique([*supports, limits.support]),
        np.unique([*confidences, limits.confidence]),
        lift_min=limits.lift,
        max_depth=limits.max_depth,
    )


def _plane(landscape: Landscape, limits: Thresholds) -> Plane:
    counts = landscape.rule_count
    # From one rule to thousands: by powers of ten.
    depth = np.log10(1.0 + counts) / max(float(np.log10(1.0 + counts.max())), 1e-9)
    rows = []
    for column in range(len(landscape.confidences) - 1, -1, -1):
        confidence = float(landscape.confidences[column])
        cells = []
        for row, support in enumerate(landscape.supports.tolist()):
            ground, ink = layer_colour(float(depth[row, column]))
            chosen = support == limits.support and confidence == limits.confidence
            cells.append(Cell(f"{int(counts[row, column]):,}", ground, ink, chosen))
        rows.append((_short(confidence), tuple(cells)))
    return Plane(tuple(_short(float(support)) for support in landscape.supports), tuple(rows))


def _short(share: float) -> str:
    """A threshold as a percentage, without its sign."""
    return threshold_text(float(np.round(100 * share, 6)))


def _least(trees: Sequence[PolicyTree]) -> float:
    """The least minimum support at which the trees know all rules."""
    return max(tree.least_support for tree in trees)


def _neighbours(trees: Sequence[PolicyTree], limits: Thresholds) -> tuple[Neighbour, ...]:
    support, confidence = limits.support, limits.confidence
    pairs: dict[str, tuple[float, float]] = {_CHOSEN: (support, confidence)}
    if support > 0:
        pairs["half the support"] = (support / 2, confidence)
        pairs["twice the support"] = (min(2 * support, 1.0), confidence)
    else:
        pairs["some support"] = (FILTERED.support, confidence)
    pairs["less confidence"] = (support, max(confidence - 0.05, 0.0))
    if confidence < 1:
        pairs["more confidence"] = (support, float(np.round((confidence + 1) / 2, 6)))
    for name, setting in (("“filtered”", FILTERED), ("“unfiltered”", UNFILTERED)):
        pairs[name] = (setting.support, setting.confidence)
    neighbours: dict[tuple[float, float], Neighbour] = {}
    for name, pair in pairs.items():
        if pair in neighbours or pair[0] < _least(trees):
            continue
        at = _landscape(trees, Thresholds(*pair, limits.lift, limits.max_depth), (), ())
        neighbours[pair] = Neighbour(
            name=name,
            thresholds=f"{_short(pair[0])} %, {_short(pair[1])} %",
            rules=f"{int(at.rule_count[0, 0]):,}",
            length=f"{float(at.mean_length[0, 0]):.1f}",
            covered=share_text(float(at.coverage[0, 0])),
            followed=share_text(float(at.fidelity[0, 0])),
            chosen=name == _CHOSEN,
        )
    return tuple(neighbours.values())


# --- a budget ----------------------------------------------------------------------------------


def _built(rule_set: RuleSet, card: RuleSetCard) -> tuple[str, ...]:
    if rule_set.cut != "leaves":
        return _cut(rule_set)
    sentences = [
        "These rules were not cut out by thresholds. A tree of a few conditions was built so that "
        f"in every state exactly one rule{_of_each(rule_set)} applies: few rules that do as much "
        "as possible. So these rules leave an agent nothing to choose from: they are a policy that "
        "replaces it, and no longer a shield that corrects it here and there.",
    ]
    if card.budget is not None:
        rounds_text = (
            f" In {counted(len(card.rounds), 'round')} the rules were let act, the expert was "
            "asked what it would have done in the states they led to, and the rules were built "
            "anew from all its answers."
            if card.rounds
            else ""
        )
        sentences.append(f"The budget was {card.budget:,} rules{_of_each(rule_set)}.{rounds_text}")
        if card.refined:
            sentences.append(
                "Then the thresholds in the rules were moved to where the rules achieve more "
                "when they act. They are therefore no plain record of what the expert did most "
                "often: a rule may say what only a part of its states show."
            )
    sentences.append(
        "So judge these rules by what they achieve (see the card below and the comparison), and "
        "read the share of states in which the expert did the same as how far they follow it."
    )
    return tuple(sentences)


def _of_each(rule_set: RuleSet) -> str:
    """Of each what there is one rule, where there are several."""
    return " of each action dimension" if len(rule_set.actions) > 1 else ""


def _card_facts(card: RuleSetCard, *, forbids: bool) -> Iterator[tuple[str, str]]:
    """What a card says."""
    agent = "an agent under the rules" if forbids else "an agent that follows the rules"
    if card.budget is not None:
        yield "Most rules", number_text(card.budget)
    if card.rounds:
        choice = _with(", of which the rules of round {} were taken", card.chosen_round)
        rounds = "Rounds of probes" if forbids else "Rounds of asking the expert"
        yield rounds, f"{len(card.rounds)}{choice}"
    if card.refined is not None:
        yield "Thresholds moved to achieve more", "yes" if card.refined else "no"
    if card.chosen_by is not None:
        yield "Chosen by", card.chosen_by
    reported = card.reported_episodes
    if reported.mean is not None:
        yield (
            f"Mean return of {agent}",
            number_text(reported.mean)
            + _with(" ± {}", reported.std)
            + _with(", from {} to {}", reported.min, reported.max)
            + _with(", over {} episodes", reported.episodes),
        )
    rate = reported.rate
    if rate is not None:
        yield f"Failures of {agent}", rate_text(rate)
    if reported.worst_tenth is not None:
        yield "Mean return of the worst tenth of them", number_text(reported.worst_tenth)
    cost = _with("{} an episode", reported.cost)
    if cost and not (rate and reported.cost == rate.rate):
        between = _with(" (95 % interval {} to {})", reported.cost_low, reported.cost_high)
        yield f"Cost of {agent}", cost + between
    if card.reported_on is not None:
        yield "Measured on", card.reported_on
    if card.seed is not None:
        yield "Seed", number_text(card.seed)
    if card.command is not None:
        yield "Made by", card.command


def _with(text: str, *numbers: float | None) -> str:
    """A text with numbers in its gaps; nothing where one of them is not known."""
    known = [number_text(one) for one in numbers if one is not None]
    return text.format(*known) if len(known) == len(numbers) else ""
