"""The evidence envelope against a plain reading of the rule list."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import InputError, Shield, ShieldedEnv, mine_rules
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source

D = 3
VALUES = np.array([-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0, 1.5], dtype=np.float32)
DISCRETE = (LabelledDimension("push", ("left", "right", "wait"), first=4),)
JOINTS = (
    LabelledDimension.of_edges("hip", (-1.0, -0.25, 0.25, 1.0)),
    LabelledDimension.of_edges("knee", (-1.0, 0.0, 1.0)),
)


def box_of(rng, kind):
    """A box, one that is a point in some features, or none."""
    if kind == 0:
        return None
    pairs = np.sort(rng.choice(VALUES, (D, 2)), axis=1).astype(float)
    least, most = tuple(pairs[:, 0].tolist()), tuple(pairs[:, 1].tolist())
    return DataBox(least, least, most, most)


def random_rules(seed, actions, *, count=12):
    """Rules that overlap, some placed, some off, some without a box."""
    rng = np.random.default_rng(seed)
    rules = []
    for number in range(count):
        dimension = int(rng.integers(len(actions)))
        conditions = tuple(
            Condition(
                int(rng.integers(D)), "<=" if rng.random() < 0.5 else ">", float(rng.choice(VALUES))
            )
            for _ in range(rng.integers(0, 4))
        )
        rules.append(
            Rule(
                f"{dimension}.{number}",
                dimension,
                conditions,
                int(rng.integers(actions[dimension].n_labels)),
                0.1,
                1.0,
                1.0,
                5,
                enabled=bool(rng.random() < 0.85),
                origin="manual" if rng.random() < 0.4 else "mined",
                pinned=bool(rng.random() < 0.2),
                box=box_of(rng, rng.integers(3)),
            )
        )
    features = tuple(make_feature(name) for name in ("x", "y", "z"))
    return RuleSet(
        tuple(rules), actions, Source("", features, "none", 100, 1), Thresholds(0.0, 0.0)
    )


def make_feature(name):
    from sarl_core.demonstrations.dataset import Feature

    return Feature(name, "")


def states_of(seed, n=40):
    """Values on the edges, and one float32 step beside them."""
    rng = np.random.default_rng(seed)
    at = rng.choice(VALUES, (n, D))
    beside = rng.integers(3, size=(n, D))
    at = np.where(beside == 1, np.nextafter(at, np.float32(9)), at)
    at = np.where(beside == 2, np.nextafter(at, np.float32(-9)), at)
    return at.astype(np.float32)


def in_force(rules, state, dimension):
    """Algorithm 2: placed rules first, then the others, the first whose conditions hold."""
    own = [
        (number, rule)
        for number, rule in enumerate(rules)
        if rule.dimension == dimension and rule.enabled
    ]
    for number, rule in sorted(own, key=lambda entry: not entry[1].placed):
        holds = [
            (np.float64(state[c.feature]) <= c.threshold) == (c.op == "<=") for c in rule.conditions
        ]
        if all(holds):
            return number
    return None


def is_outside(rule, state):
    return rule.box is not None and any(
        not (least <= float(value) <= most)
        for value, least, most in zip(state, rule.box.least, rule.box.most, strict=True)
    )


@settings(max_examples=80)
@given(
    st.integers(0, 10_000), st.sampled_from([DISCRETE, JOINTS]), st.sampled_from(["act", "abstain"])
)
def test_one_state_many_states_and_the_rule_list_agree(seed, actions, outside):
    rule_set = random_rules(seed, actions)
    shield = Shield(rule_set, outside=outside)
    states = states_of(seed + 1)
    rng = np.random.default_rng(seed + 2)
    discrete = not actions[0].is_interval
    proposed = (
        rng.integers(4, 7, len(states))
        if discrete
        else rng.uniform(-1, 1, (len(states), 2)).astype(np.float32)
    )
    batch = shield.decide_batch(states, proposed)
    for row, state in enumerate(states):
        one = shield.decide(state, proposed[row])
        wanted = np.array(proposed[row], dtype=np.float64).reshape(-1)
        before = wanted.copy()
        beyond = changed = False
        for dimension, action in enumerate(actions):
            found = in_force(rule_set.rules, state, dimension)
            assert one.rules[dimension] == found
            if found is None:
                continue
            rule = rule_set.rules[found]
            if action.label_of(float(before[dimension])) == rule.action:
                continue
            out = is_outside(rule, state)
            beyond |= out
            if out and outside == "abstain":
                continue
            changed = True
            wanted[dimension] = (
                action.centre(rule.action) if action.is_interval else action.first + rule.action
            )
        assert one.outside == beyond
        assert one.intervened == changed
        assert np.array_equal(
            np.asarray(one.executed).reshape(-1), wanted.astype(np.asarray(proposed).dtype)
        )
        if not changed:
            assert np.asarray(one.executed).tobytes() == np.asarray(proposed[row]).tobytes()
        assert np.array_equal(batch.executed[row], one.executed)
        assert batch.intervened[row] == one.intervened
        assert batch.outside[row] == one.outside
        assert batch.margin[row] == one.margin


def test_a_rule_without_a_box_is_never_outside(lander_like):
    mined = mine_rules(lander_like, supp_min=0.0, conf_min=0.9)
    rules = replace(mined, rules=tuple(replace(rule, box=None) for rule in mined.rules))
    states = 9 * lander_like.observations
    labels = np.zeros(len(states), dtype=int)
    acting, abstaining = Shield(rules), Shield(rules, outside="abstain")
    assert not acting.keeps_boxes
    found, other = acting.decide_batch(states, labels), abstaining.decide_batch(states, labels)
    assert found.intervened.any()
    assert not found.outside.any()
    for one, two in zip(found, other, strict=True):
        assert np.array_equal(one, two)


def test_no_demonstrated_state_lies_outside(lander_like):
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=0.9)
    shield = Shield(rules, outside="abstain")
    assert shield.keeps_boxes
    decisions = shield.decide_batch(
        lander_like.observations, np.full(len(lander_like.observations), 3)
    )
    assert decisions.intervened.any()
    assert not decisions.outside.any()


def test_a_word_that_is_no_choice_is_refused(lander_like):
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    with pytest.raises(InputError, match="neither act nor abstain"):
        Shield(rules, outside="stop")


@pytest.fixture(scope="module")
def cart():
    """Rules of the cart pole whose boxes hold half of the angles they apply to."""
    from sarl_core import record

    shown = record("CartPole-v1", "expert", steps=2_000, stochastic=True)
    rules = mine_rules(shown, supp_min=0.005, conf_min=0.9)
    narrow = tuple(
        replace(
            rule,
            box=DataBox(
                (*rule.box.least[:2], -0.01, *rule.box.least[3:]),
                rule.box.low,
                rule.box.high,
                (*rule.box.most[:2], 0.01, *rule.box.most[3:]),
            ),
        )
        for rule in rules.rules
    )
    return replace(rules, rules=narrow)


@pytest.mark.parametrize("outside", ["act", "abstain"])
def test_the_records_of_all_ways_to_play_agree(cart, outside):
    from sarl_core import rollout
    from sarl_core.rendering.camera import film_episode
    from sarl_core.rendering.film import Film, Palette
    from sarl_core.rollouts.trial import make_agent

    shield = Shield(cart, outside=outside)
    played = rollout("CartPole-v1", "novice", shield=shield, episodes=3, seed=5)
    steps = played.steps
    again = shield.decide_batch(steps.observation, steps.proposed[:, 0])
    assert np.array_equal(steps.outside, again.outside)
    assert steps.outside.any()
    assert not steps.outside.all()
    assert (steps.outside & steps.intervened).any() == (outside == "act")
    for episode in range(3):
        own = steps.of_episode(episode)
        assert played.outside[episode] == own.outside.sum()
        assert played.withheld[episode] == (own.outside & ~own.intervened).sum()
    broken = (steps.intervened | steps.outside).sum()
    assert played.summary()["outside_rate"] == steps.outside.sum() / broken
    assert played.part(1, 3).outside.tolist() == played.outside[1:].tolist()
    assert steps.to_frame()["outside"].tolist() == steps.outside.tolist()

    agent = make_agent("novice", "CartPole-v1", seed=5)
    filmed = film_episode(
        "CartPole-v1", agent, shield, 5, Film(Palette()), 500, lambda done, total: None
    )
    assert filmed.steps.outside.tolist() == steps.of_episode(0).outside.tolist()
    assert filmed.outside[0] == played.outside[0]
    assert filmed.withheld[0] == played.withheld[0]


def test_the_record_of_an_environment_says_it(cart):
    import gymnasium
    from stable_baselines3.common.vec_env import DummyVecEnv

    from sarl_core import ShieldedVecEnv

    shield = Shield(cart)
    env = ShieldedEnv(gymnasium.make("CartPole-v1"), shield)
    many = ShieldedVecEnv(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")]), shield)
    env.reset(seed=3)
    many.seed(3)
    many.reset()
    seen = set()
    for step in range(40):
        action = step % 2
        _, _, terminated, truncated, info = env.step(action)
        _, _, _, infos = many.step(np.array([action]))
        record, other = info["shield"], infos[0]["shield"]
        again = shield.decide(record.observation, action)
        assert record.outside == other.outside == again.outside
        seen.add(record.outside)
        if terminated or truncated:
            break
    assert seen == {True, False}


def test_without_a_shield_nothing_is_outside():
    from sarl_core import rollout

    played = rollout("CartPole-v1", "novice", episodes=2, seed=0)
    assert not played.steps.outside.any()
    assert played.outside.tolist() == [0, 0]
    assert played.summary()["outside_rate"] == 0.0
