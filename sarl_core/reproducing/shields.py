"""Figures 5 to 7: a novice alone, with filtered and with unfiltered rules, and the expert."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.reproducing.shipped import PAPER_DIVIDER, environment_name, named_rules
from sarl_core.reproducing.study import FIRST_SEED, Drawing, Effort, Study
from sarl_core.rollouts.comparison import Arm, Comparison, compare_arm, crashed
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

NOVICE, FILTERED, UNFILTERED, EXPERT = "novice alone", "filtered", "unfiltered", "expert"
ARMS = (NOVICE, FILTERED, UNFILTERED, EXPERT)
_AS_THEY_ARE = 0  # divider of discrete actions, and of who has no rules

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
_COLUMNS = ("environment", "divider", "arm", "agent", "rule_count", "crashed", *_FROM_EPISODES)


def measure(
    effort: Effort, progress: Progress | None, env_id: str, dividers: Sequence[int]
) -> pd.DataFrame:
    """Run the same episodes with the novice, alone and shielded, and with the expert.

    The novice acts at random. The expert samples its actions, as it did when its demonstrations
    were recorded.

    Args:
        effort: How many episodes.
        progress: Called with (episodes done, in all); returning False stops.
        env_id: Environment.
        dividers: Of the rules, one pair of rule sets each.

    Returns:
        One row an episode: `environment`, `divider` (0 for discrete actions and where there are
        no rules), `arm`, `agent`, `rule_count`, whether it `crashed`, and what `Episodes` holds.
    """
    import pandas as pd

    arms = [(_AS_THEY_ARE, Arm(NOVICE, "novice"))]
    for divider in dividers:
        rules = named_rules(env_id, divider or PAPER_DIVIDER)
        arms += [
            (divider, Arm(FILTERED, "novice", rules["filtered"])),
            (divider, Arm(UNFILTERED, "novice", rules["unfiltered"])),
        ]
    arms.append((_AS_THEY_ARE, Arm(EXPERT, "expert", stochastic=True)))
    total = effort.episodes * len(arms)
    parts = []
    for number, (divider, arm) in enumerate(arms):

        def told(done: int, _: int, before: int = number * effort.episodes) -> None:
            report(progress, before + done, total)

        found = compare_arm(env_id, arm, episodes=effort.episodes, seed=FIRST_SEED, progress=told)
        parts.append(
            pd.DataFrame(
                {
                    "environment": env_id,
                    "divider": divider,
                    "arm": arm.name,
                    "agent": found.agent,
                    "rule_count": 0 if arm.rules is None else len(arm.rules),
                    "crashed": crashed(found, env_id),
                    **{name: getattr(found, own) for name, own in _FROM_EPISODES.items()},
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def comparison_of(frame: pd.DataFrame, divider: int) -> Comparison:
    """The four arms with the rules of one divider, out of the table.

    Args:
        frame: What `measure` gives.
        divider: One that is in it.

    Returns:
        The comparison; its arms are without their rules, which no table holds.
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
        episodes.append(Episodes(env_id=env_id, agent=str(rows["agent"].iloc[0]), **columns))
    arms = tuple(Arm(name, str(found.agent)) for name, found in zip(ARMS, episodes, strict=True))
    return Comparison(env_id, int(episodes[0].seeds[0]), arms, tuple(episodes))


def dividers_of(frame: pd.DataFrame) -> tuple[int, ...]:
    """The dividers in a table; (0,) where the actions are discrete."""
    found = sorted(set(frame["divider"].tolist()) - {_AS_THEY_ARE})
    return tuple(int(divider) for divider in found) or (_AS_THEY_ARE,)


def returns_of(frame: pd.DataFrame, divider: int) -> dict[str, NDArray[np.float64]]:
    """The returns of each arm, in the order of the seeds, by the arms' names."""
    found = comparison_of(frame, divider)
    return {
        arm.name: episodes.returns for arm, episodes in zip(found.arms, found.episodes, strict=True)
    }


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    """What sums up each arm, by divider and name."""
    numbers: dict[str, Any] = {}
    for divider in dividers_of(frame):
        found = comparison_of(frame, divider)
        for arm, episodes in zip(found.arms, found.episodes, strict=True):
            rows = frame[
                (frame["arm"] == arm.name) & frame["divider"].isin((_AS_THEY_ARE, divider))
            ]
            summary = episodes.summary()
            del summary["outside_rate"]  # the table does not hold what it is made of
            one = {
                "rules": int(rows["rule_count"].iloc[0]),
                "episodes": len(episodes),
                **summary,
                "least": float(episodes.returns.min()),
                "greatest": float(episodes.returns.max()),
                "crash_rate": float(rows["crashed"].mean()),
            }
            own = divider and arm.name in (FILTERED, UNFILTERED)
            numbers[f"{arm.name}, divider {divider}" if own else arm.name] = one
    return numbers


def _settings(effort: Effort, env_id: str, dividers: Sequence[int]) -> dict[str, Any]:
    return {
        "environment": env_id,
        "episodes": effort.episodes,
        "dividers": [divider for divider in dividers if divider],
        "novice": "uniform random actions",
        "expert": "the shipped one, actions sampled",
        "projection": "centre",
        "seeds": {"episodes": [FIRST_SEED, FIRST_SEED + effort.episodes - 1]},
    }


def _part(divider: int) -> str:
    if not divider:
        return "all"
    return f"divider {divider}" + (" (the paper's)" if divider == PAPER_DIVIDER else "")


def _parts(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(_part(divider) for divider in dividers_of(frame))


def _draw(frame: pd.DataFrame, part: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.comparison_figures import arm_style, returns_figure, typical_figure

    divider = next(value for value in dividers_of(frame) if _part(value) == part)
    found = comparison_of(frame, divider)
    rules = {FILTERED: 0, UNFILTERED: 1}
    agents = {EXPERT: 1}
    styles = [
        # The novice with rules is told by their colour, so every line can be a plain one.
        replace(arm_style(agents.get(arm.name, 0), rules.get(arm.name)), dash="solid")
        for arm in found.arms
    ]
    where = environment_name(found.env_id) + (f", {part}" if divider else "")
    return (
        Drawing(
            f"Return of every episode, {where}",
            returns_figure(found, styles=styles, height=380),
            share=0.65,
            alt=f"Returns of {len(found.episodes[0])} episodes of the four arms, {where}",
        ),
        Drawing(
            "Typical return",
            typical_figure(found, styles=styles, height=380),
            share=0.35,
            alt=f"Interquartile means of the returns with 95 % intervals, {where}",
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
        "demonstrations; the same seeds for all. The typical return is the mean of the middle "
        f"half of the episodes (IQM), with its 95 % interval over episodes.{more}",
        measure=partial(measure, env_id=env_id, dividers=dividers),
        settings=partial(_settings, env_id=env_id, dividers=dividers),
        numbers=_numbers,
        claims=claims,
        parts=_parts,
        draw=_draw,
        columns=_COLUMNS,
    )
