"""Ways to learn: which there are, what each needs, and how far a learner is trusted."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core import InputError, RuleSet, load_demonstrations, mine_rules
from sarl_core.learning.arms import ARMS, Handover, arms_named, check_learning

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@pytest.fixture(scope="module")
def cart_rules() -> RuleSet:
    return mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.9)


def test_arms_come_in_their_order_each_once() -> None:
    assert [arm.name for arm in arms_named(["replay", "none", "none"])] == ["none", "replay"]
    assert arms_named(["all", "mask"]) == tuple(ARMS.values())


def test_all_leaves_out_what_the_actions_do_not_allow() -> None:
    assert {arm.name for arm in arms_named(["all"], discrete=False)} == set(ARMS) - {"mask"}
    assert [arm.name for arm in arms_named(["mask"], discrete=False)] == ["mask"]


def test_each_arm_is_compared_with_the_same_learner_without_a_shield() -> None:
    for arm in ARMS.values():
        alone = ARMS[arm.alone]
        assert not alone.shielded
        assert alone.replay == arm.replay


@pytest.mark.parametrize(("names", "fragment"), [(["masks"], "no arm 'masks'"), ([], "no way")])
def test_unknown_arms_and_none_are_refused(names: list[str], fragment: str) -> None:
    with pytest.raises(InputError, match=fragment):
        arms_named(names)


@pytest.mark.parametrize(
    ("env_id", "arm", "steps", "seed", "fragment"),
    [
        ("CartPole-v1", "none", 0, 0, "steps is 0"),
        ("CartPole-v1", "none", -5, 0, "steps is -5"),
        ("CartPole-v1", "none", 100, -1, "seed is -1"),
        ("LunarLander-v3", "override", 100, 0, "ask about 4 features"),
        ("Pendulum-v1", "mask", 100, 0, "continuous"),
        ("toy/MultiDiscrete-v0", "none", 100, 0, "several discrete actions"),
        ("toy/Offset-v0", "none", 100, 0, "from -1"),
        ("Nowhere-v7", "none", 100, 0, "Nowhere-v7"),
    ],
)
def test_what_cannot_be_learned_is_said(
    cart_rules: RuleSet, env_id: str, arm: str, steps: int, seed: int, fragment: str
) -> None:
    with pytest.raises(InputError, match=fragment) as caught:
        check_learning(env_id, cart_rules, ARMS[arm], steps=steps, seed=seed)
    assert "\n" not in str(caught.value)


def test_a_shielded_arm_needs_rules_and_one_without_a_shield_none() -> None:
    with pytest.raises(InputError, match="no rules"):
        check_learning("CartPole-v1", None, ARMS["penalty"], steps=100, seed=0)
    check_learning("CartPole-v1", None, ARMS["none"], steps=100, seed=0)


def told(handover: Handover, *episodes: tuple[bool, bool]) -> Handover:
    for shielded, crashed in episodes:
        handover.ended(shielded=shielded, crashed=crashed)
    return handover


def test_a_learner_that_never_fails_is_trusted_with_everything() -> None:
    handover = told(Handover(), *[(False, False)] * 20)
    assert handover.share == 1.0


def test_a_learner_that_fails_more_often_than_the_rules_keeps_its_trials_only() -> None:
    handover = told(Handover(), *[(True, False)] * 20, *[(False, True)] * 20)
    assert handover.share == Handover.START > 0


def test_before_a_few_trials_nothing_is_concluded() -> None:
    handover = told(Handover(), *[(True, True)] * 20, *[(False, False)] * (Handover.TRIALS - 1))
    assert handover.share == Handover.START
    assert told(handover, (False, False)).share > Handover.START


def test_trust_is_lost_again() -> None:
    handover = told(Handover(), *[(True, False)] * 60, *[(False, False)] * 20)
    assert told(handover, (False, True)).share == 0.5


def test_old_failures_are_forgotten() -> None:
    failures = [(False, True)] * Handover.OWN
    handover = told(Handover(), *[(True, False)] * 60, *failures)
    handover = told(handover, *[(False, False)] * (Handover.OWN + 9))
    assert handover.share == pytest.approx(1.0)


def test_episodes_under_the_rules_alone_change_nothing() -> None:
    assert told(Handover(), *[(True, True)] * 100).share == Handover.START
