"""Table 1: the two named settings, and the rule sets that they give."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.mining.language import share_text
from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
    named_rules,
    recorded_seeds,
    replicates_of,
)
from sarl_core.paper.study import Drawing, Effort, Frames, Study, experts_in
from sarl_core.paper.verdicts import Claim, Floats, above, below, claim, together
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
_COMPACT, _SMALLER = 0.1, 0.5  # of the unfiltered rules
_EVERY_STATE, _MOST_STATES = 0.995, 0.95
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
    found: dict[str, Any] = {}
    for row in _first(frame).to_dict("records"):
        env_id, setting = row["environment"], row["setting"]
        every = frame[(frame["environment"] == env_id) & (frame["setting"] == setting)]
        found.setdefault(env_id, {})[setting] = {
            **{layer: row[layer] for layer in _LAYERS},
            "over_recordings": {
                layer: [float(every[layer].min()), float(every[layer].max())] for layer in _LAYERS
            },
        }
    return found


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
            "recordings": {
                env_id: recorded_seeds(env_id, effort.recordings) for env_id in environments()
            },
        },
    }


def settings_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the two rule sets themselves.

    Args:
        frames: With the table of Table 1.

    Returns:
        Its claims and ours.
    """
    frame = frames["table-1"]
    experts = experts_in(frame)

    def values(env_id: str, setting: str, layer: str) -> Floats:
        rows = (frame["environment"] == env_id) & (frame["setting"] == setting)
        return frame.loc[rows].sort_values("recording")[layer].to_numpy(dtype=np.float64)

    def both(env_id: str, layer: str) -> tuple[Floats, Floats]:
        return values(env_id, "filtered", layer), values(env_id, "unfiltered", layer)

    counts = {env_id: both(env_id, "rule_count") for env_id in experts}
    shares = {env_id: some / many for env_id, (some, many) in counts.items()}
    covered = {env_id: values(env_id, "unfiltered", "coverage") for env_id in experts}
    told = "; ".join(
        f"{environment_name(env_id)} {_range(some)} of {_range(many)} "
        f"({' and '.join(_range(lengths, 1) for lengths in both(env_id, 'mean_length'))})"
        for env_id, (some, many) in counts.items()
    )
    least = min(covered, key=lambda env_id: float(covered[env_id].min()))
    lowest = float(covered[least].min())
    compact = [
        below(shares[env_id], experts[env_id], agrees=_COMPACT, partly=_SMALLER)
        for env_id in experts
    ]
    every = [
        above(
            covered[env_id],
            experts[env_id],
            agrees=_EVERY_STATE,
            partly=_MOST_STATES,
            show=share_text,
        )
        for env_id in experts
    ]
    everywhere = "So in every environment; partly, if in some."
    return (
        claim(
            together(compact, f"{compact[0].rule} {everywhere}"),
            paper="Filtering by support and confidence gives a compact rule set.",
            where="Lessons Learned, Table 1",
            ours="Filtered rules of the unfiltered ones, and the mean lengths of both, from the "
            f"least to the most of the recordings: {told}.",
            measured="The share of the unfiltered rules that remains.",
            numbers={f"share_{env_id}": float(one.mean()) for env_id, one in shares.items()},
            constructed="a rule with support 0.005 applies to 75 of 15,000 steps, so there can be "
            "no more than 200 a dimension, whatever was demonstrated",
        ),
        claim(
            together(every, f"{every[0].rule} {everywhere}"),
            paper="The unfiltered rule set has an action for every state.",
            where="text on Figure 4",
            ours=f"Its rules cover {share_text(lowest)} of the demonstrated states or more"
            + (
                f"; least on {environment_name(least)}, where some equal states were shown with "
                "different actions."
                if lowest < 1
                else "."
            ),
            measured="The share of the demonstrated states with a rule.",
            numbers={f"coverage_{env_id}": float(one.mean()) for env_id, one in covered.items()},
            constructed="a fully grown tree ends in one action everywhere, but for equal states "
            "that were shown with different ones",
        ),
    )


def settings_exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same rule sets, each pair called filtered and unfiltered as it comes.

    Args:
        frame: What `measure` gives.
        rng: Random numbers.

    Returns:
        A table as `measure` gives it.
    """
    if rng.random() < 0.5:
        return frame
    other = {"filtered": "unfiltered", "unfiltered": "filtered"}
    return frame.assign(setting=frame["setting"].map(other))


def _range(values: Floats, decimals: int = 0) -> str:
    """The least and the most of some numbers, or the one that they all are, for people."""
    ends = dict.fromkeys(f"{value:,.{decimals}f}" for value in (values.min(), values.max()))
    return " to ".join(ends)


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
    claims=settings_claims,
    exchanged=settings_exchanged,
    parts=lambda frame: (_ALL,),
    draw=_draw,
    columns=_COLUMNS,
)
