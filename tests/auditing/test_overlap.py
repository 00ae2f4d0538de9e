"""Rules that forbid, held against logs: what is counted is what a count step by step gives."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core import (
    Audit,
    Demonstrations,
    RuleSet,
    Shield,
    audit,
    grow_policy_trees,
    mine_never_rules,
    mine_rules,
)
from sarl_core.auditing.near import NEAR, sample_keys, spreads_of
from sarl_core.explaining.exports.audit import audit_html
from sarl_core.explaining.figures.audit import audit_tracks, step_texts
from sarl_core.explaining.words.audit import drift_text
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.never.never_rules import with_never_rules

EPSILON = 0.2


class Case(NamedTuple):
    """Rules and a log.

    Attributes:
        rules: Of which some forbid.
        log: Which breaks some, here and there where their data do not reach.
        demonstrations: What the rules were mined from.
    """

    rules: RuleSet
    log: Demonstrations
    demonstrations: Demonstrations


def moved(demonstrations: Demonstrations) -> Demonstrations:
    """Other states and actions, in the same episodes."""
    rng = np.random.default_rng(3)
    order = rng.permutation(len(demonstrations))
    mixed = np.where(rng.random(len(demonstrations)) < 0.4, order, np.arange(len(demonstrations)))
    return Demonstrations(
        demonstrations.raw_observations * np.float32(1.05),
        demonstrations.actions[mixed],
        demonstrations.episodes,
        label_names=demonstrations.label_names,
        action_names=demonstrations.action_names,
        action_low=demonstrations.action_low,
        action_high=demonstrations.action_high,
    )


def never(demonstrations: Demonstrations, divider: int = 2) -> RuleSet:
    return mine_never_rules(demonstrations, epsilon=EPSILON, supp_min=0.02, divider=divider)


def behind(demonstrations: Demonstrations, divider: int = 2) -> RuleSet:
    trees = grow_policy_trees(demonstrations, divider=divider)
    demanding = mine_rules(trees, supp_min=0.05, conf_min=0.8)
    return with_boxes(with_never_rules(demanding, trees, EPSILON), demonstrations)


def wild(demonstrations: Demonstrations) -> RuleSet:
    """Rules of a person's own before those that were mined: of two labels, of all, switched off."""
    rules = behind(demonstrations)
    place = next(at for at, rule in enumerate(rules) if rule.forbids and rule.conditions)
    one = rules[place]
    own = [
        replace(
            one,
            id=f"own.{number}",
            conditions=one.conditions[:length],
            forbids=forbids,
            instead=tuple(label for label in range(4) if label not in forbids),
            origin="manual",
            enabled=enabled,
        )
        for number, (length, forbids, enabled) in enumerate(
            [(1, (0, 3), True), (0, (2,), True), (1, (1,), True), (0, (0,), False)]
        )
    ]
    return replace(rules, rules=(*own, *rules.rules))


def amounts(demonstrations: Demonstrations) -> Demonstrations:
    values = np.stack([demonstrations.actions * 0.5 - 0.75, -demonstrations.actions], axis=1)
    return replace(
        demonstrations,
        actions=values.astype(np.float32),
        label_names=None,
        label_first=None,
        action_names=("left", "right"),
    )


def half(demonstrations: Demonstrations) -> RuleSet:
    """Rules that demand of one action, and rules that forbid of the other."""
    both = behind(demonstrations, 3)
    kept = [rule for rule in both if bool(rule.forbids) == bool(rule.dimension)]
    return replace(both, rules=tuple(kept))


CASES = ["never", "behind", "wild", "derived", "amounts", "both", "half"]


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest, lander_like: Demonstrations) -> Case:
    numbers = amounts(lander_like)
    derived = with_combinations(lander_like)
    made = {
        "never": lambda: (never(lander_like), lander_like),
        "behind": lambda: (behind(lander_like), lander_like),
        "wild": lambda: (wild(lander_like), lander_like),
        "derived": lambda: (never(derived), derived),
        "amounts": lambda: (never(numbers, 3), numbers),
        "both": lambda: (behind(numbers, 3), numbers),
        "half": lambda: (half(numbers), numbers),
    }
    rules, demonstrations = made[request.param]()
    assert rules.forbids
    return Case(rules, moved(demonstrations), demonstrations)


def held(case: Case) -> Audit:
    return audit(case.rules, case.log)


