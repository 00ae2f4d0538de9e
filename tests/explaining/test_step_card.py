from __future__ import annotations

from dataclasses import replace

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.html.step_card import legend, picture, step_card
from sarl_core.explaining.words.replay import ActionView, StepView

ACTION = ActionView(
    "engine", "left", "right", 0, 1, True, "If the angle > 0, then right.", "7", "R8"
)
STEP = StepView(4, (ACTION,), 0.25, (("angle", "0.5", "rad"), ("<b>x</b>", "2", "")))


def test_a_changed_action_is_told_with_both_and_the_rule() -> None:
    card = step_card(STEP, shielded=True)
    assert "Changed by the rules" in card
    assert card.index(label_colour(0)) < card.index(label_colour(1))
    assert "<b>R8.</b> If the angle &gt; 0, then right." in card
    assert "Smallest distance to a threshold on the way: 0.25" in card
    assert "<tr><td>angle</td>" in card
    assert "<b>engine</b>" not in card  # one action dimension needs no name


def test_what_the_shield_did_is_told_apart() -> None:
    kept = replace(ACTION, executed="left", executed_label=0, changed=False)
    abstains = replace(kept, abstains=True)
    alone = replace(kept, rule="", rule_id="")
    told = [
        step_card(replace(STEP, actions=(action,)), shielded=True)
        for action in (kept, abstains, alone)
    ]
    words = ("Allowed by the rules", "Rule abstains", "No rule applies")
    for card, own in zip(told, words, strict=True):
        assert [word for word in words if word in card] == [own]
    without = step_card(replace(STEP, actions=(alone,)), shielded=False)
    assert not any(word in without for word in words)
    assert "threshold" not in without


def test_each_of_several_actions_is_named_and_names_are_no_markup() -> None:
    second = replace(ACTION, dimension="<i>knee</i>", rule_id="<u>9</u>", executed="<s>")
    card = step_card(replace(STEP, actions=(ACTION, second), outside=True), shielded=True)
    assert "<b>engine</b>" in card
    assert "Outside the data" in card
    for raw in ("<i>", "<u>", "<s>", "<b>x</b>"):
        assert raw not in card
    assert "<script" not in legend([("<script>", "#000000")])
    assert 'alt="a &#34;b&#34;"' in picture(b"png", 'a "b"')
