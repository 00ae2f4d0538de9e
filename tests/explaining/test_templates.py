from __future__ import annotations

import ast
import re
from pathlib import Path

import jinja2
import pytest
from markupsafe import Markup

from sarl_core.explaining.templates import render, style_sheet, whole_percents


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


def test_percents_are_whole_but_not_in_commands() -> None:
    command = "<pre>sarl report --title '5 % less'\nsarl</pre><script>a = 5 % b</script>"
    assert whole_percents(Markup(f"<p>5 %</p>{command}<p>6 %</p>")) == (
        f"<p>5\N{NO-BREAK SPACE}%</p>{command}<p>6\N{NO-BREAK SPACE}%</p>"
    )


def test_the_style_stays_when_the_page_is_cleaned() -> None:
    # A style that holds something like a tag, as "<length>", is taken out as a whole.
    found = re.fullmatch(r"\s*<style>(.*)</style>\s*", style_sheet(), re.DOTALL)
    assert found
    assert "<" not in found[1]


ROOT = Path(__file__).resolve().parents[2]
PRODUCT = [
    path
    for folder in ("sarl_core", "sarl_dashboard", "pages")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
# What Plotly knows in its texts on hovering, and Streamlit in Markdown, is no HTML of ours.
ELEMENT = re.compile(
    r"</?(?!b>|br>|extra>)(a|div|span|p|i|b|u|em|small|style|script|table|t[dhr]|h\d|img|svg)\b[^<]*>|style=[\"']"
)


def test_html_stands_in_templates_and_not_in_python() -> None:
    """But for docstrings, which say what comes out."""
    within = {
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in PRODUCT
        for node in ast.walk(without_docstrings(ast.parse(path.read_text(encoding="utf-8"))))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if ELEMENT.search(node.value)
    }
    assert within == set()


def without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [
                one
                for one in node.body
                if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))
            ]
    return tree


def test_nothing_is_escaped_by_hand() -> None:
    for path in PRODUCT:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"unsafe_allow_html|html\.escape|markupsafe import .*escape", text), (
            path
        )
