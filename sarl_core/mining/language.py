"""Rules in plain language: names, units, merged intervals; numbers rounded for display only."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import extended_state
from sarl_core.environments.formulas import Formula
from sarl_core.mining.action_words import action_text, says_text
from sarl_core.mining.digits import limit_texts
from sarl_core.mining.rule_contents import RuleContents
from sarl_core.mining.rules import Bounds, Condition, Rule, share_bounds

_DIGITS = 3
_OFF = 0.1  # of the difference of two numbers, that each may be off
_LONGEST = 120
_IS = " is "
_IS_NOT = " is not "
_FLAG_WORDS = ("contact",)
_THE = "the {}".format


def number_text(value: float, *, apart_from: float | None = None) -> str:
    """A number for people: three significant digits, more where two lie near each other.

    Args:
        value: Any finite number.
        apart_from: Another number shown beside it; the difference of the two is not lost.

    Returns:
        As "0.0213" or "-12".
    """
    apart = math.inf if apart_from is None else abs(value - apart_from)
    for digits in range(_DIGITS, 18):
        text = _rounded(value, digits)
        if not apart or abs(float(text) - value) <= _OFF * apart:
            return text if apart_from is None else decimal_text(float(text))
    return decimal_text(value)


def _rounded(value: float, digits: int) -> str:
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def threshold_text(value: float) -> str:
    """A threshold with every digit it has, and without an exponent.

    Args:
        value: 0 to 1, or any other number.

    Returns:
        As "0.00005"; reads back as the same number.
    """
    return np.format_float_positional(value, trim="-")


def limit_text(share: float) -> str:
    """A threshold of support or confidence for people: as it was chosen, where that is short.

    Args:
        share: 0 to 1.

    Returns:
        As "0.005" or "0.002 %".
    """
    text, end = threshold_text(share), 100.0 if share > 0.5 else 0.0
    long = len(text) > len("0.0046")
    return f"{number_text(100 * share, apart_from=end)} %" if long else text


def counted(count: int, noun: str) -> str:
    """A number of things.

    Args:
        count: How many.
        noun: One of them; an "s" makes it many.

    Returns:
        As "1 condition" or "1,200 conditions".
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def listed(names: Sequence[str], *, most: int) -> str:
    """Names one after the other.

    Args:
        names: Any number.
        most: So many are named, the others counted.

    Returns:
        As "wind, load and height", or "wind, load and 3 others"; "" without any.
    """
    more = len(names) - most
    every = [*names] if more <= 0 else [*names[:most], f"{more:,} other{'s' if more > 1 else ''}"]
    return " and ".join(filter(None, (", ".join(every[:-1]), *every[-1:])))


def share_text(share: float, *, decimals: int | None = None) -> str:
    """A share as a percentage that never rounds up to all or down to none.

    Args:
        share: 0 to 1, or NaN where there is nothing to share.
        decimals: At least so many; where not given, as many as tell something.

    Returns:
        As "97 %", "99.96 %", "< 0.01 %"; "–" for NaN.
    """
    if math.isnan(share):
        return "–"
    if share in (0.0, 1.0):
        return "100 %" if share else "0 %"
    fewest = decimals if decimals is not None else 0 if 0.1 <= share < 0.9 else 1
    for digits in range(fewest, 3):
        text = f"{100 * share:.{digits}f}"
        if float(text) not in (0.0, 100.0):
            if decimals is None and "." in text:
                text = text.rstrip("0").rstrip(".")
            return f"{text} %"
    return "< 0.01 %" if share < 0.5 else "> 99.99 %"


def at_least_text(share: float, unknown: int) -> str:
    """A share of which some are not known, and so may be more.

    Args:
        share: Of what is known to be so.
        unknown: How many are not known.

    Returns:
        As "15 %", or "at least 15 %".
    """
    return f"at least {share_text(share)}" if unknown else share_text(share)


def is_flag(feature: Feature, bounds: Bounds) -> bool:
    """Whether bounds on a feature say no more than yes or no, as those on a contact do.

    Args:
        feature: Its name tells, and its demonstrated values, where they are known.
        bounds: What is asked of it.

    Returns:
        True for one bound between 0 and 1 on a feature such as "left leg contact" or "gear is 2",
        or on one that says which word a column holds.
    """
    one = math.isinf(bounds.low) != math.isinf(bounds.high)
    threshold = bounds.high if math.isinf(bounds.low) else bounds.low
    if feature.derived is not None:
        return False
    if feature.indicator is not None:
        return one and 0.0 <= threshold < 1.0
    named = _states(feature) or any(word in feature.name.lower().split() for word in _FLAG_WORDS)
    # A force of contact has values in between, and is asked for more than yes or no.
    binary = feature.splits is None or feature.splits.binary
    return named and binary and one and not feature.unit and 0.0 <= threshold < 1.0


