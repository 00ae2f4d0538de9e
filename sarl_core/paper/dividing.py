"""The paper's open question: would a finer division of continuous actions help?"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from sarl_core.environments.failures import failure_known
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import share_text
from sarl_core.mining.quantisation import SNAPPINGS, STUDIED_DIVIDERS, Quantisation, Snapping
from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
    recorded_seeds,
    replicates_of,
    shipped_demonstrations,
)
from sarl_core.paper.study import Drawing, Effort, Frames, Study, experts_in
from sarl_core.paper.verdicts import Claim, Floats, above, claim, over_recordings, together
from sarl_core.paper.words import interval, number
from sarl_core.progress import Progress, report
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import MeanInterval, interquartile_mean
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
_STAYS, _SOME = 0.5, 0.25  # of the expert's typical return


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

        def told(done: int, total: int, before: int = done_before) -> None:
            report(progress, before * total + done, len(wanted) * total)

        found = study_divider(
            replicate.env_id,
            replicate.expert,
            demonstrations_of(replicate),
            episodes=effort.snapped_episodes,
            seed=replicate.first_seed,
            # The walker's physics take nearly all the time; the result is the same, bit for bit.
            jobs=1 if effort.quick else os.cpu_count() or 1,
            progress=told,
        )
        own = {
            "environment": replicate.env_id,
            "expert": replicate.name,
            "recording": replicate.recording,
        }
        rows += [{**own, **row} for row in _rows(found)]
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _rows(found: DividerStudy) -> Iterator[dict[str, Any]]:
    yield from _returns(0, "clip", found.unchanged)
    for each in found.snapped:
        if each.snapping != "clip":
            yield from _returns(each.divider, each.snapping, each.episodes)
    for part in (part for divided in found.quantisations for part in divided):
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
    known = failure_known(episodes.env_id)
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


def episodes_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], Episodes]:
    """The episodes of each divider and way to snap, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        Seeds and returns of each combination, those of all recordings one after the other, with
        nothing else in them; 0 and ``clip`` stand for the expert as it is.
    """
    rows = frame[(frame["environment"] == env_id) & (frame["what"] == "return")]
    found = {}
    for divider, snapping in dict.fromkeys(zip(rows["divider"], rows["snapping"], strict=True)):
        own = rows[(rows["divider"] == divider) & (rows["snapping"] == snapping)]
        nothing = np.zeros(len(own), dtype=np.int64)
        found[int(divider), cast(Snapping, snapping)] = Episodes(
            env_id=env_id,
            agent="expert",
            seeds=own["seed"].to_numpy(dtype=np.int64).copy(),
            returns=own["value"].to_numpy(dtype=np.float64).copy(),
            lengths=nothing,
            interventions=nothing,
            covered=nothing,
            terminated=nothing.astype(np.bool_),
            truncated=nothing.astype(np.bool_),
            last_rewards=nothing.astype(np.float64),
        )
    return found


def typical_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], Floats]:
    """The typical return (IQM) of each divider and way to snap in each recording.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        As in `episodes_of`, one number a recording.

    Raises:
        ValueError: If recordings have different numbers of episodes.
    """
    recordings = frame[frame["environment"] == env_id]["recording"].nunique()
    return {
        key: interquartile_mean(episodes.returns.reshape(recordings, -1))
        for key, episodes in episodes_of(frame, env_id).items()
    }


def failures_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], float]:
    """The share of the episodes that failed, for each divider and way to snap.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        As in `episodes_of`; NaN where it is not known.
    """
    rows = frame[(frame["environment"] == env_id) & (frame["what"] == "return")]
    shares = rows.groupby(["divider", "snapping"])["crashed"].mean()
    return {key: float(shares.loc[key]) for key in episodes_of(frame, env_id)}


def quantisations_of(frame: pd.DataFrame, env_id: str) -> tuple[tuple[Quantisation, ...], ...]:
    """How the demonstrated actions of the first recording are divided, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        For each action dimension one entry a divider.
    """
    rows = frame[frame["environment"] == env_id]
    rows = rows[rows["recording"] == rows["recording"].iloc[0]]
    intervals, errors = rows[rows["what"] == "interval"], rows[rows["what"] == "error"]
    found = []
    for action in intervals["action"].unique():
        own = intervals[intervals["action"] == action]
        divided = []
        for divider in own["divider"].unique():
            parts = own[own["divider"] == divider]
            edges = [*parts["low"].tolist(), float(parts["high"].iloc[-1])]
            lost = errors[(errors["action"] == action) & (errors["divider"] == divider)]
            divided.append(
                Quantisation(
                    dimension=LabelledDimension.of_edges(str(action), edges),
                    divider=int(divider),
                    counts=parts["count"].to_numpy(dtype=np.int64).copy(),
                    medians=parts["median"].to_numpy(dtype=np.float64).copy(),
                    errors={
                        cast(Snapping, str(snapping)): float(value)
                        for snapping, value in zip(lost["snapping"], lost["value"], strict=True)
                    },
                )
            )
        found.append(tuple(divided))
    return tuple(found)


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


def divider_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper leaves open, and what it supposes.

    Args:
        frames: With the table of the divider study.

    Returns:
        Its claims and ours.
    """
    frame = frames["divider"]
    found = {env_id: typical_of(frame, env_id) for env_id in _environments(frame)}
    experts = experts_in(frame)
    failures = {env_id: failures_of(frame, env_id) for env_id in found}
    claims = [_finer(found, failures, experts)]
    if _WALKER in found:
        claims.append(_complexity(found[_WALKER], failures[_WALKER], experts[_WALKER]))
    return tuple(claims)


