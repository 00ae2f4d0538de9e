from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, mine_rules
from sarl_core.explaining.html.rule_card import rule_card
from sarl_core.explaining.words.evidence import VERDICT_COLOURS
from sarl_core.mining.evidence import HeldOut


@pytest.fixture(scope="module")
def pushed() -> RuleSet:
    """One rule a side: 30 states below 0, of which 27 are pushed left, and 20 above, all right."""
    values = np.concatenate([np.linspace(-3, -0.1, 30), np.linspace(0.1, 2, 20)])
    actions = np.array([0] * 27 + [1] * 3 + [1] * 20)
    pairs = Demonstrations(
        values.astype(np.float32)[:, None],
        actions,
        np.zeros(50, dtype=np.int64),
        feature_names=("<b>tilt</b>",),
        label_names=(("push left", "push & pull"),),
    )
    return mine_rules(pairs, supp_min=0.3, conf_min=0.8, max_depth=1)


def test_a_card_says_the_rule_and_its_numbers_with_names_escaped(pushed: RuleSet) -> None:
    rule = max(pushed.rules, key=lambda one: one.samples)
    card = rule_card(rule, pushed, threshold=0.8)
    assert "<b>tilt</b>" not in card
    assert "<h2>If the &lt;b&gt;tilt&lt;/b&gt; is at most" in card
    assert f"so did the expert in {100 * rule.confidence:.0f} % of {rule.samples} states." in card
    for part in (f"{pushed.name_of(rule)} ·", f"lift {rule.lift:.2f}", "1 condition on 1 feature"):
        assert part in card
    assert "mined from" in card
    assert "held out" not in card


def test_a_rule_that_held_out_episodes_refute_is_told_in_red(pushed: RuleSet) -> None:
    rule = max(pushed.rules, key=lambda one: one.samples)
    red = f'<p style="color:color-mix(in srgb, {VERDICT_COLOURS["below"]} '
    refuted = replace(rule, held_out=HeldOut(100, 40, 12, 0.4, 0.28, 0.53))
    card = rule_card(refuted, pushed, threshold=0.8)
    assert red in card
    assert (
        "In 12 episodes that it was not mined from, it was right in 40 % of its states on average, "
        "and between 28 and 53 % is what that can tell. That is too low.</p>"
    ) in card
    kept = rule_card(
        replace(rule, held_out=HeldOut(100, 90, 12, 0.9, 0.78, 0.99)), pushed, threshold=0.8
    )
    assert red not in kept
    assert "it was right in 90 % of its states on average" in kept
    few = replace(rule, held_out=HeldOut(9, 2, 3, 0.2, None, None))
    card = rule_card(few, pushed, threshold=0.8)
    assert red not in card
    assert "right in 20 % of its states on average; that is too few to say more." in card


def test_of_a_rule_without_a_threshold_nothing_is_judged(pushed: RuleSet) -> None:
    card = rule_card(pushed.rules[0], pushed, threshold=None)
    assert "95 %" not in card
    assert "sarl-sure" not in card
    assert "support" in card


def test_a_rule_that_no_pair_reaches_has_no_numbers(pushed: RuleSet) -> None:
    rule = replace(pushed.rules[0], samples=0)
    card = rule_card(rule, pushed, threshold=0.8)
    assert "support" not in card
    assert "so did the expert" not in card
    assert "1 condition on 1 feature" in card
