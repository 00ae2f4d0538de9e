"""An aggregation that begins with given rules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import InputError, load_demonstrations, mine_rules
from sarl_core.agents.agent import EXPERT_FOLDER
from sarl_core.improving.aggregation import aggregate
from sarl_core.improving.aggregation_files import aggregation_card
from sarl_core.improving.plan import Plan
from sarl_core.improving.refinement import Refinement
from sarl_core.improving.shapes import with_a_rule_less
from sarl_core.mining.rule_set import RuleSet, load_rules, rules_digest
from sarl_core.mining.rule_tree import recount
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF
from sarl_core.rollouts.seeds import REFINEMENT
from sarl_core.shielding.shield import Shield

DATA = EXPERT_FOLDER.parent
PLAN = Plan(max_rules=3, rounds=1, episodes=2, validation=2, report=2)


@pytest.fixture(scope="module")
def cart():
    return load_demonstrations(DATA / "demonstrations" / "cartpole.parquet").select(range(4))


def shipped(name: str) -> RuleSet:
    return load_rules(DATA / "rules" / f"{name}.json")


def as_it_acts(rules: RuleSet, states: np.ndarray) -> np.ndarray:
    label = np.zeros(len(states), dtype=np.int64)
    return Shield(rules).decide_batch(states, label).executed


@pytest.mark.parametrize("name", ["cartpole_compact", "cartpole_combined"])
def test_the_first_round_plays_them(name, cart):
    rules = shipped(name)
    found = aggregate(cart, PLAN, first_rules=rules)
    assert [one.rules for one in found.rounds] == [len(rules)]
    assert [rule.conditions for rule in found.rule_set.rules] == [
        rule.conditions for rule in rules.rules
    ]
    states = cart.raw_observations
    assert np.array_equal(as_it_acts(found.rule_set, states), as_it_acts(rules, states))
    assert len(set(as_it_acts(rules, states).tolist())) == 2
    card = aggregation_card(found, command="")
    assert card["first_rules"] == rules_digest(rules)
    assert "first_rules" not in aggregation_card(aggregate(cart, PLAN), command="")


def test_later_rounds_learn_from_where_they_led(cart):
    first, second = aggregate(
        cart, replace(PLAN, rounds=2), first_rules=shipped("cartpole_compact")
    ).rounds
    assert first.pairs == len(cart)
    assert second.pairs > first.pairs


def test_a_search_begins_with_them(cart, small_search, monkeypatch):
    begun = []
    monkeypatch.setattr(
        Refinement, "run", lambda self, *_, **__: begun.append(self.start) or [self.start]
    )
    rules = shipped("cartpole_combined")
    plan = replace(PLAN, turns=1, search_episodes=2)
    found = aggregate(cart, plan, first_rules=rules)
    assert len(begun[0].derived) == 1
    assert len(found.rule_set) == len(rules) == 2


def test_rules_beyond_the_budget_are_left_out_one_after_the_other(cart, small_search):
    ticks = []
    rules = shipped("cartpole_compact")
    plan = replace(PLAN, max_rules=2, turns=1, search_episodes=2, validation=8)
    found = aggregate(
        cart, plan, first_rules=rules, progress=lambda *tick: ticks.append(tick) or True
    )
    assert (len(rules), len(found.rule_set)) == (3, 2)
    assert found.refined
    assert [one.rules for one in found.rounds] == [3]
    done, totals = [done for done, _ in ticks], {total for _, total in ticks}
    assert done == sorted(done)
    assert totals == {done[-1]}
    card = aggregation_card(found, command="")
    assert (card["left_out"], card["budget"], card["refined"]) == (1, 2, True)
    again = aggregate(cart, plan, first_rules=rules, jobs=2)
    assert rules_digest(again.rule_set) == rules_digest(found.rule_set)


@pytest.mark.parametrize(("name", "most"), [("cartpole_compact", 3), ("lunar_lander_compact", 41)])
def test_as_many_seeds_are_taken_as_are_planned(name, most, small_search, monkeypatch):
    """With nothing to leave out, and with four rules too many, between which all is moved."""
    searches = []
    run = Refinement.run
    monkeypatch.setattr(
        Refinement, "run", lambda self, *_, **named: searches.append(self) or run(self, 0, **named)
    )
    task = name.removesuffix("_compact")
    start = load_demonstrations(DATA / "demonstrations" / f"{task}.parquet").select(range(4))
    plan = replace(PLAN, max_rules=most, turns=1, search_episodes=2, max_steps=30)
    rules = shipped(name)
    ticks = []
    aggregate(start, plan, first_rules=rules, progress=lambda done, _: ticks.append(done) or True)
    (search,) = searches
    effort = plan.search(pruned=len(rules) - most)
    assert search._next - REFINEMENT == effort.seeds(0)
    assert search._done == search._total == effort.cost(0)
    assert ticks == sorted(ticks)


def stopped_in(part, cart, monkeypatch):
    """Ctrl-C in a part of a refinement that is to leave a rule out."""

    def interrupted(*arguments, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr(Refinement, part, interrupted)
    plan = replace(PLAN, max_rules=2, turns=1, search_episodes=2)
    return aggregate(cart, plan, first_rules=shipped("cartpole_compact"))


def test_who_stops_has_no_more_rules_than_were_asked_for(cart, small_search, monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        stopped_in("_prune", cart, monkeypatch)


@pytest.mark.parametrize("part", ["_move_after_pruning", "_turn"])
def test_who_stops_later_has_what_was_left(part, cart, small_search, monkeypatch):
    found = stopped_in(part, cart, monkeypatch)
    assert len(found.rule_set) == 2
    assert found.refined
    assert not found.is_finished


def test_what_is_left_asks_something(cart):
    (tree,) = recount(shipped("cartpole_compact"), cart)
    assert (tree.feature == LEAF).sum() == 3
    less = with_a_rule_less([tree], cart, max_rules=2, count=100)
    assert {len(one.structures[0].feature) for one in less} == {3}


def test_more_seeds_than_one_run_has_are_refused(cart):
    plan = replace(PLAN, max_rules=2, turns=1, search_episodes=500)
    rules = shipped("lunar_lander_compact")
    start = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet").select(range(4))
    with pytest.raises(InputError, match="give a larger --max-rules, or fewer --search-episodes"):
        aggregate(start, plan, first_rules=rules)


def test_what_few_states_meet_is_left_out_first():
    start = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet").select(range(20))
    (tree,) = recount(shipped("lunar_lander_compact"), start)
    leaves = np.flatnonzero(tree.feature == LEAF)
    every = with_a_rule_less([tree], start, max_rules=44, count=100)
    few = with_a_rule_less([tree], start, max_rules=44, count=5)
    assert with_a_rule_less([tree], start, max_rules=45, count=100) == []
    before = tree.label[tree.apply(start.observations)]
    rare = np.sort(tree.samples[leaves])
    assert [one.key for one in few] == [one.key for one in every[:5]]
    for most, one in zip(rare.tolist(), every, strict=False):
        (less,) = one.trees(start, 2)
        after = less.label[less.apply(start.observations)]
        assert (less.feature == LEAF).sum() < len(leaves)
        assert (after != before).sum() <= most


@pytest.mark.parametrize(
    ("task", "name", "plan", "sentence"),
    [
        (
            "cartpole",
            "cartpole_compact",
            replace(PLAN, max_rules=2),
            "give --max-rules 3, fewer rules, or --rounds 1 and --refine",
        ),
        (
            "cartpole",
            "cartpole_compact",
            replace(PLAN, thresholds=Thresholds(0.1, 0.9)),
            "give --first-rules without --support and --confidence",
        ),
        (
            "pendulum",
            "cartpole_compact",
            PLAN,
            "ask about 4 features and the demonstrations have 3",
        ),
        ("pendulum", "pendulum_combined", replace(PLAN, max_rules=16), "give --divider 16"),
    ],
)
def test_what_does_not_fit_is_refused(task, name, plan, sentence):
    start = load_demonstrations(DATA / "demonstrations" / f"{task}.parquet")
    with pytest.raises(InputError, match=sentence):
        aggregate(start, plan, first_rules=shipped(name))


def test_rules_that_do_not_say_what_to_do_everywhere_are_refused(cart):
    plan = replace(PLAN, max_rules=1_000)
    rules = shipped("cartpole_compact")
    off = replace(rules, rules=(*rules.rules[:-1], replace(rules.rules[-1], enabled=False)))
    with pytest.raises(InputError, match="are switched off; give those of an aggregation"):
        aggregate(cart, plan, first_rules=off)
    mined = mine_rules(cart, supp_min=0.01, conf_min=0.95)
    with pytest.raises(InputError, match="not all leaves of one tree; give a rule set that covers"):
        aggregate(cart, plan, first_rules=mined)


def test_amounts_keep_their_intervals():
    pendulum = load_demonstrations(DATA / "demonstrations" / "pendulum.parquet").select(range(4))
    rules = shipped("pendulum_combined")
    plan = replace(PLAN, max_rules=16, divider=16, max_steps=20)
    found = aggregate(pendulum, plan, first_rules=rules)
    assert [rule.action for rule in found.rule_set.rules] == [rule.action for rule in rules.rules]
    (torque,) = rules.actions
    other = replace(torque, edges=tuple(2 * edge for edge in torque.edges))
    with pytest.raises(InputError, match="part 'torque' into other intervals than the demons"):
        aggregate(pendulum, plan, first_rules=replace(rules, actions=(other,)))
