"""Reports made beside the page: what one depends on, the work, and where the latest are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.report.comparison import Result, results_of
from sarl_core.explaining.report.report import Report, Wishes, make_report
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_core.studies.comparison import Arm, Comparison
from sarl_dashboard.byte_cache import Kept
from sarl_dashboard.jobs.episodes import job as shield_job
from sarl_dashboard.jobs.episodes import results
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.text import digest_of

KEPT = 8  # a report has about a megabyte


@dataclass(frozen=True, eq=False)
class Order:
    """Everything that a report depends on.

    Attributes:
        key: Digest of it; equal keys give equal reports.
        rule_set: The rules.
        demonstrations: They are about.
        wishes: What it is to hold.
        card: Of the rules, None without one.
        comparison: Results to show.
        trees: Grown from the demonstrations, None where no thresholds cut the rules.
    """

    key: str
    rule_set: RuleSet
    demonstrations: Demonstrations
    wishes: Wishes
    card: Mapping[str, Any] | None
    comparison: tuple[Result, ...]
    trees: tuple[PolicyTree, ...] | None


def order_key(
    rules: str, demonstrations: Demonstrations, wishes: Wishes, comparison: Sequence[Result]
) -> str:
    """Digest of what a report depends on.

    Args:
        rules: Tells the rules from all others, by content.
        demonstrations: They are about.
        wishes: What it is to hold; no agent among them.
        comparison: Results to show.

    Returns:
        Hexadecimal digits.
    """
    asked = (wishes.in_full, wishes.frames, wishes.commands, wishes.rules_name)
    return digest_of(repr((rules, demonstrations.digest, asked, tuple(comparison))).encode())


@st.cache_resource
def kept_reports() -> Kept[Report]:
    """Finished reports by their order's key."""
    return Kept(KEPT)


class Reporting(Job):
    """One report in the making.

    Attributes:
        order: What was asked for.
    """

    def __init__(self, order: Order) -> None:
        self.order = order
        self._kept = kept_reports()  # the work's own thread has no session
        super().__init__(self._make, 100)

    def _make(self, _: Job) -> None:
        order = self.order
        self.text = "Playing episodes and drawing them …" if order.wishes.frames else "Writing …"

        def told(done: int, total: int) -> bool:
            self.done, self.total = done, total
            if done == total:
                self.text = "Writing …"
            return self.wanted()

        report = make_report(
            order.rule_set,
            order.demonstrations,
            **vars(order.wishes),
            card=order.card,
            comparison=order.comparison,
            trees=order.trees,
            progress=told,
        )
        self._kept.put(order.key, report)


def kept_report(key: str) -> Report | None:
    """The report of an order, if it has been made."""
    found = kept_reports().get(key)
    return found if isinstance(found, Report) else None


def comparison_of_session(env_id: str) -> tuple[Comparison | None, str]:
    """What this visitor ran last on the page Shield, as far as it is there.

    Args:
        env_id: Of the report; a comparison in another environment says nothing about it.

    Returns:
        The comparison, None where there is none; and the name of the file that the page Shield
        downloads of it.
    """
    asked = shield_job("comparison")
    if asked is None or asked.running:
        return None, ""
    arms, found = [], []
    rows = [row for row in asked.rows if row.env_id == env_id]
    for row in rows:
        episodes = results().get(row.key, asked.episodes)
        shield = row.shield()
        if episodes is not None:
            rules = shield.rule_set if shield is not None else None
            arms.append(Arm(row.name, episodes.agent, rules))
            found.append(episodes)
    if not found:
        return None, ""
    seed = rows[0].seed
    name = f"comparison-{env_id.rsplit('/', 1)[-1]}-{seed}.csv"
    return Comparison(env_id, seed, tuple(arms), tuple(found)), name


def as_results(comparison: Comparison | None) -> tuple[Result, ...]:
    """A comparison as results; none without one."""
    return results_of(comparison) if comparison is not None else ()
