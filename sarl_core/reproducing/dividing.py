"""The paper's open question: would a finer division of continuous actions help?"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from sarl_core.explaining.language import share_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.quantisation import SNAPPINGS, STUDIED_DIVIDERS, Quantisation, Snapping
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
)
from sarl_core.reproducing.study import FIRST_SEED, Claim, Drawing, Effort, Frames, Study, judge
from sarl_core.reproducing.words import COMPARED, interval, number
from sarl_core.rollouts.divider_study import DividerStudy, study_divider
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.progress import Progress, report
from sarl_core.rollouts.statistics import Interval

if TYPE_CHECKING:
    import pandas as pd

_WALKER = "BipedalWalker-v3"
_COLUMNS = (
    "environment",
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
)
_STAYS, _SOME = 0.5, 0.25  # of the expert's typical return


def continuous() -> tuple[str, ...]:
    """The environments whose demonstrations have continuous actions."""
    return tuple(one for one in environments() if not demonstrations_of(one).is_discrete)


def measure(effort: Effort, progress: Progress | None) -> pd.DataFrame:
    """Snap the expert's actions to intervals, with no rule in between.

    Args:
        effort: How many episodes for each divider and way to snap.
        progress: Called with (episodes done, in all); returning False stops.

    Returns:
        Three kinds of rows, told apart by `what`: "return", an episode of the expert (`seed`,
        `value`; `divider` 0 is the expert as it is); "error", what snapping changes in the
        demonstrated actions (`value`, root mean square); "interval", with its edges `low` and
        `high`, the `count` of demonstrated values in it, and their `median`.
    """
    import pandas as pd

    ids = continuous()
    rows: list[dict[str, Any]] = []
    for number_of, env_id in enumerate(ids):

        def told(done: int, total: int, before: int = number_of) -> None:
            report(progress, before * total + done, len(ids) * total)

        found = study_divider(
            env_id,
            "expert",
            demonstrations_of(env_id),
            episodes=effort.snapped_episodes,
            seed=FIRST_SEED,
            # The walker's physics take nearly all the time; the result is the same, bit for bit.
            jobs=1 if effort.quick else os.cpu_count() or 1,
            progress=told,
        )
        rows += [{"environment": env_id, **row} for row in _rows(found)]
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
    for seed, value in zip(episodes.seeds.tolist(), episodes.returns.tolist(), strict=True):
        yield {
            "what": "return",
            "divider": divider,
            "snapping": snapping,
            "seed": seed,
            "value": value,
        }


def episodes_of(frame: pd.DataFrame, env_id: str) -> dict[tuple[int, Snapping], Episodes]:
    """The episodes of each divider and way to snap, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        Seeds and returns of each combination, with nothing else in them; 0 and ``clip`` stand for
        the expert as it is.
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


