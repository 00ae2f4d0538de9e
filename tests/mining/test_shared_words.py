"""Rule sets over the same column of words that know different words are compared."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, InputError, RuleSet, Shield, mine_rules, save_demonstrations
from sarl_core.cli.app import main
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.mining.editing.difference import comparable
from sarl_core.mining.editing.shared_words import in_shared_words
from sarl_core.mining.language import conditions_text
from sarl_core.shielding.disagreement import disagreement, sampled_states


def log(*modes: str, also: str = "gap") -> Demonstrations:
    does = {"heavy": "brake", "light": "hoist", "medium": "wait", "odd": "wait"}
    rows = "".join(
        f"{i // 20},{modes[i % len(modes)]},{i % 7}.5,{does[modes[i % len(modes)]]}\n"
        for i in range(120)
    )
    return read_demonstrations(f"run,mode,{also},action\n{rows}".encode(), "log.csv")


def rules_of(log: Demonstrations) -> RuleSet:
    labels = (("brake", "hoist", "wait"),)
    actions = np.array([labels[0].index(log.label_names[0][at]) for at in log.actions])
    named = Demonstrations(
        log.observations,
        actions,
        log.episodes,
        feature_names=log.feature_names,
        indicators=log.indicators,
        label_names=labels,
    )
    return mine_rules(named, supp_min=0.0, conf_min=1.0)


TWO, THREE, OTHERS = (
    rules_of(log(*modes))
    for modes in (("heavy", "light"), ("heavy", "light", "medium"), ("odd", "light", "heavy"))
)


def test_each_knows_the_others_words_and_decides_as_before() -> None:
    first, second, notes = in_shared_words(TWO, THREE)
    assert [one.name for one in first.source.features] == [
        "mode is heavy",
        "mode is light",
        "mode is medium",
        "gap",
    ]
    assert comparable(first, second).rule_set is second
    assert len(notes) == 1
    assert notes[0].startswith("the first rules do not know the mode 'medium'")
    shown = log("heavy", "light")
    widened = recoded(shown, first.source.features, called="the log").observations
    assert np.array_equal(
        Shield(first).rules_in_force(widened), Shield(TWO).rules_in_force(shown.observations)
    )
    for before, after in zip(TWO, first, strict=True):
        assert after.box is not None
        assert before.box is not None
        inside = widened[after.applies(widened)]
        assert inside.min(axis=0).tolist() == list(after.box.least)
        assert inside.max(axis=0).tolist() == list(after.box.most)


def test_both_may_have_words_of_their_own() -> None:
    first, second, notes = in_shared_words(THREE, OTHERS)
    assert [one.name for one in second.source.features][:4] == [
        "mode is heavy",
        "mode is light",
        "mode is medium",
        "mode is odd",
    ]
    assert [note.split(":")[0] for note in notes] == [
        "the first rules do not know the mode 'odd'",
        "the second rules do not know the mode 'medium'",
    ]
    found = disagreement(first, second, sampled_states([first, second], count=400))
    # To both what is neither heavy nor light is to wait.
    assert (found.difference.same, found.different) == (3, 0)
    assert "mode is neither light nor heavy" in [conditions_text(rule, first) for rule in first]


def test_the_same_words_are_left_alone() -> None:
    assert in_shared_words(THREE, THREE).first is THREE
    assert in_shared_words(THREE, rules_of(log("heavy", "medium", "light"))).notes == ()


def test_random_states_hold_one_word_each() -> None:
    states = sampled_states([THREE], count=300)
    assert set(states[:, :3].sum(axis=1).tolist()) == {1.0}
    assert (states[:, :3].mean(axis=0) > 0.25).all()
    assert set(sampled_states([TWO], count=300)[:, 0].tolist()) == {0.0, 1.0}


def test_the_command_compares_them_and_says_which_words_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    TWO.save(tmp_path / "two.json")
    THREE.save(tmp_path / "three.json")
    files = [str(tmp_path / "two.json"), str(tmp_path / "three.json")]
    assert main(["diff", *files, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["notes"][0].startswith("the first rules do not know the mode 'medium'")
    save_demonstrations(log("light", "medium"), tmp_path / "log.parquet")
    assert main(["diff", *files, "--demonstrations", str(tmp_path / "log.parquet")]) == 0
    assert "do not know the mode 'medium'" in capsys.readouterr().out
    rules_of(log("heavy", "light", "medium", also="wind")).save(tmp_path / "wind.json")
    assert main(["diff", files[0], str(tmp_path / "wind.json")]) == 2
    assert "wind" in capsys.readouterr().err


def test_other_features_and_other_words_are_both_said() -> None:
    more = rules_of(
        read_demonstrations(
            b"run,mode,gap,wind,action\n0,heavy,1.5,2.5,brake\n0,odd,2.5,1.5,hoist\n"
            b"1,light,3.5,7.5,hoist\n",
            "log.csv",
        )
    )
    with pytest.raises(InputError, match="second rules do not know the mode 'medium'"):
        comparable(THREE, more)
