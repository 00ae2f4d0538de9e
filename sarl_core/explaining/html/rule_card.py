"""One rule in words and numbers, in HTML."""

from __future__ import annotations

from markupsafe import Markup

from sarl_core.explaining.html.evidence_bar import evidence_bar
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.evidence import VERDICT_COLOURS, episodes_text, mined_text
from sarl_core.mining.language import counted, merged_length, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import verdict

_MEANINGS = (
    ("Support", "Share of all states to which the rule applies"),
    ("Confidence", "Share of those in which the expert did what the rule says"),
    (
        "Lift",
        "Confidence over the action's share of all states; above 1, the conditions make the action "
        "more frequent than it is overall",
    ),
    ("Joint support", "Share of all states to which the rule applies and in which it is right"),
)


def measures_text(rule: Rule) -> str:
    """The numbers of a rule.

    Args:
        rule: That some pair reaches.

    Returns:
        As "support 2.5 % · confidence 97 % · lift 1.92 · joint support 2.4 %".
    """
    return (
        f"support {share_text(rule.support)} · confidence {share_text(rule.confidence)} · "
        f"lift {rule.lift:.2f} · joint support {share_text(rule.joint_support)}"
    )


def rule_card(rule: Rule, rule_set: RuleSet, *, threshold: float | None) -> Markup:
    """A rule as a sentence, its numbers, and how sure it is.

    Args:
        rule: One of the rule set.
        rule_set: Knows the names.
        threshold: The minimum confidence that the rule has to reach; None for a rule that was not
            cut by one, of which nothing is said but its numbers.

    Returns:
        The sentence as a heading, and below it what follows from the pairs; nothing of those where
        none reaches the rule.
    """
    reached = rule.samples > 0
    words = [rule_set.name_of(rule)]
    if reached:
        words.append(measures_text(rule))
    length = merged_length(rule, rule_set.source.features)
    words.append(f"{counted(rule.length, 'condition')} on {counted(length, 'feature')}")
    sureness, colour, bar = "", "", Markup()
    if reached and threshold is not None:
        sureness, colour = _sureness(rule, threshold)
        bar = evidence_bar(rule, threshold)
    return render(
        "rules/rule_card",
        sentence=sentence(rule, rule_set, evidence=reached),
        words=" · ".join(words),
        sureness=sureness,
        colour=colour,
        bar=bar,
        meanings=_MEANINGS if reached else (),
    )


def _sureness(rule: Rule, threshold: float) -> tuple[str, str]:
    """How sure the rule is, on what it was mined from and held out, and a colour that warns."""
    sentences = f"{mined_text(rule)} that it was mined from."
    if rule.held_out is None:
        return sentences, ""
    sentences += f" {episodes_text(rule.held_out, what='it was right')}"
    if verdict(rule, threshold) == "below":
        return f"{sentences} That is too low.", VERDICT_COLOURS["below"]
    return sentences, ""