def flag_text(feature: Feature, bounds: Bounds) -> str:
    """What a flag is asked for, in a few words.

    Args:
        feature: Of which `is_flag` is true.
        bounds: What is asked of it.

    Returns:
        As "mode is heavy", or "no left leg contact".
    """
    holds = math.isinf(bounds.high)
    if feature.indicator is not None:
        return feature.statement(holds)
    if _states(feature):
        return feature.name if holds else feature.name.replace(_IS, f"{_IS}not ", 1)
    return f"{'' if holds else 'no '}{feature.name}"


def least_conditions(rule: Rule, features: Sequence[Feature]) -> tuple[tuple[Bounds, ...], ...]:
    """The least that says what a rule asks: of a column of words exactly one is the case.

    Args:
        rule: Any.
        features: All features.

    Returns:
        One entry a feature or a column of words, in the order of the rule. It is one interval; or
        several, where several of a column's words are not to be the case and two or more are left.
    """
    by_thing: dict[int | str, list[Bounds]] = {}
    for one in rule.bounds:
        feature = features[one.feature]
        of_words = feature.indicator is not None and not feature.indicator.otherwise
        if of_words and is_flag(feature, one):
            assert feature.indicator is not None
            by_thing.setdefault(feature.indicator.column, []).append(one)
        else:
            by_thing[one.feature] = [one]
    return tuple(
        entry
        for thing, bounds in by_thing.items()
        for entry in (_least(thing, bounds, features) if isinstance(thing, str) else [(bounds[0],)])
    )


def _least(
    column: str, bounds: Sequence[Bounds], features: Sequence[Feature]
) -> list[tuple[Bounds, ...]]:
    """The same of one column of words."""
    holding = [one for one in bounds if math.isinf(one.high)]
    if holding:  # the others say no more; two of them hold nowhere, which is said
        return [(one,) for one in holding]
    excluded = {one.feature for one in bounds}
    left = [
        at
        for at, feature in enumerate(features)
        if feature.indicator is not None
        and feature.indicator.column == column
        and at not in excluded
    ]
    if len(left) == 1 and len(bounds) > 1:
        return [(Bounds(left[0], bounds[-1].high, math.inf),)]
    return [tuple(bounds)]


def least_bounds(rule: Rule, features: Sequence[Feature]) -> tuple[Bounds, ...]:
    """The same, interval by interval."""
    return tuple(one for entry in least_conditions(rule, features) for one in entry)


def merged_length(rule: Rule, features: Sequence[Feature]) -> int:
    """Number of features and columns of words that a rule asks about."""
    return len(least_conditions(rule, features))


def neither_text(entry: Sequence[Bounds], features: Sequence[Feature]) -> str | None:
    """What an entry of `least_conditions` is that leaves out several words of a column.

    Args:
        entry: One or several intervals.
        features: All features.

    Returns:
        As "mode is neither light nor mixed"; None for one interval, and where features were
        renamed to what names no word of a column.
    """
    if len(entry) == 1:
        return None
    excluded = [features[one.feature].statement(False).partition(_IS_NOT) for one in entry]
    columns, _, words = zip(*excluded, strict=True)
    if len({*columns}) > 1 or not all(words):
        return None
    return f"{columns[0]} is neither {', '.join(words[:-1])} nor {words[-1]}"


def _condition_texts(
    rule: Rule,
    features: Sequence[Feature],
    text: Callable[[Bounds], str],
    of_words: Callable[[str], str] = str,
) -> list[str]:
    texts: list[str] = []
    for entry in least_conditions(rule, features):
        neither = neither_text(entry, features)
        texts += map(text, entry) if neither is None else [of_words(neither)]
    return texts


def _states(feature: Feature) -> bool:
    """Whether its name is a statement, as that of an environment's "gear is 2" is."""
    return feature.indicator is not None or _IS in feature.name


def condition_text(bounds: Bounds, feature: Feature, *, beside: Sequence[float] = ()) -> str:
    """What a rule asks of one feature, as part of a sentence.

    Args:
        bounds: The feature's interval.
        feature: Its name and unit.
        beside: Values of the feature that are shown with it.

    Returns:
        As "the pole angle is above 0.02 rad".
    """
    if is_flag(feature, bounds):
        return f"{'the' if _states(feature) else 'there is'} {flag_text(feature, bounds)}"
    unit = f" {feature.unit}" if feature.unit else ""
    limits = limit_texts(bounds, feature, beside=beside)
    if math.isinf(bounds.low):
        return f"the {feature.name} is at most {limits[0]}{unit}"
    if math.isinf(bounds.high):
        return f"the {feature.name} is above {limits[0]}{unit}"
    return f"the {feature.name} is between {limits[0]} and {limits[1]}{unit}"


