"""What would agree if names were dealt out at random."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

from sarl_core.paper.chance import chance_text, how_decided, with_chance
from sarl_core.paper.landscape_table import cells_exchanged, landscapes_of
from sarl_core.paper.shields import arms_exchanged
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import Frames
from sarl_core.paper.verdicts import Claim
from tests.paper.frames import landscapes
from tests.paper.test_landscapes import AS_THE_PAPER
from tests.paper.test_report import ENTRY
from tests.paper.test_shields import cart, lander

CLAIM = ENTRY.claims[0]


def chances(name: str, deals: int, frame: pd.DataFrame) -> list[float | None]:
    """By a study that is asked once about each order of the arms, of which there are 24."""
    study, known = STUDIES[name], dict[tuple[str, ...], tuple[Claim, ...]]()

    def claims(frames: Frames) -> tuple[Claim, ...]:
        order = tuple(frames[name]["arm"])
        if order not in known:
            known[order] = study.claims(frames)
        return known[order]

    asked_once = dataclasses.replace(study, claims=claims)
    dealt = with_chance(asked_once, {name: frame}, deals=deals)
    return [claim.by_chance for claim in dealt]


def test_an_order_of_four_agrees_once_in_twenty_four() -> None:
    apart = lander(
        novice=np.linspace(-210, -190, 8),
        filtered=np.linspace(-10, 10, 8),
        unfiltered=np.linspace(140, 160, 8),
        expert=np.linspace(260, 280, 8),
    )
    order, *_ = chances("6", 240, apart)
    assert order == pytest.approx(1 / 24, abs=0.03)


def test_what_asks_for_little_agrees_often_and_the_same_every_time() -> None:
    first, second = (chances("5", 60, cart()) for _ in range(2))
    assert first == second
    # Two arms of four have dips.
    assert first[3] is not None
    assert 0.3 < first[3] < 0.8


def test_what_follows_from_the_method_counts_as_one() -> None:
    found = with_chance(STUDIES["2"], {"2": landscapes({"CartPole-v1": AS_THE_PAPER})}, deals=5)
    assert [claim.by_chance for claim in found if claim.constructed] == [1.0, 1.0, 1.0]
    assert "holds whatever is demonstrated" in how_decided(found[0])
    text = chance_text(found)
    assert "3.0 of 4 claims would agree: 3 that follow from the method" in text


def test_names_are_dealt_alike_in_all_recordings() -> None:
    frame = cart()
    for seed in range(5):
        dealt = arms_exchanged(frame, np.random.default_rng(seed))
        pairs = set(zip(frame["arm"], dealt["arm"], strict=True))
        assert len(pairs) == 4
        assert dealt["return"].tolist() == frame["return"].tolist()
        assert sorted(dealt["arm"]) == sorted(frame["arm"])
    table = landscapes({"CartPole-v1": AS_THE_PAPER})
    dealt = cells_exchanged(table, np.random.default_rng(1))
    shown = [one.rule_count for one in landscapes_of(dealt)["CartPole-v1"].values()]
    assert all((one == shown[0]).all() for one in shown)
    assert sorted(shown[0].ravel()) == sorted(AS_THE_PAPER.ravel())
    assert (shown[0] != AS_THE_PAPER).any()


def test_a_sum_is_of_what_is_known() -> None:
    assert chance_text(()) == ""
    assert chance_text((CLAIM,)) == ""
    some = chance_text((CLAIM, replace(CLAIM, by_chance=0.5)))
    assert "0.5 of the 1 claim that have enough recordings" in some
    text = chance_text((replace(CLAIM, by_chance=0.25), replace(CLAIM, by_chance=0.5)))
    assert "0.8 of 2 claims would agree: 0 that follow" in text
    assert "25 % of the time" in how_decided(replace(CLAIM, by_chance=0.25))
    assert how_decided(CLAIM) == CLAIM.decided_by
