from __future__ import annotations

import json
from dataclasses import fields

import numpy as np
import pytest

from sarl_core import InputError, Shield, load_demonstrations, mine_rules, rollout
from sarl_core.rollouts.episode_files import episodes_from_json, episodes_to_json
from sarl_core.shipped import DATA

RULES = mine_rules(
    load_demonstrations(DATA / "demonstrations" / "cartpole.parquet"), supp_min=0.005, conf_min=0.95
)
PLAYED = rollout("CartPole-v1", "novice", shield=Shield(RULES), episodes=5, seed=3)


def test_episodes_come_back_number_by_number() -> None:
    read = episodes_from_json(episodes_to_json(PLAYED), name="it")
    for field in fields(PLAYED):
        before, after = getattr(PLAYED, field.name), getattr(read, field.name)
        if field.name == "steps":
            assert after is None
        elif isinstance(before, np.ndarray):
            np.testing.assert_array_equal(after, before)
            assert after.dtype == before.dtype
        else:
            assert after == before
    assert read.summary() == PLAYED.summary()
    assert read.failures == PLAYED.failures


@pytest.mark.parametrize(
    "change",
    [
        {"format": "other"},
        {"version": 2},
        {"more": 1},
        {"returns": [1.0]},
        {"returns": "12345"},
        {"lengths": [1.5] * 5},
        {"lengths": [10**30] * 5},
        {"seeds": None},
    ],
)
def test_what_is_no_such_file_is_refused_in_a_sentence(change: dict[str, object]) -> None:
    document = json.loads(episodes_to_json(PLAYED)) | change
    with pytest.raises(InputError) as error:
        episodes_from_json(json.dumps(document), name="it")
    assert "\n" not in str(error.value)
    assert "it " in str(error.value)
