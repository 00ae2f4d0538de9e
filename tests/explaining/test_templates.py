from __future__ import annotations

import re

import jinja2
import pytest
from markupsafe import Markup

from sarl_core.explaining.templates import render, style_sheet


def test_every_text_is_escaped_and_what_is_html_already_is_not() -> None:
    assert render("parts/note", text='<b>"it\'s"</b>') == (
        '<p class="sarl-note">&lt;b&gt;&#34;it&#39;s&#34;&lt;/b&gt;</p>'
    )
    assert (
        render("parts/note", text=Markup("<b>bold</b>")) == '<p class="sarl-note"><b>bold</b></p>'
    )


def test_what_a_template_asks_for_and_does_not_get_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError, match="text"):
        render("parts/note")


def test_the_style_stays_when_the_page_is_cleaned() -> None:
    # A style that holds something like a tag, as "<length>", is taken out as a whole.
    found = re.fullmatch(r"\s*<style>(.*)</style>\s*", style_sheet(), re.DOTALL)
    assert found
    assert "<" not in found[1]
