"""The paper's open question: would a finer division of continuous actions help?"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.mining.quantisation import SNAPPINGS, STUDIED_DIVIDERS
from sarl_core.paper.claims import DIVIDER, decided
from sarl_core.paper.divider_table import episodes_of, failures_of, quantisations_of, typical_of
from sarl_core.paper.metrics.division import divided_in
from sarl_core.paper.replicates import (
    demonstrations_of,
    environment_name,
    environments,
    recorded_seeds,
    replicates_of,
    shipped_demonstrations,
)
from sarl_core.paper.study import Drawing, Effort, Study, experts_in
from sarl_core.paper.verdicts import over_recordings
from sarl_core.progress import Progress, report
from sarl_core.rollouts.episodes import Episodes
from sarl_core.studies.divider import DividerStudy, study_divider

if TYPE_CHECKING:
    import pandas as pd

_WALKER = "BipedalWalker-v3"
_COLUMNS = (
    "environment",
    "expert",
    "recording",
    "what",
    "divider",
    "snapping",
    "action",
    "interval",
    "low",
    "high",
    "count",
    "median",
    "seed",
    "value",
    "crashed",
)


def continuous() -> tuple[str, ...]:
    """The environments whose demonstrations have continuous actions."""
    return tuple(one for one in environments() if not shipped_demonstrations(one).is_discrete)


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """Snap the experts' actions to intervals, with no rule in between.

    Args:
        effort: How many recordings, and episodes for each divider and way to snap.
        progress: Called with (episodes done, in all); returning False stops.

    Returns:
        For each recording (`environment`, `expert`, `recording`) three kinds of rows, told apart by
        `what`: "return", an episode of the expert (`seed`, `value`, and whether it `crashed`, where
        that is known; `divider` 0 is the expert as it is); "error", what snapping changes in the
        demonstrated actions (`value`, root mean square); "interval", with its edges `low` and
        `high`, the `count` of demonstrated values in it, and their `median`.
    """
    import pandas as pd

    wanted = [one for env_id in continuous() for one in replicates_of(env_id, effort.recordings)]
    rows: list[dict[str, Any]] = []
    for done_before, replicate in enumerate(wanted):

        def advance(done: int, total: int, before: int = done_before) -> None:
            report(progress, before * total + done, len(wanted) * total)

        studied = study_divider(
            replicate.env_id,
            replicate.expert,
            demonstrations_of(replicate),
            episodes=effort.snapped_episodes,
            seed=replicate.first_seed,
            # The walker's physics take nearly all the time; the result is the same, bit for bit.
            jobs=1 if effort.quick else os.cpu_count() or 1,
            executor=effort.executor,
            progress=advance,
        )
        own = {
            "environment": replicate.env_id,
            "expert": replicate.name,
            "recording": replicate.recording,
        }
        rows += [{**own, **row} for row in _rows(studied)]
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _rows(study: DividerStudy) -> Iterator[dict[str, Any]]:
    yield from _returns(0, "clip", study.unchanged)
    for each in study.snapped:
        if each.snapping != "clip":
            yield from _returns(each.divider, each.snapping, each.episodes)
    for part in (part for parts in study.quantisations for part in parts):
        name, edges = part.dimension.name, part.dimension.edges
        for snapping, error in part.errors.items():
            yield {
                "what": "error",
                "divider": part.divider,
                "snapping": snapping,
                "action": name,
                "value": error,
            }
        for label in range(part.divider):
            yield {
                "what": "interval",
                "divider": part.divider,
                "action": name,
                "interval": label,
                "low": edges[label],
                "high": edges[label + 1],
                "count": int(part.counts[label]),
                "median": float(part.medians[label]),
            }


def _returns(divider: int, snapping: str, episodes: Episodes) -> Iterator[dict[str, Any]]:
    known = episodes.failures_known
    for seed, value, fell in zip(
        episodes.seeds.tolist(), episodes.returns.tolist(), episodes.failed.tolist(), strict=True
    ):
        yield {
            "what": "return",
            "divider": divider,
            "snapping": snapping,
            "seed": seed,
            "value": value,
            "crashed": float(fell) if known else np.nan,
        }


def _environments(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(frame["environment"].unique().tolist())


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    numbers: dict[str, Any] = {}
    for env_id in _environments(frame):
        returns = {}
        experts = experts_in(frame)[env_id]
        typical, failures = typical_of(frame, env_id), failures_of(frame, env_id)
        for (divider, snapping), episodes in episodes_of(frame, env_id).items():
            name = f"divider {divider}, {snapping}" if divider else "as it is"
            over = over_recordings(typical[divider, snapping], experts)
            returns[name] = {
                "recordings": len(experts),
                "experts": len(set(experts)),
                "mean": float(episodes.returns.mean()),
                "std": float(episodes.returns.std(ddof=1)) if len(episodes) > 1 else 0.0,
                # Over recordings, and not over episodes, which are alike within one.
                "iqm": over.mean,
                "iqm_low": over.low,
                "iqm_high": over.high,
                "iqm_of_recordings": typical[divider, snapping].tolist(),
                "failure_rate": _known(failures[divider, snapping]),
            }
        divided = {
            parts[0].dimension.name: {
                f"divider {one.divider}": {
                    "occupancy": one.occupancy.tolist(),
                    "never_seen": list(one.never_seen),
                    **{f"error_{snapping}": one.errors[snapping] for snapping in SNAPPINGS},
                }
                for one in parts
            }
            for parts in quantisations_of(frame, env_id)
        }
        numbers[env_id] = {"returns": returns, "actions": divided}
    return numbers


def _known(share: float) -> float | None:
    return None if math.isnan(share) else share


def _exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same episodes with dividers and ways to snap dealt out anew, alike in all recordings."""
    rows = frame["what"] == "return"
    names = list(zip(frame["divider"], frame["snapping"], strict=True))
    keys = list(dict.fromkeys(key for key, own in zip(names, rows, strict=True) if own))
    order = rng.permutation(len(keys))
    dealt = dict(zip(keys, [keys[number] for number in order], strict=True))
    new = [dealt[key] if own else key for key, own in zip(names, rows, strict=True)]
    return frame.assign(
        divider=[divider for divider, _ in new], snapping=[snapping for _, snapping in new]
    )


