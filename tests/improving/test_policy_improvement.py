"""Rules are changed by what their own episodes say of each label."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, load_demonstrations
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.improving import policy_improvement
from sarl_core.improving.candidate import Candidate
from sarl_core.improving.critic import Critic
from sarl_core.improving.policy_improvement import (
    MOST_PROPOSALS,
    DeviatingAgent,
    PolicyImprovement,
)
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import LEAF
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.player import check_environment, shield_for
from sarl_core.shielding.shield import Shield

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
STATES = np.random.default_rng(0).uniform(-1, 1, (600, 2)).astype(np.float32)
PAIRS = Demonstrations(
    observations=STATES,
    actions=np.random.default_rng(1).integers(0, 3, 600),
    episodes=np.arange(600),
)
# Says 0 on the left, 1 on the right of the first feature.
TREE = TreeStructure(
    feature=np.array([0, LEAF, LEAF]),
    threshold=np.array([0.0, 0.0, 0.0]),
    children_left=np.array([1, LEAF, LEAF]),
    children_right=np.array([2, LEAF, LEAF]),
    label=np.array([0, 0, 1]),
)
HERE = Candidate.of([TREE], [], observed=2)


def improving(here: Candidate = HERE, **changes: object) -> PolicyImprovement:
    named = {"observed": 2, "max_rules": 3, "worth": 0.0, "seed": 0, **changes}
    return PolicyImprovement(here, label_dimensions(PAIRS, 2), **named)


def said(candidate: Candidate, states: np.ndarray = STATES) -> np.ndarray:
    (structure,) = candidate.structures
    return structure.label[structure.apply(states)]


def known(monkeypatch: pytest.MonkeyPatch, worth: np.ndarray) -> list[np.ndarray]:
    """Critics that say so, (N, labels); returns what they have learned about."""
    learned: list[np.ndarray] = []
    monkeypatch.setattr(Critic, "values", lambda self, observations: [worth])
    monkeypatch.setattr(
        Critic, "learn", lambda self, experience, labels, batches: learned.append(labels)
    )
    monkeypatch.setattr(policy_improvement.Experience, "join", lambda parts: _shown())
    return learned


def _shown() -> policy_improvement.Experience:
    ends = np.ones(600, dtype=bool)
    return policy_improvement.Experience(
        STATES, PAIRS.actions[:, None], np.zeros(600), last=ends, open=~ends
    )


# --- what is proposed --------------------------------------------------------------------------


def test_what_is_worth_most_is_changed_first(monkeypatch) -> None:
    """Everywhere the third label is worth a little more, above on the right a lot."""
    worth = np.zeros((600, 3))
    worth[:, 2] = 0.1
    right_above = (STATES[:, 0] > 0) & (STATES[:, 1] > 0.5)
    worth[right_above, 2] = 10.0 * STATES[right_above, 1]
    known(monkeypatch, worth)
    here = said(HERE)
    proposals = improving().proposals(PAIRS)
    assert 0 < len(proposals) <= MOST_PROPOSALS
    answers = [here.tobytes(), *(said(one).tobytes() for one in proposals)]
    assert len(set(answers)) == len(answers)
    changed = [np.flatnonzero(said(one) != here) for one in proposals]
    # Of the smallest share only what is worth most, and that by the label that is.
    dearest = changed[0]
    assert len(dearest) < 0.05 * 600
    assert STATES[dearest, 1].min() > 0.85
    assert set(said(proposals[0])[dearest]) == {2}
    assert all((one.structures[0].feature == LEAF).sum() <= 3 for one in proposals)


def test_where_no_other_label_is_worth_more_nothing_is_changed(monkeypatch) -> None:
    worth = np.zeros((600, 3))
    worth[np.arange(600), said(HERE)] = 5.0
    known(monkeypatch, worth)
    assert improving().proposals(PAIRS) == []


def test_a_full_tree_has_room_made_for_what_is_worth_more(monkeypatch) -> None:
    """A query that changes little gives its place to one that helps."""
    tree = TreeStructure(
        feature=np.array([0, LEAF, 0, LEAF, LEAF]),
        threshold=np.array([0.0, 0.0, 0.95, 0.0, 0.0]),
        children_left=np.array([1, LEAF, 3, LEAF, LEAF]),
        children_right=np.array([2, LEAF, 4, LEAF, LEAF]),
        label=np.array([0, 0, 0, 1, 2]),
    )
    here = Candidate.of([tree], [], observed=2)
    worth = np.zeros((600, 3))
    worth[np.arange(600), said(here)] = 1.0
    left_above = (STATES[:, 0] < 0) & (STATES[:, 1] > 0.8)
    worth[left_above, 2] = 20.0
    known(monkeypatch, worth)
    best = max(
        improving(here).proposals(PAIRS),
        key=lambda one: worth[np.arange(600), said(one)].sum(),
    )
    assert (best.structures[0].feature == LEAF).sum() == 3
    assert (said(best)[left_above] == 2).mean() > 0.9
    assert (said(best)[(STATES[:, 0] > 0) & (STATES[:, 0] < 0.9)] == 1).all()


def test_new_queries_may_ask_about_combinations(monkeypatch) -> None:
    both = DerivedFeature(Combination(((0, 1.0), (1, 1.0))))
    pairs = PAIRS.deriving([both])
    worth = np.zeros((600, 3))
    worth[:, 2] = np.maximum(STATES.sum(axis=1) - 1.0, 0.0)
    learned = known(monkeypatch, worth)
    way = improving()
    proposals = way.proposals(pairs)
    assert any(one.derived == (both,) for one in proposals)
    # And are known again when it goes on from there.
    way.here = next(one for one in proposals if one.derived == (both,))
    way.proposals(pairs.deriving(way.here.derived))
    states = pairs.deriving(way.here.derived).observations
    np.testing.assert_array_equal(learned[-1][:, 0], said(way.here, states))


# --- whole ways on real environments -----------------------------------------------------------


def played(env_id: str, agent: object, shield: Shield | None, count: int) -> Episodes:
    return rollout(
        env_id, agent, shield=shield, episodes=count, seed=0, keep_steps=True, max_steps=150
    )


@pytest.mark.parametrize(("name", "divider"), [("cartpole", 2), ("lunar_lander_continuous", 8)])
def test_single_actions_are_others_than_the_rules_say(name: str, divider: int) -> None:
    pairs = load_demonstrations(DATA / f"{name}.parquet").select(range(4))
    trees = grow_budgeted_trees(pairs, max_rules=4, divider=divider)
    dimensions = label_dimensions(pairs, divider)
    shield = shield_for(pairs.env_id, Shield(leaf_rules(trees)))
    adapter = check_environment(pairs.env_id, None).adapter
    agent = DeviatingAgent(shield, dimensions, adapter)
    steps = played(pairs.env_id, agent, None, 12).steps
    labels = np.column_stack(
        [one.labels_of(column) for one, column in zip(dimensions, steps.executed.T, strict=True)]
    )
    rules = np.column_stack([tree.label[tree.apply(steps.observation)] for tree in trees])
    others = labels != rules
    assert others.sum(axis=1).max() == 1  # one dimension at a time
    n_labels = dimensions[0].n_labels
    share = 0.15 * (1 - 1 / n_labels)  # some happen to be what the rules say
    assert others.any(axis=1).mean() == pytest.approx(share, abs=0.04)
    assert (others.sum(axis=0) > 0).all()
    assert len(np.unique(labels)) == n_labels


def test_rules_come_to_balance_the_pole_by_episodes_alone(monkeypatch) -> None:
    """The only query is about the angle: nobody says that how it changes is worth more."""
    monkeypatch.setattr(policy_improvement, "_FIRST_BATCHES", 600)
    monkeypatch.setattr(policy_improvement, "_BATCHES", 200)
    pairs = load_demonstrations(DATA / "cartpole.parquet").select(range(4))
    angle = replace(TREE, feature=np.array([2, LEAF, LEAF]))
    way = PolicyImprovement(
        Candidate.of([angle], [], observed=4),
        label_dimensions(pairs, 2),
        observed=4,
        max_rules=4,
        worth=0.0,
        seed=0,
    )
    adapter = check_environment(pairs.env_id, None).adapter

    def shield(candidate: Candidate) -> Shield:
        return shield_for(pairs.env_id, Shield(leaf_rules(candidate.trees(pairs, 2))))

    achieved = [played(pairs.env_id, "novice", shield(way.here), 20)]
    for _ in range(4):
        agent = DeviatingAgent(shield(way.here), label_dimensions(pairs, 2), adapter)
        way.add(played(pairs.env_id, agent, None, 40))
        way.add(achieved[-1])
        steps = achieved[-1].steps
        met = Demonstrations(
            observations=steps.observation, actions=steps.executed[:, 0], episodes=steps.episode
        )
        proposals = [way.here, *way.proposals(met)]
        tried = [played(pairs.env_id, "novice", shield(one), 20) for one in proposals]
        best = max(range(len(tried)), key=lambda place: tried[place].returns.mean())
        way.here = proposals[best]
        achieved.append(tried[best])
    means = [float(one.returns.mean()) for one in achieved]
    assert means[0] < 60
    assert means[-1] > 100, means


def test_a_failure_is_counted_where_it_ends_an_episode(monkeypatch) -> None:
    """Rewards of the last step alone are less, by the worth."""
    pairs = load_demonstrations(DATA / "cartpole.parquet").select(range(2))
    shown = played(pairs.env_id, "novice", None, 6)
    assert shown.failures.count == 6
    parts: dict[float, policy_improvement.Experience] = {}
    for worth in (0.0, 50.0):
        way = PolicyImprovement(
            HERE, label_dimensions(pairs, 2), observed=4, max_rules=2, worth=worth, seed=0
        )
        way.add(shown)
        (parts[worth],) = way._parts
    less = parts[0.0].rewards - parts[50.0].rewards
    assert parts[0.0].last.sum() == 6
    np.testing.assert_array_equal(less, 50.0 * parts[0.0].last)
    np.testing.assert_array_equal(parts[0.0].rewards, shown.steps.reward)


def test_an_episode_that_ends_on_its_last_step_is_over() -> None:
    """Where the limit of time is reached as it ends, nothing would have followed."""
    shown = played("CartPole-v1", "novice", None, 3)
    assert shown.terminated.all()
    pairs = load_demonstrations(DATA / "cartpole.parquet").select(range(2))
    way = PolicyImprovement(
        HERE, label_dimensions(pairs, 2), observed=4, max_rules=2, worth=0.0, seed=0
    )
    way.add(replace(shown, truncated=np.array([True, True, True])))
    way.add(replace(shown, terminated=np.zeros(3, bool), truncated=np.array([True, False, True])))
    assert [int(part.open.sum()) for part in way._parts] == [0, 2]


def test_the_latest_steps_are_learned_from_and_of_both_kinds(monkeypatch) -> None:
    """However long the episodes are in which no action deviates."""
    monkeypatch.setattr(policy_improvement, "_MOST_STEPS", 150)
    pairs = load_demonstrations(DATA / "cartpole.parquet").select(range(2))
    followed = played("CartPole-v1", "expert", None, 2)
    deviating = played("CartPole-v1", "novice", None, 4)
    way = PolicyImprovement(
        HERE, label_dimensions(pairs, 2), observed=4, max_rules=2, worth=0.0, seed=0
    )
    for _ in range(3):
        way.add(deviating)
        way.add(followed)
    assert len(followed.steps.episode) > 150
    assert list(map(len, way._parts)) == [
        len(deviating.steps.episode),
        len(followed.steps.episode),
    ]
