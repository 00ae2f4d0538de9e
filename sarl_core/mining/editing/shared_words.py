"""Two rule sets over the same columns of words of which each knows words of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.demonstrations.words import columns_of_words, words_of
from sarl_core.errors import quoted
from sarl_core.mining.editing.shared_derived import deriving_alike
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule


class SharedWords(NamedTuple):
    """Two rule sets that know the same words.

    Attributes:
        first: A rule set.
        second: Another.
        notes: Which words each did not know.
    """

    first: RuleSet
    second: RuleSet
    notes: tuple[str, ...]


class _Own(NamedTuple):
    """Where a rule set has what a feature of the shared ones says.

    Attributes:
        at: Place of its own feature, None where it has none that says so.
        turned: Whether that is 0 where the shared one is 1.
    """

    at: int | None
    turned: bool = False


def in_shared_words(first: RuleSet, second: RuleSet) -> SharedWords:
    """Let two rule sets know each other's words and derived features, for a comparison.

    No condition of a rule becomes another one: of two words, "not heavy" stays "not heavy".

    Args:
        first: A rule set.
        second: Another.

    Returns:
        The same objects where both know the same, or have other columns of words.
    """
    first, second = deriving_alike(first, second)
    words = [_words(each.source.features) for each in (first, second)]
    differing = {
        column: tuple(dict.fromkeys((*known, *words[1][column])))
        for column, known in words[0].items()
        if column in words[1] and {*known} != {*words[1][column]}
    }
    if not differing:
        return SharedWords(first, second, ())
    names = {
        one.indicator: one.name
        for each in (second, first)
        for one in each.source.features
        if one.indicator is not None and not one.indicator.otherwise
    }
    notes = tuple(
        f"the {which} rules do not know the {column} "
        f"{' and '.join(map(quoted, unknown))}: where it is that, to them it is none of theirs"
        for column, known in differing.items()
        for which, own in zip(("first", "second"), words, strict=True)
        if (unknown := [word for word in known if word not in own[column]])
    )
    return SharedWords(_widened(first, differing, names), _widened(second, differing, names), notes)


def _words(features: Sequence[Feature]) -> dict[str, tuple[str, ...]]:
    """The words that each column is known to hold."""
    indicators = [one.indicator for one in features]
    return {
        column: words_of([one for at in places if (one := indicators[at]) is not None])
        for column, places in columns_of_words(indicators).items()
    }


def _widened(
    rule_set: RuleSet, words: dict[str, tuple[str, ...]], names: dict[Indicator, str]
) -> RuleSet:
    """The same rules over features that say more words."""
    features: list[Feature] = []
    origin: list[_Own] = []
    done: set[str] = set()
    own = rule_set.source.features
    for at, feature in enumerate(own):
        column = feature.indicator.column if feature.indicator is not None else ""
        if column not in words:
            features.append(feature)
            origin.append(_Own(at))
        elif column not in done:
            done.add(column)
            for word in words[column]:
                indicator = Indicator(column, word)
                features.append(Feature(names.get(indicator, indicator.name), "", indicator))
                origin.append(_own_of(own, indicator))
    places = {one.at: place for place, one in enumerate(origin) if not one.turned}
    return replace(
        rule_set,
        rules=tuple(_moved(rule, places, origin) for rule in rule_set.rules),
        source=replace(rule_set.source, features=tuple(features)),
    )


def _own_of(features: Sequence[Feature], wanted: Indicator) -> _Own:
    for at, feature in enumerate(features):
        one = feature.indicator
        if one is not None and one.column == wanted.column:
            if one.value == wanted.value:
                return _Own(at)
            if one.otherwise == wanted.value:
                return _Own(at, turned=True)
    return _Own(None)


def _moved(rule: Rule, places: dict[int | None, int], origin: Sequence[_Own]) -> Rule:
    return replace(
        rule,
        conditions=tuple(
            Condition(places[feature], op, threshold) for feature, op, threshold in rule.conditions
        ),
        box=None if rule.box is None else _wide_box(rule.box, origin),
    )


def _wide_box(box: DataBox, origin: Sequence[_Own]) -> DataBox:
    """What was not known was never there."""
    opposite = DataBox(box.most, box.high, box.low, box.least)
    return DataBox(
        *(
            tuple(
                0.0 if one.at is None else 1.0 - turned[one.at] if one.turned else bound[one.at]
                for one in origin
            )
            for bound, turned in zip(box, opposite, strict=True)
        )
    )
