"""One rule in words and numbers, in HTML without script; every name escaped."""

from __future__ import annotations

from html import escape

from sarl_core.explaining.html.number_cards import meanings
from sarl_core.explaining.words.evidence import (
    VERDICT_COLOURS,
    evidence_bar,
    mined_text,
    told_by_episodes,
)
from sarl_core.mining.language import counted, sentence, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import verdict

_STYLE = """<style>
.sarl-rule h4 { font-size: 1rem; font-weight: 600; line-height: 1.4; margin: 0 0 0.5rem;
  padding: 0; overflow-wrap: anywhere; }
.sarl-rule p { font-size: 0.875rem; line-height: 1.5; margin: 0 0 0.35rem; }
.sarl-rule .quiet { opacity: 0.7; }
</style>"""
_MEANINGS = meanings(
    {
        "Support": "Share of all states to which the rule applies",
        "Confidence": "Share of those in which the expert did what the rule says",
        "Lift": "Confidence over the action's share of all states; above 1, the conditions make "
        "the action more frequent than it is overall",
        "Joint support": "Share of all states to which the rule applies and in which it is right",
    }
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


def rule_card(rule: Rule, rule_set: RuleSet, *, threshold: float | None) -> str:
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
    words.append(f"{counted(rule.length, 'condition')} on {counted(rule.merged_length, 'feature')}")
    parts = [
        f"<h4>{escape(sentence(rule, rule_set, evidence=reached))}</h4>",
        f'<p class="quiet">{" · ".join(words)}</p>',
    ]
    if reached and threshold is not None:
        parts += [_sureness(rule, threshold), evidence_bar(rule, threshold)]
    if reached:
        parts.append(_MEANINGS)
    return f'{_STYLE}<div class="sarl-rule">{"".join(parts)}</div>'


def _sureness(rule: Rule, threshold: float) -> str:
    """How sure the rule is, on what it was mined from and on what was held out."""
    told = f"{mined_text(rule)} that it was mined from."
    if rule.held_out is None:
        return f'<p class="quiet">{escape(told)}</p>'
    told += f" {told_by_episodes(rule.held_out, what='it was right')}"
    if verdict(rule, threshold) == "below":
        # Mixed with the ink of the page, so that it can be read on white and on black.
        ink = f"color-mix(in srgb, {VERDICT_COLOURS['below']} 75%, currentColor)"
        return f'<p style="color:{ink}">{escape(told)} That is too low.</p>'
    return f'<p class="quiet">{escape(told)}</p>'
