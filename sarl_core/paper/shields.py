"""Figures 5 to 7: a novice alone, with filtered and with unfiltered rules, and the expert."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.paper.replicates import (
    PAPER_DIVIDER,
    Replicate,
    environment_name,
    named_rules,
    recorded_seeds,
    replicates_of,
)
from sarl_core.paper.study import Drawing, Effort, Study
from sarl_core.paper.verdicts import (
    Floats,
    Truths,
    over_recordings,
    share_over_recordings,
)
from sarl_core.paper.words import interval, shares
from sarl_core.progress import Progress, part_of
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import MeanInterval, interquartile_mean
from sarl_core.studies.comparison import Arm, Comparison, compare_arm

if TYPE_CHECKING:
    import pandas as pd

NOVICE, FILTERED, UNFILTERED, EXPERT = "novice alone", "filtered", "unfiltered", "expert"
ARMS = (NOVICE, FILTERED, UNFILTERED, EXPERT)
_AS_THEY_ARE = 0  # divider of discrete actions, and of who has no rules
_SLOW = "BipedalWalker-v3"  # its episodes are worth processes of their own

_FROM_EPISODES = {
    "seed": "seeds",
    "return": "returns",
    "length": "lengths",
    "interventions": "interventions",
    "covered": "covered",
    "terminated": "terminated",
    "truncated": "truncated",
    "last_reward": "last_rewards",
}
_COLUMNS = (
    "environment",
    "expert",
    "recording",
    "divider",
    "arm",
    "agent",
    "rule_count",
    "crashed",
    *_FROM_EPISODES,
)


def measure(
    effort: Effort, progress: Progress | None, env_id: str, dividers: Sequence[int]
) -> pd.DataFrame:
    """Run the same episodes with the novice, alone and shielded, and with the expert.

    Each recording has its rules, its expert and its episodes. The novice acts at random. The
    expert samples its actions, as it did when its demonstrations were recorded.

    Args:
        effort: How many recordings, and episodes for each.
        progress: Called with (episodes done, in all); returning False stops.
        env_id: Environment.
        dividers: Of the rules, one pair of rule sets each.

    Returns:
        One row an episode: `environment`, `expert`, `recording`, `divider` (0 for discrete actions
        and where there are no rules), `arm`, `agent`, `rule_count`, whether it `crashed`, and what
        `Episodes` holds.
    """
    import pandas as pd

    wanted = [
        (replicate, divider, arm)
        for replicate in replicates_of(env_id, effort.recordings)
        for divider, arm in _arms(replicate, dividers)
    ]
    total = effort.episodes * len(wanted)
    parts: list[pd.DataFrame] = []
    for replicate, divider, arm in wanted:
        episodes = compare_arm(
            env_id,
            arm,
            episodes=effort.episodes,
            seed=replicate.first_seed,
            # The result is the same, bit for bit.
            jobs=1 if effort.quick or env_id != _SLOW else os.cpu_count() or 1,
            executor=effort.executor,
            progress=part_of(progress, len(parts) * effort.episodes, total),
        )
        parts.append(
            pd.DataFrame(
                {
                    "environment": env_id,
                    "expert": replicate.name,
                    "recording": replicate.recording,
                    "divider": divider,
                    "arm": arm.name,
                    "agent": episodes.agent,
                    "rule_count": 0 if arm.rules is None else len(arm.rules),
                    "crashed": episodes.failed,
                    **{name: getattr(episodes, own) for name, own in _FROM_EPISODES.items()},
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _arms(replicate: Replicate, dividers: Sequence[int]) -> list[tuple[int, Arm]]:
    arms = [(_AS_THEY_ARE, Arm(NOVICE, "novice"))]
    for divider in dividers:
        rules = named_rules(replicate, divider or PAPER_DIVIDER)
        arms += [
            (divider, Arm(FILTERED, "novice", rules["filtered"])),
            (divider, Arm(UNFILTERED, "novice", rules["unfiltered"])),
        ]
    return [*arms, (_AS_THEY_ARE, Arm(EXPERT, replicate.expert, stochastic=True))]


# --- out of the table ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Runs:
    """The episodes of four arms, recording by recording.

    Attributes:
        experts: The expert of each recording, R.
        returns: By arm, (R, E).
        failed: Whether an episode ended in failure, likewise.
        divider: Of the rules; 0 where actions are discrete.
        beside: What a claim compares them with, by name.
    """

    experts: tuple[str, ...]
    returns: Mapping[str, Floats]
    failed: Mapping[str, Truths]
    divider: int
    beside: Mapping[str, Runs] = field(default_factory=dict)

    @cached_property
    def _typical(self) -> dict[str, Floats]:
        return {arm: interquartile_mean(values) for arm, values in self.returns.items()}

    def typical(self, arm: str) -> Floats:
        """The typical return (IQM) in each recording, (R,)."""
        return self._typical[arm]

    def way(self, values: NDArray[np.float64]) -> Floats:
        """Returns as parts of the way from the lone novice's typical one (0) to the expert's (1).

        Args:
            values: One a recording, (R,).

        Returns:
            The same shape; 0 where there is no way.
        """
        start, goal = self.typical(NOVICE), self.typical(EXPERT)
        length = goal - start
        return np.divide(
            values - start, length, out=np.zeros(len(values)), where=np.asarray(length != 0)
        )

    def over(self, arm: str) -> MeanInterval:
        """The typical return over recordings."""
        return over_recordings(self.typical(arm), self.experts)

    def failures(self, arm: str) -> str:
        """The share of failures, for people."""
        return shares(share_over_recordings(self.failed[arm], self.experts))

    def in_words(self, arm: str) -> str:
        """Typical return and share of failures, for people; neither stands without the other."""
        return f"{interval(self.over(arm))}, failing in {self.failures(arm)}"


def runs_of(frame: pd.DataFrame, divider: int) -> Runs:
    """The episodes of four arms, out of the table.

    Args:
        frame: What `measure` gives.
        divider: One that is in it, of the rules.

    Returns:
        Recording by recording, in the order of their seeds.

    Raises:
        KeyError: If an arm is missing.
        ValueError: If a recording has other numbers of episodes.
    """
    chosen = frame[frame["divider"].isin((_AS_THEY_ARE, divider))]
    chosen = chosen.sort_values(["recording", "seed"], kind="stable")
    recordings = chosen["recording"].nunique()
    returns, failed = {}, {}
    for name in ARMS:
        rows = chosen[chosen["arm"] == name]
        if len(rows) == 0:
            raise KeyError(name)
        returns[name] = rows["return"].to_numpy(dtype=np.float64).reshape(recordings, -1)
        failed[name] = rows["crashed"].to_numpy(dtype=np.bool_).reshape(recordings, -1)
    experts = chosen.drop_duplicates("recording")["expert"]
    return Runs(tuple(experts.tolist()), returns, failed, divider)


def comparison_of(frame: pd.DataFrame, divider: int) -> Comparison:
    """The four arms with the rules of one divider, out of the table.

    Args:
        frame: What `measure` gives.
        divider: One that is in it.

    Returns:
        The comparison, the episodes of all recordings one after the other; its arms are without
        their rules, which no table holds.
    """
    env_id = str(frame["environment"].iloc[0])
    chosen = frame[frame["divider"].isin((_AS_THEY_ARE, divider))]
    episodes = []
    for name in ARMS:
        rows = chosen[chosen["arm"] == name]
        if len(rows) == 0:
            raise KeyError(name)
        columns: dict[str, Any] = {
            own: rows[title].to_numpy().copy() for title, own in _FROM_EPISODES.items()
        }
        agent = "expert" if name == EXPERT else str(rows["agent"].iloc[0])
        episodes.append(Episodes(env_id=env_id, agent=agent, **columns))
    arms = tuple(Arm(name, str(played.agent)) for name, played in zip(ARMS, episodes, strict=True))
    return Comparison(env_id, int(episodes[0].seeds[0]), arms, tuple(episodes))


def dividers_of(frame: pd.DataFrame) -> tuple[int, ...]:
    """The dividers in a table; (0,) where the actions are discrete."""
    dividers = sorted(set(frame["divider"].tolist()) - {_AS_THEY_ARE})
    return tuple(int(divider) for divider in dividers) or (_AS_THEY_ARE,)


def arms_exchanged(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The same episodes with the arms' names dealt out anew, alike in all recordings."""
    keys = list(dict.fromkeys(zip(frame["divider"], frame["arm"], strict=True)))
    order = rng.permutation(len(keys))
    names = dict(zip(keys, [keys[number] for number in order], strict=True))
    dealt = [names[key] for key in zip(frame["divider"], frame["arm"], strict=True)]
    return frame.assign(divider=[divider for divider, _ in dealt], arm=[arm for _, arm in dealt])


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    """What sums up each arm, by divider and name."""
    numbers: dict[str, Any] = {}
    for divider in dividers_of(frame):
        comparison, runs = comparison_of(frame, divider), runs_of(frame, divider)
        for arm, episodes in zip(comparison.arms, comparison.episodes, strict=True):
            rows = frame[
                (frame["arm"] == arm.name) & frame["divider"].isin((_AS_THEY_ARE, divider))
            ]
            summary = episodes.summary()
            del summary["outside_rate"]  # the table does not hold what it is made of
            summary.pop("cost", None)  # the failures, which stand there over recordings
            typical = runs.over(arm.name)
            failures = share_over_recordings(runs.failed[arm.name], runs.experts)
            one = {
                "rules": [int(rows["rule_count"].min()), int(rows["rule_count"].max())],
                "recordings": len(runs.experts),
                "experts": len(set(runs.experts)),
                "episodes": len(episodes),
                **summary,
                # Over recordings, and not over episodes, which are alike within one.
                "iqm": typical.mean,
                "iqm_low": typical.low,
                "iqm_high": typical.high,
                "least": float(episodes.returns.min()),
                "greatest": float(episodes.returns.max()),
                "failure_rate": failures.mean,
                "failure_low": failures.low,
                "failure_high": failures.high,
                "iqm_of_recordings": runs.typical(arm.name).tolist(),
                "failure_rate_of_recordings": runs.failed[arm.name].mean(axis=1).tolist(),
            }
            own = divider and arm.name in (FILTERED, UNFILTERED)
            numbers[f"{arm.name}, divider {divider}" if own else arm.name] = one
    return numbers


