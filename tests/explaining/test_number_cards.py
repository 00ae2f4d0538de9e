from __future__ import annotations

from sarl_core.explaining.html.headings import heading, note
from sarl_core.explaining.html.number_cards import Number, number_cards


def test_numbers_stand_under_their_names_with_what_they_were() -> None:
    cards = number_cards(
        [
            Number("Rules <in> force", "1,204", "Those that are on", "1,205"),
            Number("Conflicts", "0"),
        ]
    )
    assert "<dt>Rules &lt;in&gt; force</dt><dd>1,204<small>was 1,205</small></dd>" in cards
    assert "<dt>Conflicts</dt><dd>0</dd>" in cards
    assert cards.count("<div") == 2
    assert "framed" in number_cards([], framed=True)


def test_what_numbers_mean_can_be_read_without_a_pointer() -> None:
    cards = number_cards([Number("Coverage", "41 %", "Share of the states & more")])
    assert '<div title="Share of the states &amp; more">' in cards
    assert "<p><b>Coverage</b>: Share of the states &amp; more.</p>" in cards
    assert "<details" not in number_cards([Number("Coverage", "41 %")])


def test_headings_and_notes_are_no_markup() -> None:
    assert heading("<i>a</i>").endswith(">&lt;i&gt;a&lt;/i&gt;</h2>")
    assert note("<i>a</i>").endswith(">&lt;i&gt;a&lt;/i&gt;</p>")