def in_force(rules: RuleSet, state: np.ndarray, dimension: int) -> list[int]:
    """The rule that demands, else all that forbid."""
    applying = [
        place
        for place, rule in enumerate(rules)
        if rule.dimension == dimension and rule.enabled and rule.applies(state[None])[0]
    ]
    demanding = [place for place in applying if not rules[place].forbids]
    return demanding[:1] or applying


def test_every_step_of_every_rule_is_counted(case: Case) -> None:
    rules, audited = case.rules, held(case)
    queried = {one.feature for rule in rules for one in rule.conditions}
    asked = [
        at for at, one in enumerate(rules.source.features) if one.derived is None or at in queried
    ]
    applied: Counter[tuple[int, int]] = Counter()
    broken: Counter[tuple[int, int]] = Counter()
    outside: Counter[int] = Counter()
    covered, broke = np.zeros((2, len(case.log)), dtype=bool)
    for row, episode in enumerate(case.log.episodes.tolist()):
        state = audited.observations[row]
        for dimension in range(len(rules.actions)):
            for place in in_force(rules, state, dimension):
                rule = rules[place]
                covered[row] = True
                applied[place, episode] += 1
                if not rule.obeyed_by(audited.labels[row, dimension]):
                    broke[row] = True
                    broken[place, episode] += 1
                    if rule.forbids and rule.box is not None:
                        low, high = rule.box.least, rule.box.most
                        # What is derived counts where some rule asks about it, as for a shield.
                        within = ((low <= state) & (state <= high))[asked]
                        outside[place] += not within.all()
    assert np.array_equal(audited.is_covered, covered)
    assert np.array_equal(audited.is_broken, broke)
    table = audited.rule_table()
    for place, rule in enumerate(rules):
        at = {episode: count for (rule_at, episode), count in applied.items() if rule_at == place}
        assert table["applies"][place] == sum(at.values())
        assert table["broken"][place] == sum(broken[place, episode] for episode in at)
        assert table["episodes"][place] == len(at)
        shares = [1 - broken[place, episode] / count for episode, count in at.items()]
        if shares:
            assert table["obeyed"][place] == pytest.approx(np.mean(shares))
        if rule.forbids:
            assert table["outside"][place] == outside[place]
    forbidding = [place for place, rule in enumerate(rules) if rule.forbids]
    assert table["broken"][forbidding].sum() > 20
    assert table["outside"][forbidding].sum() > 0
    # They overlap: not all of them are the recorded one.
    recorded = np.isin(audited.rules, forbidding).sum()
    assert table["applies"][forbidding].sum() > recorded > 0


def test_the_rules_of_a_stretch_are_all_that_it_breaks(case: Case) -> None:
    audited = held(case)
    for stretch in audited.worst:
        broken = {
            place
            for row in range(stretch.row, stretch.row + stretch.length)
            for dimension in range(len(case.rules.actions))
            for place in in_force(case.rules, audited.observations[row], dimension)
            if not case.rules[place].obeyed_by(audited.labels[row, dimension])
        }
        assert stretch.rules == tuple(sorted(broken))


def test_freedom_is_what_is_not_forbidden(case: Case) -> None:
    rules, audited = case.rules, held(case)
    free = []
    for state in audited.observations:
        for dimension, action in enumerate(rules.actions):
            labels = np.arange(action.n_labels)
            applying = in_force(rules, state, dimension)
            allowed = np.all([rules[at].obeyed_by(labels) for at in applying], axis=0).sum()
            free.append(np.log(max(allowed, 1)) / np.log(len(labels)) if applying else 1.0)
    assert audited.freedom == pytest.approx(np.mean(free))
    assert 0 < audited.freedom < 1


def test_near_misses_are_of_rules_that_would_not_be_obeyed(case: Case) -> None:
    rules, audited = case.rules, held(case)
    spreads = spreads_of(audited.observations, sample_keys(case.log))
    near = set()
    for row in range(len(case.log)):
        state = audited.observations[row].astype(np.float64)
        wanted = -1
        for place, rule in enumerate(rules):
            missed = [one for one in rule.bounds if not one.low < state[one.feature] <= one.high]
            if not rule.enabled or len(missed) != 1:
                continue
            feature, low, high = missed[0]
            away = max(low - state[feature], state[feature] - high) / spreads[feature]
            if away <= NEAR and not rule.obeyed_by(audited.labels[row, rule.dimension]):
                wanted = place
                break
        assert audited.near[row] == (-1 if audited.is_broken[row] else wanted)
        near.add(audited.near[row])
    assert len(near) > 1


