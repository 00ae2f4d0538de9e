"""The part of a report that shows the rules: the first in full, the others in a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Combination
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.distributions import feature_rows
from sarl_core.explaining.report.origin import origin_text
from sarl_core.explaining.report.rule_cards import Card, rule_card, tags
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.tally import Tally
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import conditions_text, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.rendering.example_frames import Examples

MOST_IN_TABLE = 5_000
_MOST_FIRST = 8  # on one slide
_PRINTED_LINES = 150  # of the table; the file itself holds all


@dataclass(frozen=True)
class ShortRule:
    """A rule in one line.

    Attributes:
        name: As "R12", by its place in the rule file.
        title: The rule as a sentence.
        colour: Of its action.
        tags: As "switched off".
    """

    name: str
    title: str
    colour: str
    tags: tuple[str, ...]


@dataclass(frozen=True)
class RuleLine:
    """A rule in a table.

    Attributes:
        name: As "R12", by its place in the rule file.
        action: Its name.
        colour: Of its action.
        when: Its conditions, in signs.
        support: Share of the states to which it applies.
        samples: Number of those.
        confidence: Share of those with its action; of rules that forbid, in words.
        tags: As "switched off".
    """

    name: str
    action: str
    colour: str
    when: str
    support: str
    samples: str
    confidence: str
    tags: tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """The rules of one action dimension.

    Attributes:
        name: Of the dimension; "" where there is only one.
        cards: Rules in full.
    """

    name: str
    cards: tuple[Card, ...]


@dataclass(frozen=True)
class Rules:
    """The rules.

    Attributes:
        count: How many there are.
        first: Those that apply most often, whichever action they speak of and whoever placed them.
        introduction: What is shown how, in sentences.
        beneath: What stands under each rule, as a sentence.
        headings: Of the columns for what a rule says and what the expert did.
        groups: Rules in full, by action dimension.
        lines: The others.
        printed: How many of those are printed.
        left_out: Number of rules that are not even in the table.
    """

    count: int
    first: tuple[ShortRule, ...]
    introduction: tuple[str, ...]
    beneath: str
    headings: tuple[str, str]
    groups: tuple[Group, ...]
    lines: tuple[RuleLine, ...]
    printed: int
    left_out: int


def in_order(rule_set: RuleSet, most: int) -> tuple[list[int], list[int]]:
    """Which rules are shown in full, and which in a table.

    Args:
        rule_set: The rules.
        most: So many in full, the same number of each action dimension as far as there are.

    Returns:
        Indices: those in full by dimension and support; the others likewise. Rules that a person
        placed come first, in their order.
    """
    queues = []
    for dimension in range(len(rule_set.actions)):
        own = [index for index, rule in enumerate(rule_set.rules) if rule.dimension == dimension]
        own.sort(key=lambda index: _rank(rule_set.rules[index]))
        queues.append(own)
    shares = [0] * len(queues)
    for _ in range(min(most, len(rule_set.rules))):
        open_ones = [place for place, own in enumerate(queues) if shares[place] < len(own)]
        shares[min(open_ones, key=lambda place: shares[place])] += 1
    full = [index for own, share in zip(queues, shares, strict=True) for index in own[:share]]
    rest = [index for own, share in zip(queues, shares, strict=True) for index in own[share:]]
    rest.sort(key=lambda index: _rank(rule_set.rules[index]))
    return full, rest


def _rank(rule: Rule) -> tuple[bool, float]:
    return (not rule.placed, 0.0 if rule.placed else -rule.support)


def rules_part(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    tally: Tally,
    order: tuple[Sequence[int], Sequence[int]],
    examples: Examples | None,
    card: RuleSetCard,
) -> Rules:
    """The rules, the first in full.

    Args:
        rule_set: The rules.
        demonstrations: Of the report.
        tally: The rules on them.
        order: As `in_order` gives it.
        examples: Frames at which rules applied, None without pictures.
        card: Of the rules.

    Returns:
        The part of the report.
    """
    full, rest = order
    ranges = feature_rows(demonstrations)
    groups = []
    for dimension, action in enumerate(rule_set.actions):
        cards = tuple(
            rule_card(rule_set, index, demonstrations, tally, ranges, examples)
            for index in full
            if rule_set.rules[index].dimension == dimension
        )
        if cards:
            groups.append(Group(action.name if len(rule_set.actions) > 1 else "", cards))
    lines = tuple(_line(rule_set, index) for index in rest[:MOST_IN_TABLE])
    return Rules(
        count=len(rule_set.rules),
        first=_first(rule_set, demonstrations),
        introduction=(
            *_introduction(rule_set, demonstrations, tally, card, len(full), len(rest)),
            *_on_combinations(rule_set, full),
        ),
        beneath=_beneath(rule_set),
        headings=("What it says", "Expert") if rule_set.forbids else ("Do", "Expert did so"),
        groups=tuple(groups),
        lines=lines,
        printed=_PRINTED_LINES,
        left_out=max(len(rest) - MOST_IN_TABLE, 0),
    )


def _first(rule_set: RuleSet, demonstrations: Demonstrations) -> tuple[ShortRule, ...]:
    """The rules in force by support, and after them those that are switched off."""

    def support(rule: Rule) -> float:
        if rule.samples or rule.origin != "manual":
            return rule.support
        # It was written where there was nothing to count it on.
        return float(rule.applies(demonstrations.observations).mean())

    rules = sorted(rule_set.rules, key=lambda rule: (not rule.enabled, -support(rule)))
    return tuple(
        ShortRule(
            name=rule_set.name_of(rule),
            title=sentence(rule, rule_set, evidence=False),
            colour=label_colour(rule.label),
            tags=tags(rule),
        )
        for rule in rules[:_MOST_FIRST]
    )


def _beneath(rule_set: RuleSet) -> str:
    kinds = {(rule.kind, rule.origin == "probed") for rule in rule_set.rules}
    texts = {
        ("do", False): "the expert did what it says",
        ("never", False): "the expert did not do what it forbids",
        ("never", True): "the expert failed after what it forbids, when that was tried",
    }
    clauses = [text for kind, text in texts.items() if kind in kinds]
    here = (
        " And in how many of this report's states the expert did not do it."
        if ("never", True) in kinds
        else ""
    )
    return f"Under each rule: in how many of its states {', or '.join(clauses)}.{here}"


def _on_combinations(rule_set: RuleSet, full: Sequence[int]) -> tuple[str, ...]:
    """How the pictures of combinations are read, where a rule in full has one."""
    features = rule_set.source.features
    names = (
        features[bounds.feature].name
        for index in full
        for bounds in rule_set.rules[index].bounds
        if isinstance(features[bounds.feature].derived, Combination)
    )
    first = next(names, None)
    if first is None:
        return ()
    return (
        f"Some conditions are about two features together, as “{first}”. Each is drawn under its "
        "rule: the two features are the axes, a point is a demonstrated state in the colour of "
        "what the expert did there, and the condition holds in the shaded part, up to the line. "
        "The rule's other conditions must hold as well; so there are points of other colours too.",
    )


def _introduction(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    tally: Tally,
    card: RuleSetCard,
    full: int,
    rest: int,
) -> tuple[str, ...]:
    if not rule_set.rules:
        return (
            "There is no rule: no part of the tree reaches the thresholds. Such a shield leaves "
            "every action as it is.",
        )
    only_one = not any(rule.placed for rule in rule_set.rules) and not rule_set.forbids
    applying = (
        "In a state at most one rule for each action applies; where none does, the agent acts as "
        "it likes."
        if only_one
        else "Several may apply; the first, in this order, decides. Where none applies, the agent "
        "acts as it likes."
    )
    if only_one and tally.coverage == 1.0:
        each = " of each action dimension" if len(rule_set.actions) > 1 else ""
        applying = (
            f"In every demonstrated state exactly one rule{each} applies, and it decides: whoever "
            "is held to the rules has no choice of their own there."
        )
    if rule_set.forbids:
        applying = (
            "A rule that forbids takes an action away and leaves the others to the agent. Several "
            "may apply: what any of them forbids is replaced by what the expert did most often "
            "there of what none forbids. "
        )
        if any(not rule.forbids for rule in rule_set.rules):
            applying += "Where a rule applies that says what to do, it decides. "
        applying += "Where none applies, the agent acts as it likes."
    if any(not rule.enabled for rule in rule_set.rules):
        applying += " A rule that is switched off decides nothing."
    sentences = [f"Of several conditions in a rule all must hold. {applying}"]
    if rest:
        sentences.append(_division(rule_set, full, rest))
    if not tally.same:
        sentences.append(origin_text(rule_set, demonstrations, tally, card))
    return tuple(sentences)


def _division(rule_set: RuleSet, full: int, rest: int) -> str:
    """Which rules are shown in full and which in a table, as a sentence."""
    if not full:
        return f"There {'is 1 rule' if rest == 1 else f'are {rest:,} rules'}, in a table."
    each = ", as many of each action," if len(rule_set.actions) > 1 else ""
    which = f"The {full:,} that apply most often{each} are shown in full"
    if any(rule.placed for rule in rule_set.rules):
        which = (
            f"{full:,}{each} are shown in full, first those that a person placed and then those "
            "that apply most often"
        )
    return (
        f"There are {len(rule_set.rules):,} rules. {which}; the other {rest:,} stand in a table "
        "after them."
    )


def _line(rule_set: RuleSet, index: int) -> RuleLine:
    rule = rule_set.rules[index]
    return RuleLine(
        name=rule_set.name_of(rule),
        action=says_text(rule, rule_set.actions[rule.dimension]),
        colour=label_colour(rule.label),
        when=conditions_text(rule, rule_set),
        support=share_text(rule.support),
        samples=f"{rule.samples:,}",
        confidence=_did(rule, rule_set) if rule.samples else "–",
        tags=tags(rule),
    )


def _did(rule: Rule, rule_set: RuleSet) -> str:
    share = share_text(rule.confidence)
    if rule.origin == "probed":
        return f"failed after it in {share}"
    if rule_set.forbids:
        return f"did {'not' if rule.forbids else 'so'} in {share}"
    return share
