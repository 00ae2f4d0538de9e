"""Processes that work for another one end with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

WORK = """
from sarl_core.rollouts.episodes import rollout
rollout("LunarLander-v3", "novice", episodes=100_000, seed=0, jobs=2, keep_steps=False)
"""


def session_of(process: Path) -> int | None:
    """The session that a process belongs to; None where it is gone, or is only a name still."""
    try:
        state, _, _, session = (process / "stat").read_text().rsplit(")", 1)[1].split()[:4]
    except OSError:
        return None
    return None if state == "Z" else int(session)


def members(session: int) -> list[Path]:
    """The processes of a session."""
    return [one for one in Path("/proc").glob("[0-9]*") if session_of(one) == session]


def test_they_are_gone_seconds_after_it_was_killed() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", WORK], start_new_session=True, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 120
    while len(members(process.pid)) < 4 and time.monotonic() < deadline:
        time.sleep(0.2)
    begun = members(process.pid)
    time.sleep(1)
    process.send_signal(signal.SIGKILL)
    process.wait()
    try:
        while members(process.pid) and time.monotonic() < deadline + 60:
            time.sleep(0.2)
        assert len(begun) >= 4  # itself, two that work, and who keeps count of what they share
        assert members(process.pid) == []
    finally:
        for left in members(process.pid):
            os.kill(int(left.name), signal.SIGKILL)
