"""The rules at the thresholds, with everything that the page Evidence says of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.validation.cross_fitting import Judged, judge, judge_pairs
from sarl_core.mining.validation.episode_counts import Influence, count_rules, most_influential
from sarl_core.mining.validation.holding_out import more_episodes
from sarl_dashboard.cache import cached
from sarl_dashboard.state.data import data_parts, mined_data
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.mined import episodes_tried_on, rules_at


@dataclass(frozen=True)
class Findings:
    """What the page says of a rule set.

    Attributes:
        rules: Those that demand before those that forbid, of each kind the most support first.
        missing: Episodes that each still misses.
        judged: All of them together on the episodes held out; None where there are none.
        influences: The held-out episode that moves the share of each rule most.
    """

    rules: tuple[Rule, ...]
    missing: tuple[float, ...]
    judged: Judged | None
    influences: tuple[Influence | None, ...]


@dataclass(frozen=True)
class RuleSetEvidence:
    """The rules at the thresholds with everything that is known about them.

    Attributes:
        parts: Of the demonstrations.
        rule_set: The rules.
        mined: The file that they are mined from; None where the steps are here.
        episodes: How many there are, those that are held out among them.
        held_out: How many of them are held out.
    """

    parts: Parts
    rule_set: RuleSet
    mined: MinedData | None
    episodes: int
    held_out: int

    @property
    def thresholds(self) -> Thresholds:
        """At which the rules were mined."""
        return self.rule_set.thresholds

    @property
    def findings(self) -> Findings:
        """What the page says."""
        return _findings(self)


def chosen_evidence() -> RuleSetEvidence:
    """That of what is chosen; there are demonstrations."""
    parts = data_parts()
    assert parts is not None
    held_out, episodes = episodes_tried_on()
    return RuleSetEvidence(parts, rules_at(), mined_data(), episodes, held_out)


@cached(show_spinner="Weighing the evidence …")
def _findings(evidence: RuleSetEvidence) -> Findings:
    rule_set, held_out = evidence.rule_set, evidence.parts.held_out
    rules = tuple(sorted(rule_set, key=lambda rule: (bool(rule.forbids), -rule.samples)))
    missing = more_episodes(rules, evidence.episodes, rule_set.thresholds)
    if not evidence.held_out:
        return Findings(rules, missing, None, (None,) * len(rules))
    ordered = replace(rule_set, rules=rules)
    if evidence.mined is not None:
        counts = evidence.mined.count_rules(ordered)
        judged = evidence.mined.judged(rule_set.thresholds)
    else:
        assert held_out is not None
        counts = count_rules(ordered, held_out)
        judged = judge_pairs(rule_set, held_out) if rule_set.forbids else judge(rule_set, counts)
    influences = tuple(
        most_influential(*counts.of(place), counts.numbers, counts.lengths)
        for place in range(len(rules))
    )
    return Findings(rules, missing, judged, influences)
