"""What the page What if asks about: the shield, and where states lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.fields import Indicator
from sarl_core.demonstrations.words import Coded, columns_of_words, indicated, spelled
from sarl_core.explaining.state_path import PathFinder
from sarl_core.explaining.words.what_if import by_use
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.neighbourhood import Neighbourhood, feature_spreads
from sarl_core.shielding.sampling import Span, feature_spans
from sarl_core.shielding.shield import Outside, Projection, Shield
from sarl_dashboard.cache import cached
from sarl_dashboard.views.what_if.rules import RulesOnTrees


@dataclass(frozen=True, eq=False)
class Situation:
    """Rules in force, and the demonstrations that states are taken from and measured by.

    Attributes:
        demonstrations: The chosen ones.
        rules: The rules.
        neighbourhood: The shield, laid out for questions about single states.
        spans: Where the values of each observed feature lie.
        spreads: What a change of each of them is measured in.
    """

    demonstrations: Demonstrations
    rules: RulesOnTrees
    neighbourhood: Neighbourhood
    spans: tuple[Span, ...]
    spreads: NDArray[np.float64]

    @property
    def order(self) -> tuple[int, ...]:
        """The observed features, those first that most rules ask about, or that count in them."""
        return _order(self.rules.rule_set)

    @property
    def columns(self) -> dict[str, list[int]]:
        """Where the indicators of each column of words stand."""
        return columns_of_words([one.indicator for one in self.demonstrations.observed])

    def indicators(self, places: Sequence[int]) -> list[Indicator]:
        """Of one column of words."""
        return [one for at in places if (one := self.demonstrations.features[at].indicator)]

    @property
    def finder(self) -> PathFinder:
        """Follows a state through rules that are of no tree at hand."""
        return _finder(self.rules.rule_set)


def situation_of(
    demonstrations: Demonstrations, rules: RulesOnTrees, projection: Projection, outside: Outside
) -> Situation:
    """Rules in force; they are laid out once."""
    neighbourhood = _neighbourhood(rules.rule_set, projection, outside)
    spans, spreads = _spans(demonstrations)
    return Situation(demonstrations, rules, neighbourhood, spans, spreads)


@cached(show_spinner="Laying out the rules …")
def _neighbourhood(rule_set: RuleSet, projection: Projection, outside: Outside) -> Neighbourhood:
    return Neighbourhood(Shield(rule_set, projection=projection, outside=outside))


@cached(show_spinner="Looking where the values lie …")
def _spans(demonstrations: Demonstrations) -> tuple[tuple[Span, ...], NDArray[np.float64]]:
    observations, features = demonstrations.raw_observations, demonstrations.observed
    spans = list(feature_spans(observations))
    # Of words the most frequent one stands in the middle: medians need not be any of them.
    for places in columns_of_words([one.indicator for one in features]).values():
        indicators = [one for at in places if (one := features[at].indicator)]
        codes, words = spelled(observations[:, places], indicators)
        likeliest = np.bincount(codes[codes >= 0], minlength=len(words)).argmax()
        middle = indicated(Coded(np.array([likeliest]), words), indicators)[0].tolist()
        for at, value in zip(places, middle, strict=True):
            spans[at] = Span(0.0, value, 1.0)
    return tuple(spans), feature_spreads(observations)


@cached()
def _order(rule_set: RuleSet) -> tuple[int, ...]:
    features = rule_set.source.features
    order: list[int] = []
    for index in by_use(rule_set):
        derived = features[index].derived
        order += [index] if derived is None else derived.features
    return tuple(dict.fromkeys(order))


@cached()
def _finder(rule_set: RuleSet) -> PathFinder:
    return PathFinder(rule_set)
