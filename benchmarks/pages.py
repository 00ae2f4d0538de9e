"""What waits on each page: a control pressed, until the page's answer is on screen.

On the shipped Lunar Lander, 15,000 steps. The answer is what the control is for, and it is there
when the last of it is; behind it stands how long the rest of the page took. What a page mines or
compares only once is on its way before the first move that counts.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

from playwright.sync_api import Locator, Page

from benchmarks.chromium import TABLES, WARM, Aim, Release, answers, opened, settle
from benchmarks.measure import Row, duration

REACH, FILTER_REACH = 0.15, 0.3  # seconds
TABLE_WAIT = 0.15  # seconds that Streamlit's tables wait before they send a selection
UNFILTERED = "support=0&confidence=1"
ROW, HEAD = 33, 33  # pixels of a table's rows and of its heading


class Control(NamedTuple):
    """One control of a page.

    Attributes:
        what: For the table.
        path: The page, with what is chosen on it.
        aim: Makes a release ready, see `answers`.
        watched: What answers.
        ready: What is done on the page first.
        reach: Seconds.
        warm: Moves that do not count.
    """

    what: str
    path: str
    aim: Aim
    watched: tuple[str, ...]
    ready: Callable[[Page], None] = settle
    reach: float = REACH
    warm: int = WARM


# --- the rows ----------------------------------------------------------------------------------


def what_if(quick: bool) -> Iterable[Row]:
    """A feature's slider on What if."""
    for rules, query in (("filtered", ""), ("unfiltered", UNFILTERED)):
        yield from _rows(
            quick,
            Control(
                f"What if, a feature's slider, {rules}",
                f"what_if?{query}",
                partial(_arrow, name="angle (rad)"),
                (
                    *(f".st-key-{part}" for part in ("decision", "lines", "changes", "misses")),
                    ".sarl-place",
                ),
            ),
        )


def edit(quick: bool) -> Iterable[Row]:
    """A rule switched off and on again."""
    for rules, query in (("filtered", ""), ("unfiltered", UNFILTERED)):
        yield from _rows(
            quick,
            Control(
                f"Edit, switch a rule off or on, {rules}",
                f"edit?{query}",
                partial(_button, selector=".st-key-edit_switch button"),
                (".st-key-numbers", ".st-key-chosen_rule", TABLES),
            ),
        )


def difference(quick: bool) -> Iterable[Row]:
    """Another of three sets beside the rules in force."""
    yield from _rows(
        quick,
        Control(
            "Compare, another set to look at closely",
            "compare?sets=in force|unfiltered|compact",
            partial(_option, label="in force against", options=("compact", "unfiltered")),
            (".st-key-confusion", TABLES),
        ),
    )


def export(quick: bool) -> Iterable[Row]:
    """Another format."""
    formats = ("Python", "C", "JSON", "CSV", "Markdown")
    for rules, query in (("filtered", ""), ("unfiltered", UNFILTERED)):
        yield from _rows(
            quick,
            Control(
                f"Export, another format, {rules}",
                f"export?{query}",
                partial(_pill, names=formats),
                ("[data-testid=stCode]",),
                warm=len(formats),
            ),
        )


def evidence(quick: bool) -> Iterable[Row]:
    """Another share of the episodes held out."""
    yield from _rows(
        quick,
        Control(
            "Evidence, another share held out",
            "evidence?holdout=0.2",
            partial(_arrow, name="Share of the episodes held out"),
            (".st-key-overview", ".st-key-enough", TABLES),
        ),
    )


def rules(quick: bool) -> Iterable[Row]:
    """Another rule, by its row and by a button, and a filter by the lower bound."""
    watched = (
        ".sarl-rule",
        ".sarl-path",
        ".sarl-place",
        ".sarl-features",
        TABLES,
    )
    yield from _rows(
        quick,
        Control("Rules, next rule", "rules", _there_and_back, watched),
        Control(
            "Rules, next rule for the first time (made ready before), unfiltered",
            f"rules?{UNFILTERED}",
            partial(_button, selector="button:has-text('Next rule')"),
            watched,
        ),
        Control(
            "Rules, a rule far down the table for the first time, unfiltered (sent 150 ms later)",
            f"rules?{UNFILTERED}",
            partial(_far_row, selector=".st-key-rule_table"),
            watched,
            reach=TABLE_WAIT + REACH,
        ),
        Control(
            "Rules, another rule, a row of the table (which waits 150 ms before it sends it)",
            "rules",
            partial(_table_row, selector=".st-key-rule_table"),
            watched,
            reach=TABLE_WAIT + REACH,
        ),
        Control(
            "Rules, lower bound at least, unfiltered",
            f"rules?{UNFILTERED}&holdout=0.4&lower=0.5",
            partial(_step, label="Lower bound at least"),
            ("[data-testid=stCaptionContainer]", TABLES),
        ),
    )


def names(quick: bool) -> Iterable[Row]:
    """A feature's name."""
    yield from _rows(
        quick,
        Control(
            "Names, a feature's name (the table waits 150 ms before it sends it)",
            "names",
            _typed_name,
            ("[data-testid=stMarkdown]",),
            reach=TABLE_WAIT + REACH,
        ),
    )


def report(quick: bool) -> Iterable[Row]:
    """How many rules stand in full."""
    yield from _rows(
        quick,
        Control(
            "Report, rules in full, unfiltered",
            f"report?{UNFILTERED}",
            partial(_step, label="Rules in full"),
            ("[data-testid=stCaptionContainer]",),
        ),
    )


