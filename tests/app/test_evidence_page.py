"""Held-out and left-out episodes, on the page that chooses them and on those that follow."""

from __future__ import annotations

import json
import time
from functools import cache

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.words.cross_fit import judged_sentence
from sarl_core.explaining.words.evidence import (
    VERDICT_COLOURS,
    episodes_text,
    held_out_text,
    mined_text,
    more_text,
    verdict_counts,
)
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import FILTERED
from sarl_core.mining.validation.contradictions import by_episode, find_contradictions
from sarl_core.mining.validation.cross_fitting import judge
from sarl_core.mining.validation.episode_counts import count_rules
from sarl_core.mining.validation.holding_out import (
    Split,
    hold_out,
    lower_bound,
    more_episodes,
    verdict,
    with_held_out,
)
from sarl_core.mining.validation.learning_curve import CurvePoint, learning_curve
from tests.app.screens import ROUTER, html, metrics, open_page, run_through, texts

CART = ROUTER.parents[1] / "data" / "demonstrations" / "cartpole.parquet"
HELD = {"data": "cartpole", "holdout": "0.2", "holdout_seed": "3"}


@cache
def parted() -> Split:
    return hold_out(load_demonstrations(CART), 0.2, seed=3)


@cache
def tried() -> RuleSet:
    mined, held_out = parted()
    return with_held_out(mine_rules(mined, supp_min=0.005, conf_min=0.95), held_out)


def held_out_fidelity() -> str:
    share = judge(tried(), count_rules(tried(), parted().held_out)).fidelity.share
    return share_text(share, decimals=1)


def until(app: AppTest, words: str) -> str:
    """Look again until work beside the page has come to an end."""
    for _ in range(900):
        app.run()
        assert not app.exception, app.exception
        if words in texts(app):
            return texts(app)
        time.sleep(0.2)
    raise AssertionError(texts(app))


def test_the_page_says_what_the_library_counts() -> None:
    app = open_page("evidence", **HELD)
    counts = verdict_counts(tried().rules, tried().thresholds)
    assert metrics(app) == {
        "Rules": str(len(tried())),
        "Held-out fidelity": held_out_fidelity(),
        "Reached": str(counts["reached"]),
        "Open": str(counts["open"]),
        "Too low": str(counts["below"]),
        "Too few episodes": str(counts["unknown"]),
    }
    table = app.dataframe[0].value
    rules = sorted(tried().rules, key=lambda rule: -rule.samples)
    assert table["Rule"].tolist() == [tried().name_of(rule) for rule in rules]
    assert table["Held out"].tolist() == [held_out_text(rule.held_out) for rule in rules]
    assert table["Mined from"].tolist() == [mined_text(rule) for rule in rules]
    missing = list(map(more_text, more_episodes(rules, 30, tried().thresholds)))
    assert table["Still missing"].tolist() == missing
    judged = judge(tried(), count_rules(tried(), parted().held_out))
    assert judged_sentence(judged) in html(app)


def test_a_share_is_chosen_and_taken_back() -> None:
    app = open_page("evidence", data="cartpole")
    assert "Nothing is held out" in texts(app)
    assert "Hold some out above" in texts(app)
    app.number_input(key="_holdout_seed_choice").set_value(3).run()
    app.select_slider(key="_holdout_choice").set_value("0.2").run()
    assert metrics(app)["Held-out fidelity"] == held_out_fidelity()
    assert app.query_params["holdout"] == "0.2"
    assert "**6 episodes** held out" in app.sidebar.caption[0].value
    app.select_slider(key="_holdout_choice").set_value("0").run()
    assert "holdout" not in app.query_params
    assert "held out" not in app.sidebar.caption[0].value


def test_junk_in_a_link_holds_nothing_out() -> None:
    app = open_page(
        "evidence", data="cartpole", holdout="2", holdout_seed="-1", left_out="x,1", reach="9"
    )
    assert "Nothing is held out" in texts(app)
    assert "out" not in app.sidebar.caption[0].value