def quantisations_of(frame: pd.DataFrame, env_id: str) -> tuple[tuple[Quantisation, ...], ...]:
    """How the demonstrated actions are divided, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        For each action dimension one entry a divider.
    """
    rows = frame[frame["environment"] == env_id]
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
        for (divider, snapping), episodes in episodes_of(frame, env_id).items():
            found = episodes.statistics
            name = f"divider {divider}, {snapping}" if divider else "as it is"
            returns[name] = {
                "mean": found.mean,
                "std": found.std,
                "iqm": found.iqm,
                "iqm_low": found.low,
                "iqm_high": found.high,
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


def divider_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper leaves open, and what it supposes.

    Args:
        frames: With the table of the divider study.

    Returns:
        Its claims and ours.
    """
    frame = frames["divider"]
    found = {env_id: episodes_of(frame, env_id) for env_id in _environments(frame)}
    claims = [_finer(found)]
    if _WALKER in found:
        claims.append(_complexity(found[_WALKER]))
    return tuple(claims)


def _finer(found: dict[str, dict[tuple[int, Snapping], Episodes]]) -> Claim:
    told: list[str] = []
    better: dict[str, bool] = {}
    numbers: dict[str, float] = {}
    for env_id, episodes in found.items():
        centred = {
            divider: one.statistics
            for (divider, snapping), one in episodes.items()
            if snapping == "centre"
        }
        coarse = centred[PAPER_DIVIDER]
        finer = {divider: one for divider, one in centred.items() if divider > PAPER_DIVIDER}
        best = max(finer, key=lambda divider: finer[divider].iqm)
        better[env_id] = finer[best].low > coarse.high
        told.append(
            f"{environment_name(env_id)} {interval(coarse)} with {PAPER_DIVIDER} intervals, "
            f"{interval(finer[best])} with {best}, {number(episodes[0, 'clip'].statistics.iqm)} "
            "as it is"
        )
        numbers |= {f"{env_id}_{divider}": one.iqm for divider, one in centred.items()}
    return Claim(
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        ours="Typical returns of the expert itself, each action replaced by the centre of its "
        f"interval: {'; '.join(told)}.",
        verdict=judge(all(better.values()), any(better.values())),
        decided_by=f"{COMPARED}; agrees if a finer division lies above {PAPER_DIVIDER} intervals, "
        "in every environment with continuous actions; partly, in some.",
        numbers=numbers,
    )


def _complexity(episodes: dict[tuple[int, Snapping], Episodes]) -> Claim:
    whole = episodes[0, "clip"].statistics
    centre, expert = (
        episodes[PAPER_DIVIDER, snapping].statistics for snapping in ("centre", "expert")
    )
    kept = max(centre.iqm, expert.iqm) / whole.iqm if whole.iqm > 0 else 0.0
    return Claim(
        paper="That no rules help on BipedalWalker is put down to poor demonstrations and to an "
        "environment that is too complex.",
        where="text on Figure 7",
        ours="Two intervals alone, without any rule, bring the expert from "
        f"{interval(whole)} to {interval(centre)} if each action becomes the centre of its "
        f"interval, as under the shield of Figure 7, and to {interval(expert)} if it becomes what "
        f"the expert typically did in it. That leaves {_of_typical(centre, whole)} and "
        f"{_of_typical(expert, whole)} of its typical return.",
        verdict=judge(kept >= _STAYS, kept >= _SOME),
        decided_by=f"Agrees if the expert, its actions divided into {PAPER_DIVIDER} intervals, "
        "keeps half of its typical return with the better of the two, the centre and its own "
        "typical value; partly if it keeps a quarter.",
        numbers={"as_it_is": whole.iqm, "centre": centre.iqm, "expert": expert.iqm},
    )


def _of_typical(found: Interval, whole: Interval) -> str:
    if min(found.iqm, whole.iqm) <= 0:
        return "nothing"
    return share_text(min(found.iqm / whole.iqm, 1.0))


def _draw(frame: pd.DataFrame, part: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.divider_figures import (
        error_figure,
        occupancy_figure,
        snapped_figure,
    )

    env_id = next(one for one in _environments(frame) if environment_name(one) == part)
    divided, episodes = quantisations_of(frame, env_id), episodes_of(frame, env_id)
    dividers = [one.divider for one in divided[0]]
    # Snapped by ``clip``, an action is what it was.
    unchanged = episodes[0, "clip"]
    episodes |= {(divider, "clip"): unchanged for divider in dividers}
    height = 60 + 38 * 2 * len(divided)
    return (
        Drawing(
            f"Typical return of the expert with snapped actions, {part}",
            snapped_figure(dividers, episodes, dark=dark).update_layout(height=max(height, 250)),
            alt=f"Typical return of the snapped expert for every divider, {part}",
        ),
        Drawing(
            f"How far an action moves, as a share of its range, {part}",
            error_figure(divided, dark=dark).update_layout(height=max(height, 250)),
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
        "episodes": effort.snapped_episodes,
        "expert": "the shipped one, its likeliest actions",
        "seeds": {"episodes": [FIRST_SEED, FIRST_SEED + effort.snapped_episodes - 1]},
    }


DIVIDING = Study(
    name="divider",
    place="Divider",
    title="What the divider costs, before any rule",
    about="Not in the paper, which leaves it open: the expert itself acts, and each of its actions "
    "is replaced by what stands for its own interval, the centre or what the expert typically did "
    "in it. Clip, the nearest value in the interval, is the action itself. What is lost is lost to "
    "the division alone. Below, how often each interval was demonstrated; those that never were, "
    "and that no rule can ask for, are hatched.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=divider_claims,
    parts=lambda frame: tuple(environment_name(one) for one in _environments(frame)),
    draw=_draw,
    columns=_COLUMNS,
)
