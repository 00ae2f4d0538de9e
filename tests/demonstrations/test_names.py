from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import (
    Demonstrations,
    InputError,
    grow_policy_trees,
    load_demonstrations,
    mine_rules,
    save_demonstrations,
)
from sarl_core.demonstrations.names import Names, names_of, renamed, tidy
from sarl_core.mining.editing.renaming import renamed_rules, renamed_trees

HOSTILE = ("<b>*bold*</b>", 'a "quoted" | name', "=cmd()", "\u202eright to left", "obs_0")


def two_actions() -> Demonstrations:
    rng = np.random.default_rng(0)
    states = rng.normal(size=(300, 3)).astype(np.float32)
    actions = np.stack([states[:, 0] > 0, 2 * (states[:, 1] > 0)], axis=1).astype(np.int64)
    return Demonstrations(states, actions, np.repeat(np.arange(3), 100))


NEW = Names(HOSTILE[:3], ("m", "", "°/s"), HOSTILE[3:], (("off", "<on>"), ("low", "mid", "top")))


@pytest.mark.parametrize("ending", [".parquet"])
def test_all_names_come_back_from_a_file(ending: str, tmp_path: Path) -> None:
    demonstrations = renamed(two_actions(), NEW)
    path = tmp_path / f"named{ending}"
    save_demonstrations(demonstrations, path)
    read = load_demonstrations(path)
    assert names_of(read) == NEW
    assert read.digest == demonstrations.digest


def test_names_change_no_tree_and_no_rule() -> None:
    before, after = two_actions(), renamed(two_actions(), NEW)
    for one, other in zip(grow_policy_trees(before), grow_policy_trees(after), strict=True):
        assert np.array_equal(one.threshold, other.threshold)
        assert np.array_equal(one.feature, other.feature)
    rules = mine_rules(before, supp_min=0.0, conf_min=1.0)
    named = mine_rules(after, supp_min=0.0, conf_min=1.0)
    assert rules.rules == named.rules
    assert named.actions == renamed_rules(rules, NEW).actions
    assert named.source.features == renamed_rules(rules, NEW).source.features


def test_trees_take_other_names_without_being_grown_again() -> None:
    before, after = two_actions(), renamed(two_actions(), NEW)
    grown, wanted = grow_policy_trees(before), grow_policy_trees(after)
    named = renamed_trees(grown, after)
    for one, other in zip(named, wanted, strict=True):
        assert (one.source, one.dimension) == (other.source, other.dimension)
        assert one.threshold.tobytes() == other.threshold.tobytes()
        assert one.counts.tobytes() == other.counts.tobytes()
    rules = mine_rules(named, supp_min=0.0, conf_min=1.0)
    assert rules == mine_rules(wanted, supp_min=0.0, conf_min=1.0)
    assert all(one is other for one, other in zip(renamed_trees(named, after), named, strict=True))


def test_pairs_are_known_under_every_name() -> None:
    pairs = two_actions()
    assert pairs.pairs_digest == renamed(pairs, NEW).pairs_digest != pairs.digest
    assert pairs.pairs_digest != pairs.select([0, 1]).pairs_digest
    other = replace(pairs, actions=pairs.actions[::-1])
    assert pairs.pairs_digest != other.pairs_digest


def test_names_of_other_data_rename_what_fits() -> None:
    rules = mine_rules(two_actions(), supp_min=0.0, conf_min=1.0)
    assert renamed_rules(rules, Names(("one",), ("",), ("a",), (("x",),))) == rules
    labels = renamed_rules(rules, NEW._replace(features=(), units=(), labels=((), ("1", "2", "3"))))
    assert labels.source == rules.source
    assert [action.label_names for action in labels.actions] == [("0", "1"), ("1", "2", "3")]


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (NEW._replace(features=("a", " ", "b")), "feature 1 has an empty name; give it one"),
        (
            NEW._replace(features=("a", "b", "a")),
            "the name 'a' stands twice, for feature 0 and 2; give each its own",
        ),
        (NEW._replace(actions=("a", "")), "action 1 has an empty name; give it one"),
        (
            NEW._replace(labels=(("x", "x"), NEW.labels[1])),
            "the name 'x' stands twice, for label of action '\\u202eright to left' 0 and 1; "
            "give each its own",
        ),
        (NEW._replace(features=("a",)), "the names are for other demonstrations"),
    ],
)
def test_what_cannot_be_told_apart_is_refused(wrong: Names, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        renamed(two_actions(), wrong)
    assert str(refused.value).startswith(sentence)


def test_names_are_tidied() -> None:
    typed = NEW._replace(features=("  pole\n angle ", "b", "c"))
    assert tidy(typed).features == ("pole angle", "b", "c")
