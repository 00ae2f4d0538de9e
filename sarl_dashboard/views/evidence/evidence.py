"""The rules at the thresholds, with everything that the page Evidence says of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.validation.cross_fitting import Judged, judge
from sarl_core.mining.validation.episode_counts import Influence, count_rules, most_influential
from sarl_core.mining.validation.holding_out import more_episodes
from sarl_dashboard.cache import cached
from sarl_dashboard.state.data import data_parts, digest_or_empty
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.mined import mined_rules


@dataclass(frozen=True)
class Findings:
    """What the page says of a rule set.

    Attributes:
        rules: The most support first.
        missing: Episodes that each still misses.
        threshold: The minimum confidence.
        judged: All of them together on the episodes held out; None where there are none.
        influences: The held-out episode that moves the share of each rule most.
    """

    rules: tuple[Rule, ...]
    missing: tuple[float, ...]
    threshold: float
    judged: Judged | None
    influences: tuple[Influence | None, ...]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rules at the thresholds with everything that is known about them.

    Attributes:
        parts: Of the demonstrations.
        rule_set: The rules.
        key: Tells all of this from others.
        findings: What the page says.
    """

    parts: Parts
    rule_set: RuleSet
    key: tuple[object, ...]
    findings: Findings

    @property
    def thresholds(self) -> Thresholds:
        """At which the rules were mined."""
        return self.rule_set.thresholds


def chosen_evidence() -> Evidence:
    """That of what is chosen; there are demonstrations."""
    parts, rule_set = data_parts(), mined_rules()
    assert parts is not None
    held_out = digest_or_empty(parts.held_out)
    key = (parts.mined.digest, held_out, rule_set.thresholds, rule_set.divider)
    return Evidence(parts, rule_set, key, _findings(key, parts, rule_set))


@cached(show_spinner="Weighing the evidence …")
def _findings(key: tuple[object, ...], _parts: Parts, _rule_set: RuleSet) -> Findings:
    rules = tuple(sorted(_rule_set.rules, key=lambda rule: -rule.samples))
    threshold = _rule_set.thresholds.confidence
    missing = more_episodes(rules, _parts.remaining.n_episodes, threshold)
    if _parts.held_out is None:
        return Findings(rules, missing, threshold, None, (None,) * len(rules))
    counts = count_rules(replace(_rule_set, rules=rules), _parts.held_out)
    influences = tuple(
        most_influential(*counts.of(place), counts.numbers, counts.lengths)
        for place in range(len(rules))
    )
    return Findings(rules, missing, threshold, judge(_rule_set, counts), influences)
