from __future__ import annotations

from dataclasses import replace

from sarl_core.explaining.figures.pareto_front import front_figure
from sarl_core.explaining.words.cross_fit import no_recommendation_text, recommendation_sentences
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.pareto import ParetoPoint
from sarl_core.mining.validation.recommendation import Recommendation

SIX = Recommendation(Thresholds(0.02, 0.78), 6, 0.509, 0.8688, 0.8733, 115, 0.8579)


def test_a_recommendation_says_which_why_and_what_it_is_worth() -> None:
    assert recommendation_sentences(SIX) == (
        "Recommended: support 0.02 and confidence 0.78. Elsewhere, these 6 rules apply in 51 % of "
        "the states and are right in 86.9 % of them (85.8 % in episodes without a say in this "
        "choice): the fewest within 2 points of the best, 87.3 % with 115 rules, of all that apply "
        "in at least 50 % of the states."
    )


def test_the_best_is_compared_with_nothing() -> None:
    best = replace(SIX, rules=1, best_rules=1, best=SIX.fidelity)
    text = recommendation_sentences(best, "hip")
    assert text.startswith("Recommended for hip: support 0.02 and confidence 0.78. Elsewhere, ")
    assert "this rule applies in 51 % of the states and is right in 86.9 % of them" in text
    assert ": the best, and the fewest within 2 points of it, of all that apply in" in text


def test_why_nothing_is_recommended() -> None:
    assert "4 episodes cannot tell" in no_recommendation_text(4)
    assert "1 episode cannot tell" in no_recommendation_text(1)
    assert "at least 50 % of the states" in no_recommendation_text(5)


def test_the_recommended_rule_set_is_marked_among_the_trade_offs() -> None:
    points = [ParetoPoint(1, 0.2, 0.9, 0.1, 0.8), ParetoPoint(7, 0.5, 0.95, 0.01, 0.9)]
    _, mark = front_figure(points, recommended=(6, 0.509)).data
    assert (mark.name, list(mark.x), list(mark.y)) == ("recommended", [6], [0.509])
    assert "recommended" not in [trace.name for trace in front_figure(points).data]