def _settings(effort: Effort, env_id: str, dividers: Sequence[int]) -> dict[str, Any]:
    return {
        "environment": env_id,
        "episodes_a_recording": effort.episodes,
        "dividers": [divider for divider in dividers if divider],
        "novice": "uniform random actions",
        "expert": "that of the recording, actions sampled",
        "projection": "centre",
        "seeds": {
            "tree": 0,
            "recordings": recorded_seeds([env_id], effort.recordings)[env_id],
            "episodes": [
                [one.first_seed, one.first_seed + effort.episodes - 1]
                for one in replicates_of(env_id, effort.recordings)
            ],
        },
    }


def _part(divider: int) -> str:
    if not divider:
        return "all"
    return f"divider {divider}" + (" (the paper's)" if divider == PAPER_DIVIDER else "")


def _parts(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(_part(divider) for divider in dividers_of(frame))


def _draw(frame: pd.DataFrame, part: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.figures.comparison import arm_style, returns_figure
    from sarl_core.explaining.figures.recording import recordings_figure

    divider = next(value for value in dividers_of(frame) if _part(value) == part)
    comparison, runs = comparison_of(frame, divider), runs_of(frame, divider)
    rules = {FILTERED: 0, UNFILTERED: 1}
    agents = {EXPERT: 1}
    styles = [
        # The novice with rules is told by their colour, so every line can be a plain one.
        replace(arm_style(agents.get(arm.name, 0), rules.get(arm.name)), dash="solid")
        for arm in comparison.arms
    ]
    colours = {arm.name: style.colour for arm, style in zip(comparison.arms, styles, strict=True)}
    where = environment_name(comparison.env_id) + (f", {part}" if divider else "")
    failures = {name: each.mean(axis=1) for name, each in runs.failed.items()}
    return (
        Drawing(
            f"Return of every episode, one recording after the other, {where}",
            returns_figure(comparison, styles=styles, height=380),
            share=1.0,
            alt=f"Returns of {len(comparison.episodes[0])} episodes of the four arms, {where}",
        ),
        Drawing(
            f"Typical return of each recording, {where}",
            recordings_figure(
                {name: runs.typical(name) for name in ARMS},
                {name: runs.over(name) for name in ARMS},
                experts=runs.experts,
                colours=colours,
                title="typical return (IQM, 95 % interval)",
            ),
            alt=f"Interquartile means of the returns of every recording, with intervals, {where}",
        ),
        Drawing(
            f"Failures of each recording, {where}",
            recordings_figure(
                failures,
                {name: share_over_recordings(runs.failed[name], runs.experts) for name in ARMS},
                experts=runs.experts,
                colours=colours,
                title="episodes that ended in failure (95 % interval)",
                share=True,
            ),
            alt=f"Share of the episodes of every recording that failed, with intervals, {where}",
        ),
    )


def study(
    name: str,
    env_id: str,
    claims: Any,
    *,
    dividers: Sequence[int] = (_AS_THEY_ARE,),
    more: str = "",
) -> Study:
    """One of Figures 5 to 7.

    Args:
        name: The figure's number.
        env_id: Its environment.
        claims: What the paper says of it, as in `Study`.
        dividers: Of continuous actions.
        more: What else is to be said about it.

    Returns:
        The study.
    """
    return Study(
        name=name,
        place=f"Figure {name}",
        title=f"Shielded novices, {environment_name(env_id)}",
        about="A novice that acts at random, alone, with the filtered rules and with the "
        "unfiltered rules as a shield, and the expert, whose actions are sampled as in its "
        "demonstrations; for every recording its own rules, expert and episodes, with the same "
        "seeds for all four. The typical return is the mean of the middle half of a recording's "
        "episodes (IQM); it leaves out the worst quarter, so the share of episodes that ended in "
        f"failure stands beside it. Intervals are over recordings and their experts.{more}",
        measure=partial(measure, env_id=env_id, dividers=dividers),
        settings=partial(_settings, env_id=env_id, dividers=dividers),
        numbers=_numbers,
        claims=claims,
        exchanged=arms_exchanged,
        parts=_parts,
        draw=_draw,
        columns=_COLUMNS,
    )