def test_rules_are_compared_where_they_say_what_a_log_can_be_compared_with(case: Case) -> None:
    rules = case.rules
    own = audit(rules, case.demonstrations)
    demanding = {rule.dimension for rule in rules if not rule.forbids}
    known = [
        rule
        for rule in rules
        if rule.enabled and not rule.placed and not (rule.forbids and rule.dimension in demanding)
    ]
    shares = [one for one in own.drift.rules if one.name != "no rule"]
    assert [one.name for one in shares] == [rules.name_of(rule) for rule in known]
    for one in shares:
        assert one.now == pytest.approx(one.before)
    forbidding = {rule.dimension for rule in rules if rule.forbids}
    without = len(rules.actions) - len(forbidding)
    assert len(own.drift.rules) - len(shares) == without
    assert own.drift.drifted == ()
    # Beside each other, both sides are counted alike, whatever stands before.
    beside = audit(rules, case.demonstrations, demonstrations=case.demonstrations).drift
    assert len(beside.rules) == len(rules) + len(rules.actions)
    for one in beside.all:
        assert one.now == one.before
    share = own.rule_table()["share"]
    for place, one in enumerate(beside.rules[: len(rules)]):
        episodes = own.counts.by_rule(own.counts.rules.applied, len(rules))[:, place]
        assert one.now == pytest.approx(np.mean(episodes / own.counts.steps))
        assert (one.now == 0) == (share[place] == 0)


def test_states_are_held_against_the_data_of_every_rule_that_applies(
    lander_like: Demonstrations,
) -> None:
    rules, log = never(lander_like), moved(lander_like)
    audited = audit(rules, log)
    pairs, beyond = 0, np.zeros(8)
    for state in audited.observations:
        for place in in_force(rules, state, 0):
            box = rules[place].box
            assert box is not None
            pairs += 1
            beyond += (state < box.low) | (state > box.high)
    assert [one.now for one in audited.drift.features] == pytest.approx((beyond / pairs).tolist())
    far = replace(log, observations=log.observations + np.float32(3))
    assert {one.what for one in audit(rules, far).drift.drifted} == {
        "states outside the middle 98 % of the data of the rule that applies",
        "steps in which it applies",
    }


def test_what_follows_from_probes_says_nothing_of_how_often_it_applies(
    lander_like: Demonstrations,
) -> None:
    rules = never(lander_like)
    probed = replace(rules, rules=tuple(replace(rule, origin="probed") for rule in rules))
    drift = audit(probed, lander_like).drift
    assert drift.all == ()
    assert "cannot be said: nothing that these rules say of them" in drift_text(drift)
    beside = audit(probed, lander_like, demonstrations=lander_like).drift
    assert len(beside.rules) == len(rules) + 1


@given(row=st.integers(0, 1_999))
def test_a_step_of_a_log_is_what_a_shield_decides(lander_like: Demonstrations, row: int) -> None:
    rules = behind(lander_like.select(range(5)))
    audited = audit(rules, lander_like)
    decision = Shield(rules).decide(lander_like.observations[row], lander_like.actions[row])
    place = audited.rules[row, 0]
    assert (None if place < 0 else place) == decision.rules[0]
    assert audited.executed[row] == decision.executed
    assert audited.is_broken[row] == decision.intervened
    assert audited.outside[row] == decision.outside


def test_a_step_says_what_is_forbidden(lander_like: Demonstrations) -> None:
    named = replace(lander_like, label_names=(("brake", "lift", "lower", "wait"),))
    rules = behind(named)
    audited = audit(rules, moved(named))
    rows = slice(0, len(audited.labels))
    tracks = {one.name: one.labels for one in audit_tracks(audited, rows)}
    texts = step_texts(audited, rows)
    for row, place in enumerate(audited.rules[:, 0].tolist()):
        if place < 0:
            continue
        rule = rules[place]
        assert np.isnan(tracks["forbidden"][row]) == (not rule.forbids)
        assert np.isnan(tracks["rule says"][row]) == bool(rule.forbids)
        if rule.forbids:
            forbidden = int(tracks["forbidden"][row])
            assert forbidden in rule.forbids
            assert (forbidden == audited.labels[row, 0]) == audited.is_broken[row]
            assert f"says never {rules.actions[0].label_names[forbidden]}" in texts[row]
        else:
            assert tracks["rule says"][row] == rule.action
    page = audit_html(audited, title="a log")
    assert "then never " in page
    assert "unless all others were forbidden too" in page
    alone = audit(never(named), named)
    assert [one.name for one in audit_tracks(alone, rows)][:2] == ["done", "forbidden"]
