"""What words mean is said once: the guide says it as the dashboard does."""

from __future__ import annotations

import re
from pathlib import Path

from sarl_core.explaining.words.glossary import GLOSSARY, meaning_of

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "words.md"


def test_the_guide_says_what_the_dashboard_says() -> None:
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert rows[0] == ("word", "means")
    assert dict(rows[2:]) == GLOSSARY
    assert [word for word, _ in rows[2:]] == list(GLOSSARY)


def test_a_meaning_is_a_sentence() -> None:
    for word in GLOSSARY:
        assert re.fullmatch(r"[A-Z].*[^.]\.", meaning_of(word)), word
