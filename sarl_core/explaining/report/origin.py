"""What was shown and where rules come from, told the same way wherever a report tells it."""

from __future__ import annotations

from collections.abc import Iterator

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.tally import Share, Tally
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.leeway import Leeway


def demonstrated(
    rule_set: RuleSet, demonstrations: Demonstrations, counts: Tally, card: RuleSetCard
) -> tuple[str, ...]:
    """What was shown, and what rules came of it.

    Args:
        rule_set: The rules.
        demonstrations: They are about.
        counts: The rules on them.
        card: Of the rules.

    Returns:
        Sentences.
    """
    whole = demonstrations.whole
    who = f"The agent “{demonstrations.agent}”" if demonstrations.agent else "An expert"
    where = f" in {demonstrations.env_id}" if demonstrations.env_id else ""
    acted = (
        f"{who} acted{where} for {counted(whole.steps, 'step')} in "
        f"{counted(whole.episodes, 'episode')}."
    )
    if not counts.in_force:
        off = len(rule_set.rules)
        which = "The 1 rule is" if off == 1 else f"All {off:,} rules are"
        return (acted, f"{which} switched off." if off else "No rule came of it.")
    if counts.leeway is not None:
        return (acted, *_forbidding(rule_set, counts, counts.leeway))
    return (
        f"{acted} {origin_text(rule_set, demonstrations, counts, card)}",
        f"{_coverage_text(counts)}{_followed(counts)}.",
    )


def origin_text(
    rule_set: RuleSet, demonstrations: Demonstrations, counts: Tally, card: RuleSetCard
) -> str:
    """What rules were made from, as a sentence.

    Args:
        rule_set: The rules.
        demonstrations: Of the report.
        counts: The rules on them.
        card: Of the rules.

    Returns:
        As "The 6 rules were read off from these."; where the expert was asked anew while they were
        made, that too, and whether they were moved away from what it said.
    """
    number = sum(rule.enabled for rule in rule_set.rules)
    rules = "The rule was" if number == 1 else f"The {number:,} rules were"
    source, whole = rule_set.source, demonstrations.whole
    if any(rule.origin == "probed" for rule in rule_set.rules):
        return (
            f"{rules} made from probes of {counted(source.steps, 'state')}: in states that an "
            "agent came to each action was tried, and the expert went on from there."
        )
    if counts.split:
        aside = counted(whole.episodes - source.episodes, "episode")
        return (
            f"{rules} read off from {counted(source.episodes, 'episode')} of these; the other "
            f"{aside} were kept aside to try the rules on."
        )
    if counts.same:
        return f"{rules} read off from these."
    size = f"{counted(source.steps, 'state')} in {counted(source.episodes, 'episode')}"
    moved = (
        ". Then their thresholds were moved to where the rules achieve more, so they follow it "
        "less closely"
    )
    if card.rounds and source.steps > whole.steps:
        return (
            f"{rules} made from these states and more, {size}, in each of which the expert was "
            f"asked anew what it would do{moved if card.refined else ''}."
        )
    return f"{rules} made from other data: {size}."


def _coverage_text(counts: Tally) -> str:
    if counts.coverage == 1.0:
        return "In every one of the demonstrated states a rule applies"
    return f"A rule applies in {share_text(counts.coverage)} of the demonstrated states"


def _followed(counts: Tally) -> str:
    followed = counts.followed
    did = f", and in {share_text(followed.value)} of these the expert did what the rule says"
    return did if followed.whole else ""


def _forbidding(rule_set: RuleSet, counts: Tally, leeway: Leeway) -> Iterator[str]:
    """What was shown where rules forbid, and what they leave."""
    rules = [rule for rule in rule_set.rules if rule.enabled]
    forbidding = sum(bool(rule.forbids) for rule in rules)
    probed = any(rule.origin == "probed" for rule in rules)
    which = (
        f"{counted(len(rules), 'rule')} in plain language"
        if forbidding == len(rules)
        else f"{counted(len(rules), 'rule')} in plain language, of which {forbidding:,} forbid"
    )
    yield (
        f"{which} come from probes: in states that an agent came to each action was tried, and the "
        "expert went on from there."
        if probed
        else f"From what it did came {which}."
    )
    what = (
        "The rules forbid: each says what not to do in some states, and leaves the rest to the "
        "agent."
        if forbidding == len(rules)
        else "A rule that forbids says what not to do in some states, and leaves the rest to the "
        "agent."
    )
    followed: Share = counts.followed
    share = (
        f", and in {share_text(followed.value)} of these the expert did as they say"
        if followed.whole
        else ""
    )
    yield (
        f"{what} A rule applies in {share_text(counts.coverage)} of the states{share}. "
        f"{share_text(leeway.freedom)} of the choice is left in the demonstrated states (freedom: "
        "100 % is all actions everywhere, 0 % a single one)."
    )
