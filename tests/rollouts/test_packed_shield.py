from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, Shield, load_demonstrations, mine_rules
from sarl_core.rollouts.packed_shield import PackedShield, pack, unpack
from sarl_core.rollouts.rule_use import without_rule

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


def again(packed: PackedShield) -> PackedShield:
    """The same as it comes with another piece: equal, and not the same object."""
    return packed._replace(content=bytes(bytearray(packed.content)))


def same_decisions(one: Shield, other: Shield, demonstrations: Demonstrations) -> bool:
    states = demonstrations.observations[:2_000]
    proposed = demonstrations.actions[:2_000][::-1]  # those of other states, so that some differ
    found = [shield.decide_batch(states, proposed) for shield in (one, other)]
    return all(np.array_equal(a, b) for a, b in zip(*found, strict=True))


@pytest.mark.parametrize("name", ["cartpole", "pendulum"])
@pytest.mark.parametrize("outside", ["act", "abstain"])
def test_what_comes_out_decides_as_what_went_in(name: str, outside: str) -> None:
    data = load_demonstrations(DATA / f"{name}.parquet")
    rules = mine_rules(data, supp_min=0.02, conf_min=0.8)
    shield = Shield(rules, projection="clip", outside=outside)  # type: ignore[arg-type]
    packed = PackedShield(pack(shield))
    assert same_decisions(unpack(packed), shield, data)
    used = shield.decide_batch(data.observations, data.actions).rules
    rule = int(used[used >= 0][0])
    others = unpack(packed._replace(without=rule))
    assert same_decisions(others, without_rule(shield, rule), data)
    assert not same_decisions(others, shield, data)
    # The shield itself keeps the rule.
    assert same_decisions(unpack(packed), shield, data)


def test_a_process_unpacks_once_what_comes_again() -> None:
    data = load_demonstrations(DATA / "cartpole.parquet")
    packed = PackedShield(pack(Shield(mine_rules(data, supp_min=0.005, conf_min=0.95))))
    assert unpack(again(packed)) is unpack(packed)
    without = packed._replace(without=3)
    assert unpack(again(without)) is unpack(without)
    assert unpack(without) is not unpack(packed)


def test_many_shields_in_turn_are_not_mistaken_for_each_other() -> None:
    data = load_demonstrations(DATA / "cartpole.parquet")
    shields = [
        Shield(mine_rules(data, supp_min=support, conf_min=confidence))
        for support in (0.0, 0.005, 0.05, 0.2)
        for confidence in (0.8, 0.95)
    ]
    packed = [PackedShield(pack(shield)) for shield in shields]
    for _ in range(2):
        for one, shield in zip(packed, shields, strict=True):
            assert same_decisions(unpack(again(one)), shield, data)
            without = one._replace(without=0)
            assert same_decisions(unpack(again(without)), without_rule(shield, 0), data)
