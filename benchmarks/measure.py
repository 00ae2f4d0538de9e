"""Measuring two ways of doing one thing, side by side."""

from __future__ import annotations

import gc
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

Kind = Literal["times faster", "share", "seconds"]


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes:
        what: Ours.
        against: What it is compared with, "-" for nothing.
        kind: What is measured: how many times faster ours is, ours as a share of the other, or
            the seconds that ours takes.
        measured: The figure.
        reach: The figure to reach.
        details: What lies behind it, in absolute terms.
        holds: What else must be true, as "the file is no larger".
    """

    what: str
    against: str
    kind: Kind
    measured: float
    reach: float
    details: str
    holds: bool = True

    @property
    def passed(self) -> bool:
        """Whether the figure is reached."""
        enough = (
            self.measured >= self.reach
            if self.kind == "times faster"
            else self.measured <= self.reach
        )
        return enough and self.holds

    def text(self, value: float) -> str:
        """A figure of this row's kind, for the table."""
        if self.kind == "times faster":
            return f"{value:.3g} x" if value < 1000 else f"{value:,.0f} x"
        if self.kind == "share":
            return f"{100 * value:.2g} %" if value < 0.5 else f"{value:.2f} x"
        return duration(value)


def seconds(work: Callable[[], object]) -> float:
    """How long one call takes.

    Args:
        work: To be called once.

    Returns:
        Seconds.
    """
    gc.collect()
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def side_by_side(
    ours: Callable[[], object], theirs: Callable[[], object], *, repeats: int, ours_calls: int = 1
) -> tuple[float, float]:
    """Time two pieces of work in turns, so that what else the machine does meets both.

    Args:
        ours: The one.
        theirs: The other.
        repeats: Turns, after one that does not count.
        ours_calls: Calls of ours in a turn, where one is too short to time.

    Returns:
        The medians in seconds, of one call each.
    """
    ours()
    theirs()
    first, second = [], []
    for _ in range(repeats):
        first.append(seconds(lambda: [ours() for _ in range(ours_calls)]) / ours_calls)
        second.append(seconds(theirs))
    return statistics.median(first), statistics.median(second)


def duration(value: float) -> str:
    """A time for people.

    Args:
        value: Seconds.

    Returns:
        As "4.1 us", "23 ms", "1.7 s".
    """
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def print_rows(rows: Iterable[Row]) -> None:
    """Print the table."""
    table = Table(box=SIMPLE_HEAD)
    for heading in ("what", "against"):
        table.add_column(heading)
    for heading in ("measured", "to reach"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("behind it", style="dim")
    for row in rows:
        limit = ">=" if row.kind == "times faster" else "<="
        table.add_row(
            row.what,
            row.against,
            row.text(row.measured),
            f"{limit} {row.text(row.reach)}",
            "[green]reached[/]" if row.passed else "[red]missed[/]",
            row.details,
        )
    Console(width=None if sys.stdout.isatty() else 170).print(table)
