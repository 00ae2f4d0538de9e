"""Whatever is observed and proposed: one answer, alone and in a batch, that obeys the rules."""

from __future__ import annotations

import math

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from stable_baselines3.common.vec_env import DummyVecEnv

from sarl_core import InputError, RuleSet, Shield, ShieldedEnv, ShieldedVecEnv, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.exports.code_python import rules_to_python
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import Source
from sarl_core.shielding import matching
from tests.shielding.any_inputs import ACTIONS, observations, proposals, rule_sets

PROJECTIONS = ("centre", "clip", "expert")


@pytest.fixture(autouse=True, scope="module")
def few_are_walked_together_too():
    """Else a small batch would be matched as single states are, and compared with itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(matching, "_FEW", 0)
        yield


@st.composite
def shields(draw):
    rule_set = draw(rule_sets())
    return Shield(
        rule_set,
        projection=draw(st.sampled_from(PROJECTIONS)),
        outside=draw(st.sampled_from(["act", "abstain"])),
        on_invalid=draw(st.sampled_from(["raise", "pass"])),
    )


def answer(decide, observation, action):
    """What is decided, or the sentence."""
    try:
        return decide(observation, action)
    except InputError as error:
        text = str(error)
        assert len(text) < 400
        assert "\n" not in text
        return text


def same_action(one, other):
    """The same numbers of the same kind; the same object where they are none."""
    if one is other:
        return True
    one, other = np.asarray(one), np.asarray(other)
    return (
        one.dtype == other.dtype
        and one.shape == other.shape
        and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    )


def same_number(one, other):
    return one == other or (math.isnan(one) and math.isnan(other))


def in_row(batch, row):
    """A row of a batch as `decide` would tell it."""
    return (
        tuple(int(rule) if rule >= 0 else None for rule in batch.rules[row]),
        bool(batch.intervened[row]),
        bool(batch.outside[row]),
        batch.invalid[row],
    )


def assert_same(one, batch, row):
    assert (one.rules, one.intervened, one.outside, one.invalid) == in_row(batch, row)
    assert same_number(one.margin, batch.margin[row])
    if one.invalid is None or one.executed is not one.proposed:
        assert same_action(one.executed, batch.executed[row])
    elif batch.executed.dtype == object:
        assert one.executed is batch.executed[row] or same_action(one.executed, batch.executed[row])


@settings(max_examples=300)
@given(shields(), st.data())
def test_one_and_a_batch_of_one_give_the_same_answer_or_the_same_sentence(shield, data):
    observation = data.draw(observations(shield.rule_set))
    action = data.draw(proposals(shield.rule_set))
    one = answer(shield.decide, observation, action)
    batch = answer(shield.decide_batch, [observation], [action])
    if isinstance(one, str):
        assert one == batch
        assert shield.on_invalid == "raise"
        return
    assert one.proposed is action
    assert_same(one, batch, 0)


@settings(max_examples=150)
@given(shields(), st.data())
def test_a_batch_is_its_rows(shield, data):
    count = data.draw(st.integers(1, 5))
    seen = [data.draw(observations(shield.rule_set)) for _ in range(count)]
    wanted = [data.draw(proposals(shield.rule_set)) for _ in range(count)]
    alone = [answer(shield.decide, *pair) for pair in zip(seen, wanted, strict=True)]
    together = answer(shield.decide_batch, seen, wanted)
    refused = [number for number, one in enumerate(alone) if isinstance(one, str)]
    if refused:
        first = alone[refused[0]].split(";")[0]
        where = f" (row {refused[0]} of {count})" if count > 1 else ""
        assert together.split(";")[0] == f"{first}{where}"
        return
    for row, one in enumerate(alone):
        assert one.rules == in_row(together, row)[0]
        assert (one.intervened, one.outside, one.invalid) == in_row(together, row)[1:]
        assert same_number(one.margin, together.margin[row])
        if one.invalid is None:
            ours, theirs = np.ravel(one.executed), np.ravel(together.executed[row])
            assert ours.dtype == theirs.dtype
            assert np.array_equal(ours, theirs)


@settings(max_examples=300)
@given(shields(), st.data())
def test_what_is_executed_carries_the_rules_labels(shield, data):
    rule_set = shield.rule_set
    action = data.draw(proposals(rule_set))
    decision = answer(shield.decide, data.draw(observations(rule_set)), action)
    if isinstance(decision, str):
        return
    if decision.invalid is not None:
        assert decision.rules == (None,) * len(rule_set.actions)
        assert not decision.intervened
        assert math.isnan(decision.margin)
        return
    executed = np.asarray(decision.executed)
    assert executed.dtype == (np.float32 if rule_set.actions[0].is_interval else np.int64)
    assert executed.size == len(rule_set.actions)
    numbers = np.asarray(np.asarray(action).tolist(), dtype=np.float64)
    proposed = numbers.astype(executed.dtype)
    changed = False
    for dimension, rule in enumerate(decision.rules):
        before, after = proposed.ravel()[dimension], executed.ravel()[dimension]
        label = rule_set.actions[dimension].label_of
        if rule is None or label(float(before)) == rule_set.rules[rule].action:
            assert before == after
        elif before == after:
            assert decision.outside
            assert shield.outside == "abstain"
        else:
            assert label(float(after)) == rule_set.rules[rule].action
            changed = True
    assert decision.intervened == changed
    assert not math.isnan(decision.margin)


@settings(max_examples=100)
@given(shields().filter(lambda shield: shield.outside == "act"), st.data())
def test_exported_python_gives_the_same_answer(shield, data):
    rule_set = shield.rule_set
    assume(any(rule.enabled for rule in rule_set.rules))
    names = {}
    source = rules_to_python(rule_set, shield.projection, shield.on_invalid)
    exec(compile(source, "shield.py", "exec"), names)
    single = len(rule_set.actions) == 1 and not rule_set.actions[0].is_interval
    d, m = len(rule_set.source.features), len(rule_set.actions)
    odd = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, 0.5])
    first, count = rule_set.actions[0].first, rule_set.actions[0].n_labels
    known = st.integers(first, first + count - 1)
    wanted = st.floats(-3, 3) if rule_set.actions[0].is_interval else known
    for _ in range(8):
        broken = data.draw(st.sampled_from(["", "", "state", "length", "action"]))
        numbers = st.floats(-2, 2) | odd if broken == "state" else st.floats(-2, 2)
        size = data.draw(st.integers(0, d + 1)) if broken == "length" else d
        state = data.draw(st.lists(numbers, min_size=size, max_size=size))
        actions = wanted | odd | st.integers(-6, 260) if broken == "action" else wanted
        action = data.draw(st.lists(actions, min_size=m, max_size=m))
        if single:
            (action,) = action
        decision = answer(shield.decide, state, action)
        if isinstance(decision, str):
            with pytest.raises(ValueError, match="none that the rules can be asked about"):
                names["shield"](state, action)
            continue
        executed, rules = names["shield"](state, action)
        assert [None if rule < 0 else rule for rule in rules] == list(decision.rules)
        if decision.invalid is not None:
            assert executed is action
        else:
            assert np.array_equal(np.ravel(executed), np.ravel(decision.executed))


BOXES = [
    spaces.Box(-1.0, 1.0, (2,), np.float32),
    spaces.Box(-1.0, 1.0, (2,), np.float64),
    spaces.Box(-1.0, 1.0, (2,), np.float16),
    spaces.Box(-1.0, 1.0, (2, 1), np.float32),
    spaces.Box(-9, 9, (2,), np.int32),
    spaces.Box(0, 255, (2,), np.uint8),
    spaces.Discrete(5, start=-4),
    spaces.MultiDiscrete([3, 4], start=[-1, 0]),
    spaces.MultiBinary(2),
]


def rules_of(space, seed, projection):
    """Rules that always apply, one a dimension."""
    rng = np.random.default_rng(seed)
    if isinstance(space, spaces.Box):
        low, high = space.low.ravel().astype(float), space.high.ravel().astype(float)
        actions = tuple(
            LabelledDimension.of_edges(f"a{i}", np.linspace(low[i], high[i], 4 + i).tolist())
            for i in range(2)
        )
    elif isinstance(space, spaces.Discrete):
        actions = ACTIONS["discrete from -4"]
    elif isinstance(space, spaces.MultiBinary):
        actions = (LabelledDimension("a", ("0", "1")), LabelledDimension("b", ("0", "1")))
    else:
        actions = (
            LabelledDimension("gear", tuple("abc"), first=-1),
            LabelledDimension("horn", tuple("abcd")),
        )
    rules = tuple(
        Rule(
            str(index),
            index,
            (),
            label := int(rng.integers(action.n_labels)),
            *(0.1, 1.0, 1.0, 5),
            demonstrated_value=action.centre(label) if action.is_interval else None,
        )
        for index, action in enumerate(actions)
    )
    features = (Feature("x"), Feature("y"), Feature("z"))
    return RuleSet(rules, actions, Source("", features, "none", 9, 1), Thresholds(0.0, 0.0))


class Still(gymnasium.Env):
    """Takes whatever is an action of its space, and remembers it."""

    observation_space = spaces.Box(-1.0, 1.0, (3,), np.float32)

    def __init__(self, action_space):
        self.action_space = action_space
        self.got = None

    def reset(self, **kwargs):
        return np.zeros(3, dtype=np.float32), {}

    def step(self, action):
        assert self.action_space.contains(action), (action, self.action_space)
        self.got = action
        return np.zeros(3, dtype=np.float32), 1.0, False, False, {}


@settings(max_examples=150)
@given(
    st.sampled_from(BOXES),
    st.integers(0, 500),
    st.sampled_from(PROJECTIONS),
    st.sampled_from(["i1", "i8", ">i4", "f2", "f4", ">f8", "f8", "O", "list"]),
)
def test_an_environment_gets_its_own_dtype_and_shape(space, seed, projection, kind):
    rule_set = rules_of(space, seed, projection)
    shield = Shield(rule_set, projection=projection)
    still = Still(space)
    env = ShieldedEnv(still, shield)
    env.reset(seed=0)
    space.seed(seed)
    whole = space.dtype.kind in "iu"
    proposed = np.asarray(space.sample()).ravel()
    if kind.endswith("1") and whole:
        proposed = np.clip(proposed, -9, 9)
    action = proposed.tolist() if kind == "list" else proposed.astype(kind)
    _, _, _, _, info = env.step(action)
    got = np.asarray(still.got)
    assert got.dtype == space.dtype
    assert got.shape == space.shape
    for value, rule, dimension in zip(got.ravel(), rule_set.rules, rule_set.actions, strict=True):
        assert dimension.label_of(float(value)) == rule.action
    assert info["shield"].executed is still.got

    venv = ShieldedVecEnv(DummyVecEnv([lambda: Still(space) for _ in range(2)]), shield)
    venv.reset()
    venv.step(np.array([action] * 2))
    for each in venv.unwrapped.envs:
        assert np.array_equal(np.asarray(each.got), got)
        assert np.asarray(each.got).dtype == space.dtype


def test_a_walker_that_proposes_whole_numbers_does_what_the_rules_say():
    rule_set = RuleSet.load("data/rules/bipedal_walker_compact.json")
    shield = Shield(rule_set)
    for proposed in ([0, 0, 0, 0], np.zeros(4, dtype=int), np.zeros((4, 1), dtype=np.uint8)):
        decision = shield.decide(np.zeros(24), proposed)
        assert decision.intervened
        executed = np.asarray(decision.executed).ravel()
        assert executed.dtype == np.float32
        for value, rule in zip(executed, decision.rules, strict=True):
            if rule is not None:
                wanted = rule_set.rules[rule]
                assert rule_set.actions[wanted.dimension].label_of(float(value)) == wanted.action


@pytest.mark.parametrize("size", [3, 5])
def test_an_action_with_too_few_or_too_many_values_is_refused(size):
    rule_set = RuleSet.load("data/rules/bipedal_walker_compact.json")
    with pytest.raises(InputError, match=f"{size} values .* 4 action dimensions"):
        Shield(rule_set).decide(np.zeros(24), np.zeros(size))
    passed = Shield(rule_set, on_invalid="pass").decide(np.zeros(24), action := np.zeros(size))
    assert passed.executed is action
    assert "4 action dimensions" in passed.invalid


def test_an_invalid_row_disturbs_no_other(lander_like):
    shield = Shield(mine_rules(lander_like, supp_min=0.0, conf_min=1.0), on_invalid="pass")
    states, actions = lander_like.observations[:60].copy(), np.arange(60) % 4
    whole = shield.decide_batch(states, actions)
    states[7, 2], states[20] = np.nan, np.inf
    actions[31] = 9
    found = shield.decide_batch(states, actions)
    bad = [7, 20, 31]
    assert [row for row in range(60) if found.invalid[row] is not None] == bad
    assert found.invalid[7] == "the observation's 'feature 2' is not a number"
    assert found.invalid[31] == "the action is 9, which is none of 0 to 3"
    assert found.executed[bad].tolist() == actions[bad].tolist()
    others = np.delete(np.arange(60), bad)
    for ours, theirs in zip(found[:6], whole[:6], strict=True):
        assert np.array_equal(ours[others], theirs[others])
    assert (found.rules[bad] == -1).all()
    assert np.isnan(found.margin[bad]).all()


def test_a_choice_that_is_none_is_refused(lander_like):
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    with pytest.raises(InputError, match="neither raise nor pass"):
        Shield(rules, on_invalid="ignore")