def replay(quick: bool) -> Iterable[Row]:
    """The step of an episode: its slider, and its row in the flight recorder."""
    path = "replay?agent=novice&rules=unfiltered"
    watched = (".sarl-picture", ".sarl-step", ".sarl-lit", TABLES)
    yield from _rows(
        quick,
        Control("Replay, the step", path, partial(_arrow, name="Step"), watched, _run),
        Control(
            "Replay, a row of the flight recorder (sent 150 ms later, too)",
            path,
            partial(_table_row, selector=".st-key-recorder_table"),
            watched,
            _run,
            TABLE_WAIT + REACH,
        ),
    )


def recorder(quick: bool) -> Iterable[Row]:
    """A filter of the flight recorder on the steps of 200 episodes of Cart Pole."""
    yield from _rows(
        quick,
        Control(
            "Replay, a filter of the flight recorder, 200 episodes",
            "replay?data=cartpole&agent=novice&rules=unfiltered&over=200&recorded=all+episodes",
            partial(_button, selector=".st-key-only >> text=changed by the rules"),
            ("[data-testid=stCaptionContainer]", TABLES),
            _run_many,
            FILTER_REACH,
        ),
    )


def _rows(quick: bool, *controls: Control) -> Iterable[Row]:
    with opened() as (page, address, _):
        for control in controls:
            page.goto(f"{address}/{control.path}")
            settle(page)
            control.ready(page)
            found = answers(
                page, control.aim, control.watched, 6 if quick else 20, warm=control.warm
            )
            took = [one.answer for one in found]
            whole = duration(statistics.median(one.page for one in found))
            yield Row(
                control.what,
                "-",
                "seconds",
                statistics.median(took),
                control.reach,
                f"median of {len(took)} moves, {duration(min(took))} to {duration(max(took))}; "
                f"whole page {whole}",
            )


# --- what comes before a release ---------------------------------------------------------------


def _arrow(page: Page, move: int, *, name: str) -> Release:
    """A slider's arrow keys, to and fro."""
    page.get_by_role("slider", name=name).focus()
    return lambda: page.keyboard.press("ArrowLeft" if move % 2 else "ArrowRight")


def _button(page: Page, _: int, *, selector: str) -> Release:
    return _click(page.locator(selector).first)


def _there_and_back(page: Page, move: int) -> Release:
    """The buttons from rule to rule."""
    return _click(page.get_by_role("button", name=("Next rule", "Previous rule")[move % 2]))


def _click(target: Locator) -> Release:
    """The pointer stands still over it first, so that only the click is timed."""
    target.scroll_into_view_if_needed()
    target.hover()
    return target.click


def _option(page: Page, move: int, *, label: str, options: tuple[str, ...]) -> Release:
    """An option of a list that is open."""
    page.get_by_role("combobox", name=label).click()
    option = page.get_by_role("option", name=options[move % len(options)], exact=True)
    return _click(option)


def _pill(page: Page, move: int, *, names: tuple[str, ...]) -> Release:
    return _click(page.get_by_role("radio", name=names[move % len(names)], exact=True))


def _step(page: Page, move: int, *, label: str) -> Release:
    """The buttons of a number, to and fro."""
    number = page.get_by_test_id("stNumberInput").filter(has=page.get_by_text(label, exact=True))
    way = "stNumberInputStepDown" if move % 2 else "stNumberInputStepUp"
    return _click(number.get_by_test_id(way))


def _table_row(page: Page, move: int, *, selector: str) -> Release:
    """The box at the left of a row, in turn one of the first five."""
    table = page.locator(f"{selector} [data-testid=stDataFrameResizable]").first
    table.scroll_into_view_if_needed()
    _point(page, table, 15, 1 + move % 5)
    return lambda: _press(page)


def _far_row(page: Page, _: int, *, selector: str) -> Release:
    """The box of a row that is thirty rows further down every time."""
    table = page.locator(f"{selector} [data-testid=stDataFrameResizable]").first
    table.scroll_into_view_if_needed()
    _point(page, table, 15, 3)
    page.mouse.wheel(0, 30 * ROW)
    page.wait_for_timeout(600)
    return lambda: _press(page)


def _point(page: Page, table: Locator, across: int, row: int) -> None:
    """The pointer over a row of a table."""
    box = table.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + across, box["y"] + HEAD + ROW * (row + 0.5))


def _press(page: Page) -> None:
    page.mouse.down()
    page.mouse.up()


def _typed_name(page: Page, move: int) -> Release:
    """A name typed into the first column, before Enter."""
    _point(page, page.get_by_test_id("stDataFrame").first, 120, 4)
    _press(page)
    page.keyboard.type(f"lean {move}")
    return lambda: page.keyboard.press("Enter")


# --- what comes before the first move ----------------------------------------------------------


def _run(page: Page) -> None:
    page.get_by_role("button", name="Run", exact=True).click()
    page.locator(".st-key-recorder_table canvas").first.wait_for()
    settle(page)


def _run_many(page: Page) -> None:
    _run(page)
    page.get_by_role("button", name="Run 200 episodes").click()
    page.locator(".st-key-comparison").wait_for()
    settle(page)
    page.get_by_text("all episodes", exact=True).first.click()
    settle(page)
