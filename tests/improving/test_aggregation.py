"""The expert answers where the rules lead: rounds, choice, refinement, report."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sarl_core import InputError, load_demonstrations
from sarl_core.agents.agent import EXPERT_FOLDER
from sarl_core.demonstrations.dataset import with_formulas
from sarl_core.improving.aggregation import aggregate
from sarl_core.improving.aggregation_files import aggregation_card, card_path, save_aggregation
from sarl_core.improving.alternation import ScoredStates, alternated
from sarl_core.improving.candidate import Evaluator, structure_of
from sarl_core.improving.plan import Plan
from sarl_core.improving.questions import ask, importance, scores
from sarl_core.improving.refinement import Refinement
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.growing.structure import count_tree
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.seeds import REPORT, ROUNDS
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

DATA = EXPERT_FOLDER.parent / "demonstrations"
CART = "CartPole-v1"


@pytest.fixture(scope="module")
def cart():
    return load_demonstrations(DATA / "cartpole.parquet").select(range(4))


@pytest.fixture(scope="module")
def small() -> Plan:
    return Plan(max_rules=5, rounds=3, episodes=4, validation=16, report=8)


@pytest.fixture(scope="module")
def found(cart, small):
    return aggregate(cart, small)


def test_it_gives_rules_within_the_budget_and_tells_every_round(found, cart, small):
    assert [one.number for one in found.rounds] == [1, 2, 3]
    assert found.rounds[0].pairs == len(cart)
    pairs = [one.pairs for one in found.rounds]
    assert pairs == sorted(pairs)
    assert pairs[2] > pairs[1] > pairs[0]
    assert all(one.rules <= 5 and len(one.returns) == 4 for one in found.rounds)
    assert all(one.coverage == 1.0 for one in found.rounds)
    assert len(found.rule_set) <= 5
    assert found.rule_set.cut == "leaves"
    assert found.demonstrations.digest == found.rule_set.source.digest
    assert len(found.demonstrations) == found.rounds[found.chosen - 1].pairs
    # What comes out is better than what one comes from.
    alone = rollout(CART, "novice", episodes=8, seed=REPORT).returns.mean()
    assert found.reported.returns.mean() > 2 * alone


def test_the_report_is_a_fresh_run_of_the_rules(found):
    assert found.reported.seeds.tolist() == list(range(REPORT, REPORT + 8))
    again = rollout(CART, "novice", shield=Shield(found.rule_set), episodes=8, seed=REPORT)
    assert (again.returns == found.reported.returns).all()


def test_what_is_told_of_a_round_can_be_checked_by_hand(cart, small, found):
    (tree,) = grow_budgeted_trees(
        cart_answers(cart),
        max_rules=5,
        weights=importance(scores(make_agent("expert", CART), cart.observations)),
    )
    expert = make_agent("expert", CART)
    states = ScoredStates(cart.observations, scores(expert, cart.observations))
    changed = alternated(structure_of(tree), states, max_rules=5)
    rules = leaf_rules([count_tree(changed, cart_answers(cart), 0, divider=2)])
    run = rollout(CART, "novice", shield=Shield(rules), episodes=4, seed=ROUNDS)
    first = found.rounds[0]
    assert (first.returns == run.returns).all()
    wanted = make_agent("expert", CART).act(run.steps.observation, None)[:, 0]
    said = np.array([rule.action for rule in rules.rules])[run.steps.rules[:, 0]]
    assert first.disagreement == pytest.approx((wanted != said).mean())
    assert first.needed == pytest.approx(first.disagreement)  # one dimension, all covered


def cart_answers(cart):
    return replace(cart, actions=make_agent("expert", CART).act(cart.observations, None)[:, 0])


def test_the_same_plan_gives_the_same_rules_whatever_the_processes(cart, small, found):
    again = aggregate(cart, small, jobs=2)
    assert again.rule_set == found.rule_set
    assert (again.reported.returns == found.reported.returns).all()


def test_states_in_which_a_formula_has_no_value_are_not_learned_from(cart, small_search):
    """In every demonstrated state it is 1; further to the left, where rules lead, 0/0."""
    least = 0.001 - float(cart.observations[:, 2].min())
    upright = f"max(pole_angle + {least:.6f}, 0)"
    start = with_formulas(cart, [f"upright = {upright} / {upright}"])
    plan = Plan(max_rules=2, rounds=2, episodes=8, validation=4, report=2, turns=1, max_steps=80)
    found = aggregate(start, plan)
    assert len(found.rounds) == 2
    met = int(found.rounds[0].returns.sum())  # 1 a step
    assert 0 < found.rounds[1].pairs - found.rounds[0].pairs < met
    assert (found.demonstrations.observations[:, 4] == 1.0).all()
    assert found.is_finished


@pytest.mark.parametrize("limit", [700, 60])
def test_episodes_of_the_search_alone_have_another_limit(cart, small_search, monkeypatch, limit):
    longest = {}
    play = Refinement._play

    def noted(self, *arguments, **named):
        played = play(self, *arguments, **named)
        where = self._evaluator.env_id
        longest[where] = max(longest.get(where, 0), int(played.lengths.max()))
        return played

    monkeypatch.setattr(Refinement, "_play", noted)
    plan = Plan(
        max_rules=4, rounds=1, episodes=4, validation=8, report=8, turns=1, search_limit=limit
    )
    found = aggregate(cart, plan)
    (environment,) = longest
    assert (environment.id, environment.keywords) == ("CartPole-v1", {"max_episode_steps": limit})
    assert min(limit, 500) <= longest[environment] <= limit
    assert 60 < found.reported.lengths.max() <= 500
    assert found.env_id == "CartPole-v1"


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        ({"search_worth": 7.5, "choose": "failures"}, 7.5, 7.5),
        ({"search_worth": 7.5}, 7.5, 7.5),
        ({"choose": "failures"}, 20.0, 500.0),  # returns of CartPole differ by so much
        ({}, 0.0, 0.0),
    ],
)
def test_what_a_failure_counts_in_the_search(cart, small_search, monkeypatch, change, least, most):
    worths = set()
    scores = Evaluator.scores

    def noted(self, *arguments, **named):
        worths.add(self.worth)
        return scores(self, *arguments, **named)

    monkeypatch.setattr(Evaluator, "scores", noted)
    plan = Plan(max_rules=2, rounds=1, episodes=4, validation=8, report=8, turns=1, **change)
    card = aggregation_card(aggregate(cart, plan), command="typed so")
    (worth,) = worths
    assert least <= worth <= most
    assert card.get("search_worth") == change.get("search_worth")


def test_no_failure_counts_where_none_is_known():
    pendulum = load_demonstrations(DATA / "pendulum.parquet").select(range(2))
    with pytest.raises(InputError, match="no failure can count in the search, because"):
        aggregate(pendulum, Plan(max_rules=4, turns=1, search_worth=50.0))


def test_another_seed_gives_other_episodes(cart, small, found):
    other = aggregate(cart, replace(small, seed=1, rounds=1))
    assert not np.array_equal(other.rounds[0].returns, found.rounds[0].returns)


def test_thresholds_cut_the_trees(cart):
    plan = Plan(
        max_rules=8, rounds=2, episodes=2, validation=4, report=2, thresholds=Thresholds(0.05, 0.9)
    )
    found = aggregate(cart, plan)
    assert found.rule_set.cut == "thresholds"
    assert found.rule_set.thresholds == Thresholds(0.05, 0.9)
    assert all(rule.confidence >= 0.9 and rule.support >= 0.05 for rule in found.rule_set.rules)
    assert any(one.coverage < 1.0 for one in found.rounds)
    assert all(one.needed >= 1.0 - one.coverage for one in found.rounds)


def test_progress_counts_up_to_the_end(cart, small):
    told = []
    aggregate(cart, small, progress=lambda done, total: told.append((done, total)))
    counts = [done for done, _ in told]
    assert counts == sorted(counts)
    assert told[-1][0] == told[-1][1]
    assert len({total for _, total in told}) == 1


def test_the_card_says_how_the_rules_came_about(found, tmp_path):
    written, card = save_aggregation(found, tmp_path / "rules.json", command="typed so")
    assert written == tmp_path / "rules.json"
    assert json.loads(card_path(tmp_path / "rules.json").read_text()) == card
    assert RuleSet.load(tmp_path / "rules.json") == found.rule_set
    assert card["command"] == "typed so"
    assert card["reported"]["mean"] == pytest.approx(found.reported.returns.mean(), abs=0.01)
    assert [one["number"] for one in card["rounds"]] == [1, 2, 3]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"max_rules": 1}, "the budget of rules is 1; give 2 or more"),
        ({"max_rules": -5}, "the budget of rules is -5; give 2 or more"),
        ({"rounds": 0}, "the number of rounds is 0"),
        ({"episodes": 0}, "the number of episodes a round is 0"),
        ({"rounds": 1_001}, "the number of rounds is 1,001; give 1,000 or fewer"),
        ({"episodes": 10_001}, "the number of episodes a round is 10,001; give 10,000 or fewer"),
        ({"validation": 500_001}, "validation episodes is 500,001; give 500,000 or fewer"),
        ({"turns": 10**6}, "the number of turns is 1,000,000; give"),
        ({"turns": -1}, "the number of turns is -1"),
        ({"turns": 1, "search_episodes": 0}, "the number of search episodes is 0"),
        ({"turns": 1, "search_episodes": 10**9}, "give 1,000 or fewer"),
        (
            {"turns": 1, "rounds": 400, "search_episodes": 1_000},
            "give fewer rounds, --search-steps, --search-generations or",
        ),
        ({"turns": 1, "search_limit": 0}, "the limit of a search episode is 0"),
        ({"seed": -1}, "the seed is -1"),
    ],
)
def test_a_plan_that_cannot_be_done_is_refused(change, sentence):
    with pytest.raises(InputError, match=sentence):
        Plan(**{"max_rules": 4, **change})


def test_rounds_without_turns_need_no_seeds_of_a_search():
    assert Plan(4, rounds=1_000, search_episodes=1_000).turns == 0


def test_who_acts_at_random_cannot_be_asked(cart, small):
    with pytest.raises(InputError, match="'novice' acts at random and cannot be asked"):
        aggregate(cart, small, expert="novice")
    with pytest.raises(InputError, match="name no environment"):
        aggregate(replace(cart, env_id=""), small)


def test_scores_and_importance():
    expert = make_agent("expert", CART)
    states = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    found = scores(expert, states)
    assert found.shape == (50, 2)
    answers = ask(expert, states, np.arange(len(states)))
    assert (found.argmax(axis=1) == answers[:, 0]).all()
    assert found.min() >= -4.0
    assert importance(found).mean() == pytest.approx(1.0)
    assert (importance(np.zeros((3, 2))) == 1.0).all()
    assert scores(make_agent("expert", "Pendulum-v1"), np.zeros((2, 3), np.float32)) is None
