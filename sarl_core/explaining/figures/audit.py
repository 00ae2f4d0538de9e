"""What was done in an episode of a log, and where it broke the rules."""

from __future__ import annotations

import numpy as np

from sarl_core.auditing.audit import Audit
from sarl_core.explaining.colours import MUTED_COLOUR, OUTSIDE_COLOUR
from sarl_core.explaining.figures.replay import Track
from sarl_core.mining.language import label_text


def audit_tracks(audit: Audit, rows: slice) -> tuple[Track, ...]:
    """The rows of the strip of an episode.

    Args:
        audit: Of the log.
        rows: Of the episode, T of them.

    Returns:
        For each action dimension what was done and what the rule in force says; then the breaks,
        those outside the data of their rules, and the near misses, where there are any.
    """
    says = np.array([float(rule.action) for rule in audit.rule_set] + [np.nan])
    tracks = []
    for index, dimension in enumerate(audit.rule_set.actions):
        name = f"{dimension.name}: " if len(audit.rule_set.actions) > 1 else ""
        done = audit.labels[rows, index].astype(np.float64)
        tracks.append(Track(f"{name}done", done, dimension))
        tracks.append(Track(f"{name}rule says", says[audit.rules[rows, index]], dimension))
    broken = audit.is_broken[rows]
    tracks.append(Track("broken", np.where(broken, 0.0, np.nan), None))
    for called, marks, colour in (
        ("outside data", audit.outside[rows], OUTSIDE_COLOUR),
        ("near miss", audit.near[rows] >= 0, MUTED_COLOUR),
    ):
        if marks.any():
            tracks.append(Track(called, np.where(marks, 0.0, np.nan), None, colour))
    return tuple(tracks)


def step_texts(audit: Audit, rows: slice) -> list[str]:
    """What is said of each step of an episode.

    Args:
        audit: Of the log.
        rows: Of the episode.

    Returns:
        As "step 17: brake; R3 says lift".
    """
    rule_set = audit.rule_set
    texts = []
    assert audit.log.steps is not None
    for row in range(rows.start, rows.stop):
        parts = []
        for index, dimension in enumerate(rule_set.actions):
            place = int(audit.rules[row, index])
            done = label_text(int(audit.labels[row, index]), dimension)
            if place < 0:
                parts.append(f"{done}, no rule")
                continue
            rule = rule_set[place]
            said = label_text(rule.action, dimension)
            parts.append(f"{done}; {rule_set.name_of(rule)} says {said}")
        texts.append(f"step {audit.log.steps[row]}: {', '.join(parts)}")
    return texts
