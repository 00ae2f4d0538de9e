from __future__ import annotations

import pytest

from sarl_core.explaining.ticks import share_ticks


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (0.0, 1.0, ["0 %", "20 %", "40 %", "60 %", "80 %", "100 %"]),
        (0.0, 0.106, ["0 %", "2.5 %", "5 %", "7.5 %", "10 %"]),
        (0.992, 1.0, ["99.2 %", "99.4 %", "99.6 %", "99.8 %", "100 %"]),
    ],
)
def test_round_shares_are_written_with_a_space_where_they_are(
    low: float, high: float, texts: list[str]
) -> None:
    ticks = share_ticks(low, high)
    assert ticks["ticktext"] == texts
    numbers = [float(text.removesuffix(" %")) / 100 for text in texts]
    assert ticks["tickvals"] == pytest.approx(numbers)


def test_an_axis_over_nothing_has_ticks() -> None:
    assert share_ticks(1.0, 1.0)["ticktext"][0] == "100 %"
    assert share_ticks(0.0, 0.0)["ticktext"][0] == "0 %"
