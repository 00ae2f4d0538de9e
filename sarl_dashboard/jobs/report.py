"""Reports made beside the page: what one depends on, the work, and where the latest are kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.report.comparison import Result, results_of
from sarl_core.explaining.report.pdf import document_to_pdf
from sarl_core.explaining.report.report import Report, Wishes, make_report
from sarl_core.explaining.words.sign_off import sign_off_text
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_core.studies.comparison import Arm, Comparison
from sarl_dashboard.cache import key_of
from sarl_dashboard.jobs.episodes import COMPARISON, known
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.memory_cache import BoundedCache

MOST_REPORTS = 8  # a report has about a megabyte


@dataclass(frozen=True, eq=False)
class ReportOrder:
    """Everything that a report depends on.

    Attributes:
        rule_set: The rules.
        demonstrations: They are about.
        wishes: What it is to hold.
        card: Of the rules, None without one.
        comparison: Results to show.
        trees: Grown from the demonstrations, None where no thresholds cut the rules.
    """

    rule_set: RuleSet
    demonstrations: Demonstrations
    wishes: Wishes
    card: Mapping[str, Any] | None
    comparison: tuple[Result, ...]
    trees: tuple[PolicyTree, ...] | None

    @cached_property
    def key(self) -> object:
        """Equal keys give equal reports; no agent is among the wishes."""
        wishes = self.wishes
        names = (wishes.rules_name, wishes.demonstrations_name)
        sign_off = sign_off_text(wishes.sign_off)
        contents = (wishes.in_full, wishes.frames, wishes.commands, names, sign_off, wishes.cover)
        return key_of((self.rule_set, self.demonstrations, contents, self.comparison))


@st.cache_resource
def report_cache() -> BoundedCache[Report]:
    """Finished reports by their order's key."""
    return BoundedCache(MOST_REPORTS)


def reporting(order: ReportOrder) -> Job[Report]:
    """Make a report.

    Args:
        order: What is asked for.
    """
    cache = report_cache()
    return Job(order.key, lambda job: _make(job, order, cache), 100, lasts=True)


def _make(job: Job[Report], order: ReportOrder, cache: BoundedCache[Report]) -> None:
    plays = order.wishes.frames and (order.wishes.env_id or order.demonstrations.env_id)
    job.text = "Playing episodes and drawing them …" if plays else "Writing …"

    def progress(done: int, total: int) -> bool:
        if done == total:
            job.text = "Writing …"
        return job.progress(done, total)

    report = make_report(
        order.rule_set,
        order.demonstrations,
        **vars(order.wishes),
        card=order.card,
        comparison=order.comparison,
        trees=order.trees,
        progress=progress,
    )
    cache.put(order.key, report)


@st.cache_resource
def print_cache() -> BoundedCache[bytes]:
    """Reports on paper, as PDF files, by their order's key."""
    return BoundedCache(MOST_REPORTS)


def printing(order: ReportOrder, report: Report) -> Job[bytes]:
    """Print a report, which takes a browser: it takes its turn as all long work does.

    Args:
        order: What was asked for.
        report: What came of it.
    """
    cache = print_cache()
    return Job(order.key, lambda job: _print(job, order, report, cache), 1, lasts=True)


def _print(job: Job[bytes], order: ReportOrder, report: Report, cache: BoundedCache[bytes]) -> None:
    def progress(seconds: int, _: int) -> bool:
        # How long it takes nobody can say, so the seconds stand in the text.
        job.text = f"Printing for {counted(seconds, 'second')} …" if seconds else "Printing …"
        return job.wanted()

    cache.put(order.key, document_to_pdf(report.html, progress))


def comparison_of_session(env_id: str) -> tuple[Comparison | None, str]:
    """What this visitor ran last on the page Measure, as far as it is there.

    Args:
        env_id: Of the report; a comparison in another environment says nothing about it.

    Returns:
        The comparison, None where there is none; and the name of the file that the page Measure
        downloads of it.
    """
    job = COMPARISON.job
    if job is None or job.running or job.result is None:
        return None, ""
    arms, finished = [], []
    rows = [row for row in job.result.rows if str(row.env_id) == env_id]
    for row, episodes in zip(rows, known(rows, job.result.episodes), strict=True):
        if episodes is not None:
            shield = row.shield()
            rules = shield.rule_set if shield is not None else None
            arms.append(Arm(row.name, episodes.agent, rules))
            finished.append(episodes)
    if not finished:
        return None, ""
    seed = rows[0].seed
    name = f"comparison-{env_id.rsplit('/', 1)[-1]}-{seed}.csv"
    return Comparison(env_id, seed, tuple(arms), tuple(finished)), name


def as_results(comparison: Comparison | None) -> tuple[Result, ...]:
    """A comparison as results; none without one."""
    return results_of(comparison) if comparison is not None else ()