def test_the_rules_page_shows_both_confidences_and_filters_by_the_lower_bound() -> None:
    app = open_page("rules", **HELD)
    rules = sorted(tried().rules, key=lambda rule: -rule.samples)
    told = episodes_text(rules[0].held_out, what="it was right")
    assert f"{mined_text(rules[0])} that it was mined from. {told}" in html(app)
    table = app.dataframe[0].value
    assert table["Held out"].tolist() == [held_out_text(rule.held_out) for rule in rules]
    bounds = sorted(bound for bound in map(lower_bound, rules) if bound)
    middle = bounds[len(bounds) // 2]
    app.number_input(key="lower").set_value(middle).run()
    kept = [rule for rule in rules if lower_bound(rule) >= middle]
    assert 0 < len(app.dataframe[0].value) == len(kept) < len(rules)


def test_a_lower_bound_that_nothing_reaches_is_explained_where_it_is_set() -> None:
    app = open_page("rules", **HELD, lower="0.9")
    told = texts(app)
    count = len(tried())
    assert f"0 of {count} rules reach 90 %; {count} were met in too few held-out episodes" in told
    assert "6 held-out episodes can show at most 75.4 %" in told
    app.number_input(key="lower").set_value(0.0).run()
    assert "can show at most" not in texts(app)


def test_a_minimum_confidence_that_nothing_can_reach_is_explained() -> None:
    few = html(open_page("evidence", **HELD))
    assert "No rule reaches the minimum confidence: 6 held-out episodes can show at most" in few
    app = open_page("evidence", **HELD, confidence="0.6")
    assert int(metrics(app)["Reached"]) > 0
    assert "can show at most" not in html(app)


def test_where_no_episodes_would_help_there_is_no_empty_plot() -> None:
    told = html(open_page("evidence", data="lunar_lander", holdout="0.2"))
    assert "No rule would reach it: 3 never do at this rate, and 5 were met in too few" in told
    assert "Rules that reach it" not in told
    assert "Rules that reach it" in html(open_page("evidence", data="pendulum", holdout="0.3"))


def test_the_rules_page_says_in_red_what_other_episodes_refute() -> None:
    unfiltered = {**HELD, "holdout": "0.5", "support": "0", "confidence": "1"}
    mined, held_out = hold_out(load_demonstrations(CART), 0.5, seed=3)
    rules = with_held_out(mine_rules(mined, supp_min=0, conf_min=1), held_out)
    low = next(rule for rule in rules.rules if verdict(rule, 1.0) == "below")
    told = html(open_page("rules", **unfiltered, rule=low.id))
    red = f"{VERDICT_COLOURS['below']} 75%, currentColor"
    assert f'{red})">{mined_text(low)} that it was mined from. In ' in told
    assert episodes_text(low.held_out, what="it was right") in told


def test_the_maps_have_a_held_out_layer() -> None:
    app = open_page("thresholds", **HELD, layer="Held out")
    assert metrics(app)["Held-out fidelity"] == held_out_fidelity()
    assert metrics(app)["Rules"] == str(len(tried()))
    assert "Held-out fidelity: the same on episodes held out" in texts(app)
    without = open_page("thresholds", data="cartpole", layer="Held out")
    assert "Held-out fidelity" not in metrics(without)
    assert without.button_group(key="layer").value == "Rules and length"


def test_contradictions_are_counted_and_an_episode_is_left_out_everywhere() -> None:
    app = open_page("evidence", data="cartpole", about="Contradictions")
    whole = load_demonstrations(CART)
    found = find_contradictions(whole)
    assert f"**{found.contradicting().sum():,} of 15,000 states** contradict another" in texts(app)
    worst = by_episode(whole, found)
    assert app.dataframe[0].value["Episode"].tolist() == [one.episode for one in worst]
    app = open_page("evidence", data="cartpole", about="Leave episodes out")
    app.multiselect(key="_left_out_choice").set_value([worst[0].episode, worst[1].episode]).run()
    gone = sorted(one.episode for one in worst[:2])
    assert app.query_params["left_out"] == ",".join(map(str, gone))
    del app.query_params["left_out"]  # as a browser does when it changes the page
    app.switch_page("thresholds.py").run()
    rest = whole.select([one.episode for one in worst[2:]])
    rules = mine_rules(rest, supp_min=0.005, conf_min=0.95)
    assert metrics(app)["Rules"] == str(len(rules))
    assert "**2 episodes** left out" in app.sidebar.caption[0].value
    app.sidebar.selectbox(key="_data_choice").select("pendulum").run()
    assert "left out" not in app.sidebar.caption[0].value


def test_every_episode_cannot_be_left_out() -> None:
    gone = ",".join(map(str, range(30)))
    app = open_page("evidence", data="cartpole", about="Leave episodes out", left_out=gone)
    assert any("so none is; leave out fewer" in one.value for one in app.warning)
    assert metrics(app)["Rules"] == str(
        len(mine_rules(load_demonstrations(CART), supp_min=0.005, conf_min=0.95))
    )


def test_rules_are_looked_for_in_other_draws() -> None:
    app = open_page("evidence", data="cartpole", about="Stability", rounds="5")
    app.button(key="run_stability").click().run()
    words = until(app, "came back in at least half of 5 rounds")
    rules = mine_rules(load_demonstrations(CART), supp_min=0.005, conf_min=0.95)
    assert f"of {len(rules)} rules**" in words
    table = app.dataframe[0].value
    assert set(table["Rule"]) == set(rules.names.values())
    assert set(table["Comes back"]) <= {0.0, 20.0, 40.0, 60.0, 80.0, 100.0}


def test_where_there_is_no_rule_the_page_says_what_to_do() -> None:
    app = open_page("evidence", data="cartpole", support="0.9", confidence="1")
    assert "There is no rule at the present thresholds" in texts(app)
    assert "Nothing has been uploaded" in texts(open_page("evidence", data="upload"))


def test_a_learning_curve_is_what_the_library_gives() -> None:
    # Of few episodes, so that there is little to mine.
    left_out = [str(episode) for episode in range(24)]
    few = {"holdout": "0.5", "left_out": ",".join(left_out)}
    app = open_page("evidence", about="Learning curve", **(HELD | few))
    run_through(app, "curve")
    assert "Line: the mean of 6 orders." in texts(app)
    mined, held_out = hold_out(load_demonstrations(CART).select(range(24, 30)), 0.5, seed=3)
    expected = learning_curve(mined, FILTERED, held_out=held_out)
    drawn = [json.loads(chart.proto.spec)["data"][1]["y"] for chart in app.get("plotly_chart")]
    assert drawn == [
        pytest.approx(np.nanmean(getattr(expected, layer), axis=0)) for layer in CurvePoint._fields
    ]
