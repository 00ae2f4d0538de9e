"""What every figure of the paper is to this program: something measured, drawn and compared.

A study measures a table of plain columns, and everything else, the figures, the numbers and the
verdicts, follows from that table. So who has the table, as a CSV file, can draw the same figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sarl_core.mining.language import counted
from sarl_core.paper.verdicts import Claim
from sarl_core.progress import Progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import numpy as np
    import pandas as pd
    import plotly.graph_objects as go

FULL_MINUTES = 60
"""What all studies together take on two cores with nothing else to do."""


@dataclass(frozen=True)
class Effort:
    """How much work a study may take.

    Attributes:
        quick: Whether this only shows that everything works; its numbers mean little.
        recordings: Of each environment, in turn of one expert and the next. Each has a learner of
            its own in Figure 4, and episodes of its own elsewhere.
        phases: Phases of learning of each learner.
        test_steps: Steps of each test between them.
        episodes: Episodes of each way to act in Figures 5 to 7, for each recording.
        snapped_episodes: Episodes of each way to divide actions, likewise.
        executor: Whose processes play the episodes; this machine's where not given. The result is
            the same, bit for bit.
    """

    quick: bool
    recordings: int
    phases: int
    test_steps: int
    episodes: int
    snapped_episodes: int
    executor: Executor | None = None


FULL = Effort(
    quick=False,
    recordings=6,
    phases=100,
    test_steps=20_000,
    episodes=35,
    snapped_episodes=18,
)
QUICK = Effort(
    quick=True,
    recordings=2,
    phases=3,
    test_steps=2_000,
    episodes=1,
    snapped_episodes=1,
)


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
        exchanged: From the table and random numbers, the same table with the names of what the
            claims compare dealt out anew; by it one sees what would agree by chance.
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
    exchanged: Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]
    parts: Callable[[pd.DataFrame], tuple[str, ...]]
    draw: Callable[[pd.DataFrame, str, bool], tuple[Drawing, ...]]
    columns: tuple[str, ...]

    @property
    def slug(self) -> str:
        """What its files are called, without their ends, as "figure_2"."""
        return f"figure_{self.name}" if self.name.isdigit() else self.name.replace("-", "_")


def experts_in(frame: pd.DataFrame) -> dict[str, tuple[str, ...]]:
    """The expert of each recording in a table.

    Args:
        frame: With columns `environment`, `expert` and `recording`.

    Returns:
        By environment, in the order of the recordings' first rows.
    """
    rows = frame.drop_duplicates(["environment", "recording"])
    return {
        str(env_id): tuple(own["expert"].tolist())
        for env_id, own in rows.groupby("environment", sort=False)
    }


def replication(frame: pd.DataFrame) -> str:
    """How many recordings and experts an environment has in a table, for people.

    Args:
        frame: With columns `environment`, `expert` and `recording`.

    Returns:
        As "6 recordings of 3 experts"; of the environment that has the fewest.
    """
    fewest = min(experts_in(frame).values(), key=len)
    return f"{counted(len(fewest), 'recording')} of {counted(len(set(fewest)), 'expert')}"