def short_condition(bounds: Bounds, feature: Feature, *, beside: Sequence[float] = ()) -> str:
    """The same in signs, for tables.

    Args:
        bounds: The feature's interval.
        feature: Its name and unit.
        beside: Values of the feature that are shown with it.

    Returns:
        As "pole angle > 0.02 rad".
    """
    if is_flag(feature, bounds):
        return flag_text(feature, bounds)
    unit = f" {feature.unit}" if feature.unit else ""
    limits = limit_texts(bounds, feature, beside=beside)
    if math.isinf(bounds.low):
        return f"{feature.name} ≤ {limits[0]}{unit}"
    if math.isinf(bounds.high):
        return f"{feature.name} > {limits[0]}{unit}"
    return f"{limits[0]} < {feature.name} ≤ {limits[1]}{unit}"


def query_text(
    condition: Condition, features: tuple[Feature, ...], *, beside: Sequence[float] = ()
) -> str:
    """One query on a path, in signs.

    Args:
        condition: The query.
        features: All features.
        beside: Values of its feature that are shown with it.

    Returns:
        As "pole angle > 0.02 rad".
    """
    return short_condition(bounds_of(condition), features[condition.feature], beside=beside)


def bounds_of(condition: Condition) -> Bounds:
    """One query as an interval.

    Args:
        condition: The query.

    Returns:
        With one end.
    """
    feature, op, threshold = condition
    low, high = (-math.inf, threshold) if op == "<=" else (threshold, math.inf)
    return Bounds(feature, low, high)


def exact_condition(condition: Condition, features: tuple[Feature, ...]) -> str:
    """One query with its threshold at full precision.

    Args:
        condition: The query.
        features: All features.

    Returns:
        As "pole angle > 0.020938472", or "mode is heavy".
    """
    feature, bounds = features[condition.feature], bounds_of(condition)
    if feature.indicator is not None and is_flag(feature, bounds):
        return flag_text(feature, bounds)
    return f"{features[condition.feature].name} {condition.op} {condition.threshold!r}"


def conditions_text(rule: Rule, rule_set: RuleContents) -> str:
    """All conditions of a rule in signs, for tables.

    Args:
        rule: One of the rule set.
        rule_set: Knows the names.

    Returns:
        As "pole angle > 0.02 rad and cart velocity ≤ 0.3 m/s"; "always" without conditions.
    """
    features = rule_set.source.features
    parts = _condition_texts(
        rule, features, lambda one: short_condition(one, features[one.feature])
    )
    return " and ".join(parts) if parts else "always"


def sentence(
    rule: Rule,
    rule_set: RuleContents,
    *,
    evidence: bool = True,
    state: Sequence[float] | NDArray[np.float32] | None = None,
) -> str:
    """A rule as a sentence that needs no knowledge of trees.

    Args:
        rule: One of the rule set.
        rule_set: Knows the names.
        evidence: Whether to add how often the expert did so.
        state: The d values of a state that is shown with it.

    Returns:
        As "If the pole angle is above 0.02 rad, then push right: so did the expert in 97 % of
        412 states." It is true of the demonstrated states to which the rule applies, and of no
        others; and of `state` if the rule applies there.
    """
    features = rule_set.source.features
    values = [] if state is None else extended_state(np.asarray(state).tolist(), features)

    def text_of(bounds: Bounds) -> str:
        beside = (float(values[bounds.feature]),) if len(values) else ()
        return condition_text(bounds, features[bounds.feature], beside=beside)

    parts = _condition_texts(rule, features, text_of, _THE)
    action = says_text(rule, rule_set.actions[rule.dimension])
    return _sentence(rule, parts, action, evidence=evidence)


def _sentence(rule: Rule, parts: Sequence[str], action: str, *, evidence: bool) -> str:
    """A sentence of its conditions and of what follows."""
    if not parts:
        text = f"{action[0].upper()}{action[1:]}" if rule.forbids else f"Always {action}"
    elif len(parts) == 1:
        text = f"If {parts[0]}, then {action}"
    else:
        text = f"If {', '.join(parts[:-1])} and {parts[-1]}, then {action}"
    if not evidence or rule.origin == "manual":
        return f"{text}."
    states = "1 state" if rule.samples == 1 else f"{rule.samples:,} states"
    if rule.origin == "probed":
        return f"{text}: after it the expert failed in {share_text(rule.confidence)} of {states}."
    if rule.forbids:
        return f"{text}: the expert did not in {share_text(rule.confidence)} of {states}."
    return f"{text}: so did the expert in {share_text(rule.confidence)} of {states}."