Typical = Mapping[tuple[int, Snapping], Floats]
Failures = Mapping[tuple[int, Snapping], float]


def _finer(
    found: Mapping[str, Typical],
    failures: Mapping[str, Failures],
    experts: Mapping[str, tuple[str, ...]],
) -> Claim:
    told: list[str] = []
    parts = []
    numbers: dict[str, float] = {}
    for env_id, typical in found.items():
        own = experts[env_id]
        centred = {
            divider: values
            for (divider, snapping), values in typical.items()
            if snapping == "centre"
        }
        coarse = centred[PAPER_DIVIDER]
        finer = [values for divider, values in centred.items() if divider > PAPER_DIVIDER]
        parts.append(above(np.mean(finer, axis=0) - coarse, own, agrees=0, partly=0, show=number))
        over = {divider: over_recordings(values, own) for divider, values in centred.items()}
        parts_told = [
            f"{_told(one, failures[env_id][divider, 'centre'])} with {divider}"
            + (" intervals" if divider == PAPER_DIVIDER else "")
            for divider, one in over.items()
        ]
        whole = _told(over_recordings(typical[0, "clip"], own), failures[env_id][0, "clip"])
        told.append(f"{environment_name(env_id)} {', '.join(parts_told)}, {whole} as it is")
        numbers |= {f"{env_id}_{divider}": one.mean for divider, one in over.items()}
    return claim(
        together(
            parts,
            f"{parts[0].rule} So in every environment with continuous actions; partly, if in some.",
        ),
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        ours="Typical returns of the experts themselves, each action replaced by the centre of its "
        f"interval: {'; '.join(told)}.",
        measured="What all finer divisions bring on average, over that in "
        f"{PAPER_DIVIDER} intervals.",
        numbers=numbers,
    )


def _complexity(typical: Typical, failures: Failures, experts: tuple[str, ...]) -> Claim:
    whole = typical[0, "clip"]
    ways: tuple[Snapping, Snapping] = ("centre", "expert")
    centre, median = (over_recordings(typical[PAPER_DIVIDER, way], experts) for way in ways)
    better = max(ways, key=lambda way: float(typical[PAPER_DIVIDER, way].mean()))
    kept = np.divide(
        typical[PAPER_DIVIDER, better], whole, out=np.zeros(len(whole)), where=whole > 0
    )
    before = over_recordings(whole, experts)
    told = [
        _told(over_recordings(typical[key], experts), failures[key])
        for key in ((0, "clip"), (PAPER_DIVIDER, "centre"), (PAPER_DIVIDER, "expert"))
    ]
    return claim(
        above(kept, experts, agrees=_STAYS, partly=_SOME),
        paper="That no rules help on BipedalWalker is put down to poor demonstrations and to an "
        "environment that is too complex.",
        where="text on Figure 7",
        ours=f"Two intervals alone, without any rule, bring the experts from {told[0]} to "
        f"{told[1]} if each action becomes the centre of its interval, as under the shield of "
        f"Figure 7, and to {told[2]} if it becomes what the expert typically did in it. That "
        f"leaves {_of_typical(centre, before)} and {_of_typical(median, before)} of their typical "
        "return.",
        measured=f"What the expert, its actions divided into {PAPER_DIVIDER} intervals, keeps of "
        "its typical return with the better of the two, the centre and its own typical value.",
        numbers={"as_it_is": before.mean, "centre": centre.mean, "expert": median.mean},
    )


def _told(found: MeanInterval, failing: float) -> str:
    """Typical return and share of failures, for people; the latter where it is known."""
    if math.isnan(failing):
        return interval(found)
    text = interval(found)
    fail = f"{share_text(failing)} fail)"
    return f"{text[:-1]}; {fail}" if text.endswith(")") else f"{text} ({fail}"


def _of_typical(found: MeanInterval, whole: MeanInterval) -> str:
    if min(found.mean, whole.mean) <= 0:
        return "nothing"
    return share_text(min(found.mean / whole.mean, 1.0))


def divisions_exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same episodes with dividers and ways to snap dealt out anew, alike in all recordings.

    Args:
        frame: What `measure` gives.
        rng: Random numbers.

    Returns:
        A table as `measure` gives it.
    """
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
            "recordings": {
                env_id: recorded_seeds(env_id, effort.recordings) for env_id in continuous()
            },
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
    claims=divider_claims,
    exchanged=divisions_exchanged,
    parts=lambda frame: tuple(environment_name(one) for one in _environments(frame)),
    draw=_draw,
    columns=_COLUMNS,
)