def _draw(frame: pd.DataFrame, part: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.divider import (
        TypicalReturn,
        error_figure,
        occupancy_figure,
        typical_cells_figure,
    )

    env_id = next(one for one in _environments(frame) if environment_name(one) == part)
    divided = quantisations_of(frame, env_id)
    dividers = [one.divider for one in divided[0]]
    experts = experts_in(frame)[env_id]
    failures = failures_of(frame, env_id)
    cells = {
        key: TypicalReturn(over_recordings(values, experts), failures[key])
        for key, values in typical_of(frame, env_id).items()
    }
    # Snapped by ``clip``, an action is what it was.
    cells |= {(divider, "clip"): cells[0, "clip"] for divider in dividers}
    height = 60 + 38 * 2 * len(divided)
    return (
        Drawing(
            f"Typical return and failures of the expert with snapped actions, {part}",
            typical_cells_figure(dividers, cells, dark=dark).update_layout(height=max(height, 290)),
            alt=f"Typical return and failures of the snapped expert for every divider, {part}",
        ),
        Drawing(
            f"How far an action moves, as a share of its range, {part}",
            error_figure(divided, dark=dark).update_layout(height=max(height, 290)),
            alt=f"Root mean square of what snapping changes, for every action and divider, {part}",
        ),
        *(
            Drawing(
                f"Share of the steps in each interval of {one[0].dimension.name}, {part}",
                occupancy_figure(one, dark=dark),
                share=0.5 if len(divided) > 1 else 1.0,
                alt=f"Share of the steps in every interval of {one[0].dimension.name}, for every "
                f"divider, {part}; intervals that were never shown are hatched",
            )
            for one in divided
        ),
    )


def _settings(effort: Effort) -> dict[str, Any]:
    return {
        "environments": list(continuous()),
        "dividers": list(STUDIED_DIVIDERS),
        "snappings": list(SNAPPINGS),
        "episodes_a_recording": effort.snapped_episodes,
        "expert": "that of the recording, its likeliest actions",
        "seeds": {
            "recordings": recorded_seeds(continuous(), effort.recordings),
            "episodes": {
                env_id: [
                    [one.first_seed, one.first_seed + effort.snapped_episodes - 1]
                    for one in replicates_of(env_id, effort.recordings)
                ]
                for env_id in continuous()
            },
        },
    }


DIVIDING = Study(
    name="divider",
    place="Divider",
    title="What the divider costs, before any rule",
    about="Not in the paper, which leaves it open: the expert itself acts, and each of its actions "
    "is replaced by what stands for its own interval, the centre or what the expert typically did "
    "in it. Clip, the nearest value in the interval, is the action itself. What is lost is lost to "
    "the division alone. Each recording has its expert, its typical values and its episodes. "
    "Below, how often each interval was demonstrated in the shipped recording; those that never "
    "were, and that no rule can ask for, are hatched.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=lambda frames: decided(DIVIDER, divided_in(frames["divider"])),
    exchanged=_exchanged,
    parts=lambda frame: tuple(environment_name(one) for one in _environments(frame)),
    draw=_draw,
    columns=_COLUMNS,
)
