"""Searches small enough for a test."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sarl_core.improving import movement, refinement

SMALL = {
    "_EXPERT": 1,
    "_MET": 2,
    "_NEIGHBOURS": 3,
    "_RANKED": 2,
    "_SHAPES": 2,
    "_EARLY": 1,
    "_LATE": 1,
    "_COMPARED": 2,
    "_BETWEEN": 1,
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
