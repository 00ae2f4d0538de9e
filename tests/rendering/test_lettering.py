from __future__ import annotations

import json

import numpy as np
import pytest
from fontTools.ttLib import TTFont

from sarl_core.environments.description import describe_environment
from sarl_core.rendering.canvas import ALPHABET, FONTS, INKS, Canvas, fitted, text_width, wrapped
from sarl_core.rendering.overlay import typeset
from sarl_core.rollouts.recording import SHIPPED

FILES = ("DejaVuSansCondensed.ttf", "DejaVuSansCondensed-Bold.ttf")


def drawn(text: str, *, bold: bool = False) -> np.ndarray:
    canvas = Canvas(30, 400)
    canvas.text(4, 4, text, 14, INKS.text, bold=bold)
    return canvas.pixels


@pytest.mark.parametrize("name", FILES)
def test_the_font_has_the_alphabet_and_nothing_else(name: str) -> None:
    with TTFont(FONTS / name) as font:
        assert set(map(chr, font.getBestCmap())) == ALPHABET
        assert "Bitstream" in font["name"].getDebugName(0)
    assert (FONTS / name).stat().st_size < 60_000


def test_its_licence_and_where_it_is_from_stand_beside_it() -> None:
    assert "Permission is hereby granted" in (FONTS / "LICENCE.txt").read_text()
    card = json.loads((FONTS / "fonts.json").read_text())
    assert {"what", "from", "licence", "command"} == card.keys()


@pytest.mark.parametrize("bold", [False, True])
def test_every_sign_has_a_form_of_its_own(bold: bool) -> None:
    """Neither nothing nor the box that stands for a glyph that is missing."""
    signs = "≤≥−×°²³·…→←↑↓±µμΔαβγθπω≈≠∞äöüßéèçñøåłžñČЖж½′″–—€"
    pictures = {drawn(sign, bold=bold).tobytes() for sign in signs}
    pictures.add(drawn("", bold=bold).tobytes())
    # The two signs for "micro" are one picture.
    assert len(pictures) == len(set(signs))
    assert set(signs) <= ALPHABET


@pytest.mark.parametrize(
    ("text", "instead"),
    [("ệ", "e"), ("ǘ", "u"), ("你好", "??"), ("x\u200b\ny", "xy"), ("ﬁt", "fit")],
)
def test_what_the_font_lacks_is_written_otherwise(text: str, instead: str) -> None:
    assert (drawn(text) == drawn(instead)).all()
    assert text_width(text, 14) == text_width(instead, 14)


@pytest.mark.parametrize("env_id", SHIPPED)
def test_names_and_units_of_environments_can_be_written(env_id: str) -> None:
    description = describe_environment(env_id)
    names = (*description.feature_names, *description.feature_units, *description.action_names)
    assert set("".join(names)) <= ALPHABET


def test_bold_letters_are_wider_and_are_measured_so() -> None:
    text = "hip 1 torque −0.764, knee 1 torque −0.279"
    assert text_width(text, 16, bold=True) > text_width(text, 16)
    for bold in (False, True):
        line = fitted(text, 16, 150, bold=bold)
        assert line.endswith("…")
        assert text_width(line, 16, bold=bold) <= 150


def test_numbers_have_true_minus_signs_and_names_their_hyphens() -> None:
    said = "If the x-velocity is between -1.5 and -.2 at 1e-06, then lead-2 from -infinite"
    assert typeset(said) == (
        "If the x-velocity is between −1.5 and −.2 at 1e-06, then lead-2 from −infinite"
    )


def test_a_line_is_as_wide_as_it_is_drawn() -> None:
    text = "If the pole angle (ệ, 你) is at most −0.5 rad"
    for bold in (False, True):
        columns = np.flatnonzero((drawn(text, bold=bold) > 0).any(axis=0))
        assert abs(int(columns[-1]) - 4 - text_width(text, 14, bold=bold)) <= 3


def test_lines_break_between_words_and_a_word_too_long_is_shortened() -> None:
    lines = wrapped("one two  three Donaudampfschifffahrtsgesellschaft four", 14, 110, 5)
    assert lines[0] == "one two three"
    assert lines[1].startswith("Donaudampf")
    assert lines[1].endswith("…")
    assert lines[2:] == ["four"]
    assert wrapped("", 14, 90, 3) == []
