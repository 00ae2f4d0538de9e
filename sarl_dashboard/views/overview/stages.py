"""What of the way from data to a report is done for the data in hand, as far as this session knows.

Nothing is worked out for it: a stage is done where its result, or the choice that it is about, is
there already.
"""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.language import counted, limit_text, share_text
from sarl_core.mining.rules import FILTERED
from sarl_dashboard.jobs.cross_fitting import known
from sarl_dashboard.jobs.replays import latest
from sarl_dashboard.jobs.report import comparison_of_session
from sarl_dashboard.state import formulas, given_names, hold_out, in_force, rule_base
from sarl_dashboard.state.data import (
    UPLOAD,
    chosen_dataset,
    dataset_label,
    mined_data,
    raw_demonstrations,
    upload_name,
)
from sarl_dashboard.state.thresholds import chosen_thresholds
from sarl_dashboard.text import escaped, size_text


@dataclass(frozen=True)
class Stage:
    """One thing to do.

    Attributes:
        name: What it is called.
        done: Whether it was done.
        text: What was done, or how it stands.
        file: The page on which it is done.
    """

    name: str
    done: bool
    text: str
    file: str


def show_stages() -> None:
    """The list, each line a link to its page."""
    name = escaped(upload_name()) if chosen_dataset() == UPLOAD else dataset_label(chosen_dataset())
    raw = raw_demonstrations()
    if raw is None:
        st.header("What is done")
        st.caption("There are no data in hand: upload some, or choose a shipped set.")
        stages: tuple[Stage, ...] = (_data(None),)
    else:
        st.header(f"What is done for {name}")
        st.caption("In this session. Every line leads to its page.")
        stages = stages_of(raw)
    with st.container(gap=None, key="stages"):
        for stage in stages:
            icon = ":green[:material/check_circle:]" if stage.done else ":material/circle:"
            st.page_link(stage.file, label=f"{icon} **{stage.name}:** {stage.text}")


def stages_of(raw: Demonstrations) -> tuple[Stage, ...]:
    """What there is to do for some data, in order.

    Args:
        raw: As they were read.
    """
    return (
        _data(raw),
        _names(raw),
        _rules(),
        _evidence(),
        _edits(),
        _replay(raw),
        _measure(raw),
    )


def _data(raw: Demonstrations | None) -> Stage:
    if raw is None:
        return Stage("Data", False, "nothing uploaded yet", "demonstrations.py")
    size = size_text(raw)
    origin = "uploaded" if chosen_dataset() == UPLOAD else "shipped"
    if raw.sample_of is not None:
        origin = "mined on a cluster"
    return Stage("Data", True, f"{size}, {origin}", "demonstrations.py")


def _names(raw: Demonstrations) -> Stage:
    own = {
        "names": given_names.given_names(raw) is not None,
        "formulas": formulas.values_key(raw) is not None,
    }
    given = " and ".join(name for name, is_own in own.items() if is_own)
    text = f"{given} of your own" if given else "as the file has them"
    return Stage("Names", bool(given), text, "names.py")


def _rules() -> Stage:
    if not rule_base.at_thresholds():
        return Stage("Rules", True, f"{in_force.title()} chosen", "thresholds.py")
    thresholds = chosen_thresholds()
    limits = [f"support at least {limit_text(thresholds.support)}"]
    if thresholds.demands:
        limits.append(f"confidence at least {limit_text(thresholds.confidence)}")
    if thresholds.never is not None:
        limits.append(f"forbidden what the expert does in at most {limit_text(thresholds.never)}")
    at = ", ".join(limits)
    moved = thresholds != FILTERED
    return Stage(
        "Thresholds", moved, f"{'set: ' if moved else 'the usual ones, '}{at}", "thresholds.py"
    )


def _evidence() -> Stage:
    mined = mined_data()
    if mined is not None and mined.held_out:
        episodes = counted(mined.held_out_episodes, "episode")
        return Stage("Evidence", True, f"{episodes} held out where it was mined", "evidence.py")
    share = hold_out.chosen().share
    if share and mined is None:
        return Stage(
            "Evidence", True, f"{share_text(share)} of the episodes held out", "evidence.py"
        )
    if known() is not None:
        text = "the rules were tried on episodes that they were not mined from"
        return Stage("Evidence", True, text, "evidence.py")
    return Stage("Evidence", False, "not looked at yet", "evidence.py")


def _edits() -> Stage:
    made = in_force.count()
    return Stage("Edits", bool(made), counted(made, "edit") if made else "none", "edit.py")


def _replay(raw: Demonstrations) -> Stage:
    played = latest()
    if played is None or str(played.order.env_id) != raw.env_id:
        return Stage("Replay", False, "none watched yet", "replay.py")
    order = played.order
    rules = f"rules: {order.rules}" if order.rule_set is not None else "without rules"
    text = f"{order.agent.choice} on seed {order.seed:,}, {rules}"
    return Stage("Replay", True, text, "replay.py")


def _measure(raw: Demonstrations) -> Stage:
    comparison, _ = comparison_of_session(raw.env_id)
    if comparison is None:
        return Stage("Measure", False, "not measured yet", "shield.py")
    episodes = len(comparison.episodes[0])
    text = f"{counted(len(comparison.arms), 'line')}, {counted(episodes, 'episode')} each"
    return Stage("Measure", True, text, "shield.py")
