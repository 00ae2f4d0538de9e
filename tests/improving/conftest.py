"""Searches small enough for a test."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sarl_core.improving import movement, refinement

SMALL = {
    "EPISODES": 2,
    "_EXPERT_EPISODES": 2,
    "_MET_EPISODES": 3,
    "_NEIGHBOURS": 3,
    "_SHAPE_EPISODES": 3,
    "_SHAPES": 2,
    "_EARLY": 1,
    "_LATE": 1,
    "_COMPARED_EPISODES": 4,
    "GENERATIONS": 3,
}


@pytest.fixture
def sized_search(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Call it to make refinements try fewer neighbours in fewer episodes."""

    def sized(population: int = 4, **sizes: int) -> None:
        monkeypatch.setattr(movement, "POPULATION", population)
        monkeypatch.setattr(refinement, "POPULATION", population)
        for name, number in (SMALL | sizes).items():
            monkeypatch.setattr(refinement, name, number)

    return sized


@pytest.fixture
def small_search(sized_search: Callable[..., None]) -> None:
    """A refinement of few episodes."""
    sized_search()
