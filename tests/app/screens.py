"""Opening a page of the dashboard without a browser."""

from __future__ import annotations

import re
import time
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

from streamlit.testing.v1 import AppTest

from sarl_core.explaining.templates import style_sheet

ROUTER = Path(__file__).parents[2] / "pages" / "_router.py"


def open_page(name: str, **query: str | list[str]) -> AppTest:
    """Run a page as a visitor with this URL would see it first."""
    app = AppTest.from_file(ROUTER, default_timeout=120)
    for key, value in query.items():
        app.query_params[key] = value
    if name != "overview":
        app.switch_page(page_file(name))
    app.run()
    if name != "overview":
        app.switch_page(page_file(name))  # under its address, which is known from now on
    assert not app.exception, app.exception
    return app


def follow(app: AppTest, label: str) -> None:
    """Click a link to a page."""
    link = next(one.proto for one in app.get("page_link") if one.proto.label == label)
    for name in list(app.query_params):
        del app.query_params[name]
    for name, value in parse_qsl(link.query_string):
        app.query_params[name] = value
    app.switch_page(page_file(link.page or "overview")).run()  # whose address is empty


def page_file(name: str) -> str:
    """Where a page lies, as pages call each other."""
    (file,) = ROUTER.parent.rglob(f"{name}.py")
    return str(file.relative_to(ROUTER.parent))


def texts(app: AppTest) -> str:
    """Everything a visitor reads, Markdown's escapes undone."""
    parts = [*app.title, *app.markdown, *app.caption, *app.info, *app.error, *app.header]
    return "\n".join(unescape(str(part.value).replace("\\", "")) for part in parts)


def html(app: AppTest) -> str:
    """What is written in HTML, without the style sheet of every page."""
    return "\n".join(
        part.proto.body for part in app.get("html") if part.proto.body != style_sheet()
    )


def errors(app: AppTest) -> list[str]:
    """The sentences of errors, Markdown's escapes undone."""
    return [unescape(str(error.value).replace("\\", "")) for error in app.error]


def shown_and_further(app: AppTest) -> tuple[set[str], set[str]]:
    """Keys of the settings that a form shows, and of those that it keeps under "More"."""

    def settings(block: Any) -> set[str]:
        kinds = ("selectbox", "number_input", "slider", "button_group")
        return {widget.key for kind in kinds for widget in block.get(kind)}

    (more,) = (one for one in app.main.get("popover") if one.proto.popover.label == "More")
    return settings(app.main) - settings(more), settings(more)


def metrics(app: AppTest) -> dict[str, str]:
    """Every number on a card by its label."""
    cards = re.findall(r"<dt>(.*?)</dt><dd>(.*?)(?:<small>.*?</small>)?</dd>", html(app))
    return {metric.label: metric.value for metric in app.metric} | {
        unescape(label): unescape(value) for label, value in cards
    }


def chosen_rules(app: AppTest) -> str:
    """Which rules are in force, as an address says it."""
    return str(app.selectbox(key="_rules_choice").value)


def upload_rules(app: AppTest, name: str, content: bytes) -> None:
    """Choose a rule file in the sidebar."""
    app.selectbox(key="_rules_choice").set_value("a rule file …").run()
    app.file_uploader(key="rule_file").set_value((name, content, "application/json"))
    app.run()


def compare(app: AppTest, *names: str) -> None:
    """Choose the rule sets of the page Compare."""
    app.multiselect(key="_sets_choice").set_value(list(names)).run()


def run_through(app: AppTest, name: str) -> AppTest:
    """Begin work beside the page, where it is offered, and look in until it is done.

    What the page began by itself comes first.
    """
    finished(app, name)
    keys = [button.key for button in app.button]
    if f"run_{name}" in keys:
        app.button(key=f"run_{name}").click().run()
    return finished(app, name)


def finished(app: AppTest, name: str) -> AppTest:
    """Look in until work is done, as the browser does every second; at first more often."""
    for look in range(1, 800):
        assert not app.exception, app.exception
        if f"cancel_{name}" not in [button.key for button in app.button]:
            return app
        time.sleep(min(0.1 * look, 0.5))  # to draw the page takes time from the work
        app.run()
    raise AssertionError("the work does not end")
