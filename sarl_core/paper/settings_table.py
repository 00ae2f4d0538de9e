"""Table 1: the two named settings, and the rule sets that they give."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.paper.claims import TABLE_1, decided
from sarl_core.paper.metrics.named_settings import named_sets
from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
    named_rules,
    recorded_seeds,
    replicates_of,
)
from sarl_core.paper.study import Drawing, Effort, Study
from sarl_core.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
_COLUMNS = (
    "environment",
    "expert",
    "recording",
    "setting",
    "support",
    "confidence",
    "divider",
    *_LAYERS,
)
_ALL = "all environments"


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """Mine the two named rule sets of every shipped environment, once a recording.

    Args:
        effort: How many recordings.
        progress: Called with (pairs of rule sets done, in all); returning False stops.

    Returns:
        One row a rule set; columns `environment`, `expert`, `recording`, `setting`, its `support`
        and `confidence`, `divider` (0 for discrete actions), `rule_count`, `mean_length`,
        `coverage`, `fidelity`.
    """
    import pandas as pd

    wanted = [one for env_id in environments() for one in replicates_of(env_id, effort.recordings)]
    rows = []
    report(progress, 0, len(wanted))
    for done, replicate in enumerate(wanted, 1):
        discrete = demonstrations_of(replicate).is_discrete
        for name, rules in named_rules(replicate).items():
            rows.append(
                {
                    "environment": replicate.env_id,
                    "expert": replicate.name,
                    "recording": replicate.recording,
                    "setting": name,
                    "support": rules.thresholds.support,
                    "confidence": rules.thresholds.confidence,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    **{layer: getattr(rules, layer) for layer in _LAYERS},
                }
            )
        report(progress, done, len(wanted))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _first(frame: pd.DataFrame) -> pd.DataFrame:
    """The rule sets of the shipped recording, which are those used everywhere."""
    chosen: pd.DataFrame = frame[frame["recording"] == frame["recording"].iloc[0]]
    return chosen


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    numbers: dict[str, Any] = {}
    for row in _first(frame).to_dict("records"):
        env_id, setting = row["environment"], row["setting"]
        every = frame[(frame["environment"] == env_id) & (frame["setting"] == setting)]
        numbers.setdefault(env_id, {})[setting] = {
            **{layer: row[layer] for layer in _LAYERS},
            "over_recordings": {
                layer: [float(every[layer].min()), float(every[layer].max())] for layer in _LAYERS
            },
        }
    return numbers


def _settings(effort: Effort) -> dict[str, Any]:
    return {
        **{
            name: {"support": setting.support, "confidence": setting.confidence}
            for name, setting in NAMED_SETTINGS.items()
        },
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {
            "tree": 0,
            "recordings": recorded_seeds(environments(), effort.recordings),
        },
    }


def _exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same rule sets, each pair called filtered and unfiltered as it comes."""
    if rng.random() < 0.5:
        return frame
    other = {"filtered": "unfiltered", "unfiltered": "filtered"}
    return frame.assign(setting=frame["setting"].map(other))


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.settings import settings_figure

    rows = [
        (environment_name(str(row["environment"])), str(row["setting"]), row)
        for row in _first(frame).to_dict("records")
    ]
    counts = [(name, setting, float(row["rule_count"])) for name, setting, row in rows]
    covered = [(name, setting, float(row["coverage"])) for name, setting, row in rows]
    return (
        Drawing(
            "Number of rules",
            settings_figure(counts, title="rules", share=False),
            alt="Number of rules of the filtered and the unfiltered rule set of each environment",
        ),
        Drawing(
            "Coverage: share of the demonstrated states with a rule",
            settings_figure(covered, title="coverage", share=True),
            alt="Coverage of the filtered and the unfiltered rule set of each environment",
        ),
    )


SETTINGS = Study(
    name="table-1",
    place="Table 1",
    title="The two named settings",
    about="The rule sets at the paper's two named settings, filtered (support 0.005, confidence "
    "0.95) and unfiltered (support 0, confidence 1), for every environment. They are meant by "
    "these words wherever they stand. A rule needs at least these values; under the paper's "
    "Algorithm 1, which asks for more than them, the unfiltered set would be empty. Drawn for the "
    "shipped recording; the claims are decided over several recordings of several experts.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=lambda frames: decided(TABLE_1, named_sets(frames["table-1"])),
    exchanged=_exchanged,
    parts=lambda frame: (_ALL,),
    draw=_draw,
    columns=_COLUMNS,
)
