"""Rules held against logs: the counts, near misses, drift, matching by name, and conditions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from sarl_core import (
    Audit,
    Demonstrations,
    InputError,
    RuleSet,
    Shield,
    audit,
    load_demonstrations,
    mine_rules,
)
from sarl_core.auditing.comparison import LogComparison
from sarl_core.auditing.guards import guard
from sarl_core.auditing.matching import unmatched_names
from sarl_core.auditing.near import NEAR, sample_keys, spreads_of
from sarl_core.shielding.neighbourhood import Neighbourhood

NAMES = ("wind", "load", "height", "a", "b", "c", "d", "e")


@pytest.fixture(scope="module")
def demonstrations(lander_like: Demonstrations) -> Demonstrations:
    return replace(
        lander_like,
        feature_names=NAMES,
        feature_units=("m/s", "t", "m", "", "", "", "", ""),
        label_names=(("brake", "lift", "lower", "wait"),),
    )


@pytest.fixture(scope="module")
def rules(demonstrations: Demonstrations) -> RuleSet:
    return mine_rules(demonstrations, supp_min=0.01, conf_min=0.9)


@pytest.fixture(scope="module")
def audited(rules: RuleSet, demonstrations: Demonstrations) -> Audit:
    return audit(rules, demonstrations)


def test_it_counts_what_a_shield_would_change(
    audited: Audit, rules: RuleSet, demonstrations: Demonstrations
) -> None:
    decision = Shield(rules).decide_batch(demonstrations.observations, demonstrations.actions)
    assert np.array_equal(audited.is_broken, decision.intervened)
    assert np.array_equal(audited.executed, decision.executed)
    assert audited.broken > 20
    table = audited.rule_table()
    assert table["applies"].tolist() == [rule.samples for rule in rules]
    assert (table["applies"] - table["broken"]).tolist() == [rule.correct for rule in rules]
    assert audited.episodes["broken"].sum() == audited.broken
    document = audited.to_dict()
    assert {"steps", "covered", "broken", "rules", "episodes", "drift"} <= set(document)
    assert document["steps"] == len(audited.to_frame()) == 2000


def test_the_worst_stretch_ends_with_its_episode(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    says = np.array([rule.action for rule in rules])
    in_force = Shield(rules).rules_in_force(demonstrations.observations)[:, 0]
    rows = np.flatnonzero(in_force >= 0)
    # Episodes of states that have a rule, broken at the end of one and the start of the next.
    states, obeyed = demonstrations.observations[rows][:40], says[in_force[rows]][:40]
    broken = np.zeros(40, dtype=bool)
    broken[[3, 4, 17, 18, 19, 20, 21, 22, 23]] = True
    log = replace(
        demonstrations,
        observations=states,
        actions=np.where(broken, (obeyed + 1) % 4, obeyed),
        episodes=np.repeat([7, 9], 20),
        steps=None,
    )
    held = audit(rules, log)
    assert [(one.episode, one.step, one.length) for one in held.worst] == [
        (9, 0, 4),
        (7, 17, 3),
        (7, 3, 2),
    ]
    assert held.episodes["longest_run"].tolist() == [3, 4]


def test_near_misses_are_those_of_what_if(
    audited: Audit, rules: RuleSet, demonstrations: Demonstrations
) -> None:
    neighbourhood = Neighbourhood(Shield(rules))
    spreads = spreads_of(demonstrations.observations, sample_keys(demonstrations))
    near = 0
    for row in range(300):
        misses = neighbourhood.near_misses(demonstrations.observations[row], spreads, most=1000)
        label = audited.labels[row, 0]
        wanted = [
            one.rule for one in misses if one.distance < NEAR and rules[one.rule].action != label
        ]
        assert audited.is_broken[row] or audited.near[row] == min(wanted, default=-1)
        near += bool(wanted)
    assert near > 5


def test_features_and_labels_are_matched_by_name(
    audited: Audit, rules: RuleSet, demonstrations: Demonstrations
) -> None:
    order = [2, 0, 1, 7, 6, 5, 4, 3]
    shuffled = replace(
        demonstrations,
        observations=np.column_stack([demonstrations.observations[:, order], np.zeros(2000)]),
        feature_names=(*tuple(NAMES[at].upper() for at in order), "spare"),
        feature_units=(*tuple(demonstrations.feature_units[at] for at in order), ""),
        indicators=None,
        actions=3 - demonstrations.actions,
        label_names=(("wait", "lower", "lift", "brake"),),
    )
    other = audit(rules, shuffled)
    assert np.array_equal(other.breaks, audited.breaks)
    assert "spare of the log is no feature of the rules" in other.notes[0]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"feature_names": ("gust", *NAMES[1:])}, "has no wind (the log: gust, load"),
        ({"feature_units": ("km/h",) + ("",) * 7}, "gives 'wind' in km/h and the rules ask"),
        (
            {"label_names": (("brake", "lift", "lower", "swing"),)},
            "holds the 'action' 'swing' in row",
        ),
        ({"label_names": None, "actions": np.full(2000, 9)}, "holds the 'action' '9' in row 1"),
        (
            {"label_names": None, "actions": np.linspace(0, 1, 2000)[:, None]},
            "is a label in the rules (brake, lift, lower, wait) and an amount in the log",
        ),
    ],
)
def test_a_log_of_something_else_is_refused_by_name(
    rules: RuleSet, demonstrations: Demonstrations, changes: dict[str, Any], said: str
) -> None:
    given = {"label_first": None, **changes} if "label_names" in changes else changes
    with pytest.raises(InputError) as error:
        audit(rules, replace(demonstrations, **given))
    assert said in str(error.value)


def test_numbers_without_names_are_the_rules_numbers(
    audited: Audit, rules: RuleSet, demonstrations: Demonstrations
) -> None:
    numbers = replace(demonstrations, label_names=None, label_first=None)
    assert np.array_equal(audit(rules, numbers).breaks, audited.breaks)


def halves(demonstrations: Demonstrations) -> tuple[Demonstrations, Demonstrations]:
    return demonstrations.select(range(10)), demonstrations.select(range(10, 20))


def test_drift_is_seen_where_there_is_some_and_nowhere_else(
    demonstrations: Demonstrations,
) -> None:
    mined, later = halves(demonstrations)
    rules = mine_rules(mined, supp_min=0.01, conf_min=0.9)
    moved = later.observations.copy()
    moved[:, 0] += 2.0
    for shown in (None, mined):
        alike = audit(rules, later, demonstrations=shown).drift
        assert alike.is_known
        assert alike.drifted == ()
        log = replace(later, observations=moved)
        drifted = audit(rules, log, demonstrations=shown).drift
        assert "wind" in {one.name for one in drifted.drifted}
        assert not {"b", "c", "d"} & {one.name for one in drifted.drifted}
        few = audit(rules, log.select(range(10, 13)), demonstrations=shown).drift
        assert not few.is_known
        assert few.drifted == ()


def test_two_logs_are_compared_over_episodes(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    first, second = (audit(rules, half) for half in halves(demonstrations))
    assert not any(one.drifted for one in LogComparison(first, second).differences)
    worse = replace(second.log, actions=(second.log.actions + 1) % 4)
    comparison = LogComparison(first, audit(rules, worse))
    breaks = next(one for one in comparison.differences if one.name == "breaks")
    assert breaks.drifted
    assert breaks.low is not None
    assert 0 < breaks.low < breaks.now - breaks.before < (breaks.high or 0)


def test_a_guard_holds_or_not(audited: Audit) -> None:
    share = audited.broken / audited.steps
    assert guard(f"breaks>{share - 0.001:.4f}").holds(audited)
    assert not guard(f"breaks > {100 * share + 0.1:.2f}%").holds(audited)
    assert guard("coverage<=1").holds(audited)
    for text, said in (
        ("brakes>0.1", "'brakes', which is no measure"),
        ("breaks", "write a measure"),
        ("breaks>0.1 or gaps>0", "write a measure"),
        ("breaks>__import__('os')", "write a measure"),
    ):
        with pytest.raises(InputError, match=said.replace("(", r"\(")):
            guard(text)


def test_a_guard_that_cannot_know_counts_as_if_it_held(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    none = replace(rules, rules=tuple(replace(rule, enabled=False) for rule in rules))
    assert guard("agreement<0.9").holds(audit(none, demonstrations))


def test_continuous_actions_and_several_dimensions(demonstrations: Demonstrations) -> None:
    amounts = np.stack([demonstrations.actions * 0.5 - 0.75, -demonstrations.actions], axis=1)
    continuous = replace(
        demonstrations,
        actions=amounts.astype(np.float32),
        label_names=None,
        label_first=None,
        action_names=("left", "right"),
    )
    rules = mine_rules(continuous, supp_min=0.01, conf_min=0.9, divider=2)
    held = audit(rules, continuous, projection="clip")
    decision = Shield(rules, projection="clip").decide_batch(
        continuous.observations, continuous.actions
    )
    assert np.array_equal(held.executed, decision.executed)
    assert np.array_equal(held.is_broken, decision.intervened)
    assert held.broken
    turned = replace(
        continuous,
        actions=continuous.actions[:, ::-1],
        action_names=("right", "left"),
        action_low=continuous.action_low[::-1],
        action_high=continuous.action_high[::-1],
    )
    assert np.array_equal(audit(rules, turned, projection="clip").breaks, held.breaks)
    assert {"done_0", "rule_1", "executed_1"} <= set(held.to_frame())


def test_words_and_codes_are_the_rules_own(tmp_path: Path) -> None:
    """What a table calls heavy is heavy, whichever words stand beside it there."""
    rng = np.random.default_rng(2)

    def table(modes: list[str], path: str) -> Demonstrations:
        frame = pd.DataFrame(
            {
                "episode": np.repeat(np.arange(6), 50),
                "wind": rng.choice([-1.0, 1.0], 300) + 0.1 * rng.random(300),
                "mode": rng.choice(modes, 300),
            }
        )
        heavy = frame["mode"] == "heavy"
        frame["action"] = np.where(heavy & (frame["wind"] > 0), "brake", "lift")
        frame.to_csv(tmp_path / path, index=False)
        return load_demonstrations(tmp_path / path)

    mined = table(["heavy", "light", "empty"], "mined.csv")
    rules = mine_rules(mined, supp_min=0.01, conf_min=0.99)
    assert len(rules) > 1
    for modes in (["heavy", "light"], ["heavy"], ["light", "empty", "heavy"]):
        held = audit(rules, table(modes, "log.csv"))
        assert held.broken == 0
        assert held.coverage == 1
    with pytest.raises(InputError, match=r"holds the mode 'loaded' in row .* do not know"):
        audit(rules, table(["heavy", "loaded"], "log.csv"))
    two = mine_rules(table(["heavy", "light"], "two.csv"), supp_min=0.01, conf_min=0.99)
    assert audit(two, table(["light"], "log.csv")).broken == 0

    codes = replace(mined, actions=np.where(mined.actions == 0, 90_000, 100), label_names=None)
    numbered = mine_rules(codes, supp_min=0.01, conf_min=0.99)
    held = audit(numbered, replace(codes, actions=np.where(codes.actions == 100, 90_000, 100)))
    assert held.broken == 300
    assert set(held.to_frame()["executed"]) == {"100", "90000"}


def test_gaps_in_the_numbers_of_steps_are_counted(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    steps = np.tile(np.arange(100), 20)
    steps[50:100] += 7
    steps[150:200] += 1
    held = audit(rules, replace(demonstrations, steps=steps))
    assert (held.gaps, held.missing_steps) == (2, 8)
    assert guard("missing_steps>0").holds(held)
    wrong = audit(rules, replace(held.log, actions=(held.labels[:, 0] + 1) % 4))
    rows, lengths = wrong.runs
    assert not ((rows < 50) & (rows + lengths > 50)).any()


def test_breaks_are_counted_by_the_minute_where_times_are_known(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    says = np.array([rule.action for rule in rules])
    in_force = Shield(rules).rules_in_force(demonstrations.observations)[:, 0]
    rows = np.flatnonzero(in_force >= 0)[:40]
    broken = np.zeros(40, dtype=bool)
    broken[[1, 2, 3, 12, 19, 20, 30]] = True
    # A step every ten seconds; half an hour passes in the first episode, after a break.
    times = np.tile(np.arange(20) * 10.0, 2)
    times[3:20] += 1800.0
    obeyed = says[in_force[rows]]
    log = replace(
        demonstrations,
        observations=demonstrations.observations[rows],
        actions=np.where(broken, (obeyed + 1) % 4, obeyed),
        episodes=np.repeat([7, 9], 20),
        steps=None,
        rewards=None,
        terminated=None,
        truncated=None,
        times=times,
    )
    held = audit(rules, log)
    assert held.clock is not None
    assert (held.clock.step, held.clock.minutes) == (10.0, 40 / 6)
    assert held.breaks_per_minute == pytest.approx(7 / (40 / 6))
    # 3 and 12 lie 90 s apart, 19 and 20 in two episodes.
    assert held.worst_minute is not None
    assert held.worst_minute._asdict() == {"episode": 7, "step": 1, "row": 1, "breaks": 2}
    assert held.episodes["worst_minute"].tolist() == [2.0, 1.0]
    assert held.episodes["breaks_per_minute"].tolist() == pytest.approx([1.5, 0.6])
    assert (held.time_gaps, held.clock.longest_gap) == (1.0, 1810.0)
    # What was done in the half hour, nobody knows.
    assert [(one.row, one.length, one.seconds) for one in held.worst][:1] == [(1, 2, 20.0)]
    document = held.to_dict()["time"]
    assert document["gaps"] == 1
    assert document["worst_minute"]["breaks"] == 2
    assert guard("worst_minute>1").holds(held)
    assert not guard("time_gaps>1").holds(held)
    untimed = audit(rules, replace(log, times=None))
    assert untimed.to_dict()["time"] is None
    assert guard("breaks_per_minute>1000").holds(untimed)  # it cannot be known
    still = audit(rules, replace(log, times=np.zeros(40)))
    assert still.clock is None


def test_what_a_log_lacks_is_named_and_may_be_what_its_columns_are_called(
    rules: RuleSet, demonstrations: Demonstrations
) -> None:
    features = replace(demonstrations, feature_names=("gust", *NAMES[1:]))
    assert unmatched_names(rules, features)[:2] == (("wind",), ())
    assert unmatched_names(rules, features).matched == NAMES[1:]
    assert unmatched_names(rules, demonstrations) == ((), (), NAMES)
    counted = replace(demonstrations, feature_names=None)
    assert unmatched_names(rules, counted)[:2] == ((), ())


def test_dimensions_of_other_names_are_named(lander_like: Demonstrations) -> None:
    seen = lander_like.observations
    amounts = Demonstrations(
        seen, seen[:, :2] / 2, lander_like.episodes, action_names=("gas", "steer")
    )
    rules = mine_rules(amounts, supp_min=0.01, conf_min=0.6)
    log = replace(amounts, action_names=("push", "steer"))
    assert unmatched_names(rules, log).actions == ("gas",)
    with pytest.raises(InputError, match=r"has no gas .*COLUMN=action as gas"):
        audit(rules, log)
