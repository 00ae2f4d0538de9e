"""What every figure of the paper is to this program: something measured, drawn and compared.

A study measures a table of plain columns, and everything else, the figures, the numbers and the
verdicts, follows from that table. So who has the table, as a CSV file, can draw the same figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from sarl_core.rollouts.progress import Progress
from sarl_core.rollouts.seeds import REPRODUCED

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

Verdict = Literal["agrees", "partly", "does not agree"]
VERDICTS: tuple[Verdict, ...] = ("agrees", "partly", "does not agree")

FULL_MINUTES = 75
"""What all studies together took when their results were committed, on two busy cores."""

FIRST_SEED = REPRODUCED  # of the episodes; no expert was trained or chosen by them


@dataclass(frozen=True)
class Effort:
    """How much work a study may take.

    Attributes:
        quick: Whether this only shows that everything works; its numbers mean little.
        learners: Learners of Figure 4, each with a seed of its own.
        phases: Phases of learning of each.
        test_steps: Steps of each test between them.
        episodes: Episodes of each way to act in Figures 5 to 7.
        snapped_episodes: Episodes of each way to divide actions.
    """

    quick: bool
    learners: int
    phases: int
    test_steps: int
    episodes: int
    snapped_episodes: int


FULL = Effort(
    quick=False,
    learners=5,
    phases=100,
    test_steps=20_000,
    episodes=100,
    snapped_episodes=100,
)
QUICK = Effort(
    quick=True,
    learners=2,
    phases=3,
    test_steps=2_000,
    episodes=3,
    snapped_episodes=1,
)


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper beside our number.

    Attributes:
        paper: What the paper says, in one sentence.
        where: Where it says so.
        ours: What we found, in one sentence.
        verdict: Whether the two agree, decided by `decided_by` and nothing else.
        decided_by: By which rule.
        numbers: What went into `ours` and the verdict.
    """

    paper: str
    where: str
    ours: str
    verdict: Verdict
    decided_by: str
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawing:
    """One figure as it stands on a page.

    Attributes:
        title: Above it.
        figure: Transparent, without a title of its own.
        share: Share of the width of its row.
        alt: What it shows, for who cannot see it.
    """

    title: str
    figure: go.Figure
    share: float = 0.5
    alt: str = ""


Frames = Mapping[str, "pd.DataFrame"]
"""Tables of studies by their names."""


@dataclass(frozen=True)
class Study:
    """One figure or table of the paper.

    Attributes:
        name: On the command line and in file names, as "2" or "table-1".
        place: As "Figure 2".
        title: What it shows, in a few words.
        about: The same in a sentence or two, with how it was measured.
        measure: Does the work, and gives its table.
        settings: What the work was done with, seeds included, for the report.
        numbers: From the table, what sums it up, for the report.
        claims: From the tables at hand, its own among them, the paper's claims and ours.
        parts: From the table, what can be looked at one by one, as environments; at least one.
        draw: From the table and one of its parts (and whether the ground is dark), its figures;
            those whose shares add up to 1 stand in a row.
        columns: Of the table, at least.
    """

    name: str
    place: str
    title: str
    about: str
    measure: Callable[[Effort, Progress | None], pd.DataFrame]
    settings: Callable[[Effort], dict[str, Any]]
    numbers: Callable[[pd.DataFrame], dict[str, Any]]
    claims: Callable[[Frames], tuple[Claim, ...]]
    parts: Callable[[pd.DataFrame], tuple[str, ...]]
    draw: Callable[[pd.DataFrame, str, bool], tuple[Drawing, ...]]
    columns: tuple[str, ...]

    @property
    def slug(self) -> str:
        """What its files are called, without their ends, as "figure_2"."""
        return f"figure_{self.name}" if self.name.isdigit() else self.name.replace("-", "_")


def judge(agrees: bool, partly: bool = False) -> Verdict:
    """A verdict.

    Args:
        agrees: Whether the claim holds.
        partly: Whether it holds in part.

    Returns:
        The verdict.
    """
    return "agrees" if agrees else "partly" if partly else "does not agree"