class BoundsTexts(dict[Bounds, str]):
    """Texts of intervals: many rules ask for the same one, which is written once.

    Args:
        write: Writes one.
    """

    def __init__(self, write: Callable[[Bounds], str]) -> None:
        super().__init__()
        self._write = write

    def __missing__(self, bounds: Bounds) -> str:
        text = self[bounds] = self._write(bounds)
        return text


class Wording:
    """All rules of a set in words: `sentence`, `conditions_text` and so on, for many of them.

    Args:
        rule_set: Whose rules they are.
    """

    def __init__(self, rule_set: RuleContents) -> None:
        share_bounds(rule_set.rules)
        self._features = features = rule_set.source.features
        self._any_words = any(feature.indicator is not None for feature in features)
        self._long = BoundsTexts(lambda one: condition_text(one, features[one.feature]))
        self._short = BoundsTexts(lambda one: short_condition(one, features[one.feature]))
        self._dimensions = rule_set.actions
        self._actions = [
            [action_text(label, dimension) for label in range(dimension.n_labels)]
            for dimension in rule_set.actions
        ]

    def action(self, rule: Rule) -> str:
        """As `says_text`."""
        if rule.forbids:
            return says_text(rule, self._dimensions[rule.dimension])
        return self._actions[rule.dimension][rule.action]

    def conditions(self, rule: Rule) -> str:
        """As `conditions_text`."""
        return " and ".join(self.texts(rule, self._short)) or "always"

    def sentence(self, rule: Rule, *, evidence: bool = True) -> str:
        """As `sentence`."""
        parts = self.texts(rule, self._long, _THE)
        return _sentence(rule, parts, self.action(rule), evidence=evidence)

    def merged_length(self, rule: Rule) -> int:
        """As `merged_length`."""
        return merged_length(rule, self._features) if self._any_words else len(rule.bounds)

    def texts(
        self, rule: Rule, texts: BoundsTexts, of_words: Callable[[str], str] = str
    ) -> list[str]:
        """What a rule asks, in texts of its intervals.

        Args:
            rule: One of the set.
            texts: Of intervals.
            of_words: Writes what is said of several words of a column at once.

        Returns:
            One text a feature or a column of words.
        """
        if self._any_words:
            return _condition_texts(rule, self._features, texts.__getitem__, of_words)
        return list(map(texts.__getitem__, rule.bounds))


def formula_texts(rule_set: RuleContents) -> list[str]:
    """What the formulas are that rules ask about.

    Args:
        rule_set: Any.

    Returns:
        As "time to collision (s) = gap / (own speed - lead speed)"; a combination says itself what
        it is.
    """
    queried = {one.feature for rule in rule_set.rules for one in rule.conditions}
    texts = [
        f"{feature.name}{f' ({feature.unit})' if feature.unit else ''} = {feature.derived}"
        for place, feature in enumerate(rule_set.source.features)
        if isinstance(feature.derived, Formula) and place in queried
    ]
    return ["".join(sign if sign.isprintable() else " " for sign in text) for text in texts]


def limits_text(rule_set: RuleContents) -> str:
    """The thresholds that a rule set was mined at.

    Args:
        rule_set: Any.

    Returns:
        As "support at least 0.005, confidence at least 0.95".
    """
    thresholds = rule_set.thresholds
    limits = [f"support at least {limit_text(thresholds.support)}"]
    if thresholds.demands:
        limits.append(f"confidence at least {limit_text(thresholds.confidence)}")
    if thresholds.never is not None:
        limits.append(f"forbidden what the expert does in at most {limit_text(thresholds.never)}")
    if any(rule.origin == "probed" for rule in rule_set.rules):
        risk = limit_text(thresholds.confidence)
        limits = [f"forbidden what the expert fails after in more than {risk}"]
    if rule_set.cut == "leaves":
        limits = ["every leaf of the tree"]
    if thresholds.lift:
        limits.append(f"lift at least {threshold_text(thresholds.lift)}")
    if thresholds.max_depth is not None:
        limits.append(f"at most {counted(thresholds.max_depth, 'condition')}")
    if any(dimension.is_interval for dimension in rule_set.actions):
        limits.append(f"divider {rule_set.divider}")
    return ", ".join(limits)


def one_line(text: str) -> str:
    """Text from outside for a comment in code: one line, nothing invisible.

    Args:
        text: A name, a unit or a label, which may come from a file.

    Returns:
        The text, with a space for every sign that cannot be seen.
    """
    if len(text) <= _LONGEST and text.isprintable():
        return text
    printable = "".join(sign if sign.isprintable() else " " for sign in text[: _LONGEST + 1])
    return printable if len(printable) <= _LONGEST else f"{printable[:_LONGEST]}..."
