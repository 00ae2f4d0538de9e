"""Colours that names are written on."""

from __future__ import annotations

import re

import pytest

from sarl_core.explaining.colours import chip_colour, label_colour


def contrast_with_white(colour: str) -> float:
    """As WCAG 2.2 defines it, with the exact curve of sRGB."""
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in (int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
    )
    return 1.05 / (0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05)


@pytest.mark.parametrize("label", range(16))
def test_white_can_be_read_on_the_chip_of_every_action(label: int) -> None:
    chip = chip_colour(label_colour(label))
    assert re.fullmatch("#[0-9A-F]{6}", chip)
    # No darker than it has to be.
    assert 4.5 <= contrast_with_white(chip) < 4.8 or chip == label_colour(label)


def test_what_is_dark_enough_stays_as_it_is() -> None:
    assert chip_colour("#0072B2") == "#0072B2"
    assert chip_colour("#000000") == "#000000"
